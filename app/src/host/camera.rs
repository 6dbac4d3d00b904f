//! What the 3D view does with its camera: rays through pixels, places on the picture, orbit, pan, zoom
//! and the six views along the body's axes. Plain numbers; no window.
//!
//! Positions in a picture are `[x, y]` from its upper left corner, in whatever unit `size` is in
//! (egui's points here); world is LPS mm.

use render::scene::{Camera, CameraError, CameraFrame, Projection};
use render::volume::{Affine, Point, Vector};

/// Vertical field of view of a camera nobody has chosen; radians.
pub const FOV_RAD: f64 = 30.0 * std::f64::consts::PI / 180.0;
/// Closest and farthest that zooming goes from the target, or of the height of a parallel view; mm.
const REACH_MM: [f64; 2] = [1.0, 1e5];

/// A half line in world space.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Ray {
    /// Where it starts; on the eye's plane.
    pub origin: Point,
    /// Unit vector.
    pub direction: Vector,
}

impl Ray {
    /// The place `distance_mm` along it.
    pub fn at(&self, distance_mm: f64) -> Point {
        self.origin + self.direction * distance_mm
    }

    /// How far along the ray its closest approach to the line through `point` along the unit vector
    /// `axis` lies *on that line*, measured from `point`; mm. `None` where they are parallel.
    pub fn closest_on_line(&self, point: &Point, axis: &Vector) -> Option<f64> {
        let between = self.origin - point;
        let cosine = self.direction.dot(axis);
        let sine_squared = 1.0 - cosine * cosine;
        (sine_squared > 1e-6)
            .then(|| (between.dot(axis) - cosine * between.dot(&self.direction)) / sine_squared)
    }

    /// Distance from a place to the ray's line; mm.
    pub fn distance_to(&self, p: &Point) -> f64 {
        (p - self.origin).cross(&self.direction).norm()
    }
}

/// A camera with the size of the picture it makes.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Lens {
    camera: Camera,
    frame: CameraFrame,
    size: [f64; 2],
}

impl Lens {
    /// A picture of `size`, both > 0.
    ///
    /// # Errors
    /// [`CameraError`] where the camera shows nothing.
    pub fn new(camera: &Camera, size: [f64; 2]) -> Result<Self, CameraError> {
        let frame = camera.frame()?;
        Ok(Self { camera: *camera, frame, size: size.map(|s| s.max(1.0)) })
    }

    /// The camera's axes.
    pub fn frame(&self) -> &CameraFrame {
        &self.frame
    }

    /// Half the height of the picture, at distance 1 (perspective) or anywhere (parallel); mm.
    fn half_height(&self) -> f64 {
        match self.camera.projection {
            Projection::Perspective { fov_rad } => (fov_rad / 2.0).tan(),
            Projection::Parallel { height_mm } => height_mm / 2.0,
        }
    }

    /// The ray through a position of the picture.
    pub fn ray(&self, at: [f64; 2]) -> Ray {
        let [width, height] = self.size;
        let half = self.half_height();
        let x = (2.0 * at[0] - width) / height * half;
        let y = (height - 2.0 * at[1]) / height * half;
        let across = self.frame.right * x + self.frame.up * y;
        match self.camera.projection {
            Projection::Perspective { .. } => {
                let direction = self.frame.forward + across;
                // At least as long as `forward`, so never zero.
                Ray { origin: self.camera.eye, direction: direction / direction.norm() }
            }
            Projection::Parallel { .. } => {
                Ray { origin: self.camera.eye + across, direction: self.frame.forward }
            }
        }
    }

    /// Where a place is seen; `None` for what lies behind the eye's plane.
    pub fn project(&self, p: &Point) -> Option<[f64; 2]> {
        let from_eye = p - self.camera.eye;
        let depth = from_eye.dot(&self.frame.forward);
        if depth <= 1e-6 {
            return None;
        }
        let half = match self.camera.projection {
            Projection::Perspective { .. } => self.half_height() * depth,
            Projection::Parallel { .. } => self.half_height(),
        };
        let [width, height] = self.size;
        let scale = height / 2.0 / half;
        let x = width / 2.0 + from_eye.dot(&self.frame.right) * scale;
        let y = height / 2.0 - from_eye.dot(&self.frame.up) * scale;
        Some([x, y])
    }

    /// Size of one unit of the picture where a place is; mm.
    pub fn mm_per_unit(&self, p: &Point) -> f64 {
        let half = match self.camera.projection {
            Projection::Perspective { .. } => {
                let depth = (p - self.camera.eye).dot(&self.frame.forward);
                self.half_height() * depth.max(1e-3)
            }
            Projection::Parallel { .. } => self.half_height(),
        };
        2.0 * half / self.size[1]
    }

    /// The camera turned about its target as a hand would turn a ball behind the picture: a drag of
    /// half the picture's height is a quarter turn. There is no pole to be stuck at.
    pub fn orbited(&self, drag: [f64; 2]) -> Camera {
        let rad_per_unit = std::f64::consts::PI / self.size[1];
        let (yaw_rad, pitch_rad) = (-drag[0] * rad_per_unit, -drag[1] * rad_per_unit);
        let turn = Affine::rotation_about(self.camera.target, self.frame.up, yaw_rad)
            * Affine::rotation_about(self.camera.target, self.frame.right, pitch_rad);
        Camera { eye: turn.point(&self.camera.eye), up: turn.vector(&self.frame.up), ..self.camera }
    }

    /// The camera shifted so that what is at the target's depth follows the pointer.
    pub fn panned(&self, drag: [f64; 2]) -> Camera {
        let mm = self.mm_per_unit(&self.camera.target);
        let shift = self.frame.up * (drag[1] * mm) - self.frame.right * (drag[0] * mm);
        Camera { eye: self.camera.eye + shift, target: self.camera.target + shift, ..self.camera }
    }

    /// The camera with everything at the target's depth `factor` times as large; > 0.
    pub fn zoomed(&self, factor: f64) -> Camera {
        if !(factor > 0.0 && factor.is_finite()) {
            return self.camera;
        }
        let [least, most] = REACH_MM;
        match self.camera.projection {
            Projection::Perspective { .. } => {
                let back = self.camera.eye - self.camera.target;
                let distance = (back.norm() / factor).clamp(least, most);
                Camera { eye: self.camera.target - self.frame.forward * distance, ..self.camera }
            }
            Projection::Parallel { height_mm } => {
                let height_mm = (height_mm / factor).clamp(least, most);
                Camera { projection: Projection::Parallel { height_mm }, ..self.camera }
            }
        }
    }
}

/// A side of the body to look at.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Facing {
    /// From the front.
    Anterior,
    /// From behind.
    Posterior,
    /// From the patient's left.
    Left,
    /// From the patient's right.
    Right,
    /// From the head.
    Superior,
    /// From the feet.
    Inferior,
}

impl Facing {
    /// All six, in the order shown.
    pub const ALL: [Self; 6] =
        [Self::Anterior, Self::Posterior, Self::Left, Self::Right, Self::Superior, Self::Inferior];

    /// The letter radiology marks the side with.
    pub fn letter(self) -> char {
        match self {
            Self::Anterior => 'A',
            Self::Posterior => 'P',
            Self::Left => 'L',
            Self::Right => 'R',
            Self::Superior => 'S',
            Self::Inferior => 'I',
        }
    }

    /// The whole word, in lower case.
    pub fn word(self) -> &'static str {
        match self {
            Self::Anterior => "anterior",
            Self::Posterior => "posterior",
            Self::Left => "left",
            Self::Right => "right",
            Self::Superior => "superior",
            Self::Inferior => "inferior",
        }
    }

    /// Unit vector out of the body on that side; LPS.
    pub fn outward(self) -> Vector {
        match self {
            Self::Anterior => -Vector::y(),
            Self::Posterior => Vector::y(),
            Self::Left => Vector::x(),
            Self::Right => -Vector::x(),
            Self::Superior => Vector::z(),
            Self::Inferior => -Vector::z(),
        }
    }

    /// A camera on that side that sees all of a ball; the head is up, and the front for a look along the
    /// body.
    pub fn camera(self, ball: Ball) -> Camera {
        let distance = ball.radius_mm.max(REACH_MM[0]) / (FOV_RAD / 2.0).sin();
        let up = match self {
            Self::Superior | Self::Inferior => -Vector::y(),
            _ => Vector::z(),
        };
        Camera {
            eye: ball.centre + self.outward() * distance,
            target: ball.centre,
            up,
            projection: Projection::Perspective { fov_rad: FOV_RAD },
        }
    }

    /// The letters of a direction, strongest first: `"A"`, or `"AL"` where a second part is at least
    /// half of the first. Empty for no direction.
    pub fn letters(direction: &Vector) -> String {
        let mut parts: Vec<(f64, char)> =
            Self::ALL.iter().map(|side| (side.outward().dot(direction), side.letter())).collect();
        parts.sort_by(|a, b| b.0.total_cmp(&a.0));
        let strongest = parts.first().map_or(0.0, |p| p.0);
        parts.iter().filter(|p| p.0 > 1e-9 && p.0 >= 0.5 * strongest).map(|p| p.1).collect()
    }
}

/// A ball in world space that holds what is to be seen.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Ball {
    /// Its middle; mm.
    pub centre: Point,
    /// > 0; mm.
    pub radius_mm: f64,
}

impl Ball {
    /// The ball about the box of some places; a ball of 100 mm at the origin where there are none.
    pub fn about(places: impl IntoIterator<Item = Point>) -> Self {
        let mut low = Point::from([f64::INFINITY; 3]);
        let mut high = Point::from([f64::NEG_INFINITY; 3]);
        for p in places {
            low = low.inf(&p);
            high = high.sup(&p);
        }
        let across = high - low;
        if across.iter().all(|d| d.is_finite()) {
            Self { centre: low + across / 2.0, radius_mm: (across.norm() / 2.0).max(1.0) }
        } else {
            Self { centre: Point::origin(), radius_mm: 100.0 }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn ball() -> Ball {
        Ball { centre: Point::new(10.0, -20.0, 30.0), radius_mm: 80.0 }
    }

    #[test]
    fn a_ray_through_a_pixel_meets_what_is_seen_there() {
        for projection in [Projection::Perspective { fov_rad: 0.6 }, Projection::Parallel { height_mm: 90.0 }]
        {
            let camera = Camera { projection, ..Facing::Left.camera(ball()) };
            let lens = Lens::new(&camera, [640.0, 360.0]).expect("lens");
            let ray = lens.ray([500.0, 37.0]);
            let [x, y] = lens.project(&ray.at(150.0)).expect("before the eye");
            assert!((x - 500.0).abs() < 1e-9 && (y - 37.0).abs() < 1e-9, "{projection:?}: {x} {y}");
            assert_eq!(lens.project(&ray.at(-1.0)), None, "behind the eye");
        }
    }

    #[test]
    fn the_front_view_has_the_patients_left_on_the_right_and_the_head_up() {
        let lens = Lens::new(&Facing::Anterior.camera(ball()), [100.0, 100.0]).expect("lens");
        assert_eq!(Facing::letters(&lens.frame().right), "L", "right of the picture");
        assert_eq!(Facing::letters(&lens.frame().up), "S", "top of the picture");
        let lens = Lens::new(&Facing::Inferior.camera(ball()), [100.0, 100.0]).expect("lens");
        assert_eq!(Facing::letters(&lens.frame().right), "L", "from the feet, as in an axial slice");
        assert_eq!(Facing::letters(&lens.frame().up), "A", "front on top");
    }

    #[test]
    fn every_reset_sees_the_whole_ball() {
        for side in Facing::ALL {
            let camera = side.camera(ball());
            let lens = Lens::new(&camera, [300.0, 300.0]).expect("lens");
            // A ball's outline touches the cone of view exactly when its centre is r / sin(fov / 2) away.
            let edge = lens.ray([150.0, 0.0]);
            assert!((edge.distance_to(&ball().centre) - 80.0).abs() < 1e-9, "{side:?} fits tightly");
        }
    }

    #[test]
    fn orbiting_keeps_the_target_and_the_distance_and_turns_the_ball_with_the_hand() {
        let camera = Facing::Anterior.camera(ball());
        let lens = Lens::new(&camera, [400.0, 400.0]).expect("lens");
        let turned = lens.orbited([200.0, 0.0]);
        assert!((turned.target - camera.target).norm() < 1e-9, "target");
        let distance = |c: &Camera| (c.eye - c.target).norm();
        assert!((distance(&turned) - distance(&camera)).abs() < 1e-9, "distance");
        // Dragging to the right by half the height brings the patient's right side to the front.
        let forward = Lens::new(&turned, [400.0, 400.0]).expect("lens").frame().forward;
        assert_eq!(Facing::letters(&-forward), "R", "a quarter turn");
        let front = camera.target - Vector::y() * 10.0;
        let lens_after = Lens::new(&lens.orbited([5.0, 3.0]), [400.0, 400.0]).expect("lens");
        let (before, after) =
            (lens.project(&front).expect("seen"), lens_after.project(&front).expect("seen"));
        assert!(after[0] > before[0] && after[1] > before[1], "the near side follows the pointer");
    }

    #[test]
    fn panning_carries_the_target_with_the_pointer() {
        let camera = Facing::Superior.camera(ball());
        let lens = Lens::new(&camera, [500.0, 300.0]).expect("lens");
        let moved = Lens::new(&lens.panned([40.0, -25.0]), [500.0, 300.0]).expect("lens");
        let [x, y] = moved.project(&camera.target).expect("seen");
        assert!((x - 290.0).abs() < 1e-9 && (y - 125.0).abs() < 1e-9, "{x} {y}");
    }

    #[test]
    fn zooming_makes_things_at_the_target_larger_by_the_factor() {
        for projection in [Projection::Perspective { fov_rad: 0.6 }, Projection::Parallel { height_mm: 90.0 }]
        {
            let camera = Camera { projection, ..Facing::Left.camera(ball()) };
            let size = [200.0, 200.0];
            let lens = Lens::new(&camera, size).expect("lens");
            let near = Lens::new(&lens.zoomed(2.0), size).expect("lens");
            let ratio = lens.mm_per_unit(&camera.target) / near.mm_per_unit(&camera.target);
            assert!((ratio - 2.0).abs() < 1e-9, "{projection:?}: {ratio}");
            assert_eq!(lens.zoomed(f64::NAN), camera, "nonsense changes nothing");
        }
    }

    #[test]
    fn the_closest_place_on_a_line_is_at_right_angles() {
        let ray = Ray { origin: Point::new(0.0, -50.0, 3.0), direction: Vector::y() };
        let axis = Vector::new(1.0, 1.0, 1.0).normalize();
        let point = Point::new(2.0, 1.0, -4.0);
        let along = ray.closest_on_line(&point, &axis).expect("not parallel");
        let on = point + axis * along;
        let gap = on - (ray.origin + ray.direction * (on - ray.origin).dot(&ray.direction));
        assert!(gap.dot(&axis).abs() < 1e-9 && gap.dot(&ray.direction).abs() < 1e-9, "perpendicular to both");
        assert_eq!(ray.closest_on_line(&point, &Vector::y()), None, "parallel lines have no closest place");
    }

    #[test]
    fn oblique_directions_have_two_letters() {
        assert_eq!(Facing::letters(&Vector::new(0.8, -0.6, 0.1)), "LA", "mostly left, partly front");
        assert_eq!(Facing::letters(&Vector::new(0.9, -0.1, 0.1)), "L", "almost left");
        assert_eq!(Facing::letters(&Vector::zeros()), "", "no direction");
    }
}
