//! Lines in a section: where its plane meets surfaces and cutters, the cutters where their pieces went to.

use rayon::prelude::*;

use super::Section;
use crate::scene::Piece;
use crate::volume::{Affine, Body, Cutter, Face, Grid, Point, Side, TriangleMesh, Vector};

/// Where a mesh crosses the section's plane: line pieces in world mm, unordered. `pose` is
/// `world_from_mesh`. A triangle that lies in the plane gives nothing; its neighbours draw its edges.
pub fn mesh_outline(section: &Section, mesh: &TriangleMesh, pose: &Affine) -> Vec<[Point; 2]> {
    let in_world: Vec<Point> = mesh.positions().par_iter().map(|p| pose.point(p)).collect();
    let depth: Vec<f64> = in_world.par_iter().map(|p| section.depth_mm(p)).collect();
    let crossing = |corners: &[u32; 3]| {
        let corner = corners.map(|v| v as usize);
        let mut ends = (0..3).filter_map(|k| {
            let (a, b) = (corner[k], corner[(k + 1) % 3]);
            // Half-open, so that a plane through a vertex meets two edges and not one or three.
            ((depth[a] < 0.0) != (depth[b] < 0.0)).then(|| {
                let part = depth[a] / (depth[a] - depth[b]);
                in_world[a] + (in_world[b] - in_world[a]) * part
            })
        });
        Some([ends.next()?, ends.next()?])
    };
    mesh.triangles().par_iter().filter_map(crossing).collect()
}

/// Where a cutter crosses the section's plane within `reach_mm` of the section's centre: polylines in world mm.
///
/// Where there is a kerf, those of both its borders; of a blade the outline of what it has passed. Parallel planes
/// give none.
pub fn cutter_outline(section: &Section, cutter: &Cutter, reach_mm: f64) -> Vec<Vec<Point>> {
    let (body, _) = cutter.solid(Side::Plus);
    let mut lines = body_outline(section, &body, body.faces().len(), reach_mm);
    if cutter.kerf_mm() > 0.0 {
        // Of a blade only the face, which comes first, has a kerf.
        lines.extend(body_outline(section, &cutter.solid(Side::Minus).0, 1, reach_mm));
    }
    lines
}

/// The outline of a round body, or of the first `count` faces of another.
fn body_outline(section: &Section, body: &Body, count: usize, reach_mm: f64) -> Vec<Vec<Point>> {
    match body {
        Body::HalfSpace(_) | Body::Prism(_) => {
            let faces = body.faces();
            let of_face =
                |i: usize| face_line(section, &faces[i], reach_mm).and_then(|l| behind(l, faces, i));
            (0..count).filter_map(of_face).map(|line| line.to_vec()).collect()
        }
        Body::Cylinder { point, axis, radius_mm } => {
            let Some(axis) = axis.try_normalize(0.0) else { return Vec::new() };
            cylinder_outline(section, point, axis, *radius_mm, reach_mm)
        }
        Body::Ball { centre, radius_mm } => {
            let off = section.depth_mm(centre);
            if off.abs() >= *radius_mm {
                return Vec::new();
            }
            let radius = (radius_mm * radius_mm - off * off).sqrt();
            let middle = centre - section.forward() * off;
            vec![ring(|cos, sin| middle + (section.right * cos + section.down * sin) * radius)]
        }
    }
}

/// Where the whole plane of a face crosses that of the section, within reach.
fn face_line(section: &Section, face: &Face, reach_mm: f64) -> Option<[Point; 2]> {
    let forward = section.forward();
    let normal = face.normal.try_normalize(0.0)?;
    let along = forward.cross(&normal).try_normalize(1e-9)?;
    // The direction in the section's plane that leads straight to the face.
    let towards = along.cross(&forward);
    let distance = normal.dot(&(face.point - section.centre)) / normal.dot(&towards);
    if distance.abs() > reach_mm {
        return None;
    }
    let nearest = section.centre + towards * distance;
    let half = (reach_mm * reach_mm - distance * distance).sqrt();
    Some([nearest - along * half, nearest + along * half])
}

/// The part of a line on face `own` that lies behind all the other faces.
fn behind([a, b]: [Point; 2], faces: &[Face], own: usize) -> Option<[Point; 2]> {
    let (mut from, mut to) = (0.0_f64, 1.0_f64);
    for (_, face) in faces.iter().enumerate().filter(|(i, _)| *i != own) {
        let [at_a, at_b] = [a, b].map(|p| face.normal.dot(&(p - face.point)));
        let crossing = at_a / (at_a - at_b);
        match (at_a < 0.0, at_b < 0.0) {
            (true, true) => {}
            (true, false) => to = to.min(crossing),
            (false, true) => from = from.max(crossing),
            (false, false) => return None,
        }
    }
    (from < to).then(|| [from, to].map(|t| a + (b - a) * t))
}

/// A closed line by cosine and sine of an angle that goes round.
fn ring(at: impl Fn(f64, f64) -> Point) -> Vec<Point> {
    const STEPS: usize = 96;
    let turn = |step: usize| std::f64::consts::TAU * step as f64 / STEPS as f64;
    (0..=STEPS).map(|step| at(turn(step).cos(), turn(step).sin())).collect()
}

fn cylinder_outline(
    section: &Section,
    point: &Point,
    axis: Vector,
    radius_mm: f64,
    reach_mm: f64,
) -> Vec<Vec<Point>> {
    let forward = section.forward();
    let slope = axis.dot(&forward);
    // Seen side on to within a tenth of a degree it is two lines, which the ellipse would not reach.
    if slope.abs() < 2e-3 {
        let Some(across) = axis.cross(&forward).try_normalize(1e-9) else { return Vec::new() };
        let off = section.depth_mm(point);
        if off.abs() > radius_mm {
            return Vec::new();
        }
        let half = (radius_mm * radius_mm - off * off).sqrt();
        let along = (axis - forward * slope).try_normalize(1e-9).unwrap_or(axis);
        let middle = point - forward * off;
        let middle = middle + along * along.dot(&(section.centre - middle));
        return [-half, half]
            .map(|side| {
                let on = middle + across * side;
                vec![on - along * reach_mm, on + along * reach_mm]
            })
            .to_vec();
    }
    let mut seed = Vector::zeros();
    seed[axis.iamin()] = 1.0;
    let Some(u) = axis.cross(&seed).try_normalize(1e-9) else { return Vec::new() };
    let v = axis.cross(&u);
    vec![ring(|cos, sin| {
        let on = point + (u * cos + v * sin) * radius_mm;
        on - axis * (section.depth_mm(&on) / slope)
    })]
}

/// A part of a cutter's line in a section.
#[derive(Debug, Clone, PartialEq)]
pub struct PieceLine {
    /// Which cutter: its position in [`Piece::keep`].
    pub cutter: usize,
    /// The line; world mm.
    pub places: Vec<Point>,
}

/// Where the cutters of a piece bound it in the section's plane, in the place where it was moved to.
///
/// Each cutter's line goes as far as it lies in the volume's box and on the kept sides of the others. `pose` is
/// `world_from_patient` of the volume. Ends are right to a thousandth of a pixel; gaps narrower than a pixel may be
/// missed.
pub fn piece_outlines(section: &Section, grid: &Grid, pose: &Affine, piece: &Piece) -> Vec<PieceLine> {
    let unmoved_from_world = piece.pose.inverse();
    let unmoved = section.moved(&unmoved_from_world);
    let corners = grid.corners_in_world().map(|p| pose.point(&p));
    let reach_mm = corners.iter().map(|p| (p - unmoved.centre()).norm()).fold(0.0, f64::max);
    let voxel_from_unmoved = (*pose * *grid.world_from_voxel()).inverse();
    let in_box = |p: &Point| {
        let at = voxel_from_unmoved.point(p);
        at.iter().zip(grid.extent()).all(|(&c, n)| c >= -0.5 && c <= n as f64 - 0.5)
    };
    // The borders of the sides that are kept, with the kerf on their other sides.
    let bodies: Vec<(Body, bool)> = piece.keep.iter().map(|(cutter, side)| cutter.solid(*side)).collect();
    let mut lines = Vec::new();
    for (cutter, (body, _)) in bodies.iter().enumerate() {
        let others = || bodies.iter().enumerate().filter(move |(other, _)| *other != cutter);
        let bounds = |p: &Point| in_box(p) && others().all(|(_, (other, inside))| other.holds(p) == *inside);
        for line in body_outline(&unmoved, body, body.faces().len(), reach_mm) {
            let parts = clipped(&line, section.mm_per_pixel(), &bounds);
            lines.extend(parts.into_iter().map(|part| PieceLine {
                cutter,
                places: part.iter().map(|p| piece.pose.point(p)).collect(),
            }));
        }
    }
    lines
}

/// The parts of a line that lie inside, sampled every `step_mm`, with their ends found by halving.
fn clipped(line: &[Point], step_mm: f64, inside: &impl Fn(&Point) -> bool) -> Vec<Vec<Point>> {
    const MOST_STEPS: f64 = 20_000.0;
    let mut parts: Vec<Vec<Point>> = Vec::new();
    let mut before: Option<(Point, bool)> = None;
    let mut take = |p: Point| {
        let is_inside = inside(&p);
        match before {
            Some((from, was)) if was != is_inside => {
                let (mut low, mut high) = (from, p);
                for _ in 0..10 {
                    let middle = nalgebra::center(&low, &high);
                    if inside(&middle) == was { low = middle } else { high = middle }
                }
                if is_inside {
                    parts.push(vec![high, p]);
                } else if let Some(part) = parts.last_mut() {
                    part.push(low);
                }
            }
            Some(_) if is_inside => {
                if let Some(part) = parts.last_mut() {
                    part.push(p);
                }
            }
            None if is_inside => parts.push(vec![p]),
            _ => {}
        }
        before = Some((p, is_inside));
    };
    if let Some(first) = line.first() {
        take(*first);
    }
    for pair in line.windows(2) {
        let along = pair[1] - pair[0];
        let steps = (along.norm() / step_mm).ceil().clamp(1.0, MOST_STEPS) as usize;
        (1..=steps).for_each(|i| take(pair[0] + along * (i as f64 / steps as f64)));
    }
    parts
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn cutter_outlines_lie_on_the_cutter_and_in_the_plane() {
        let section = Section::new(Point::new(1.0, 2.0, 3.0), Vector::x(), -Vector::z(), 0.5, [80, 60])
            .expect("section");
        let centre = Point::new(4.0, 5.0, 2.0);
        let tilted = Vector::new(1.0, 0.7, -0.4);
        let plane = Cutter::plane(centre, tilted).expect("plane");
        let lines = cutter_outline(&section, &plane, 100.0);
        assert_eq!(lines.len(), 1, "one line");
        for p in lines.iter().flatten() {
            assert!(tilted.dot(&(p - centre)).abs() < 1e-9, "on the plane: {p}");
            assert!(section.depth_mm(p).abs() < 1e-9, "in the section: {p}");
        }
        for axis in [tilted, Vector::new(1.0, 0.0, 2.0)] {
            let tube = Cutter::cylinder(centre, axis, 8.0).expect("tube");
            let lines = cutter_outline(&section, &tube, 100.0);
            assert!(!lines.is_empty(), "the tube is met");
            for p in lines.iter().flatten() {
                let distance = (p - centre).cross(&axis).norm() / axis.norm();
                assert!((distance - 8.0).abs() < 1e-9, "on the tube: {distance}");
                assert!(section.depth_mm(p).abs() < 1e-9, "in the section: {p}");
            }
        }
        let dome = Cutter::dome(centre, 4.0).expect("dome").with_kerf(1.0).expect("kerf");
        let lines = cutter_outline(&section, &dome, 100.0);
        assert_eq!(lines.len(), 2, "both borders of the kerf");
        for (line, radius) in lines.iter().zip([4.5, 3.5]) {
            for p in line {
                assert!(((p - centre).norm() - radius).abs() < 1e-9, "on the ball: {p}");
                assert!(section.depth_mm(p).abs() < 1e-9, "in the section: {p}");
            }
        }
        let parallel = Cutter::plane(centre, Vector::y()).expect("plane");
        assert!(cutter_outline(&section, &parallel, 100.0).is_empty(), "a parallel plane is not met");
    }

    #[test]
    fn a_blade_is_outlined_by_its_face_and_what_it_has_passed() {
        let section =
            Section::new(Point::origin(), Vector::x(), -Vector::z(), 0.5, [80, 60]).expect("section");
        let lines = cutter_outline(&section, &blade_of(6.0).with_kerf(0.5).expect("kerf"), 20.0);
        // The section at y = 0 passes within the height of 6 about y = 1.
        let length = |l: &Vec<Point>| (l[1] - l[0]).norm();
        assert_eq!(lines.len(), 4, "the face, two sides, and the face's other border: {lines:?}");
        for (line, height) in [(&lines[0], 3.25), (&lines[3], 2.75)] {
            assert!((length(line) - 8.0).abs() < 1e-9, "as wide as the blade: {line:?}");
            assert!(line.iter().all(|p| (p.z - height).abs() < 1e-9), "half a kerf away: {line:?}");
        }
        for (line, x) in [(&lines[1], 6.0), (&lines[2], -2.0)] {
            assert!(line.iter().all(|p| (p.x - x).abs() < 1e-9), "at the end of the blade: {line:?}");
            assert!(line.iter().any(|p| (p.z - 3.25).abs() < 1e-9), "from its edge: {line:?}");
            assert!(length(line) > 20.0, "and back as far as one sees: {line:?}");
        }
        let beside = Section::new(Point::new(0.0, 5.0, 0.0), Vector::x(), -Vector::z(), 0.5, [8, 8]);
        assert!(cutter_outline(&beside.expect("section"), &blade_of(6.0), 20.0).is_empty(), "beside it");
    }

    fn blade_of(height: f64) -> Cutter {
        Cutter::blade(Point::new(2.0, 1.0, 3.0), Vector::z(), Vector::x(), [8.0, height]).expect("blade")
    }
}
