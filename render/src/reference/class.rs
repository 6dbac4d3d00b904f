//! A transfer function cut into pieces on each of which colour and opacity are linear, so that an
//! integral can be split where they are not smooth.

use super::light;
use crate::volume::Transfer;

/// What one panel may see change of 1 - opacity, as a ratio. This and the next are measured: see the
/// tests of exactness.
const RATIO: f64 = 1.2;
/// The same of the part of a piece times the optical depth.
const BEND: f64 = 0.005;

/// One piece: values from `low` on, up to the next piece's.
#[derive(Debug, Clone, PartialEq)]
struct Piece {
    low: f64,
    /// Zero where the piece is constant.
    width: f64,
    from: [f64; 4],
    /// What `rgba` gains over the whole width.
    gain: [f64; 4],
    /// The extinction where it is the same all over; 1/mm.
    constant: Option<f64>,
    /// Whether light may take a channel past the display's range.
    glares: bool,
}

/// Classification by pieces; says the same as [`Transfer::classify`].
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Classes {
    /// `knots[i]` is where piece `i + 1` begins; never falling.
    knots: Vec<f64>,
    pieces: Vec<Piece>,
    unit_mm: f64,
}

impl Classes {
    /// The pieces of a transfer function.
    pub(super) fn of(transfer: &Transfer) -> Self {
        let points = transfer.points();
        let unit_mm = transfer.unit_mm();
        let extinction = |a: f64| extinction(a, unit_mm);
        let flat = |low: f64, rgba: [f64; 4]| Piece {
            low,
            width: 0.0,
            from: rgba,
            gain: [0.0; 4],
            constant: Some(extinction(rgba[3])),
            glares: glares(rgba),
        };
        let (first, last) = (points[0], points[points.len() - 1]);
        let mut knots = Vec::new();
        let mut pieces = vec![flat(first.value, first.rgba)];
        for pair in points.windows(2) {
            let (a, b) = (pair[0], pair[1]);
            // The cap on opacity is a bend of the extinction: one more knot.
            let part = (Transfer::MAX_OPACITY - a.rgba[3]) / (b.rgba[3] - a.rgba[3]);
            let bend = a.value + part * (b.value - a.value);
            let bend = (bend > a.value && bend < b.value).then_some(bend);
            for (low, high) in
                [(a.value, bend.unwrap_or(b.value))].into_iter().chain(bend.map(|m| (m, b.value)))
            {
                let [from, to] =
                    [transfer.rgba(low), if high == b.value { b.rgba } else { transfer.rgba(high) }];
                let capped = (from[3] + to[3]) * 0.5 >= Transfer::MAX_OPACITY;
                let constant = (from[3] == to[3] || capped).then(|| extinction(from[3].max(to[3])));
                let gain = std::array::from_fn(|c| to[c] - from[c]);
                knots.push(low);
                let glares = glares(from) || glares(to);
                pieces.push(Piece { low, width: high - low, from, gain, constant, glares });
            }
        }
        knots.push(last.value);
        pieces.push(flat(last.value, last.rgba));
        Self { knots, pieces, unit_mm }
    }

    /// The piece a value belongs to.
    pub(super) fn find(&self, value: f64) -> usize {
        self.knots.partition_point(|&k| k <= value)
    }

    /// Where pieces meet within a range of values.
    pub(super) fn knots_between(&self, [low, high]: [f64; 2]) -> &[f64] {
        let from = self.knots.partition_point(|&k| k < low);
        let to = self.knots.partition_point(|&k| k <= high);
        &self.knots[from..to]
    }

    /// Whether a piece absorbs nothing anywhere.
    pub(super) fn is_clear(&self, piece: usize) -> bool {
        self.pieces[piece].constant == Some(0.0)
    }

    /// The extinction of a piece where it does not depend on the value; 1/mm.
    pub(super) fn constant(&self, piece: usize) -> Option<f64> {
        self.pieces[piece].constant
    }

    /// Whether light may take a piece's colour past the display's range.
    pub(super) fn glares(&self, piece: usize) -> bool {
        self.pieces[piece].glares
    }

    /// The greatest extinction (1/mm) of a piece within a range of values, low and high, or `None` where it varies by more
    /// over `length` mm than one panel of the rule follows.
    pub(super) fn smooth(&self, piece: usize, range: [f64; 2], length: f64) -> Option<f64> {
        if let Some(tau) = self.constant(piece) {
            return Some(tau);
        }
        let [p, q] = range.map(|v| self.opacity(piece, v));
        let (least, most) = (p.min(q), p.max(q));
        let tau = self.extinction(most);
        let [from, to] = range.map(|v| self.part(piece, v));
        // The extinction is the logarithm of what is let through: its ratio tells how it bends. And the
        // more colour and extinction change together, the higher is the degree of their product.
        let follows = 1.0 - least <= RATIO * (1.0 - most) && (to - from) * tau * length <= BEND;
        follows.then_some(tau)
    }

    /// How far into a piece a value lies, from 0 to 1; 0 where the piece is constant.
    pub(super) fn part(&self, piece: usize, value: f64) -> f64 {
        let p = &self.pieces[piece];
        if p.width > 0.0 { ((value - p.low) / p.width).clamp(0.0, 1.0) } else { 0.0 }
    }

    /// Opacity by a piece's line, values outside it clamped to it.
    pub(super) fn opacity(&self, piece: usize, value: f64) -> f64 {
        let p = &self.pieces[piece];
        p.from[3] + p.gain[3] * self.part(piece, value)
    }

    /// Colour and extinction (1/mm) by a piece's line, values outside it clamped to it.
    pub(super) fn classify(&self, piece: usize, value: f64) -> ([f64; 3], f64) {
        let p = &self.pieces[piece];
        let part = self.part(piece, value);
        let color = std::array::from_fn(|c| p.from[c] + p.gain[c] * part);
        let tau = p.constant.unwrap_or_else(|| extinction(p.from[3] + p.gain[3] * part, self.unit_mm));
        (color, tau)
    }

    /// Extinction of an opacity; 1/mm.
    pub(super) fn extinction(&self, opacity: f64) -> f64 {
        extinction(opacity, self.unit_mm)
    }

    /// Whether every value of a closed range is clear.
    pub(super) fn range_is_clear(&self, [low, high]: [f64; 2]) -> bool {
        (self.find(low)..=self.find(high)).all(|piece| self.is_clear(piece))
    }
}

fn glares(rgba: [f64; 4]) -> bool {
    rgba[..3].iter().any(|&c| light::may_hold(c))
}

fn extinction(opacity: f64, unit_mm: f64) -> f64 {
    -(-opacity.min(Transfer::MAX_OPACITY)).ln_1p() / unit_mm
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::volume::ControlPoint;

    fn point(value: f64, a: f64) -> ControlPoint {
        ControlPoint { value, rgba: [a, 1.0 - a, 0.25 + a / 2.0, a] }
    }

    #[test]
    fn pieces_say_what_the_transfer_function_says() {
        let points = vec![
            point(-10.0, 0.0),
            point(0.0, 0.0),
            point(5.0, 0.25),
            point(5.0, 0.75),
            point(9.0, 1.0),
            point(20.0, 1.0),
            point(21.0, 0.1),
        ];
        let transfer = Transfer::new(points, 1.5).expect("points in order");
        let classes = Classes::of(&transfer);
        for i in -30..60 {
            let value = f64::from(i) * 0.5;
            let ((color, tau), (known, known_tau)) =
                (classes.classify(classes.find(value), value), transfer.classify(value));
            assert!((tau - known_tau).abs() < 1e-12, "extinction {tau} at {value}, not {known_tau}");
            for c in 0..3 {
                assert!((color[c] - known[c]).abs() < 1e-12, "colour at {value}");
            }
        }
        assert!(classes.range_is_clear([-50.0, -0.001]), "clear below the ramp");
        assert!(!classes.range_is_clear([-50.0, 0.001]), "not on it");
    }
}
