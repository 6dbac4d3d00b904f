//! The handle of a cutter in the 3D view: what of it is under the pointer, and what a drag makes of the
//! cutter. Geometry only; world mm.
//!
//! A plane's handle is a disc with an arrow along its normal. The arrow or the disc moves the plane
//! along the normal, the middle dot slides the handle within the plane (which changes where it turns,
//! not what it cuts), the four dots on the rim turn it about the middle. A cylinder's handle is its
//! middle (moves it in the plane of the picture) and a dot on its wall (its radius).

use render::volume::{Affine, Cutter, Point, Vector};

use crate::host::pointer::PointerEvent;

/// How near the pointer must be to take a dot; points of the screen.
const REACH: f64 = 10.0;
/// Straight pieces that a circle is drawn of.
pub const STEPS: usize = 72;

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
    /// Unit vector: the normal of a plane, the axis of a cylinder.
    pub axis: Vector,
    /// Unit vectors across the axis.
    across: [Vector; 2],
    /// Of the disc, or of the cylinder; mm.
    pub radius_mm: f64,
}

impl Handle {
    /// The handle of a cutter; a plane's disc has `disc_mm` radius. `None` for a kind without one.
    pub fn of(cutter: &Cutter, disc_mm: f64) -> Option<Self> {
        let (centre, axis, radius_mm) = match cutter {
            Cutter::Plane { point, normal } => (*point, *normal, disc_mm),
            Cutter::Cylinder { point, axis, radius_mm } => (*point, *axis, *radius_mm),
            _ => return None,
        };
        let axis = axis.try_normalize(0.0)?;
        let mut seed = Vector::zeros();
        seed[axis.iamin()] = 1.0;
        let u = axis.cross(&seed).try_normalize(0.0)?;
        Some(Self { cutter: *cutter, centre, axis, across: [u, axis.cross(&u)], radius_mm })
    }

    fn is_plane(&self) -> bool {
        matches!(self.cutter, Cutter::Plane { .. })
    }

    /// A place on the circle about `centre`, by angle from the first rim dot.
    fn on_circle(&self, centre: &Point, angle_rad: f64) -> Point {
        let [u, v] = self.across;
        centre + (u * angle_rad.cos() + v * angle_rad.sin()) * self.radius_mm
    }

    /// The circle, closed, shifted by `along_mm` on the axis.
    pub fn circle(&self, along_mm: f64) -> Vec<Point> {
        let centre = self.centre + self.axis * along_mm;
        let step = |i| self.on_circle(&centre, std::f64::consts::TAU * i as f64 / STEPS as f64);
        (0..=STEPS).map(step).collect()
    }

    /// The arrow's tip.
    pub fn tip(&self) -> Point {
        self.centre + self.axis * (self.radius_mm * 0.8)
    }

    /// The dots on the rim: four for a plane, one for a cylinder.
    pub fn rim(&self) -> Vec<Point> {
        let count = if self.is_plane() { 4 } else { 1 };
        let quarter = std::f64::consts::FRAC_PI_2;
        (0..count).map(|k| self.on_circle(&self.centre, quarter * f64::from(k))).collect()
    }

    /// What the pointer is on: a dot before the disc.
    pub fn grip(&self, event: &PointerEvent) -> Option<Grip> {
        let mut dots = vec![(Grip::Middle, self.centre)];
        if self.is_plane() {
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
        if !self.is_plane() || slope.abs() < 0.1 {
            return None;
        }
        let along = (self.centre - ray.origin).dot(&self.axis) / slope;
        let inside = along > 0.0 && (ray.at(along) - self.centre).norm() <= self.radius_mm;
        inside.then_some(Grip::Along)
    }

    /// The cutter after a drag of `grip` from `began` to `now`, this handle being that of the cutter
    /// where the drag began.
    pub fn dragged(&self, grip: Grip, began: &PointerEvent, now: &PointerEvent) -> Cutter {
        let made = match (grip, self.cutter) {
            (Grip::Along, Cutter::Plane { normal, .. }) => {
                self.along(began, now).map(|by| Cutter::Plane { point: self.centre + self.axis * by, normal })
            }
            (Grip::Middle, Cutter::Plane { normal, .. }) => self
                .within(&self.axis, began, now)
                .map(|by| Cutter::Plane { point: self.centre + by, normal }),
            (Grip::Rim(k), Cutter::Plane { point, .. }) => {
                let hinge = self.across[1 - k % 2];
                let turn = self.turned(k, &hinge, began, now);
                turn.map(|turn| Cutter::Plane { point, normal: turn.vector(&self.axis) })
            }
            (Grip::Middle, Cutter::Cylinder { axis, radius_mm, .. }) => {
                let forward = now.lens.frame().forward;
                let by = self.within(&forward, began, now);
                by.map(|by| Cutter::Cylinder { point: self.centre + by, axis, radius_mm })
            }
            (Grip::Rim(_), Cutter::Cylinder { point, axis, .. }) => {
                let out = self.across[0];
                let reach = now.ray().closest_on_line(&self.centre, &out);
                reach.map(|r| Cutter::Cylinder { point, axis, radius_mm: r.clamp(0.5, 1e4) })
            }
            _ => None,
        };
        made.unwrap_or(self.cutter)
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
        let start = self.nearest_rad(&across, began, dot_rad)?;
        let end = self.nearest_rad(&across, now, dot_rad)?;
        Some(Affine::rotation_about(self.centre, *hinge, end - start))
    }

    /// The angle from the axis towards `across` at which the circle through both passes nearest to the
    /// pointer's ray; ties (front and back of the circle) go to the one nearer to `near_rad`.
    fn nearest_rad(&self, across: &Vector, event: &PointerEvent, near_rad: f64) -> Option<f64> {
        let ray = event.ray();
        let apart = |a: f64| {
            let d = (a - near_rad).rem_euclid(std::f64::consts::TAU);
            d.min(std::f64::consts::TAU - d)
        };
        let cost = |angle: f64| {
            let p = self.centre + (self.axis * angle.cos() + across * angle.sin()) * self.radius_mm;
            // A small preference, far below the distances that matter, decides between equals.
            ray.distance_to(&p) + 0.02 * self.radius_mm * apart(angle)
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
        let Cutter::Plane { point, normal } = made else { panic!("a plane stays one") };
        assert!((point - (handle.centre + handle.axis * 17.0)).norm() < 1e-6, "17 mm along: {point}");
        assert_eq!(normal, Vector::new(0.3, -0.4, 2.0), "not turned");
    }

    #[test]
    fn sliding_the_middle_changes_no_side() {
        let handle = handle(Vector::new(0.3, -2.0, 0.5));
        let by = handle.across[0] * 11.0 - handle.across[1] * 6.0;
        let made = handle.dragged(Grip::Middle, &at(&handle.centre), &at(&(handle.centre + by)));
        let Cutter::Plane { point, .. } = made else { panic!("a plane stays one") };
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
            let Cutter::Plane { point, normal } = made else { panic!("a plane stays one") };
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
        let Cutter::Cylinder { radius_mm, .. } = made else { panic!("a cylinder stays one") };
        assert!((radius_mm - 30.0).abs() < 1e-6, "{radius_mm}");
    }
}
