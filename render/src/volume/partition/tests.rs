use super::*;
use crate::volume::{Point, Vector};

/// Numbers from -1 to 1 by a seed.
struct Numbers(u64);

impl Numbers {
    fn next(&mut self) -> f64 {
        self.0 = self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (self.0 >> 11) as f64 / (1_u64 << 52) as f64 - 1.0
    }

    fn whole(&mut self, below: usize) -> usize {
        ((self.next() * 0.5 + 0.5) * below as f64) as usize % below
    }

    fn vector(&mut self) -> Vector {
        Vector::new(self.next(), self.next(), self.next())
    }
}

const EXTENT: [usize; 3] = [11, 7, 5];

fn place(numbers: &mut Numbers, round: usize) -> Affine {
    let turn = match round % 3 {
        // Rows along a coordinate axis, whole numbers: surfaces go through many centres at once.
        0 => Affine::identity(),
        1 => Affine::rotation_about(Point::origin(), numbers.vector(), 1.0),
        _ => Affine::rotation_about(Point::origin(), Vector::z(), std::f64::consts::FRAC_PI_2),
    };
    let far = if round.is_multiple_of(7) { 1e6 } else { 1.0 };
    let columns =
        [Vector::x() * 0.5, Vector::y(), Vector::z() * if round.is_multiple_of(5) { 50.0 } else { 2.0 }];
    let origin = Point::from(numbers.vector() * far);
    let origin = if round.is_multiple_of(3) { origin.map(f64::round) } else { origin };
    turn * Affine::from_columns(columns[0], columns[1], columns[2], origin).expect("columns")
}

/// A cutter that goes through a voxel's centre, corner or edge as often as not.
fn cutter(numbers: &mut Numbers, world_from_voxel: &Affine, earlier: &[Cutter]) -> Cutter {
    let voxel = EXTENT.map(|n| numbers.whole(2 * n) as f64 / 2.0 - 0.25 * numbers.whole(2) as f64);
    let point = world_from_voxel.point(&Point::from(voxel));
    let axis = match numbers.whole(3) {
        0 => numbers.vector(),
        1 => world_from_voxel.vector(&[Vector::x(), Vector::y(), Vector::z()][numbers.whole(3)]),
        _ => [Vector::x(), -Vector::y(), Vector::new(1.0, 1.0, 0.0)][numbers.whole(3)],
    };
    // Up to a centre some voxels away, so that the surface goes through that one too.
    let other = world_from_voxel.point(&Point::from(EXTENT.map(|n| numbers.whole(n) as f64)));
    let radius = (other - point).norm().max(0.25);
    let made = match (numbers.whole(6), earlier.last()) {
        // The plane before, again, or all but.
        (0, Some(before)) => {
            let nudge = Affine::translation(numbers.vector() * [0.0, 1e-13, 1e-9][numbers.whole(3)]);
            Ok(before.moved(&nudge))
        }
        (1, _) => Cutter::cylinder(point, axis, radius),
        (2, _) => Cutter::dome(point, radius),
        (3, _) => Cutter::blade(point, axis, numbers.vector(), [2.0, 3.0]),
        _ => Cutter::plane(point, axis),
    };
    let kerf_mm = [0.0, 0.0, 1e-15, 0.2][numbers.whole(4)];
    made.and_then(|c| c.with_kerf(kerf_mm)).expect("cutter")
}

/// 10 000 random cuts; the oracle asks each cutter at each centre.
#[test]
fn every_voxel_is_where_its_centre_is_and_in_one_piece_only() {
    let mut numbers = Numbers(5);
    let (mut in_kerf, mut on_plus, mut on_minus) = (0, 0, 0);
    for round in 0..2500 {
        let world_from_voxel = place(&mut numbers, round);
        let mut cutters: Vec<Cutter> = Vec::new();
        for _ in 0..4 {
            cutters.push(cutter(&mut numbers, &world_from_voxel, &cutters));
        }
        let labels = label(EXTENT, &world_from_voxel, &cutters).expect("labels");
        for (i, pattern) in labels.patterns().enumerate() {
            let voxel = [i % 11, i / 11 % 7, i / 77];
            let centre = world_from_voxel.point(&Point::from(voxel.map(|v| v as f64)));
            for (index, cutter) in cutters.iter().enumerate() {
                let side = cutter.side(&centre);
                assert_eq!(pattern.side(index), side, "round {round}, {voxel:?}, {cutter:?}");
                match side {
                    Some(Side::Plus) => on_plus += 1,
                    Some(Side::Minus) => on_minus += 1,
                    None => in_kerf += 1,
                }
            }
        }
        let counts = count(EXTENT, &world_from_voxel, &cutters).expect("counts");
        assert_eq!(counts.values().sum::<u64>(), 385, "round {round}: every voxel once");
        for (pattern, voxels) in counts {
            assert_eq!(labels.patterns().filter(|&p| p == pattern).count() as u64, voxels, "round {round}");
        }
    }
    assert!(
        in_kerf > 10_000 && on_plus > 1_000_000 && on_minus > 1_000_000,
        "{in_kerf} {on_plus} {on_minus}"
    );
}

#[test]
fn the_order_of_the_cuts_does_not_matter() {
    let mut numbers = Numbers(77);
    for round in 0..300 {
        let world_from_voxel = place(&mut numbers, round);
        let mut cutters: Vec<Cutter> = Vec::new();
        for _ in 0..5 {
            cutters.push(cutter(&mut numbers, &world_from_voxel, &cutters));
        }
        let there = label(EXTENT, &world_from_voxel, &cutters).expect("labels");
        cutters.reverse();
        let back = label(EXTENT, &world_from_voxel, &cutters).expect("labels");
        for (a, b) in there.patterns().zip(back.patterns()) {
            assert!((0..5).all(|i| a.side(i) == b.side(4 - i)), "round {round}");
        }
    }
}

#[test]
fn the_volumes_of_the_fragments_and_the_kerf_are_that_of_the_whole() {
    let mut numbers = Numbers(3);
    for round in 0..40 {
        let world_from_voxel = place(&mut numbers, round);
        let mut cutters: Vec<Cutter> = Vec::new();
        for _ in 0..3 {
            cutters.push(cutter(&mut numbers, &world_from_voxel, &cutters));
        }
        let sides = |bits: usize| (0..3).map(move |i| [Side::Plus, Side::Minus][bits >> i & 1]);
        let volume = |bits| {
            let keep: Vec<_> = cutters.iter().copied().zip(sides(bits)).collect();
            fragment_volume_mm3(EXTENT, &world_from_voxel, &keep).expect("volume")
        };
        let pieces: f64 = (0..8).map(volume).sum();
        let whole = fragment_volume_mm3(EXTENT, &world_from_voxel, &[]).expect("volume");
        let counts = count(EXTENT, &world_from_voxel, &cutters).expect("counts");
        let kerf = counts.iter().filter(|(p, _)| (0..3).any(|i| p.side(i).is_none()));
        let kerf = kerf.map(|(_, n)| *n as f64).sum::<f64>() * whole / 385.0;
        assert!((pieces + kerf - whole).abs() <= 1e-12 * whole, "round {round}: {pieces} + {kerf}, {whole}");
        let spacing: f64 = world_from_voxel.column_lengths().iter().product();
        assert!((whole - 385.0 * spacing).abs() <= 1e-12 * whole, "the whole is all voxels: {whole}");
    }
}

#[test]
fn a_hundred_million_voxels_are_divided_without_exception() {
    let extent = [464, 464, 470];
    let world_from_voxel = Affine::rotation_about(Point::origin(), Vector::new(0.3, 1.0, 0.2), 0.02)
        * Affine::translation(Vector::repeat(-232.0));
    let plane = Cutter::plane(Point::new(1.0, 2.0, 3.0), Vector::new(0.1, 0.2, 1.0)).expect("plane");
    let along = Cutter::plane(
        world_from_voxel.point(&Point::new(9.0, 200.0, 7.0)),
        world_from_voxel.vector(&Vector::y()),
    );
    let tube = Cutter::cylinder(Point::new(20.0, 0.0, 0.0), world_from_voxel.vector(&Vector::x()), 100.0);
    let dome = Cutter::dome(Point::new(-40.0, 30.0, 0.0), 150.0).and_then(|c| c.with_kerf(1.3));
    let blade = Cutter::blade(Point::new(5.0, 5.0, 60.0), Vector::z(), Vector::x(), [200.0, 120.0]);
    let cutters = [Ok(plane), along, Ok(plane), tube, dome, blade].map(|c| c.expect("cutter"));
    let counts = count(extent, &world_from_voxel, &cutters).expect("counts");
    assert_eq!(counts.values().sum::<u64>(), 101_189_120, "every voxel once");
    assert!(counts.keys().all(|p| p.side(0) == p.side(2)), "coincident planes agree everywhere");
    let mut reversed = cutters;
    reversed.reverse();
    let back = count(extent, &world_from_voxel, &reversed).expect("counts");
    let sides =
        |p: &Pattern, turn: bool| (0..6).map(|i| p.side(if turn { 5 - i } else { i })).collect::<Vec<_>>();
    for (pattern, voxels) in &counts {
        let same = back.iter().find(|(p, _)| sides(p, true) == sides(pattern, false));
        assert_eq!(same.map(|(_, n)| n), Some(voxels), "in any order: {pattern:?}");
    }
    assert_eq!(counts.len(), back.len(), "no other patterns");
}

/// A ball of 40 mm in voxels of 1 mm has its volume within what its surface lets one expect.
#[test]
fn a_dome_has_the_volume_of_a_ball() {
    let dome = Cutter::dome(Point::new(50.2, 49.7, 50.4), 40.0).expect("dome");
    let found = fragment_volume_mm3([101; 3], &Affine::identity(), &[(dome, Side::Minus)]).expect("volume");
    let known = 4.0 / 3.0 * std::f64::consts::PI * 40.0_f64.powi(3);
    assert!((found / known - 1.0).abs() < 2e-3, "{found} is not {known}");
}

#[test]
fn an_empty_grid_and_one_too_large_are_no_trouble() {
    let cutters = vec![Cutter::plane(Point::origin(), Vector::x()).expect("plane"); MAX_CUTTERS + 1];
    let place = Affine::identity();
    assert_eq!(label([0, 4, 4], &place, &cutters[..1]).expect("empty").pattern(0), None, "no voxel");
    assert!(count([4, 4, 0], &place, &cutters[..1]).expect("empty").is_empty(), "no voxel");
    assert_eq!(count([1; 3], &place, &cutters), Err(PartitionError::TooMany { count: 17 }), "17");
    let huge = [usize::MAX, 2, 2];
    assert_eq!(count(huge, &place, &[]), Err(PartitionError::TooLarge { extent: huge }), "too large");
}
