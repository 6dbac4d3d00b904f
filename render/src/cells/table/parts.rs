//! Segments along which it matters which colour is in front.

use super::opacity::{behind, opacity};
use super::{EVEN_DEPTH, Place, Table};

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
        let mut begin = *from;
        while begin.piece != to.piece {
            let next = if rises { begin.piece + 1 } else { begin.piece - 1 };
            // What is summed up to where two pieces meet is at the first node of the upper one.
            let upper = &self.pieces[begin.piece.max(next)];
            let sum = self.nodes[upper.first as usize].sum;
            let end = Place { position: upper.from, piece: begin.piece, sum, varied: 0.0 };
            self.part(&begin, &end, per_position, &mut got);
            if 1.0 - got[3] < DARK {
                return got;
            }
            begin = Place { piece: next, ..end };
        }
        self.part(&begin, to, per_position, &mut got);
        got
    }

    /// Adds what lies between two places of one piece.
    fn part(&self, from: &Place, to: &Place, per_position: f32, got: &mut [f32; 4]) {
        let piece = &self.pieces[from.piece];
        let rise = to.position - from.position;
        let mm = per_position * rise;
        if piece.rough * mm * (rise * rise) <= EVEN_DEPTH {
            self.even(from, to, mm, got);
            return;
        }
        let change = (self.rate(piece, to.position)[3] - self.rate(piece, from.position)[3]).abs() * mm;
        let rough = change * piece.varies * rise.abs() / EVEN_DEPTH;
        let parts = rough.sqrt().ceil().clamp(1.0, PARTS);
        let mut begin = *from;
        for n in 1..parts as u32 {
            let position = from.position + rise * (n as f32 / parts);
            let end = Place { position, sum: self.sum(piece, position), ..*from };
            self.even(&begin, &end, per_position * (position - begin.position), got);
            if 1.0 - got[3] < DARK {
                return;
            }
            begin = end;
        }
        self.even(&begin, to, per_position * (to.position - begin.position), got);
    }

    /// Adds what lies between two places of one piece along which extinction hardly changes.
    fn even(&self, from: &Place, to: &Place, mm: f32, got: &mut [f32; 4]) {
        let depth = self.depth(from, to, mm);
        let tau = depth[3];
        if tau > 0.0 {
            let opacity = opacity(tau);
            let (part, behind) = (opacity / tau, behind(tau, opacity));
            let through = 1.0 - got[3];
            let turn = (to.position - from.position) * behind;
            let slope = &self.pieces[from.piece].slope;
            for c in 0..3 {
                got[c] += through * (depth[c] * part + slope[c] * turn);
            }
            got[3] += through * opacity;
        }
    }
}
