//! What is seen of one segment, whatever it passes.

use super::opacity::shares;
use super::{Cut, EVEN_COLOR, EVEN_DEPTH, Mean, Piece, Place, Table};

/// In how many parts a piece goes at most; such a one is opaque long before its end.
const PARTS: f32 = 1024.0;
/// What lets less through ends a segment.
const DARK: f32 = 1e-6;

/// Colour, premultiplied, and opacity.
#[derive(Debug, Default)]
struct Seen([f32; 4]);

impl Seen {
    fn is_dark(&self) -> bool {
        1.0 - self.0[3] < DARK
    }

    /// Puts a stretch of even extinction under it.
    fn put(&mut self, Mean { rates, turn, .. }: &Mean, mm: f32) {
        let tau = rates[3] * mm;
        // Neither is anything seen of what is no number.
        if tau > 0.0 {
            let [part, lag, opacity] = shares(tau);
            let through = 1.0 - self.0[3];
            for c in 0..3 {
                self.0[c] += through * (rates[c] * mm * part + turn[c] * lag);
            }
            self.0[3] += through * opacity;
        }
    }

    /// The same of what lies between two positions of one piece.
    fn put_piece(&mut self, piece: &Piece, [from, to]: [f32; 2], mm: f32) {
        let mean = piece.mean(from, to);
        let rough = mean.rise.abs() * mm * mean.varies;
        if rough.is_nan() || rough <= EVEN_DEPTH {
            self.put(&mean, mm);
            return;
        }
        let parts = (rough / EVEN_DEPTH).sqrt().ceil().clamp(1.0, PARTS);
        let by = mm / (to - from);
        let mut begin = from;
        for n in 1..=parts as u32 {
            // Not each position is one that there is.
            let end = from + (to - from) * (n as f32 / parts);
            self.put(&piece.mean(begin, end), (end - begin) * by);
            if self.is_dark() {
                return;
            }
            begin = end;
        }
    }
}

impl Table {
    /// Colour, premultiplied, and opacity of `mm` along which the scalar runs from one place to another.
    #[inline]
    pub(in super::super) fn segment(&self, from: &Place, to: &Place, mm: f32) -> [f32; 4] {
        let mut seen = Seen::default();
        let (begin, end) = (&self.pieces[from.piece], &self.pieces[to.piece]);
        if from.piece == to.piece {
            seen.put_piece(begin, [from.position, to.position], mm);
            return seen.0;
        }
        let Cut { near, between, far, mm } = self.cut(from, to, mm);
        seen.put_piece(begin, near, mm[0]);
        if let Some(pieces) = between {
            self.put_whole(&mut seen, pieces, from.piece < to.piece, mm[1]);
        }
        if !seen.is_dark() {
            seen.put_piece(end, far, mm[2]);
        }
        seen.0
    }

    /// Puts whole pieces, from one up to but not with another, under what is seen.
    fn put_whole(&self, seen: &mut Seen, [low, high]: [usize; 2], rises: bool, mm: f32) {
        let rates = self.whole(low, high);
        let varies = self.varies(low, high);
        if rates[3] * mm * varies <= EVEN_COLOR {
            seen.put(&Mean { rates, turn: [0.0; 3], rise: 0.0, varies }, mm);
            return;
        }
        let by = mm / (self.pieces[high - 1].end - self.pieces[low].begin);
        for number in 0..high - low {
            let piece = &self.pieces[if rises { low + number } else { high - 1 - number }];
            let ends = if rises { [piece.begin, piece.end] } else { [piece.end, piece.begin] };
            seen.put_piece(piece, ends, (piece.end - piece.begin) * by);
            if seen.is_dark() {
                return;
            }
        }
    }
}
