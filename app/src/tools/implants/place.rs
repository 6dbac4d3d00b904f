//! Where an implant is put, and in what unit its file seems to be.

use render::volume::{Affine, Point, TriangleMesh};

/// The middle of a model's box, after `scale`; mm.
pub fn middle(mesh: &TriangleMesh, scale: f64) -> Point {
    let [low, high] = mesh.bounds();
    (low + (high - low) / 2.0) * scale
}

/// `pose` moved so that the model's middle comes to `to`, turned as before.
pub fn moved_to(pose: &Affine, middle: &Point, to: &Point) -> Affine {
    Affine::translation(to - pose.point(middle)) * *pose
}

/// Longest side of a model's box, in the model's own unit.
pub fn longest(mesh: &TriangleMesh) -> f64 {
    let [low, high] = mesh.bounds();
    (high - low).amax()
}

/// A scale that a model of this size probably needs: nothing implanted is shorter than 1 mm, so what
/// measures less is in metres.
pub fn likely_scale(longest: f64) -> f64 {
    if longest < 1.0 { 1000.0 } else { 1.0 }
}

#[cfg(test)]
mod tests {
    use super::*;
    use render::volume::Vector;

    #[test]
    fn a_moved_implant_has_its_middle_there_and_keeps_its_turn() {
        let corners = [[0.0, 0.0, 0.0], [2.0, 0.0, 0.0], [0.0, 4.0, 0.0], [0.0, 0.0, 6.0]];
        let mesh = TriangleMesh::new(corners.map(Point::from).to_vec(), vec![[0, 1, 2], [0, 1, 3]]);
        let middle = middle(&mesh.expect("mesh"), 10.0);
        assert_eq!(middle, Point::new(10.0, 20.0, 30.0), "of the scaled box");
        let pose = Affine::rotation_about(Point::new(1.0, 1.0, 0.0), Vector::new(0.0, 1.0, 1.0), 1.1);
        let to = Point::new(-50.0, 3.0, 12.0);
        let made = moved_to(&pose, &middle, &to);
        assert!((made.point(&middle) - to).norm() < 1e-12, "there");
        assert!((made.linear() - pose.linear()).norm() < 1e-15, "as turned as before");
    }

    #[test]
    fn a_model_below_a_millimetre_is_taken_for_metres() {
        assert_eq!((likely_scale(0.11), likely_scale(96.0)), (1000.0, 1.0), "a tibial tray, a femur");
    }
}
