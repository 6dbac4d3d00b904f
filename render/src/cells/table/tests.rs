use super::lanes::Many;
use super::{BATCH, Batch, Stretches, Table};
use crate::simd::{Eight, PlainEight};
use crate::volume::{ControlPoint, Transfer};

fn transfer(points: &[[f64; 5]], unit_mm: f64) -> Transfer {
    // Positions are of single precision: control points between two of them cannot be told from these.
    let single = |value: f64| f64::from(value as f32);
    let point = |&[value, r, g, b, a]: &[f64; 5]| ControlPoint { value: single(value), rgba: [r, g, b, a] };
    Transfer::new(points.iter().map(point).collect(), unit_mm).expect("a function")
}

/// Functions that are hard each in its way, with values from 0 to 1.
fn functions() -> Vec<(&'static str, Transfer)> {
    let steps: Vec<[f64; 5]> = (0..8)
        .flat_map(|i| [i, i + 1].map(|at| (at, f64::from(i))))
        .map(|(at, i)| [f64::from(at) / 8.0, i / 7.0, 1.0 - i / 7.0, 0.5, 0.1 + 0.08 * i])
        .collect();
    let many: Vec<[f64; 5]> = (0..=255)
        .map(|i| f64::from(i) / 255.0)
        .map(|x| [x, x, (x * 9.0).sin().abs(), 1.0 - x, 0.3 * (x * 20.0).sin().powi(2)])
        .collect();
    vec![
        ("even", transfer(&[[0.0, 0.2, 0.4, 0.6, 0.3], [1.0, 0.2, 0.4, 0.6, 0.3]], 1.0)),
        ("one point", transfer(&[[0.0, 0.2, 0.4, 0.6, 0.3]], 1.0)),
        (
            "from nothing",
            transfer(
                &[
                    [0.0, 0.1, 0.2, 0.9, 0.0],
                    [0.05, 0.2, 0.8, 0.6, 0.02],
                    [0.3, 0.9, 0.8, 0.2, 0.02],
                    [1.0, 1.0, 0.2, 0.1, 0.2],
                ],
                1.0,
            ),
        ),
        (
            "to all but full opacity",
            transfer(&[[0.0, 1.0, 0.0, 0.0, 0.0], [1.0, 0.0, 0.0, 1.0, 0.9999]], 2.0),
        ),
        (
            "a narrow window",
            transfer(
                &[
                    [0.0, 0.0, 0.0, 1.0, 0.0],
                    [0.5, 0.0, 1.0, 0.0, 0.0],
                    [0.5001, 1.0, 1.0, 1.0, 0.9],
                    [0.5003, 1.0, 0.0, 0.0, 0.0],
                    [1.0, 0.0, 1.0, 1.0, 0.01],
                ],
                1.0,
            ),
        ),
        (
            "a jump within",
            transfer(
                &[
                    [0.0, 1.0, 0.0, 0.0, 0.05],
                    [0.314_159, 1.0, 0.0, 0.0, 0.05],
                    [0.314_159, 0.0, 0.0, 1.0, 0.8],
                    [1.0, 0.0, 1.0, 0.0, 0.4],
                ],
                1.0,
            ),
        ),
        (
            "jumps at the ends",
            transfer(
                &[
                    [0.0, 1.0, 0.0, 0.0, 0.0],
                    [0.0, 0.0, 1.0, 0.0, 0.5],
                    [1.0, 0.0, 1.0, 0.5, 0.5],
                    [1.0, 0.0, 0.0, 1.0, 0.0],
                ],
                1.0,
            ),
        ),
        ("steps", transfer(&steps, 1.0)),
        ("many points", transfer(&many, 0.7)),
    ]
}

/// What is seen, by sums over fine steps between the bends.
fn truth(transfer: &Transfer, [from, to]: [f32; 2], mm: f32) -> [f64; 4] {
    const STEPS: usize = 600;
    let [from, to, mm] = [from, to, mm].map(f64::from);
    let mut cuts = vec![0.0, 1.0];
    if from != to {
        cuts.extend(
            transfer.points().iter().map(|p| (p.value - from) / (to - from)).filter(|t| *t > 0.0 && *t < 1.0),
        );
    }
    cuts.sort_by(f64::total_cmp);
    let mut seen = [0.0; 4];
    for pair in cuts.windows(2) {
        let step = (pair[1] - pair[0]) / STEPS as f64;
        for n in 0..STEPS {
            let at = from + (to - from) * (pair[0] + (n as f64 + 0.5) * step);
            let (color, extinction) = transfer.classify(at);
            let opacity = -(-extinction * mm * step).exp_m1();
            let through = 1.0 - seen[3];
            for (seen, color) in seen.iter_mut().zip(color.into_iter().chain([1.0])) {
                *seen += through * color * opacity;
            }
        }
    }
    seen
}

/// From 0 to 1.
fn random(state: &mut u64) -> f64 {
    *state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
    (*state >> 11) as f64 / (1_u64 << 53) as f64
}

/// Segments of all lengths, many of them at and about control points.
fn some(transfer: &Transfer, state: &mut u64) -> ([f32; 2], f32) {
    let points = transfer.points();
    let near = points[(random(state) * points.len() as f64) as usize].value;
    let off = |state: &mut u64| (random(state) - 0.5) * 10_f64.powf(-7.0 * random(state));
    let from = match (random(state) * 4.0) as u32 {
        0 => near,
        1 => near + off(state),
        _ => random(state) * 1.4 - 0.2,
    };
    let to = match (random(state) * 4.0) as u32 {
        0 => from,
        1 => random(state) * 1.4 - 0.2,
        _ => from + off(state),
    };
    ([from as f32, to as f32], 10_f64.powf(random(state) * 4.0 - 2.0) as f32)
}

fn at_once(table: &Table, segments: &[([f32; 2], f32)]) -> Vec<[f32; 4]> {
    at_once_by::<PlainEight>(table, segments)
}

fn at_once_by<E: Eight>(table: &Table, segments: &[([f32; 2], f32)]) -> Vec<[f32; 4]> {
    of_all(segments, |batch, all| table.segments::<E>(batch, all))
}

fn of_all(segments: &[([f32; 2], f32)], integrate: impl FnOnce(&mut Batch, Stretches<'_>)) -> Vec<[f32; 4]> {
    let of = |part: fn(&([f32; 2], f32)) -> f32| -> Vec<f32> { segments.iter().map(part).collect() };
    let [from, to, mm] = [of(|s| s.0[0]), of(|s| s.0[1]), of(|s| s.1)];
    let mut batch = Batch::default();
    integrate(&mut batch, Stretches { from: &from, to: &to, mm: &mm });
    batch.seen()[..segments.len()].to_vec()
}

#[test]
fn many_at_once_are_what_they_are_in_truth() {
    let mut state = 7;
    for (name, transfer) in functions() {
        let table = Table::new(&transfer);
        for _ in 0..8 {
            let segments: Vec<_> = (0..BATCH).map(|_| some(&transfer, &mut state)).collect();
            for (seen, &(ends, mm)) in at_once(&table, &segments).iter().zip(&segments) {
                let truth = truth(&transfer, ends, mm);
                let off = (0..4).map(|c| (f64::from(seen[c]) - truth[c]).abs()).fold(0.0, f64::max);
                assert!(off * 255.0 < 0.2, "{name}, {ends:?}, {mm} mm: {seen:?}, not {truth:?}");
            }
        }
    }
}

#[test]
fn a_segment_is_the_same_in_any_company() {
    let mut state = 11;
    for (name, transfer) in functions() {
        let table = Table::new(&transfer);
        let segments: Vec<_> = (0..BATCH).map(|_| some(&transfer, &mut state)).collect();
        let all = at_once(&table, &segments);
        for (seen, &segment) in all.iter().zip(&segments) {
            assert_eq!(at_once(&table, &[segment]), [*seen], "{name}, {segment:?}");
        }
    }
}

#[test]
fn pieces_from_registers_are_those_from_memory() {
    let mut state = 17;
    let mut seen = [0; 2];
    for (name, transfer) in functions() {
        let table = Table::new(&transfer);
        let segments: Vec<_> = (0..BATCH).map(|_| some(&transfer, &mut state)).collect();
        let many = of_all(&segments, |batch, all| batch.all::<PlainEight>(&Many::new(&table), &table, all));
        if let Some(few) = table.lanes.few::<1>() {
            let few = of_all(&segments, |batch, all| batch.all::<PlainEight>(&few, &table, all));
            assert_eq!(few, many, "{name}, one register");
            seen[0] += 1;
        }
        if let Some(few) = table.lanes.few::<2>() {
            let few = of_all(&segments, |batch, all| batch.all::<PlainEight>(&few, &table, all));
            assert_eq!(few, many, "{name}, two registers");
            seen[1] += 1;
        }
    }
    assert!(seen[0] >= 3 && seen[1] > seen[0], "functions of all kinds: {seen:?}");
}

#[cfg(target_arch = "x86_64")]
#[test]
fn wide_instructions_give_the_same() {
    if !crate::simd::has_wide() {
        return;
    }
    let mut state = 13;
    for (name, transfer) in functions() {
        let table = Table::new(&transfer);
        let segments: Vec<_> = (0..BATCH - 3).map(|_| some(&transfer, &mut state)).collect();
        let wide = at_once_by::<crate::simd::WideEight>(&table, &segments);
        assert_eq!(at_once(&table, &segments), wide, "{name}");
    }
}

#[test]
fn values_without_number_or_end_show_nothing_or_something() {
    let transfer = transfer(&[[0.0, 1.0, 0.0, 0.0, 0.2], [1.0, 0.0, 1.0, 0.0, 0.4]], 1.0);
    let table = Table::new(&transfer);
    for ends in [[f32::NAN, 0.5], [0.5, f32::NAN], [f32::INFINITY, 0.5], [f32::NEG_INFINITY, f32::INFINITY]] {
        let seen = at_once(&table, &[(ends, 1.0)]);
        assert!(seen[0].iter().all(|v| (0.0..=1.0).contains(v)), "{ends:?}: {seen:?}");
    }
    let far = at_once(&table, &[([-1e6, -1e6 + 1.0], 2.0), ([1e6, 1e6 + 8.0], 2.0)]);
    for (seen, through) in far.iter().zip([0.8_f32, 0.6]) {
        assert!((1.0 - seen[3] - through * through).abs() < 1e-6, "constant outside: {seen:?}");
    }
}

#[test]
fn functions_at_the_edge_of_numbers_have_tables() {
    let color = |value: f64, a: f64| [value, 1.0, 0.5, 0.25, a];
    let many: Vec<[f64; 5]> = (0..40).map(|i| color(f64::from(i), 0.01 * f64::from(i % 7))).collect();
    let few = [color(0.0, 0.1), color(1.0, 0.2), color(2.0, 0.1)];
    // Opacities with none between them, control points closer than any position, and values of which some are past all.
    let least = [color(0.0, 0.0), color(1.0, 5e-324), color(2.0, 1e-310), color(3.0, 1e-17), color(4.0, 0.5)];
    let close = [color(0.0, 0.5), color(1e-41, 0.1), color(1.0, 0.5)];
    let wide = [color(-1e300, 0.1), color(0.0, 0.5), color(1e300, 0.1)];
    for points in [&few[..], &many, &least, &close, &wide] {
        let point = |&[value, r, g, b, a]: &[f64; 5]| ControlPoint { value, rgba: [r, g, b, a] };
        let table = Table::new(&Transfer::new(points.iter().map(point).collect(), 1.0).expect("a function"));
        let ends = [f32::NEG_INFINITY, -1.0, 0.0, 1e-42, 0.5, 1.0, 3e38, f32::INFINITY];
        for segment in ends.iter().flat_map(|&a| ends.map(|b| ([a, b], 2.0))) {
            let seen = at_once(&table, &[segment])[0];
            assert!(seen.iter().all(|v| (0.0..=1.0).contains(v)), "{points:?}, {segment:?}: {seen:?}");
        }
        let thick = at_once(&table, &[([0.0, 1.0], 1e3), ([1e-42, 1.0], 1e3)]);
        assert!(thick.iter().all(|seen| seen[3] > 0.9), "{points:?}: {thick:?}");
    }
}
