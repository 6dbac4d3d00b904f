//! One step of a time series in the compressed bytes that it was stored in.

use std::fmt;
use std::sync::Arc;

use thiserror::Error;

use super::{Affine, Point, Rescale};

/// Voxels of a block in x and y, and of a sub-volume of PVTC.
const BLOCK: usize = 4;
/// Scalars that PVTC-TE and PVTC-SE pack into a texel.
const PACKED: usize = 3;
/// The colour of a sub-volume's steps, or of a BC1 block: bytes.
const HEAD_BYTES: usize = 4;

/// How the bytes of a step are to be read. The formats of `compress`, as the renderer knows them.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum PackedFormat {
    /// One byte a voxel, x fastest.
    R8,
    /// Two bytes a voxel, little-endian, x fastest.
    R16,
    /// PVTC (Yamada): sub-volumes of 4×4×`s` voxels, `t` steps together.
    Pvtc {
        /// Slices of a sub-volume: 1, 2, 4 or 8.
        s: u8,
        /// Steps that share a table: 1 to 4.
        t: u8,
    },
    /// PVTC-TE (Nagayasu): three successive steps in red, green and blue of BC1 blocks.
    Te,
    /// PVTC-SE (Nagayasu): three successive slices of one step in red, green and blue of BC1 blocks.
    Se,
}

impl PackedFormat {
    /// Steps that the same bytes hold.
    pub fn steps(self) -> usize {
        match self {
            Self::R8 | Self::R16 | Self::Se => 1,
            Self::Pvtc { t, .. } => usize::from(t),
            Self::Te => PACKED,
        }
    }

    /// Bytes of a volume of `extent` voxels, `[x, y, z]`, of all its steps; none where they are too many to count.
    pub fn len(self, extent: [usize; 3]) -> Option<usize> {
        let [x, y, z] = extent;
        let product = |parts: [usize; 4]| parts.iter().try_fold(1_usize, |n, part| n.checked_mul(*part));
        let [columns, rows] = [x, y].map(|n| n.div_ceil(BLOCK));
        match self {
            Self::R8 => product([x, y, z, 1]),
            Self::R16 => product([x, y, z, 2]),
            Self::Pvtc { s, .. } => {
                let s = usize::from(s).max(1);
                product([columns, rows, z.div_ceil(s), HEAD_BYTES + BLOCK * s])
            }
            Self::Te => product([columns, rows, z, 2 * HEAD_BYTES]),
            Self::Se => product([columns, rows, z.div_ceil(PACKED), 2 * HEAD_BYTES]),
        }
    }
}

impl fmt::Display for PackedFormat {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::R8 => f.write_str("r8"),
            Self::R16 => f.write_str("r16"),
            Self::Pvtc { s, t } => write!(f, "pvtc<{s},{t}>"),
            Self::Te => f.write_str("pvtc-te"),
            Self::Se => f.write_str("pvtc-se"),
        }
    }
}

/// Why bytes are not a step.
#[derive(Debug, Clone, PartialEq, Eq, Error)]
#[non_exhaustive]
pub enum PackedError {
    /// S or T is none of those defined.
    #[error("{format} is not defined: S is 1, 2, 4 or 8 and T is 1 to 4")]
    Format {
        /// The format.
        format: PackedFormat,
    },
    /// The bytes are not those of the extent.
    #[error("{found} bytes were given, but {format} of this extent needs {expected}")]
    Length {
        /// The format.
        format: PackedFormat,
        /// Bytes that the extent needs; none where they cannot be counted.
        expected: String,
        /// Bytes given.
        found: usize,
    },
    /// The bytes do not hold such a step.
    #[error("step {step} of {format} was asked for, whose bytes hold {} steps", format.steps())]
    Step {
        /// The format.
        format: PackedFormat,
        /// The step asked for, from 0.
        step: usize,
    },
}

/// Bytes that are shared: of a file, or of a stream that takes their memory back when nobody has them any longer.
pub type SharedBytes = Arc<dyn AsRef<[u8]> + Send + Sync>;

/// One step of a time series, compressed. A clone shares the bytes, and so do the steps that lie in them together.
#[derive(Clone)]
pub struct PackedStep {
    format: PackedFormat,
    extent: [usize; 3],
    world_from_voxel: Affine,
    rescale: Rescale,
    bytes: SharedBytes,
    step: usize,
    max_error: f64,
    psnr_db: f64,
}

impl fmt::Debug for PackedStep {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let mut debug = f.debug_struct("PackedStep");
        debug.field("format", &self.format).field("extent", &self.extent).field("step", &self.step);
        debug.finish_non_exhaustive()
    }
}

impl PackedStep {
    /// Step `step` (from 0) of those that `bytes` hold, of `extent` voxels `[x, y, z]`. A stored number `n`, 0 to 255
    /// (or to 65 535 in [`PackedFormat::R16`]), stands for the value `slope·n + intercept`.
    ///
    /// # Errors
    /// [`PackedError`] for what its variants name.
    pub fn new(
        format: PackedFormat,
        extent: [usize; 3],
        world_from_voxel: Affine,
        rescale: Rescale,
        bytes: SharedBytes,
        step: usize,
    ) -> Result<Self, PackedError> {
        if let PackedFormat::Pvtc { s, t } = format
            && !([1, 2, 4, 8].contains(&s) && (1..=4).contains(&t))
        {
            return Err(PackedError::Format { format });
        }
        let expected = format.len(extent);
        let found = (*bytes).as_ref().len();
        if extent.contains(&0) || expected != Some(found) {
            let expected = expected.map_or_else(|| "more than can be counted".to_owned(), |n| n.to_string());
            return Err(PackedError::Length { format, expected, found });
        }
        if step >= format.steps() {
            return Err(PackedError::Step { format, step });
        }
        let (max_error, psnr_db) = (0.0, f64::INFINITY);
        Ok(Self { format, extent, world_from_voxel, rescale, bytes, step, max_error, psnr_db })
    }

    /// The same with what its making lost: the largest error in values, and the PSNR in dB.
    pub fn with_error(mut self, max_error: f64, psnr_db: f64) -> Self {
        (self.max_error, self.psnr_db) = (max_error, psnr_db);
        self
    }

    /// How the bytes are read.
    pub fn format(&self) -> PackedFormat {
        self.format
    }

    /// Voxels along x, y and z.
    pub fn extent(&self) -> [usize; 3] {
        self.extent
    }

    /// Where voxel centres lie; world mm.
    pub fn world_from_voxel(&self) -> &Affine {
        &self.world_from_voxel
    }

    /// What a stored number stands for.
    pub fn rescale(&self) -> Rescale {
        self.rescale
    }

    /// The compressed bytes.
    pub fn bytes(&self) -> &[u8] {
        (*self.bytes).as_ref()
    }

    /// Which of the steps in the bytes this is, from 0.
    pub fn step(&self) -> usize {
        self.step
    }

    /// Largest error in values, and PSNR in dB, as stated by whoever compressed it.
    pub fn error(&self) -> (f64, f64) {
        (self.max_error, self.psnr_db)
    }

    /// The greatest stored number.
    pub fn top(&self) -> f64 {
        if self.format == PackedFormat::R16 { 65535.0 } else { 255.0 }
    }

    /// Least and greatest value that the stored numbers can stand for.
    pub fn range(&self) -> [f64; 2] {
        let ends = [self.rescale.intercept, self.rescale.slope * self.top() + self.rescale.intercept];
        [ends[0].min(ends[1]), ends[0].max(ends[1])]
    }

    /// The box of all voxels, in voxel space.
    pub fn bounds(&self) -> [Point; 2] {
        [Point::from([-0.5; 3]), Point::from(self.extent.map(|n| n as f64 - 0.5))]
    }

    /// Whether this is the same step of the same bytes.
    pub fn is_same(&self, other: &Self) -> bool {
        self.shares_bytes(other) && self.step == other.step
    }

    /// Whether both lie in the same bytes, read in the same way.
    pub fn shares_bytes(&self, other: &Self) -> bool {
        Arc::as_ptr(&self.bytes).addr() == Arc::as_ptr(&other.bytes).addr()
            && (self.format, self.extent) == (other.format, other.extent)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn step(
        format: PackedFormat,
        extent: [usize; 3],
        len: usize,
        step: usize,
    ) -> Result<PackedStep, PackedError> {
        let rescale = Rescale { slope: 2.0, intercept: -10.0 };
        PackedStep::new(format, extent, Affine::identity(), rescale, Arc::new(vec![0; len]), step)
    }

    #[test]
    fn the_rates_are_those_of_the_papers() {
        let extent = [64, 64, 64];
        let raw = PackedFormat::R8.len(extent).expect("bytes") as f64;
        for (format, rate) in [
            (PackedFormat::Pvtc { s: 4, t: 3 }, 5.0 / 48.0),
            (PackedFormat::Pvtc { s: 4, t: 2 }, 5.0 / 32.0),
            (PackedFormat::Pvtc { s: 1, t: 3 }, 1.0 / 6.0),
            (PackedFormat::Pvtc { s: 1, t: 2 }, 1.0 / 4.0),
            (PackedFormat::Te, 1.0 / 6.0),
        ] {
            let len = format.len(extent).expect("bytes") as f64;
            assert_eq!(len / (raw * format.steps() as f64), rate, "{format}");
        }
        assert_eq!(PackedFormat::Se.len([64, 64, 63]), Some(16 * 16 * 21 * 8), "a sixth, where 3 divides z");
    }

    #[test]
    fn bytes_of_another_length_and_steps_that_are_not_there_are_refused() {
        let format = PackedFormat::Pvtc { s: 4, t: 3 };
        assert!(step(format, [5, 4, 6], 2 * 2 * 20, 2).is_ok(), "whole sub-volumes");
        assert!(matches!(step(format, [5, 4, 6], 81, 0), Err(PackedError::Length { .. })), "a byte more");
        assert!(matches!(step(format, [5, 4, 6], 80, 3), Err(PackedError::Step { .. })), "three steps");
        assert!(
            matches!(step(PackedFormat::R8, [usize::MAX; 3], 0, 0), Err(PackedError::Length { .. })),
            "countless"
        );
        assert!(matches!(step(PackedFormat::R8, [0; 3], 0, 0), Err(PackedError::Length { .. })), "empty");
        let odd = PackedFormat::Pvtc { s: 3, t: 3 };
        assert!(matches!(step(odd, [4; 3], 32, 0), Err(PackedError::Format { .. })), "S = 3");
    }

    #[test]
    fn stored_numbers_stand_for_values() {
        assert_eq!(step(PackedFormat::R8, [1; 3], 1, 0).expect("a step").range(), [-10.0, 500.0], "8 bits");
        assert_eq!(
            step(PackedFormat::R16, [1; 3], 2, 0).expect("a step").range(),
            [-10.0, 131_060.0],
            "16 bits"
        );
    }
}
