use super::scanner::Scanner;
use super::sides::Sides;
use super::{Cells, Corner, Found, Raws, Rect, Shown, Tetrahedron};
use crate::simd::{Four, PlainFour};

/// Pixels of a picture that are looked at.
const TILE: Rect = Rect { low: [3, 5], high: [93, 71] };

/// From 0 to 1.
fn random(state: &mut u64) -> f64 {
    *state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
    (*state >> 11) as f64 / (1_u64 << 53) as f64
}

/// A corner, of a kind of cells that are hard each in its way.
fn corner(kind: usize, about: [f64; 2], perspective: bool, state: &mut u64) -> Corner {
    let mut within = |size: f64| (random(state) - 0.5) * size;
    let [x, y] = match kind {
        0 => [about[0] + within(9.0), about[1] + within(9.0)],
        // On the middles of pixels, and between them, so that edges run along rows and columns and pass through pixels.
        1 => [about[0] + within(8.0), about[1] + within(8.0)].map(f64::round),
        2 => [about[0] + within(8.0), about[1] + within(8.0)].map(|v| (2.0 * v).round() / 2.0),
        // Less than a pixel; most of the picture; and thin.
        3 => [about[0] + within(0.9), about[1] + within(0.9)],
        4 => [about[0] + within(300.0), about[1] + within(300.0)],
        _ => [about[0] + within(40.0), about[1] + within(1e-3)],
    };
    let z = 50.0 + if kind == 1 { within(9.0).round() } else { within(9.0) };
    let rank = if perspective { -1.0 / z } else { z };
    Corner { x, y, w: 1.0, z, rank, scalar: within(1.0) }
}

/// What was found: pixel, depths and values.
type Stretch = (u32, [f64; 2], [f32; 2]);

fn of(found: Found<'_>, into: &mut Vec<Stretch>) {
    into.extend(
        (0..found.len()).map(|n| found.get(n)).map(|raw| (raw.pixel, [raw.front, raw.back], raw.values)),
    );
}

fn scanned<F: Four>(cells: Cells<'_>, perspective: bool) -> Vec<Stretch> {
    let (mut scanner, mut stretches) = (Box::<Scanner>::default(), Vec::new());
    scanner.scan::<F>(cells, [&TILE, &TILE], perspective, &mut |found| of(found, &mut stretches));
    of(scanner.rest(), &mut stretches);
    stretches
}

#[test]
fn pixels_are_those_that_exact_predicates_pass_in_the_same_order() {
    let mut state = 23;
    for (kind, perspective) in (0..6).flat_map(|kind| [(kind, false), (kind, true)]) {
        let mut corners = Vec::new();
        for _ in 0..300 {
            let about = [random(&mut state) * 96.0, random(&mut state) * 76.0];
            corners.extend((0..4).map(|_| corner(kind, about, perspective, &mut state)));
        }
        let shown: Vec<Shown> = (0..300_u16)
            .map(|n| Shown {
                corners: [0, 1, 2, 3].map(|k| 4 * n + k),
                tetrahedron: u32::from(n),
                nearest: 0.0,
                reach: Rect::around(&corners[4 * usize::from(n)..][..4], &TILE),
            })
            .filter(|shown| !shown.reach.is_empty())
            .collect();
        let cells = Cells { corners: &corners, constants: &[], shown: &shown };
        let found = scanned::<PlainFour>(cells, perspective);
        let mut exact = Vec::new();
        let mut raws = Box::<Raws>::default();
        for shown in &shown {
            let tetrahedron: Tetrahedron<'_> = (shown.corners.map(|n| &corners[usize::from(n)]), None);
            let sides = Sides::new(&tetrahedron, perspective);
            for row in shown.reach.low[1]..shown.reach.high[1] {
                let Rect { low: [left, _], high: [right, _] } = shown.reach;
                let row = Rect { low: [left, row], high: [right, row + 1] };
                sides.pass_rect(&TILE, &row, &mut raws);
                of(raws.take(), &mut exact);
            }
        }
        let pixels = |stretches: &[Stretch]| stretches.iter().map(|s| s.0).collect::<Vec<_>>();
        assert_eq!(pixels(&found), pixels(&exact), "kind {kind}, {perspective}");
        assert!(kind == 3 || kind == 5 || found.len() > 1000, "kind {kind}: {} pixels", found.len());
        for (a, b) in found.iter().zip(&exact) {
            // Depth is the plane's in both; the scalar is interpolated in two ways.
            assert_eq!(a.1, b.1, "kind {kind}, {perspective}");
            let off = (0..2).map(|end| (a.2[end] - b.2[end]).abs()).fold(0.0, f32::max);
            assert!(off < 1e-4, "kind {kind}, {perspective}: {a:?}, {b:?}");
        }
        // In parts, into which not all cells reach, the same pixels are found once each.
        let mut parts = Vec::new();
        let (mut scanner, middle) = (Box::<Scanner>::default(), 41);
        for part in
            [Rect { high: [middle, TILE.high[1]], ..TILE }, Rect { low: [middle, TILE.low[1]], ..TILE }]
        {
            scanner.scan::<PlainFour>(cells, [&TILE, &part], perspective, &mut |found| of(found, &mut parts));
            of(scanner.rest(), &mut parts);
        }
        let (mut parts, mut whole) = (pixels(&parts), pixels(&found));
        parts.sort_unstable();
        whole.sort_unstable();
        assert_eq!(parts, whole, "kind {kind}, {perspective}");
        #[cfg(target_arch = "x86_64")]
        if crate::simd::has_wide() {
            assert_eq!(scanned::<crate::simd::WideFour>(cells, perspective), found, "kind {kind}");
        }
    }
}

#[test]
fn cells_that_reach_from_the_eye_to_where_depth_is_lost_have_depths_and_values() {
    let mut state = 5;
    let mut corners = Vec::new();
    for _ in 0..300 {
        for far in [false, false, true, true] {
            let [x, y] = [random(&mut state) * 90.0 + 3.0, random(&mut state) * 66.0 + 5.0];
            // Rays pass far corners only on the middles of pixels.
            let [x, y] = if far { [x.round(), y.round()] } else { [x, y] };
            let z = if far { 1e13 } else { 2e-6 } * (1.0 + random(&mut state));
            corners.push(Corner { x, y, w: 1.0, z, rank: -1.0 / z, scalar: random(&mut state) });
        }
    }
    let cell = |n: u16| Shown {
        corners: [0, 1, 2, 3].map(|k| 4 * n + k),
        tetrahedron: u32::from(n),
        nearest: 0.0,
        reach: Rect::around(&corners[4 * usize::from(n)..][..4], &TILE),
    };
    let shown: Vec<Shown> = (0..300).map(cell).filter(|shown| !shown.reach.is_empty()).collect();
    let found = scanned::<PlainFour>(Cells { corners: &corners, constants: &[], shown: &shown }, true);
    assert!(found.len() > 10_000, "{} rays", found.len());
    assert!(found.iter().any(|&(_, [_, back], _)| back == f64::MAX), "some end where no depth is");
    for (pixel, [front, back], values) in found {
        assert!(front >= 0.0 && back > front && back.is_finite(), "{pixel}: from {front} to {back}");
        assert!(values.iter().all(|v| (-1e-3..1.001).contains(v)), "{pixel}: {values:?}");
    }
}
