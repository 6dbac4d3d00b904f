//! Lines in a section: where its plane meets surfaces and cutters, the cutters where their pieces went to.

use rayon::prelude::*;

use super::Section;
use crate::scene::Piece;
use crate::volume::{Affine, Cutter, Grid, Point, TriangleMesh, Vector};

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

/// Where a cutter crosses the section's plane within `reach_mm` of the section's centre: polylines in
/// world mm. Parallel planes give none.
pub fn cutter_outline(section: &Section, cutter: &Cutter, reach_mm: f64) -> Vec<Vec<Point>> {
    let forward = section.forward();
    match cutter {
        Cutter::Plane { point, normal } => {
            let Some(normal) = normal.try_normalize(0.0) else { return Vec::new() };
            let Some(along) = forward.cross(&normal).try_normalize(1e-9) else { return Vec::new() };
            // The direction in the section's plane that leads straight to the cutter.
            let towards = along.cross(&forward);
            let distance = normal.dot(&(point - section.centre)) / normal.dot(&towards);
            if distance.abs() > reach_mm {
                return Vec::new();
            }
            let nearest = section.centre + towards * distance;
            let half = (reach_mm * reach_mm - distance * distance).sqrt();
            vec![vec![nearest - along * half, nearest + along * half]]
        }
        Cutter::Cylinder { point, axis, radius_mm } => {
            let Some(axis) = axis.try_normalize(0.0) else { return Vec::new() };
            cylinder_outline(section, point, axis, *radius_mm, reach_mm)
        }
    }
}

fn cylinder_outline(
    section: &Section,
    point: &Point,
    axis: Vector,
    radius_mm: f64,
    reach_mm: f64,
) -> Vec<Vec<Point>> {
    const STEPS: usize = 96;
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
    let ring = (0..=STEPS)
        .map(|step| {
            let angle_rad = std::f64::consts::TAU * step as f64 / STEPS as f64;
            let on = point + (u * angle_rad.cos() + v * angle_rad.sin()) * radius_mm;
            on - axis * (section.depth_mm(&on) / slope)
        })
        .collect();
    vec![ring]
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
    let mut lines = Vec::new();
    for (cutter, (shape, _)) in piece.keep.iter().enumerate() {
        let others = || piece.keep.iter().enumerate().filter(move |(other, _)| *other != cutter);
        let bounds = |p: &Point| in_box(p) && others().all(|(_, (other, side))| other.side(p) == *side);
        for line in cutter_outline(&unmoved, shape, reach_mm) {
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
