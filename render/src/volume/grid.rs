//! A regular grid of scalar samples, as it was acquired.

use rayon::prelude::*;
use thiserror::Error;

use super::{Affine, Point};

/// Samples as stored, `[x, y, z]`, x fastest.
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
pub enum Samples {
    /// 8-bit unsigned.
    U8(Vec<u8>),
    /// 8-bit signed.
    I8(Vec<i8>),
    /// 16-bit unsigned.
    U16(Vec<u16>),
    /// 16-bit signed.
    I16(Vec<i16>),
    /// 32-bit unsigned.
    U32(Vec<u32>),
    /// 32-bit signed.
    I32(Vec<i32>),
    /// 32-bit float.
    F32(Vec<f32>),
    /// 64-bit float.
    F64(Vec<f64>),
}

/// Runs one expression for whichever kind of samples there is: `$v` is the `Vec`.
macro_rules! each_kind {
    ($samples:expr, $v:ident => $body:expr) => {
        match $samples {
            Samples::U8($v) => $body,
            Samples::I8($v) => $body,
            Samples::U16($v) => $body,
            Samples::I16($v) => $body,
            Samples::U32($v) => $body,
            Samples::I32($v) => $body,
            Samples::F32($v) => $body,
            Samples::F64($v) => $body,
        }
    };
}

impl Samples {
    /// How many there are.
    pub fn len(&self) -> usize {
        each_kind!(self, v => v.len())
    }

    /// Whether there are none.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// The kind's short name: `"i16"`.
    pub fn kind(&self) -> &'static str {
        match self {
            Self::U8(_) => "u8",
            Self::I8(_) => "i8",
            Self::U16(_) => "u16",
            Self::I16(_) => "i16",
            Self::U32(_) => "u32",
            Self::I32(_) => "i32",
            Self::F32(_) => "f32",
            Self::F64(_) => "f64",
        }
    }

    /// Whether every sample is a whole number by type.
    pub fn is_integer(&self) -> bool {
        !matches!(self, Self::F32(_) | Self::F64(_))
    }

    /// Sample `index` as stored, without rescale.
    #[expect(clippy::useless_conversion, reason = "one of the kinds is f64 already")]
    fn stored(&self, index: usize) -> f64 {
        each_kind!(self, v => f64::from(v[index]))
    }
}

/// `value = slope · stored + intercept` (DICOM PS3.3 C.11.1, NIfTI `scl_slope`).
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Rescale {
    /// Value per stored unit; finite, not zero.
    pub slope: f64,
    /// Value of a stored zero; finite.
    pub intercept: f64,
}

impl Default for Rescale {
    fn default() -> Self {
        Self { slope: 1.0, intercept: 0.0 }
    }
}

/// Why samples and sizes do not make a grid.
#[derive(Debug, Clone, PartialEq, Error)]
#[non_exhaustive]
pub enum GridError {
    /// An axis has no samples.
    #[error("a grid of {extent:?} samples is empty")]
    Empty {
        /// The sizes asked for.
        extent: [usize; 3],
    },
    /// The number of samples is not the product of the sizes.
    #[error("a grid of {extent:?} needs {needed} samples but has {found}")]
    Count {
        /// The sizes asked for.
        extent: [usize; 3],
        /// Their product.
        needed: u128,
        /// The samples given.
        found: usize,
    },
    /// Slope or intercept is not finite, or the slope is zero.
    #[error("the rescale of slope {slope} and intercept {intercept} cannot be applied")]
    Rescale {
        /// As given.
        slope: f64,
        /// As given.
        intercept: f64,
    },
}

/// A volume: samples, where they lie, and what they mean.
#[derive(Debug, Clone, PartialEq)]
pub struct Grid {
    extent: [usize; 3],
    samples: Samples,
    rescale: Rescale,
    world_from_voxel: Affine,
    padding: f64,
    range: [f64; 2],
    non_finite: usize,
}

impl Grid {
    /// A grid of `extent` samples, `[x, y, z]`, x fastest.
    ///
    /// NaN and infinite samples count as the padding value, which is the least finite value until
    /// [`Grid::with_padding`] says otherwise, or 0 where no sample is finite.
    ///
    /// # Errors
    /// [`GridError`]: an empty axis, a wrong number of samples, a rescale that cannot be applied.
    #[expect(clippy::useless_conversion, reason = "one of the kinds is f64 already")]
    pub fn new(
        extent: [usize; 3],
        samples: Samples,
        rescale: Rescale,
        world_from_voxel: Affine,
    ) -> Result<Self, GridError> {
        if extent.contains(&0) {
            return Err(GridError::Empty { extent });
        }
        let needed = extent.iter().fold(1_u128, |all, &n| all.saturating_mul(n as u128));
        if needed != samples.len() as u128 {
            return Err(GridError::Count { extent, needed, found: samples.len() });
        }
        let Rescale { slope, intercept } = rescale;
        if !slope.is_finite() || !intercept.is_finite() || slope == 0.0 {
            return Err(GridError::Rescale { slope, intercept });
        }
        let (lo, hi, finite) = each_kind!(&samples, v => v
        .par_chunks(1 << 16)
        .map(|chunk| {
            let mut acc = (f64::INFINITY, f64::NEG_INFINITY, 0_usize);
            for &s in chunk {
                let s = f64::from(s);
                if s.is_finite() {
                    acc = (acc.0.min(s), acc.1.max(s), acc.2 + 1);
                }
            }
            acc
        })
        .reduce(
            || (f64::INFINITY, f64::NEG_INFINITY, 0),
            |a, b| (a.0.min(b.0), a.1.max(b.1), a.2 + b.2),
        ));
        let non_finite = samples.len() - finite;
        let (lo, hi) = if finite == 0 { (0.0, 0.0) } else { (lo, hi) };
        let (a, b) = (lo * slope + intercept, hi * slope + intercept);
        let range = [a.min(b), a.max(b)];
        Ok(Self { extent, samples, rescale, world_from_voxel, padding: range[0], range, non_finite })
    }

    /// The same grid with another value for NaN and infinite samples (after rescale).
    #[must_use]
    pub fn with_padding(mut self, value: f64) -> Self {
        self.padding = value;
        if self.non_finite == self.samples.len() {
            self.range = [value; 2];
        } else if self.non_finite > 0 {
            self.range = [self.range[0].min(value), self.range[1].max(value)];
        }
        self
    }

    /// The same samples lying elsewhere.
    #[must_use]
    pub fn with_world_from_voxel(mut self, world_from_voxel: Affine) -> Self {
        self.world_from_voxel = world_from_voxel;
        self
    }

    /// Samples along x, y and z.
    pub fn extent(&self) -> [usize; 3] {
        self.extent
    }

    /// The samples as stored, before [`Grid::rescale`].
    pub fn samples(&self) -> &Samples {
        &self.samples
    }

    /// What turns a stored sample into a value.
    pub fn rescale(&self) -> Rescale {
        self.rescale
    }

    /// Where the samples lie; mm.
    pub fn world_from_voxel(&self) -> &Affine {
        &self.world_from_voxel
    }

    /// Distance between neighbours along x, y and z; mm.
    pub fn spacing_mm(&self) -> [f64; 3] {
        self.world_from_voxel.column_lengths()
    }

    /// Least and greatest value, after rescale; that of the padding is among them where a sample is not finite.
    pub fn range(&self) -> [f64; 2] {
        self.range
    }

    /// How many samples are NaN or infinite.
    pub fn non_finite(&self) -> usize {
        self.non_finite
    }

    /// The value that stands for NaN and infinite samples.
    pub fn padding(&self) -> f64 {
        self.padding
    }

    /// Position of a sample in [`Grid::samples`].
    pub fn index(&self, x: usize, y: usize, z: usize) -> usize {
        x + self.extent[0] * (y + self.extent[1] * z)
    }

    /// Value of a sample, after rescale and with padding for what is not finite. Indices must lie inside.
    pub fn value(&self, x: usize, y: usize, z: usize) -> f64 {
        self.value_at(self.index(x, y, z))
    }

    /// [`Grid::value`] by position in the array.
    pub fn value_at(&self, index: usize) -> f64 {
        let stored = self.samples.stored(index);
        if stored.is_finite() { stored * self.rescale.slope + self.rescale.intercept } else { self.padding }
    }

    /// All values, after rescale and padding, as `f32`, in parallel; `[x, y, z]`, x fastest.
    pub fn to_f32(&self) -> Vec<f32> {
        (0..self.samples.len()).into_par_iter().map(|i| self.value_at(i) as f32).collect()
    }

    /// Trilinear interpolation at a place in voxel space. Within the outer half voxel the edge
    /// sample is held; outside `[-0.5, n - 0.5]`, and for NaN, there is nothing.
    pub fn sample(&self, at_voxel: &Point) -> Option<f64> {
        let mut low = [0_usize; 3];
        let mut high = [0_usize; 3];
        let mut part = [0.0_f64; 3];
        for axis in 0..3 {
            let n = self.extent[axis];
            let c = at_voxel[axis];
            if !(c >= -0.5 && c <= n as f64 - 0.5) {
                return None;
            }
            let c = c.clamp(0.0, (n - 1) as f64);
            low[axis] = c.floor() as usize;
            high[axis] = (low[axis] + 1).min(n - 1);
            part[axis] = c - low[axis] as f64;
        }
        let row = |y: usize, z: usize| {
            let a = self.value(low[0], y, z);
            let b = self.value(high[0], y, z);
            a + (b - a) * part[0]
        };
        let sheet = |z: usize| {
            let (a, b) = (row(low[1], z), row(high[1], z));
            a + (b - a) * part[1]
        };
        let (a, b) = (sheet(low[2]), sheet(high[2]));
        Some(a + (b - a) * part[2])
    }

    /// The eight corners of `[-0.5, n - 0.5]` in world space; corner bits are x, y, z.
    pub fn corners_in_world(&self) -> [Point; 8] {
        std::array::from_fn(|corner| {
            let at = |axis: usize| {
                if corner >> axis & 1 == 1 { self.extent[axis] as f64 - 0.5 } else { -0.5 }
            };
            self.world_from_voxel.point(&Point::new(at(0), at(1), at(2)))
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn edges_are_held_for_half_a_voxel_and_nothing_lies_beyond() {
        let grid = Grid::new(
            [2, 1, 1],
            Samples::I16(vec![10, 20]),
            Rescale { slope: 2.0, intercept: -1.0 },
            Affine::identity(),
        )
        .expect("a grid");
        let at = |x: f64| grid.sample(&Point::new(x, 0.0, 0.0));
        assert_eq!(at(-0.5), Some(19.0), "edge held");
        assert_eq!(at(0.5), Some(29.0), "half way");
        assert_eq!(at(1.5), Some(39.0), "far edge held");
        assert_eq!(at(1.500001), None, "outside");
        assert_eq!(at(f64::NAN), None, "NaN");
        assert_eq!(grid.range(), [19.0, 39.0], "range after rescale");
    }

    #[test]
    fn samples_that_are_not_finite_count_as_padding() {
        let samples = Samples::F32(vec![f32::NAN, 3.0, f32::INFINITY, 7.0]);
        let grid = Grid::new([4, 1, 1], samples, Rescale::default(), Affine::identity()).expect("grid");
        assert_eq!((grid.non_finite(), grid.padding()), (2, 3.0), "counted and padded");
        assert_eq!(grid.value(2, 0, 0), 3.0, "infinite reads as padding");
        let padded = grid.with_padding(-1.0);
        assert_eq!(padded.value(0, 0, 0), -1.0, "padding may be set");
        assert_eq!(padded.range()[0], -1.0, "a value that occurs is in the range");
    }

    #[test]
    fn sizes_that_overflow_are_refused() {
        let huge = Grid::new(
            [usize::MAX, usize::MAX, 2],
            Samples::U8(vec![0]),
            Rescale::default(),
            Affine::identity(),
        );
        assert!(matches!(huge, Err(GridError::Count { .. })), "u128 product");
    }
}
