//! Segments along which it matters which colour is in front.

use super::opacity::{behind, opacity};
use super::{EVEN_DEPTH, Piece, Place, Table};

/// In how many parts a piece goes at most; such a one is opaque long before its end.
const PARTS: f32 = 1024.0;
/// What lets less through ends a segment.
const DARK: f32 = 1e-6;

impl Table {
    /// The same as [`Self::segment`] where it matters which colour is in front.
    #[cold]
    #[inline(never)]
    pub(super) fn in_parts(&self, from: &Place, to: &Place, mm: f32) -> [f32; 4] {
        let rises = to.position > from.position;
        let per_position = mm / (to.position - from.position);
        let mut got = [0.0_f32; 4];
        let mut at = from.position;
        let mut index = from.piece;
        loop {
            let piece = &self.pieces[index];
            let last = index == to.piece;
            let end = match (last, rises) {
                (true, _) => to.position,
                (false, true) => self.pieces[index + 1].from,
                (false, false) => piece.from,
            };
            self.part(piece, [at, end], per_position, &mut got);
            if last || 1.0 - got[3] < DARK {
                return got;
            }
            at = end;
            index = if rises { index + 1 } else { index - 1 };
        }
    }

    /// Adds what lies between two positions of one piece.
    fn part(&self, piece: &Piece, [from, to]: [f32; 2], per_position: f32, got: &mut [f32; 4]) {
        let mm = per_position * (to - from);
        let change = (self.rate(piece, to)[3] - self.rate(piece, from)[3]).abs() * mm;
        let rough = change * piece.varies * (to - from).abs() / EVEN_DEPTH;
        let parts = rough.sqrt().ceil().clamp(1.0, PARTS);
        let mut at = from;
        let index = self.pieces.partition_point(|p| p.first < piece.first);
        let place = |position| Place { position, piece: index, sum: self.sum(piece, position), varied: 0.0 };
        let mut begin = place(from);
        for n in 1..=parts as u32 {
            let end = if n as f32 == parts { to } else { from + (to - from) * (n as f32 / parts) };
            let finish = place(end);
            let depth = self.depth(&begin, &finish, per_position * (end - at));
            let tau = depth[3];
            if tau > 0.0 {
                let opacity = opacity(tau);
                let behind = behind(tau, opacity);
                let through = 1.0 - got[3];
                let rise = end - at;
                for c in 0..3 {
                    let mean = depth[c] / tau * opacity;
                    got[c] += through * (mean + piece.slope[c] * rise * behind);
                }
                got[3] += through * opacity;
            }
            if 1.0 - got[3] < DARK {
                return;
            }
            (at, begin) = (end, finish);
        }
    }
}
