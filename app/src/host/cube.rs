//! The orientation cube: a small cube with the letters of the body's sides, turned as the camera is.

use render::scene::CameraFrame;
use render::volume::Vector;

use super::camera::Facing;

/// A visible face, in picture directions: x right, y down, the cube's edge being 2.
#[derive(Debug, Clone, PartialEq)]
pub struct Face {
    /// Its side of the body.
    pub side: Facing,
    /// Its corners, in order around it.
    pub corners: [[f64; 2]; 4],
    /// How squarely it is seen, 0 (edge on) to 1.
    pub facing: f64,
}

/// The faces turned towards the viewer: at most three, none of which hides another.
pub fn faces(frame: &CameraFrame) -> Vec<Face> {
    let flat = |v: &Vector| [v.dot(&frame.right), -v.dot(&frame.up)];
    let face = |side: Facing| {
        let out = side.outward();
        let facing = -out.dot(&frame.forward);
        if facing <= 1e-6 {
            return None;
        }
        // Two unit vectors across the face.
        let u = Vector::new(out.y.abs() + out.z.abs(), out.x.abs(), 0.0);
        let u = if u.dot(&out).abs() > 0.5 { Vector::z() } else { u };
        let v = out.cross(&u);
        let corners = [u + v, v - u, -u - v, u - v].map(|c| flat(&(out + c)));
        Some(Face { side, corners, facing })
    };
    Facing::ALL.into_iter().filter_map(face).collect()
}

/// The face under a position in the same directions.
pub fn face_at(frame: &CameraFrame, at: [f64; 2]) -> Option<Facing> {
    let inside = |corners: &[[f64; 2]; 4]| {
        let turn = |k: usize| {
            let (a, b) = (corners[k], corners[(k + 1) % 4]);
            (b[0] - a[0]) * (at[1] - a[1]) - (b[1] - a[1]) * (at[0] - a[0])
        };
        let turns = [0, 1, 2, 3].map(turn);
        turns.iter().all(|t| *t >= 0.0) || turns.iter().all(|t| *t <= 0.0)
    };
    faces(frame).into_iter().find(|f| inside(&f.corners)).map(|f| f.side)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::host::camera::Ball;
    use render::volume::Point;

    fn frame(side: Facing) -> CameraFrame {
        let ball = Ball { centre: Point::origin(), radius_mm: 10.0 };
        side.camera(ball).frame().expect("frame")
    }

    #[test]
    fn a_look_at_one_side_shows_its_face_alone_as_a_square() {
        for side in Facing::ALL {
            let faces = faces(&frame(side));
            assert_eq!(faces.len(), 1, "{side:?}: one face");
            assert_eq!(faces[0].side, side, "{side:?}: its own");
            let mut area = 0.0;
            for k in 0..4 {
                let (a, b) = (faces[0].corners[k], faces[0].corners[(k + 1) % 4]);
                area += (a[0] * b[1] - a[1] * b[0]) / 2.0;
            }
            assert!((f64::abs(area) - 4.0).abs() < 1e-9, "{side:?}: a square of 2 by 2, area {area}");
        }
    }

    #[test]
    fn an_oblique_look_shows_three_faces_that_do_not_overlap() {
        let mut camera = Facing::Anterior.camera(Ball { centre: Point::origin(), radius_mm: 10.0 });
        camera.eye = Point::new(100.0, -150.0, 80.0);
        let frame = camera.frame().expect("frame");
        let sides: Vec<_> = faces(&frame).iter().map(|f| f.side).collect();
        assert_eq!(sides, [Facing::Anterior, Facing::Left, Facing::Superior], "the three nearest");
        let centre = |f: &Face| [0, 1].map(|k| f.corners.iter().map(|c| c[k]).sum::<f64>() / 4.0);
        for face in faces(&frame) {
            assert_eq!(face_at(&frame, centre(&face)), Some(face.side), "its middle is its own");
        }
        assert_eq!(face_at(&frame, [9.0, 9.0]), None, "beside the cube");
    }
}
