//! The handle of a cutter in the 3D view: what of it is under the pointer, and what a drag makes of the
//! cutter. Geometry only; world mm.
//!
//! A plane's handle is a disc with an arrow along its normal. The arrow or the disc moves the plane
//! along the normal, the middle dot slides the handle within the plane (which changes where it turns,
//! not what it cuts), the four dots on the rim turn it about the middle. A blade's is its rectangle, with
//! the same parts; sliding it within its plane does change what it cuts. A cylinder's or dome's handle is
//! its middle (moves it in the plane of the picture) and a dot on its wall (its radius).

use render::volume::{Affine, Cutter, Point, Shape, Vector};

use crate::host::pointer::PointerEvent;

/// How near the pointer must be to take a dot; points of the screen.
const REACH: f64 = 10.0;
/// Straight pieces that a circle is drawn of.
const STEPS: usize = 72;

/// A part of a handle.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Grip {
    /// The dot in the middle.
    Middle,
    /// The arrow's tip, or the disc itself.
    Along,
    /// A dot on the rim, 0 to 3.
    Rim(usize),
}

/// A cutter's handle.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Handle {
    cutter: Cutter,
    /// The middle.
    pub centre: Point,
    /// Unit vector: the normal of a plane or blade, the axis of a cylinder, any of a dome.
    pub axis: Vector,
    /// Unit vectors across the axis; along width and height of a blade.
    across: [Vector; 2],
    /// From the middle to the rim along these; the radius, or half of a blade's width and height; mm.
    half_mm: [f64; 2],
}

impl Handle {
    /// The handle of a cutter; a plane's disc has `disc_mm` radius. `None` where its directions have no
    /// length, which no cutter's have.
    pub fn of(cutter: &Cutter, disc_mm: f64) -> Option<Self> {
        let (centre, axis, right, half_mm) = match *cutter.shape() {
            Shape::Plane { point, normal } => (point, normal, None, [disc_mm; 2]),
            Shape::Cylinder { point, axis, radius_mm } => (point, axis, None, [radius_mm; 2]),
            Shape::Dome { centre, radius_mm } => {
                // The dot on its wall is seen beside its middle from every side of the body.
                let (axis, out) = (Vector::new(1.0, -1.0, 0.0), Vector::repeat(1.0));
                (centre, axis, Some(out), [radius_mm; 2])
            }
            Shape::Blade { point, normal, right, width_mm, height_mm } => {
                (point, normal, Some(right), [width_mm / 2.0, height_mm / 2.0])
            }
        };
        let axis = axis.try_normalize(0.0)?;
        let right = right.unwrap_or_else(|| {
            let mut seed = Vector::zeros();
            seed[axis.iamin()] = 1.0;
            axis.cross(&seed)
        });
        let u = (right - axis * axis.dot(&right)).try_normalize(0.0)?;
        Some(Self { cutter: *cutter, centre, axis, across: [u, axis.cross(&u)], half_mm })
    }

    /// Whether it is of a plane or a blade.
    pub fn is_flat(&self) -> bool {
        matches!(self.cutter.shape(), Shape::Plane { .. } | Shape::Blade { .. })
    }

    /// A place on the circle about `centre`, by angle from the first rim dot.
    fn on_circle(&self, centre: &Point, angle_rad: f64) -> Point {
        let [u, v] = self.across;
        centre + u * (angle_rad.cos() * self.half_mm[0]) + v * (angle_rad.sin() * self.half_mm[1])
    }

    /// The circle, closed, shifted by `along_mm` on the axis.
    fn circle(&self, along_mm: f64) -> Vec<Point> {
        let centre = self.centre + self.axis * along_mm;
        let step = |i| self.on_circle(&centre, std::f64::consts::TAU * i as f64 / STEPS as f64);
        (0..=STEPS).map(step).collect()
    }

    /// The edge of a plane's disc or of a blade, or a circle of the wall; closed.
    pub fn outline(&self) -> Vec<Point> {
        if !matches!(self.cutter.shape(), Shape::Blade { .. }) {
            return self.circle(0.0);
        }
        let [u, v] = [0, 1].map(|i| self.across[i] * self.half_mm[i]);
        [u + v, v - u, -u - v, u - v, u + v].map(|corner| self.centre + corner).to_vec()
    }

    /// The lines that show a round body: circles of many pieces, and straight ones along a cylinder; none of a
    /// flat one.
    pub fn lines(&self) -> Vec<Vec<Point>> {
        match self.cutter.shape() {
            Shape::Plane { .. } | Shape::Blade { .. } => Vec::new(),
            Shape::Cylinder { .. } => {
                let half = self.half_mm[0] * 1.5;
                let mut lines: Vec<_> = [-half, 0.0, half].map(|along| self.circle(along)).into();
                let ends = |wall: Point| vec![wall - self.axis * half, wall + self.axis * half];
                lines.extend(self.circle(0.0).into_iter().step_by(STEPS / 8).map(ends));
                lines
            }
            Shape::Dome { .. } => {
                let [x, y, z] = [Vector::x(), Vector::y(), Vector::z()];
                let about = |across| Self { across, ..*self }.circle(0.0);
                vec![about([x, y]), about([y, z]), about([z, x])]
            }
        }
    }

    /// The arrow's tip.
    pub fn tip(&self) -> Point {
        self.centre + self.axis * (self.half_mm[0].max(self.half_mm[1]) * 0.8)
    }

    /// The dots on the rim: four for a plane or blade, one for a cylinder or dome.
    pub fn rim(&self) -> Vec<Point> {
        let count = if self.is_flat() { 4 } else { 1 };
        let quarter = std::f64::consts::FRAC_PI_2;
        (0..count).map(|k| self.on_circle(&self.centre, quarter * f64::from(k))).collect()
    }

    /// What the pointer is on: a dot before the disc.
    pub fn grip(&self, event: &PointerEvent) -> Option<Grip> {
        let mut dots = vec![(Grip::Middle, self.centre)];
        if self.is_flat() {
            dots.push((Grip::Along, self.tip()));
        }
        dots.extend(self.rim().into_iter().enumerate().map(|(k, p)| (Grip::Rim(k), p)));
        let near = dots.into_iter().map(|(grip, p)| (grip, event.distance_to(&p)));
        let nearest = near.filter(|(_, d)| *d <= REACH).min_by(|a, b| a.1.total_cmp(&b.1));
        if let Some((grip, _)) = nearest {
            return Some(grip);
        }
        let ray = event.ray();
        let slope = ray.direction.dot(&self.axis);
        // A disc seen almost edge on is too thin to be meant.
        if !self.is_flat() || slope.abs() < 0.1 {
            return None;
        }
        let along = (self.centre - ray.origin).dot(&self.axis) / slope;
        let place = ray.at(along) - self.centre;
        let [x, y] = [0, 1].map(|i| (place.dot(&self.across[i]) / self.half_mm[i]).abs());
        let is_blade = matches!(self.cutter.shape(), Shape::Blade { .. });
        let inside = if is_blade { x.max(y) <= 1.0 } else { x.hypot(y) <= 1.0 };
        (along > 0.0 && inside).then_some(Grip::Along)
    }

    /// The cutter after a drag of `grip` from `began` to `now`, this handle being that of the cutter
    /// where the drag began.
    pub fn dragged(&self, grip: Grip, began: &PointerEvent, now: &PointerEvent) -> Cutter {
        self.moved(grip, began, now).unwrap_or(self.cutter)
    }

    fn moved(&self, grip: Grip, began: &PointerEvent, now: &PointerEvent) -> Option<Cutter> {
        let shift = |by: Vector| self.cutter.moved(&Affine::translation(by));
        match grip {
            Grip::Along => Some(shift(self.axis * self.along(began, now)?)),
            Grip::Middle if self.is_flat() => Some(shift(self.within(&self.axis, began, now)?)),
            Grip::Middle => Some(shift(self.within(&now.lens.frame().forward, began, now)?)),
            Grip::Rim(k) if self.is_flat() => {
                let turn = self.turned(k, &self.across[1 - k % 2], began, now)?;
                let shape = match *self.cutter.shape() {
                    // About the middle: its point stays to the last bit.
                    Shape::Plane { point, normal } => Shape::Plane { point, normal: turn.vector(&normal) },
                    Shape::Blade { point, normal, right, width_mm, height_mm } => {
                        let [normal, right] = [normal, right].map(|v| turn.vector(&v));
                        Shape::Blade { point, normal, right, width_mm, height_mm }
                    }
                    round => round,
                };
                Cutter::new(shape, self.cutter.kerf_mm()).ok()
            }
            Grip::Rim(_) => {
                let reach = now.ray().closest_on_line(&self.centre, &self.across[0])?.clamp(0.5, 1e4);
                let shape = match *self.cutter.shape() {
                    Shape::Cylinder { point, axis, .. } => Shape::Cylinder { point, axis, radius_mm: reach },
                    Shape::Dome { centre, .. } => Shape::Dome { centre, radius_mm: reach },
                    flat => flat,
                };
                // A radius that the saw leaves nothing of is not taken.
                Cutter::new(shape, self.cutter.kerf_mm()).ok()
            }
        }
    }

    /// How far the pointer went along the axis; mm.
    fn along(&self, began: &PointerEvent, now: &PointerEvent) -> Option<f64> {
        let at = |event: &PointerEvent| event.ray().closest_on_line(&self.centre, &self.axis);
        Some(at(now)? - at(began)?)
    }

    /// How far the pointer went within the plane through the middle across `normal`.
    fn within(&self, normal: &Vector, began: &PointerEvent, now: &PointerEvent) -> Option<Vector> {
        let at = |event: &PointerEvent| {
            let ray = event.ray();
            let slope = ray.direction.dot(normal);
            (slope.abs() > 0.05).then(|| ray.at((self.centre - ray.origin).dot(normal) / slope))
        };
        Some(at(now)? - at(began)?)
    }

    /// The turn about `hinge` that carries the rim's dot `k` as the pointer went. The place on the hinge's
    /// circle nearest to the pointer's ray is searched; of two, the one nearer to the dot in angle.
    fn turned(&self, k: usize, hinge: &Vector, began: &PointerEvent, now: &PointerEvent) -> Option<Affine> {
        let across = hinge.cross(&self.axis).try_normalize(1e-9)?;
        let dot = self.rim().get(k)? - self.centre;
        let dot_rad = dot.dot(&across).atan2(dot.dot(&self.axis));
        let start = self.nearest_rad(&across, began, dot_rad, dot.norm())?;
        let end = self.nearest_rad(&across, now, dot_rad, dot.norm())?;
        Some(Affine::rotation_about(self.centre, *hinge, end - start))
    }

    /// The angle from the axis towards `across` at which the circle through both passes nearest to the
    /// pointer's ray; ties (front and back of the circle) go to the one nearer to `near_rad`.
    fn nearest_rad(
        &self,
        across: &Vector,
        event: &PointerEvent,
        near_rad: f64,
        radius_mm: f64,
    ) -> Option<f64> {
        let ray = event.ray();
        let apart = |a: f64| {
            let d = (a - near_rad).rem_euclid(std::f64::consts::TAU);
            d.min(std::f64::consts::TAU - d)
        };
        let cost = |angle: f64| {
            let p = self.centre + (self.axis * angle.cos() + across * angle.sin()) * radius_mm;
            // A small preference, far below the distances that matter, decides between equals.
            ray.distance_to(&p) + 0.02 * radius_mm * apart(angle)
        };
        let step = std::f64::consts::TAU / 720.0;
        let coarse = (0..720).map(|i| f64::from(i) * step).min_by(|a, b| cost(*a).total_cmp(&cost(*b)))?;
        let fine = (-20..=20).map(|i| coarse + f64::from(i) * step / 20.0);
        fine.min_by(|a, b| cost(*a).total_cmp(&cost(*b)))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::host::camera::{Ball, Facing, Lens};
    use crate::host::pointer::Phase;

    /// A picture from the front of a ball of 100 mm at (10, 20, 30).
    fn lens() -> Lens {
        let ball = Ball { centre: Point::new(10.0, 20.0, 30.0), radius_mm: 100.0 };
        Lens::new(&Facing::Anterior.camera(ball), [500.0, 500.0]).expect("lens")
    }

    fn at(p: &Point) -> PointerEvent {
        let lens = lens();
        PointerEvent { phase: Phase::Drag, at: lens.project(p).expect("seen"), lens }
    }

    fn handle(normal: Vector) -> Handle {
        let plane = Cutter::plane(Point::new(12.0, 18.0, 25.0), normal).expect("plane");
        Handle::of(&plane, 40.0).expect("handle")
    }

    #[test]
    fn every_dot_is_gripped_where_it_is_seen() {
        let handle = handle(Vector::new(0.3, -0.4, 2.0));
        assert_eq!(handle.grip(&at(&handle.centre)), Some(Grip::Middle), "middle");
        assert_eq!(handle.grip(&at(&handle.tip())), Some(Grip::Along), "tip");
        for (k, p) in handle.rim().iter().enumerate() {
            assert_eq!(handle.grip(&at(p)), Some(Grip::Rim(k)), "rim {k}");
        }
        let beside = handle.centre + Vector::new(80.0, 0.0, 60.0);
        assert_eq!(handle.grip(&at(&beside)), None, "beside it");
        let within = handle.on_circle(&handle.centre, 0.7)
            + (handle.centre - handle.on_circle(&handle.centre, 0.7)) * 0.5;
        assert_eq!(handle.grip(&at(&within)), Some(Grip::Along), "on the disc");
    }

    #[test]
    fn the_arrow_moves_the_plane_along_its_normal_as_far_as_the_pointer_goes() {
        let handle = handle(Vector::new(0.3, -0.4, 2.0));
        let to = handle.tip() + handle.axis * 17.0;
        let made = handle.dragged(Grip::Along, &at(&handle.tip()), &at(&to));
        let Shape::Plane { point, normal } = *made.shape() else { panic!("a plane stays one") };
        assert!((point - (handle.centre + handle.axis * 17.0)).norm() < 1e-6, "17 mm along: {point}");
        assert_eq!(normal, Vector::new(0.3, -0.4, 2.0), "not turned");
    }

    #[test]
    fn sliding_the_middle_changes_no_side() {
        let handle = handle(Vector::new(0.3, -2.0, 0.5));
        let by = handle.across[0] * 11.0 - handle.across[1] * 6.0;
        let made = handle.dragged(Grip::Middle, &at(&handle.centre), &at(&(handle.centre + by)));
        let Shape::Plane { point, .. } = *made.shape() else { panic!("a plane stays one") };
        assert!((point - handle.centre - by).norm() < 1e-6, "the middle followed the pointer");
        assert!((point - handle.centre).dot(&handle.axis).abs() < 1e-9, "within the plane");
    }

    #[test]
    fn a_rim_dot_turns_the_plane_about_its_middle_by_the_angle_it_is_dragged() {
        let handle = handle(Vector::new(0.0, 0.3, 1.0));
        for (k, from) in handle.rim().iter().enumerate() {
            let hinge = handle.across[1 - k % 2];
            let turn = Affine::rotation_about(handle.centre, hinge, 0.35);
            let made = handle.dragged(Grip::Rim(k), &at(from), &at(&turn.point(from)));
            let Shape::Plane { point, normal } = *made.shape() else { panic!("a plane stays one") };
            assert_eq!(point, handle.centre, "the middle stays");
            let angle = normal.angle(&turn.vector(&handle.axis));
            // From some sides a circle's picture hardly moves with its angle; a tenth of a radian is then
            // a fraction of a point on the screen.
            let seen = at(&turn.point(from)).distance_to(from);
            assert!(angle < 0.06 || seen < 4.0, "rim {k}: {angle} rad from where it should be");
        }
    }

    #[test]
    fn a_cylinder_has_its_radius_dragged_at_the_wall() {
        let tube = Cutter::cylinder(Point::new(10.0, 20.0, 30.0), Vector::y(), 20.0).expect("tube");
        let handle = Handle::of(&tube, 40.0).expect("handle");
        let wall = handle.rim()[0];
        let to = handle.centre + (wall - handle.centre) * 1.5;
        let made = handle.dragged(Grip::Rim(0), &at(&wall), &at(&to));
        let Shape::Cylinder { radius_mm, .. } = *made.shape() else { panic!("a cylinder stays one") };
        assert!((radius_mm - 30.0).abs() < 1e-6, "{radius_mm}");
    }

    #[test]
    fn a_dome_is_dragged_by_its_middle_and_its_wall_and_keeps_its_kerf() {
        let dome = Cutter::dome(Point::new(10.0, 20.0, 30.0), 20.0).and_then(|c| c.with_kerf(1.2));
        let handle = Handle::of(&dome.expect("dome"), 40.0).expect("handle");
        let wall = handle.rim()[0];
        let made = handle.dragged(Grip::Rim(0), &at(&wall), &at(&(wall + (wall - handle.centre) * 0.25)));
        let Shape::Dome { centre, radius_mm } = *made.shape() else { panic!("a dome stays one") };
        assert!((radius_mm - 25.0).abs() < 1e-6 && centre == handle.centre, "{radius_mm} about {centre}");
        assert_eq!(made.kerf_mm(), 1.2, "the same saw");
        let by = Vector::new(7.0, 0.0, -4.0);
        let made = handle.dragged(Grip::Middle, &at(&handle.centre), &at(&(handle.centre + by)));
        let Shape::Dome { centre, .. } = *made.shape() else { panic!("a dome stays one") };
        assert!((centre - handle.centre - by).norm() < 1e-6, "with the pointer: {centre}");
        let on_it = |p: &Point| ((p - handle.centre).norm() - 20.0).abs() < 1e-9;
        assert!(handle.lines().iter().flatten().all(on_it), "drawn where it is");
    }

    #[test]
    fn a_blade_is_gripped_within_its_rectangle_and_turns_with_its_right() {
        let (normal, right) = (Vector::new(0.0, -2.0, 1.0), Vector::new(1.0, 0.0, 0.0));
        let blade = Cutter::blade(Point::new(10.0, 20.0, 30.0), normal, right, [80.0, 20.0]).expect("blade");
        let handle = Handle::of(&blade, 40.0).expect("handle");
        let [u, v] = handle.across;
        let place = |x: f64, y: f64| handle.centre + u * x + v * y;
        assert_eq!(handle.outline()[0], place(40.0, 10.0), "its corner");
        assert_eq!(handle.grip(&at(&place(25.0, 5.0))), Some(Grip::Along), "on the blade");
        assert_eq!(handle.grip(&at(&place(25.0, 16.0))), None, "above it");
        assert_eq!(handle.grip(&at(&place(0.0, 10.0))), Some(Grip::Rim(1)), "the middle of an edge");
        let turn = Affine::rotation_about(handle.centre, v, 0.3);
        let from = handle.rim()[0];
        let made = handle.dragged(Grip::Rim(0), &at(&from), &at(&turn.point(&from)));
        let Shape::Blade { point, normal: turned, right, width_mm, height_mm } = *made.shape() else {
            panic!("a blade stays one")
        };
        assert_eq!((point, width_mm, height_mm), (handle.centre, 80.0, 20.0), "the same blade");
        assert!(turned.angle(&turn.vector(&normal)) < 0.06, "{turned}");
        assert!(turned.dot(&right).abs() < 1e-9, "its width stays within it");
    }
}
