//! The outline of a cell in the picture: which pixels of a row its rays may pass.
//!
//! A ray passes where all planes of near faces rank below all those of far ones. Each such pair of planes ranks alike along the
//! line of the edge that it shares, an edge of the outline, which rows cross at places that run linearly from row to row.

use super::NEXT;
use crate::simd::Four;

/// Columns that bound a cell to the left and to the right, by the lines of its edges: on the row of pixels 0, and how much more
/// on each row further down. Without end where a line does not bound it to that side.
#[derive(Debug, Clone, Copy)]
pub(super) struct Outline {
    left: [[f64; 4]; 2],
    right: [[f64; 4]; 2],
}

impl Outline {
    /// Nothing.
    pub(super) const NONE: Self = Self { left: [[0.0; 4]; 2], right: [[0.0; 4]; 2] };

    /// Of pairs of planes, a near and a far one, with an edge of the outline between them: at (i, j) the far one ranks
    /// (c + b·j) + a·i behind the near one. All rays along which that is more than minus `slack`: twice that is allowed, the
    /// other half for what rounding does here.
    #[inline(always)]
    pub(super) fn set<F: Four>(&mut self, [a, b, c]: [F; 3], slack: F) {
        let c = c + (slack + slack);
        let none = F::all(0.0);
        let part = (none - a).inverse();
        let (first, step) = (c * part, b * part);
        // What is no number bounds nothing either: see `columns`.
        self.left = [
            none.below(a, first, F::all(f64::NEG_INFINITY)).to_array(),
            none.below(a, step, none).to_array(),
        ];
        self.right =
            [a.below(none, first, F::all(f64::INFINITY)).to_array(), a.below(none, step, none).to_array()];
    }

    /// Of four rows: the first column of each, and the one behind its last. Columns are those from `low` up to but not at
    /// `high`, which are not negative; rows below `last` have none.
    #[inline(always)]
    pub(super) fn columns<F: Four>(&self, rows: F, last: i32, [low, high]: [i32; 2]) -> [[i32; 4]; 2] {
        let (mut left, mut right) = (F::all(f64::from(low)), F::all(f64::from(high - 1)));
        for edge in 0..4 {
            left = (F::all(self.left[0][edge]) + F::all(self.left[1][edge]) * rows).most(left);
            right = (F::all(self.right[0][edge]) + F::all(self.right[1][edge]) * rows).least(right);
        }
        // Within what whole numbers there are.
        (left, right) = (left.least(F::all(f64::from(high))), right.most(F::all(f64::from(low - 1))));
        right = F::all(f64::from(last)).below(rows, F::all(f64::from(low - 1)), right);
        [(left + F::all(NEXT)).to_whole(), (right + F::all(1.0)).to_whole()]
    }
}
