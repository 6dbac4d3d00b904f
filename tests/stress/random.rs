//! Random numbers from a seed, the same on every machine.

use render::volume::{Affine, Point, Vector};

/// `SplitMix64` (Steele, Lea, Flood 2014).
#[derive(Debug, Clone)]
pub(super) struct Random(u64);

impl Random {
    /// Numbers of one case of one test.
    pub(super) fn new(what: &str, seed: u64) -> Self {
        let name =
            what.bytes().fold(0_u64, |hash, byte| (hash ^ u64::from(byte)).wrapping_mul(0x100_0000_01B3));
        let mut random = Self(name ^ seed.wrapping_mul(0x9E37_79B9_7F4A_7C15));
        random.next();
        random
    }

    fn next(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9E37_79B9_7F4A_7C15);
        let mut v = self.0;
        v = (v ^ v >> 30).wrapping_mul(0xBF58_476D_1CE4_E5B9);
        v = (v ^ v >> 27).wrapping_mul(0x94D0_49BB_1331_11EB);
        v ^ v >> 31
    }

    /// From 0 to below 1.
    pub(super) fn part(&mut self) -> f64 {
        (self.next() >> 11) as f64 / (1_u64 << 53) as f64
    }

    /// From `low` to below `high`.
    pub(super) fn between(&mut self, low: f64, high: f64) -> f64 {
        low + (high - low) * self.part()
    }

    /// A power of ten between those of `low` and `high`, any one as likely.
    pub(super) fn power(&mut self, low: f64, high: f64) -> f64 {
        10.0_f64.powf(self.between(low, high))
    }

    /// From 0 to below `count`.
    pub(super) fn below(&mut self, count: usize) -> usize {
        (self.next() % count as u64) as usize
    }

    /// Yes as often as `part` says.
    pub(super) fn chance(&mut self, part: f64) -> bool {
        self.part() < part
    }

    /// One of some.
    pub(super) fn one<T: Copy>(&mut self, of: &[T]) -> T {
        of[self.below(of.len())]
    }

    /// A direction, of length 1.
    pub(super) fn direction(&mut self) -> Vector {
        loop {
            let v = Vector::from_fn(|_, _| self.between(-1.0, 1.0));
            if (0.01..=1.0).contains(&v.norm()) {
                return v.normalize();
            }
        }
    }

    /// A vector of components from -`size` to `size`.
    pub(super) fn shift(&mut self, size: f64) -> Vector {
        Vector::from_fn(|_, _| self.between(-size, size))
    }

    /// A rotation about the origin, by any angle.
    pub(super) fn turn(&mut self) -> Affine {
        let axis = self.direction();
        Affine::rotation_about(Point::origin(), axis, self.between(-3.1, 3.1))
    }
}

#[test]
fn numbers_of_a_seed_are_the_same_and_fill_their_range() {
    let numbers = |seed| {
        let mut random = Random::new("a test", seed);
        (0..1000).map(|_| random.between(-2.0, 4.0)).collect::<Vec<_>>()
    };
    assert_eq!(numbers(5), numbers(5), "one seed");
    assert_ne!(numbers(5), numbers(6), "two seeds");
    let mean = numbers(5).iter().sum::<f64>() / 1000.0;
    assert!((mean - 1.0).abs() < 0.2 && numbers(5).iter().all(|v| (-2.0..4.0).contains(v)), "mean {mean}");
}
