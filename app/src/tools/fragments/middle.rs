//! The middle of a piece: the centroid of what its transfer function shows.

use render::volume::{Affine, Cutter, Grid, Point, Side, Transfer, Vector};

/// Places looked at along each axis of the grid.
const STEPS: usize = 32;

/// The centroid of the piece of a volume on the kept sides, in its unmoved place, weighted by opacity.
///
/// Where all of the piece is clear, that of the piece itself; where there is none, of the volume. World
/// mm, from a lattice of 32 × 32 × 32 places.
pub fn of_piece(grid: &Grid, pose: &Affine, transfer: &Transfer, keep: &[(Cutter, Side)]) -> Point {
    let world_from_voxel = *pose * *grid.world_from_voxel();
    let extent = grid.extent();
    let mut seen = Mean::default();
    let mut kept = Mean::default();
    let mut all = Mean::default();
    for index in 0..STEPS * STEPS * STEPS {
        let step = [index % STEPS, index / STEPS % STEPS, index / (STEPS * STEPS)];
        let at: [f64; 3] =
            std::array::from_fn(|axis| (step[axis] as f64 + 0.5) / STEPS as f64 * extent[axis] as f64 - 0.5);
        let at = Point::from(at);
        let place = world_from_voxel.point(&at);
        all.add(&place, 1.0);
        if !keep.iter().all(|(cutter, side)| cutter.keeps(*side, &place)) {
            continue;
        }
        kept.add(&place, 1.0);
        if let Some(value) = grid.sample(&at) {
            seen.add(&place, transfer.rgba(value)[3]);
        }
    }
    seen.place().or_else(|| kept.place()).or_else(|| all.place()).unwrap_or_else(Point::origin)
}

#[derive(Default)]
struct Mean {
    sum: Vector,
    weight: f64,
}

impl Mean {
    fn add(&mut self, place: &Point, weight: f64) {
        self.sum += place.coords * weight;
        self.weight += weight;
    }

    fn place(&self) -> Option<Point> {
        (self.weight > 0.0).then(|| Point::from(self.sum / self.weight))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use render::volume::{ControlPoint, Rescale, Samples};

    fn cube(value: i16) -> Grid {
        let n = 32;
        let voxel = Affine::translation(Vector::new(100.0, 0.0, 0.0));
        Grid::new([n; 3], Samples::I16(vec![value; n * n * n]), Rescale::default(), voxel).expect("grid")
    }

    fn step_at_zero() -> Transfer {
        let point = |value, a| ControlPoint { value, rgba: [1.0, 1.0, 1.0, a] };
        Transfer::new(vec![point(0.0, 0.0), point(0.0, 0.5)], 1.0).expect("step")
    }

    #[test]
    fn the_middle_of_half_a_cube_is_the_middle_of_that_half() {
        let plane = Cutter::plane(Point::new(115.5, 0.0, 0.0), Vector::x()).expect("plane");
        let middle = of_piece(&cube(10), &Affine::identity(), &step_at_zero(), &[(plane, Side::Minus)]);
        // The cube covers 99.5 … 131.5 along x, so its lower half has its middle at 107.5.
        assert!((middle - Point::new(107.5, 15.5, 15.5)).norm() < 1e-9, "{middle}");
    }

    #[test]
    fn a_clear_piece_has_a_middle_too() {
        let middle = of_piece(&cube(-10), &Affine::identity(), &step_at_zero(), &[]);
        assert!((middle - Point::new(115.5, 15.5, 15.5)).norm() < 1e-9, "of the piece: {middle}");
        let beyond = Cutter::plane(Point::new(500.0, 0.0, 0.0), Vector::x()).expect("plane");
        let none = of_piece(&cube(10), &Affine::identity(), &step_at_zero(), &[(beyond, Side::Plus)]);
        assert!((none - Point::new(115.5, 15.5, 15.5)).norm() < 1e-9, "of the volume: {none}");
    }
}
