//! Directions by numbers: a normal as two angles from a side of the body, and turns of it.

use render::volume::{Affine, Point, Vector};

/// An angle being entered: the direction it started from, and what it was last made into.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct TurnEntry {
    entered: [f64; 3],
    from_to: Option<(Vector, Vector)>,
}

impl TurnEntry {
    /// The angles entered so far about x, y and z, in degrees; zeros once something else turned the
    /// direction.
    pub fn angles_deg(&mut self, direction: &Vector) -> [f64; 3] {
        if self.from_to.is_none_or(|(_, to)| to != *direction) {
            *self = Self::default();
        }
        self.entered
    }

    /// The direction after the angles became `angles_deg`: turned about x, then y, then z, from where
    /// the entering began.
    pub fn turned(&mut self, direction: &Vector, angles_deg: [f64; 3]) -> Vector {
        let from = self.from_to.map_or(*direction, |(from, _)| from);
        let mut to = from;
        for (axis, angle) in [Vector::x(), Vector::y(), Vector::z()].into_iter().zip(angles_deg) {
            to = Affine::rotation_about(Point::origin(), axis, angle.to_radians()).vector(&to);
        }
        *self = Self { entered: angles_deg, from_to: Some((from, to)) };
        to
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn angles_count_from_where_the_entering_began() {
        let mut entry = TurnEntry::default();
        let first = entry.turned(&Vector::z(), [45.0, 0.0, 0.0]);
        assert_eq!(entry.angles_deg(&first), [45.0, 0.0, 0.0], "shown as entered");
        let second = entry.turned(&first, [90.0, 0.0, 0.0]);
        assert!((second - -Vector::y()).norm() < 1e-12, "90 degrees in all, not 135: {second}");
        assert_eq!(entry.angles_deg(&Vector::x()), [0.0; 3], "another direction starts anew");
    }
}
