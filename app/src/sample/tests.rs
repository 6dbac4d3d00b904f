//! The scans and the stem against the table, measured from the samples alone.

use nalgebra::{Matrix4, Vector4};
use render::volume::{Affine, Grid, Point, Samples, Side, TriangleMesh, Vector};

use super::table as t;
use super::table::{LOOKS, Tissue};

fn bytes(grid: &Grid) -> Vec<u8> {
    match grid.samples() {
        Samples::I16(v) => v.iter().flat_map(|s| s.to_le_bytes()).collect(),
        Samples::U16(v) => v.iter().flat_map(|s| s.to_le_bytes()).collect(),
        other => panic!("unexpected samples {}", other.kind()),
    }
}

/// Value at a place of the CT's world; `pose` places the grid there.
fn value(grid: &Grid, pose: &Affine, at: &Point) -> f64 {
    let voxel = (*pose * *grid.world_from_voxel()).inverse().point(at);
    grid.sample(&voxel).unwrap_or_else(|| panic!("{at} lies outside the grid"))
}

/// Mean and standard deviation of all samples within `radius` of the line from `a` to `b`; world mm.
fn core(grid: &Grid, pose: &Affine, [a, b]: [Point; 2], radius: f64) -> (f64, f64) {
    let world_from_voxel = *pose * *grid.world_from_voxel();
    let [nx, ny, nz] = grid.extent();
    let [from, to] = [a, b].map(|p| world_from_voxel.inverse().point(&p));
    let spacing = grid.spacing_mm();
    let span = |axis: usize, n: usize| {
        let (low, high) = (from[axis].min(to[axis]), from[axis].max(to[axis]));
        let reach = radius / spacing[axis];
        (low - reach).floor().max(0.0) as usize..((high + reach).ceil() as usize + 1).min(n)
    };
    let along = b - a;
    let length2 = along.norm_squared().max(1e-12);
    let (mut sum, mut square, mut count) = (0.0, 0.0, 0.0);
    for z in span(2, nz) {
        for y in span(1, ny) {
            for x in span(0, nx) {
                let p = world_from_voxel.point(&Point::new(x as f64, y as f64, z as f64));
                let part = ((p - a).dot(&along) / length2).clamp(0.0, 1.0);
                if (p - (a + along * part)).norm() <= radius {
                    let v = grid.value(x, y, z);
                    sum += v;
                    square += v * v;
                    count += 1.0;
                }
            }
        }
    }
    assert!(count > 200.0, "only {count} samples: too few for a mean");
    let mean = sum / count;
    (mean, (square / count - mean * mean).max(0.0).sqrt())
}

fn hip(x: f64, y: f64, z: f64) -> Point {
    t::head_centre() + Vector::new(x, y, z)
}

/// Directions spread evenly over the sphere.
fn directions(count: u32) -> impl Iterator<Item = Vector> {
    (0..count).map(move |k| {
        let z = 1.0 - (2.0 * f64::from(k) + 1.0) / f64::from(count);
        let angle = 2.399_963_229_728_653 * f64::from(k);
        let r = (1.0 - z * z).sqrt();
        Vector::new(r * angle.cos(), r * angle.sin(), z)
    })
}

/// Least-squares sphere: |p|² = 2 c·p + (r² - |c|²) is linear in c and the last term.
fn fit_sphere(points: &[Point]) -> (Point, f64) {
    let origin = points[0];
    let (mut a, mut b) = (Matrix4::zeros(), Vector4::zeros());
    for p in points {
        let q = p - origin;
        let row = Vector4::new(2.0 * q.x, 2.0 * q.y, 2.0 * q.z, 1.0);
        a += row * row.transpose();
        b += row * q.norm_squared();
    }
    let s = a.lu().solve(&b).expect("points spread over the sphere");
    let c = Vector::new(s[0], s[1], s[2]);
    (origin + c, (s[3] + c.norm_squared()).sqrt())
}

#[test]
fn a_sphere_fitted_to_the_head_is_that_of_the_table() {
    let ct = super::ct().expect("CT");
    // Half way between what surrounds the bone (cartilage or capsule) and its cortex.
    let half = 0.5 * (Tissue::Cartilage.look().hu.midpoint(Tissue::Capsule.look().hu) + 1000.0);
    let mut points = Vec::new();
    for direction in directions(1500) {
        if direction.dot(&t::neck_axis()) < -0.35 {
            continue;
        }
        // From the joint gap inwards, to the first crossing; a rough centre serves, as a user's click would.
        let start = hip(0.4, -0.3, 0.2);
        let at = |r: f64| value(&ct, &Affine::identity(), &(start + direction * r));
        let mut r = 26.2;
        while r > 20.0 && at(r) < half {
            r -= 0.05;
        }
        let (inside, outside) = (at(r), at(r + 0.05));
        points.push(start + direction * (r + 0.05 * (inside - half) / (inside - outside)));
    }
    let (centre, radius) = fit_sphere(&points);
    let off = (centre - t::head_centre()).norm();
    assert!(points.len() > 900, "{} boundary points", points.len());
    assert!(off < 0.1, "centre off by {off} mm");
    assert!((radius - t::HEAD_RADIUS_MM).abs() < 0.1, "radius {radius} mm");
}

#[test]
fn each_tissue_has_its_mean_in_both_scans() {
    let (ct, mri) = (super::ct().expect("CT"), super::mri().expect("MRI"));
    let junction = t::neck_shaft_junction();
    let down = t::shaft_axis();
    let medial = (t::neck_axis() - down * t::neck_axis().dot(&down)).normalize();
    let necrotic = t::head_centre() + (t::necrosis_centre() - t::head_centre()) * 0.62;
    let wall = medial * (t::SHAFT_RADIUS_MM - 0.5 * t::SHAFT_CORTEX_MM);
    let cortex = [68.0, 80.0].map(|below| junction + down * below + wall);
    let marrow = [44.0, 60.0].map(|below| junction + down * below);
    let at = |p: Point| [p; 2];
    // Lines and radii well inside each tissue, with hundreds of samples; and whether the MRI reaches them.
    let cores = [
        (Tissue::Air, at(hip(86.0, -60.0, -30.0)), 5.0, false),
        (Tissue::Fat, at(hip(72.0, 8.0, 30.0)), 5.0, true),
        (Tissue::Muscle, at(hip(-14.0, 14.0, -108.0)), 7.0, false),
        (Tissue::Muscle, at(hip(4.0, 56.0, 4.0)), 6.0, true),
        (Tissue::Urine, at(hip(-75.0, -14.0, 16.0)), 7.0, false),
        (Tissue::Cortex, cortex, 2.1, false),
        (Tissue::Cancellous, at(junction + Vector::new(10.0, 4.0, 8.0)), 7.0, true),
        (Tissue::PelvicCancellous, at(hip(-5.0, 3.0, 39.0)), 7.5, true),
        (Tissue::Marrow, marrow, 4.2, true),
        (Tissue::Necrosis, at(necrotic), 6.0, true),
    ];
    for (tissue, line, radius, in_mri) in cores {
        let look = tissue.look();
        // A few standard errors of the noise, and of the grains of texture that a core holds.
        let tolerance = |texture: f64| 4.0 + 0.12 * texture;
        let (mean, _) = core(&ct, &Affine::identity(), line, radius);
        assert!((mean - look.hu).abs() < tolerance(look.hu_texture), "{}: {mean} HU", look.name);
        if in_mri {
            let (mean, _) = core(&mri, &t::registration(), line, radius);
            assert!((mean - look.t1).abs() < tolerance(look.t1_texture), "{}: T1 {mean}", look.name);
        }
    }
}

#[test]
fn the_noise_is_as_stated() {
    let (ct, mri) = (super::ct().expect("CT"), super::mri().expect("MRI"));
    let whole = Affine::identity();
    let (_, air) = core(&ct, &whole, [hip(86.0, -60.0, -50.0), hip(86.0, -60.0, 40.0)], 3.5);
    let (_, urine) = core(&ct, &whole, [hip(-75.0, -14.0, 16.0); 2], 9.0);
    assert!((urine - t::CT_NOISE_HU).abs() < 0.06 * t::CT_NOISE_HU, "urine {urine} HU");
    // Air's lower tail ends at -1024, 1.7 deviations down, which narrows it a little.
    assert!((air - t::CT_NOISE_HU).abs() < 0.1 * t::CT_NOISE_HU, "air {air} HU");
    // Of a magnitude picture in strong signal the deviation is that of one channel.
    let [a, b] = [44.0, 60.0].map(|below| t::neck_shaft_junction() + t::shaft_axis() * below);
    let (_, signal) = core(&mri, &t::registration(), [a, b], 4.0);
    let texture = Tissue::Marrow.look().t1_texture * 0.35;
    let expected = t::MRI_NOISE.hypot(texture);
    assert!((signal / expected - 1.0).abs() < 0.15, "MRI {signal} against {expected}");
    // Where nothing is, the magnitude of two channels has mean sigma · sqrt(π / 2) (Rayleigh).
    let (empty, _) = core(&mri, &t::registration(), [hip(91.0, -27.0, 35.0), hip(87.0, -24.0, -60.0)], 3.0);
    let rayleigh = t::MRI_NOISE * std::f64::consts::FRAC_PI_2.sqrt();
    assert!((empty / rayleigh - 1.0).abs() < 0.05, "MRI air {empty} against {rayleigh}");
}

/// The dark volume on the MRI, counted as a user would: below half way between marrow and rim.
#[test]
fn the_necrosis_counted_on_the_mri_has_its_volume() {
    let mri = super::mri().expect("MRI");
    let world_from_voxel = t::registration() * *mri.world_from_voxel();
    let half = 0.5 * (Tissue::Cancellous.look().t1 + Tissue::NecrosisRim.look().t1);
    // Away from the cortex, which is dark too.
    let radius = t::HEAD_INNER_RADIUS_MM - 1.5;
    let [nx, ny, nz] = mri.extent();
    let mut count = 0_u32;
    for i in 0..nx * ny * nz {
        let voxel = Point::new((i % nx) as f64, (i / nx % ny) as f64, (i / (nx * ny)) as f64);
        let near = (world_from_voxel.point(&voxel) - t::head_centre()).norm() <= radius;
        count += u32::from(near && mri.value_at(i) < half);
    }
    let volume = f64::from(count) * mri.spacing_mm().iter().product::<f64>();
    let known = t::necrosis_volume_mm3(radius);
    assert!((volume / known - 1.0).abs() < 0.02, "{volume} mm³ counted, {known} mm³ known");
}

/// The closed form against counting points of the two balls on a fine lattice.
#[test]
fn the_volume_of_the_necrosis_is_that_of_two_balls() {
    let apart = t::necrosis_centre() - t::head_centre();
    for radius in [t::HEAD_INNER_RADIUS_MM, t::HEAD_INNER_RADIUS_MM - 1.5] {
        let step = 0.25;
        let n = (radius / step).ceil() as i32;
        let mut count = 0_u32;
        for z in -n..=n {
            for y in -n..=n {
                for x in -n..=n {
                    let p = Vector::new(f64::from(x), f64::from(y), f64::from(z)) * step;
                    count += u32::from(p.norm() <= radius && (p - apart).norm() <= t::NECROSIS_RADIUS_MM);
                }
            }
        }
        let counted = f64::from(count) * step * step * step;
        let known = t::necrosis_volume_mm3(radius);
        assert!((counted / known - 1.0).abs() < 1e-3, "{counted} against {known}");
    }
    // The rim of the necrosis lies on both spheres, at the half angle.
    let angle = t::necrosis_half_angle_rad();
    let axis = apart.normalize();
    let across = axis.cross(&Vector::x()).normalize();
    let rim = (axis * angle.cos() + across * angle.sin()) * t::HEAD_INNER_RADIUS_MM;
    assert!(((rim - apart).norm() - t::NECROSIS_RADIUS_MM).abs() < 1e-9, "rim on the second sphere");
}

#[test]
fn the_neck_meets_the_shaft_at_the_stated_angles() {
    let (neck, down) = (t::neck_axis(), t::shaft_axis());
    assert!((neck.norm() - 1.0).abs() < 1e-12, "unit neck");
    assert!((neck.dot(&down).acos().to_degrees() - t::NECK_SHAFT_DEG).abs() < 1e-9, "neck-shaft angle");
    // Seen along the shaft: the angle between the neck and the direction across the body.
    let flat = |v: Vector| (v - down * v.dot(&down)).normalize();
    let version = flat(neck).dot(&flat(-Vector::x())).acos().to_degrees();
    assert!((version - t::NECK_ANTEVERSION_DEG).abs() < 1e-9, "anteversion {version}");
    assert!(flat(neck).y < 0.0, "the head lies in front of the shaft");
    let off = (t::head_centre() - t::neck_shaft_junction()).cross(&down).norm();
    assert!((off - t::femoral_offset_mm()).abs() < 1e-9, "offset {off}");
}

/// The shaft's two walls along rays across it, from the samples.
#[test]
fn the_shaft_has_its_axis_cortex_and_canal() {
    let ct = super::ct().expect("CT");
    let down = t::shaft_axis();
    let centre = t::neck_shaft_junction() + down * (t::ISTHMUS_MM + 6.0);
    let side = down.cross(&Vector::y()).normalize();
    let other = down.cross(&side);
    let (mut outer, mut inner, mut lean) = (0.0, 0.0, Vector::zeros());
    let rays = 90;
    for k in 0..rays {
        let angle = f64::from(k) / f64::from(rays) * std::f64::consts::TAU;
        let direction = side * angle.cos() + other * angle.sin();
        let at = |r: f64| value(&ct, &Affine::identity(), &(centre + direction * r));
        let cross = |from: f64, step: f64, half: f64| {
            let mut r = from;
            while at(r) < half {
                r += step;
            }
            let (high, low) = (at(r), at(r - step));
            r - step * (high - half) / (high - low)
        };
        let wall = cross(18.0, -0.05, 0.5 * (1500.0 + Tissue::Muscle.look().hu));
        outer += wall;
        lean += direction * wall;
        inner += cross(2.0, 0.05, 0.5 * (1500.0 + Tissue::Marrow.look().hu));
    }
    let (outer, inner) = (outer / f64::from(rays), inner / f64::from(rays));
    let lean = lean.norm() * 2.0 / f64::from(rays);
    assert!((outer - t::SHAFT_RADIUS_MM).abs() < 0.15, "outer radius {outer}");
    assert!((inner - t::CANAL_RADIUS_MM).abs() < 0.15, "canal radius {inner}");
    assert!(lean < 0.15, "axis off by {lean}");
}

/// The edge of the cup's cover, found by walking down its surface in the samples.
#[test]
fn the_cup_covers_the_head_by_the_stated_angles() {
    let ct = super::ct().expect("CT");
    let edge = |outward: Vector| {
        let at = |a: f64| {
            let direction = Vector::z() * a.cos() + outward * a.sin();
            value(&ct, &Affine::identity(), &(t::head_centre() + direction * (t::CUP_RADIUS_MM + 1.2)))
        };
        (0..900).map(|k| f64::from(k) * 0.1).find(|a| at(a.to_radians()) < 520.0).expect("an edge")
    };
    for (name, outward, known) in [
        ("lateral", Vector::x(), t::lateral_centre_edge_rad()),
        ("anterior", -Vector::y(), t::anterior_centre_edge_rad()),
    ] {
        let found = edge(outward);
        let known = known.to_degrees();
        assert!((found - known).abs() < 2.0, "{name} centre-edge angle {found} against {known}");
    }
}

/// The registration found again from the pictures: a sphere fitted to the head on the MRI, in the MRI's
/// own space, and the shaft's canal, come to lie where the CT has them.
#[test]
fn the_registration_brings_the_mri_to_the_ct() {
    let mri = super::mri().expect("MRI");
    assert!(t::registration().require_rigid().is_ok(), "rigid");
    let own = Affine::identity();
    let back = t::registration().inverse();
    // A rough place in the MRI's space, then the inner wall of the cortex, dark against marrow.
    let start = back.point(&hip(0.5, 0.5, -0.5));
    let marrow = Tissue::Cancellous.look().t1;
    let mut points = Vec::new();
    for direction in directions(2500) {
        // Only where the marrow reaches the cortex: not at the neck, and below the necrosis.
        let in_ct = t::registration().vector(&direction);
        let dead = in_ct.dot(&(t::necrosis_centre() - t::head_centre()).normalize());
        if in_ct.dot(&t::neck_axis()) < -0.3 || dead > 0.35 {
            continue;
        }
        let at = |r: f64| value(&mri, &own, &(start + direction * r));
        let half = 0.5 * (marrow + Tissue::ThinCortex.look().t1);
        let mut r = 18.0;
        while r < 26.0 && at(r) > half {
            r += 0.05;
        }
        points.push(start + direction * r);
    }
    let (centre, _) = fit_sphere(&points);
    let off = (t::registration().point(&centre) - t::head_centre()).norm();
    assert!(points.len() > 500, "{} points", points.len());
    assert!(off < 0.25, "the head's centre is off by {off} mm");
    // Turn: the canal's marrow is bright where the CT's table says, and dark beside it.
    let down = t::shaft_axis();
    for below in [52.0, 62.0] {
        let axis = t::neck_shaft_junction() + down * below;
        let side = down.cross(&Vector::y()).normalize();
        let inside = value(&mri, &t::registration(), &axis);
        assert!((inside - Tissue::Marrow.look().t1).abs() < 90.0, "marrow at {below} mm: {inside}");
        for direction in [side, -side] {
            let wall = value(&mri, &t::registration(), &(axis + direction * 10.5));
            assert!(wall < 260.0, "cortex at {below} mm: {wall}");
        }
    }
    let oblique = mri.world_from_voxel().linear();
    assert!((0..3).all(|c| oblique.column(c).amax() < 0.999 * oblique.column(c).norm()), "oblique");
}

#[test]
fn the_bytes_do_not_depend_on_the_run_or_the_number_of_threads() {
    let with = |threads: usize, make: fn() -> Result<Grid, super::SampleError>| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().expect("threads");
        bytes(&pool.install(make).expect("a scan"))
    };
    let ct = bytes(&super::ct().expect("CT"));
    assert!(ct == with(1, super::scan::ct), "CT on one thread");
    let mri = bytes(&super::mri().expect("MRI"));
    assert!(mri == with(1, super::scan::mri), "MRI on one thread");
    assert!(mri == with(2, super::scan::mri), "MRI on two threads");
}

fn stem() -> std::sync::Arc<TriangleMesh> {
    super::stem().expect("stem")
}

#[test]
fn the_stem_is_closed_and_faces_outwards() {
    let stem = stem();
    let mut edges = std::collections::BTreeMap::new();
    for corners in stem.triangles() {
        for k in 0..3 {
            let (a, b) = (corners[k], corners[(k + 1) % 3]);
            assert!(a != b, "an edge of no length");
            *edges.entry((a, b)).or_insert(0_u32) += 1;
        }
    }
    for (&(a, b), &count) in &edges {
        assert_eq!((count, edges.get(&(b, a))), (1, Some(&1)), "edge {a}-{b} once each way");
    }
    assert!((5_000..20_000).contains(&stem.triangles().len()), "{} triangles", stem.triangles().len());
    let vertices = stem.positions().len() as i64;
    let euler = vertices - edges.len() as i64 / 2 + stem.triangles().len() as i64;
    assert_eq!(euler, 2, "one closed surface without a hole");
}

/// Volume by the divergence theorem against counting lattice points inside by ray parity; a surface
/// that crosses itself, or faces inwards anywhere, would differ.
#[test]
fn the_volume_of_the_stem_is_that_of_the_points_inside() {
    let stem = stem();
    let [low, high] = stem.bounds();
    let step = 1.0;
    let mut count = 0_usize;
    let cells = |a: f64, b: f64| ((b - a) / step).ceil() as i32;
    // One ray along z for each column: the lengths between crossings.
    let mut columns = std::collections::BTreeMap::<(i32, i32), Vec<f64>>::new();
    for k in 0..stem.triangles().len() {
        let [a, b, c] = stem.corners(k);
        let (u, v) = (b - a, c - a);
        let area = u.x * v.y - u.y * v.x;
        let bound = |axis: usize, least: bool| {
            let values = [a[axis], b[axis], c[axis]];
            values.into_iter().fold(values[0], |m, x| if least { m.min(x) } else { m.max(x) })
        };
        let index = |axis: usize, x: f64| ((x - low[axis]) / step).floor() as i32;
        for i in index(0, bound(0, true)) - 1..=index(0, bound(0, false)) + 1 {
            for j in index(1, bound(1, true)) - 1..=index(1, bound(1, false)) + 1 {
                // Off the lattice of the mesh, so that no ray meets an edge.
                let (x, y) = (low.x + (f64::from(i) + 0.4321) * step, low.y + (f64::from(j) + 0.3217) * step);
                let (px, py) = (x - a.x, y - a.y);
                let s = (px * v.y - py * v.x) / area;
                let r = (u.x * py - u.y * px) / area;
                if s >= 0.0 && r >= 0.0 && s + r <= 1.0 {
                    columns.entry((i, j)).or_default().push(a.z + s * u.z + r * v.z);
                }
            }
        }
    }
    let mut volume = 0.0;
    for crossings in columns.values_mut() {
        crossings.sort_by(f64::total_cmp);
        assert_eq!(crossings.len() % 2, 0, "a ray leaves as often as it enters");
        volume += crossings.chunks(2).map(|pair| pair[1] - pair[0]).sum::<f64>() * step * step;
        count += 1;
    }
    assert!(count > 500 && cells(low.x, high.x) > 30, "{count} columns");
    assert!((stem.volume_mm3() / volume - 1.0).abs() < 0.005, "{} and {volume}", stem.volume_mm3());
}

#[test]
fn the_stem_lies_in_the_canal_with_its_ball_in_the_heads_centre() {
    let (ct, stem) = (super::ct().expect("CT"), stem());
    let pose = t::stem_pose();
    assert!(pose.require_rigid().is_ok(), "rigid");
    let ball: Vec<Point> = stem
        .positions()
        .iter()
        .map(|p| pose.point(p))
        .filter(|p| (p - t::neck_shaft_junction()).dot(&t::neck_axis()) > t::NECK_LENGTH_MM - 8.0)
        .collect();
    let (centre, radius) = fit_sphere(&ball);
    assert!((centre - t::head_centre()).norm() < 1e-6, "ball at {centre}");
    assert!((radius - t::STEM_BALL_RADIUS_MM).abs() < 1e-6, "ball radius {radius}");
    // Below the cut no vertex leaves the bone: what it replaces is marrow, cancellous bone or the
    // inner part of the cortex; and in the canal not even that.
    let down = t::shaft_axis();
    let mut deepest = 0.0_f64;
    for p in stem.positions().iter().map(|p| pose.point(p)) {
        let below = (p - t::neck_shaft_junction()).dot(&down);
        if below < 0.0 {
            continue;
        }
        deepest = deepest.max(below);
        let hu = value(&ct, &Affine::identity(), &p);
        let from_axis = (p - t::neck_shaft_junction()).cross(&down).norm();
        if below > t::ISTHMUS_MM {
            assert!(from_axis < t::CANAL_RADIUS_MM - 0.5, "{from_axis} mm from the axis in the canal");
        }
        assert!(hu < 900.0, "{below} mm down the stem meets cortex: {hu} HU");
    }
    assert!((deepest - t::STEM_LENGTH_MM).abs() < 1e-6, "tip at {deepest}");
}

#[test]
fn the_plan_cuts_the_femur_in_three_and_leaves_the_pelvis_whole() {
    let case = super::case();
    let piece = |id: &str| case.piece(case.fragment(id).unwrap_or_else(|| panic!("no fragment {id}")));
    let holds = |id: &str, p: Point| piece(id).keep.iter().all(|(cutter, side)| cutter.keeps(*side, &p));
    let junction = t::neck_shaft_junction();
    let places = [
        ("head", t::head_centre()),
        ("trochanter", junction + Vector::new(11.0, 7.0, 26.0)),
        ("shaft", junction + t::shaft_axis() * 60.0),
        // The pelvis: roof, ischial tuberosity, pubic body, posterior column.
        ("head", hip(-4.0, 2.0, 40.0)),
        ("head", hip(-26.0, 25.0, -68.0)),
        ("head", hip(-12.0, 30.0, -50.0)),
        ("head", hip(-78.0, -36.0, -40.0)),
    ];
    for (owner, p) in places {
        for fragment in &case.fragments {
            assert_eq!(holds(&fragment.id, p), fragment.id == owner, "{p} and {}", fragment.id);
        }
    }
    assert_eq!(case.fragments.len(), 3, "three fragments");
    assert!(piece("head").keep.iter().all(|(_, side)| *side == Side::Minus), "below the first cut");
    let mri = case.volume("mri").expect("MRI");
    assert_eq!((mri.visible, mri.pose), (false, t::registration()), "MRI hidden, registered");
    for fragment in &case.fragments {
        assert!(fragment.pose.require_rigid().is_ok(), "{} is moved rigidly", fragment.id);
    }
    assert!(case.camera.expect("camera").frame().is_ok(), "the camera shows something");
}

/// `assets/sample/README.md` is written by hand for people; each number of it stands in the table.
#[test]
fn the_page_for_people_has_the_tables_numbers() {
    let page = include_str!("../../../assets/sample/README.md");
    let line = |name: &str| {
        let start = format!("| {name} |");
        page.lines().find(|l| l.starts_with(&start)).unwrap_or_else(|| panic!("no line for {name}"))
    };
    let cell = |name: &str, column: usize| line(name).split('|').nth(column).unwrap_or("").trim().to_owned();
    for look in &LOOKS {
        let row = [look.hu, look.hu_texture, look.t1, look.t1_texture];
        for (column, number) in row.into_iter().enumerate() {
            assert_eq!(cell(look.name, column + 2), format!("{number}"), "{} column {column}", look.name);
        }
    }
    let deg = f64::to_degrees;
    for (name, number, digits) in [
        ("Femoral head, radius", t::HEAD_RADIUS_MM, 1),
        ("Acetabulum, radius", t::CUP_RADIUS_MM, 1),
        ("Acetabulum, inclination", t::CUP_INCLINATION_DEG, 0),
        ("Acetabulum, anteversion", t::CUP_ANTEVERSION_DEG, 0),
        ("Lateral centre-edge angle", deg(t::lateral_centre_edge_rad()), 1),
        ("Anterior centre-edge angle", deg(t::anterior_centre_edge_rad()), 1),
        ("Neck-shaft angle", t::NECK_SHAFT_DEG, 0),
        ("Neck, anteversion", t::NECK_ANTEVERSION_DEG, 0),
        ("Neck, length", t::NECK_LENGTH_MM, 0),
        ("Femoral offset", t::femoral_offset_mm(), 2),
        ("Shaft, outer radius", t::SHAFT_RADIUS_MM, 1),
        ("Shaft, cortex", t::SHAFT_CORTEX_MM, 1),
        ("Shaft, canal radius", t::CANAL_RADIUS_MM, 1),
        ("Head and trochanters, cortex", t::HEAD_CORTEX_MM, 1),
        ("Necrosis, volume", t::necrosis_volume_mm3(t::HEAD_INNER_RADIUS_MM), 0),
        ("Necrosis, half angle", deg(t::necrosis_half_angle_rad()), 1),
        ("CT, noise", t::CT_NOISE_HU, 0),
        ("MRI, noise", t::MRI_NOISE, 0),
        ("Stem, ball radius", t::STEM_BALL_RADIUS_MM, 0),
        ("Stem, length below the junction", t::STEM_LENGTH_MM, 0),
    ] {
        assert_eq!(cell(name, 2), format!("{number:.digits$}"), "{name}");
    }
    let list = |name: &str, numbers: &[f64], digits: usize| {
        let text: Vec<String> = numbers.iter().map(|v| format!("{v:.digits$}")).collect();
        assert_eq!(cell(name, 2), text.join(", "), "{name}");
    };
    list("Femoral head, centre", &t::HEAD_CENTRE_MM, 1);
    list("Neck axis, towards the head", t::neck_axis().as_slice(), 4);
    list("Shaft axis, downwards", t::shaft_axis().as_slice(), 4);
    list("Junction of neck and shaft axes", t::neck_shaft_junction().coords.as_slice(), 2);
    list("Acetabulum, axis of the opening", t::cup_axis().as_slice(), 4);
    list("Registration, row 1", &t::registration().to_row_major()[0..4], 4);
    list("Registration, row 2", &t::registration().to_row_major()[4..8], 4);
    list("Registration, row 3", &t::registration().to_row_major()[8..12], 4);
}
