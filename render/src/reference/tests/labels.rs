//! Labels on volumes: a closed form, and a plain march.

use super::*;
use crate::scene::Labels;

const PAINT: [f64; 4] = [0.1, 0.9, 0.3, 0.6];

/// Labels of 0.75 mm along y, each third sample labelled, and the rest of label 2, which is not painted.
fn stripes(n: usize) -> Grid {
    let columns = Affine::from_columns(
        Vector::new(9.0, 0.0, 0.0),
        Vector::new(0.0, 0.75, 0.0),
        Vector::new(0.0, 0.0, 9.0),
        Point::new(2.0, 0.4, 2.0),
    );
    synth::from_voxels([1, n, 1], columns.expect("columns"), |[_, y, _]| if y % 3 == 1 { 1.0 } else { 2.0 })
        .expect("labels")
}

fn labels(grid: Grid) -> Labels {
    let colors = Arc::from([[0.0; 4], PAINT, [1.0, 1.0, 1.0, 0.0]]);
    Labels { grid: Arc::new(grid), pose: Affine::identity(), colors }
}

/// Front to back through homogeneous stretches: lengths and whether they are painted.
fn composited(stretches: &[(f64, bool)], color: [f64; 3], tau: f64) -> [f64; 4] {
    let mut sum = [0.0; 4];
    for &(length, painted) in stretches {
        let through = 1.0 - sum[3];
        let alpha = 1.0 - (-tau * length).exp();
        for c in 0..3 {
            let seen = if painted { 0.4 * color[c] + 0.6 * PAINT[c] } else { color[c] };
            sum[c] += through * alpha * seen;
        }
        sum[3] += through * alpha;
    }
    sum
}

#[test]
fn paint_begins_and_ends_half_way_between_labels() {
    let mut item = block([5, 5, 5], [0.8, 0.2, 0.4, 0.3]);
    item.labels = Some(labels(stripes(9)));
    let view = parallel(Point::new(2.0, -9.0, 2.0), Point::new(2.0, 0.0, 2.0), 1.0);
    let (_, tau) = item.transfer.classify(0.0);
    // The block is from -0.5 to 4.5; sample j of the labels from 0.025 + 0.75·j on.
    let stretches = [(1.275, false), (0.75, true), (1.5, false), (0.75, true), (0.725, false)];
    let known = composited(&stretches, [0.8, 0.2, 0.4], tau);
    let drawn = pixels(&scene(vec![item.clone()], Vec::new(), view), [2, 2]);
    assert!(largest_difference(&drawn, &[known; 4]) < 1e-12, "{drawn:?} is not {known:?}");
    // They ride with the piece: seen from the other side of a half turn they come in the other order.
    item.pieces[0].pose =
        Affine::rotation_about(Point::new(2.0, 2.0, 2.0), Vector::z(), std::f64::consts::PI);
    let reversed: Vec<_> = stretches.into_iter().rev().collect();
    let known = composited(&reversed, [0.8, 0.2, 0.4], tau);
    let drawn = pixels(&scene(vec![item], Vec::new(), view), [2, 2]);
    assert!(largest_difference(&drawn, &[known; 4]) < 1e-9, "turned: {drawn:?} is not {known:?}");
}

/// The same picture by many small steps, asking grid and labels at each.
#[test]
fn paint_on_a_real_field_is_what_a_march_sees() {
    let turn = Affine::rotation_about(Point::new(1.0, 0.0, 2.0), Vector::new(0.3, 1.0, 0.2), 0.5);
    let mut item = volume(noisy([12, 11, 9]), steep());
    let voxels = synth::from_voxels([7, 6, 8], turn, |at| {
        [0.0, 1.0, 1.0, 2.0][(synth::noise(9, at).abs() * 4.0) as usize % 4]
    });
    item.labels = Some(labels(voxels.expect("labels")));
    let view = perspective(Point::new(24.0, -22.0, 12.0), Point::new(-1.0, -1.0, -1.0));
    let size = [9, 8];
    let drawn = pixels(&scene(vec![item.clone()], Vec::new(), view), size);
    let paint = item.labels.as_ref().expect("labels");
    let step = 1e-3;
    let mut painted = 0;
    for (pixel, (start, direction)) in drawn.iter().zip(rays(&view, size)) {
        let mut sum = [0.0; 4];
        for i in 0..60_000 {
            let p = start + direction * (step * (f64::from(i) + 0.5));
            let Some(value) = item.grid.sample(&item.grid.world_from_voxel().inverse().point(&p)) else {
                continue;
            };
            let (mut color, tau) = item.transfer.classify(value);
            let at = paint.grid.world_from_voxel().inverse().point(&p).map(|c| (c + 0.5).floor() as i64);
            let inside = (0..3).all(|a| at[a] >= 0 && at[a] < paint.grid.extent()[a] as i64);
            if inside && paint.grid.value(at.x as usize, at.y as usize, at.z as usize) == 1.0 {
                painted += usize::from(tau > 0.0);
                color = std::array::from_fn(|c| 0.4 * color[c] + 0.6 * PAINT[c]);
            }
            let alpha = 1.0 - (-tau * step).exp();
            let through = 1.0 - sum[3];
            for c in 0..3 {
                sum[c] += through * alpha * color[c];
            }
            sum[3] += through * alpha;
        }
        for c in 0..4 {
            assert!((pixel[c] - sum[c]).abs() < 5e-4, "{pixel:?} is not {sum:?}");
        }
    }
    assert!(painted > 1000, "{painted} steps were in paint");
}
