//! The samples that a texture is made of: a box of a grid, in the type that the file had.

use super::TextureError;
use super::domain::{Domain, SampleKind};
use crate::Extent3;
use crate::simd::{LINE_BYTES, fetch_ahead};

/// Samples of a grid as they are stored, `[x, y, z]`, x fastest. A rescale to physical units stays outside: what
/// maps these to texels is given in stored values.
#[derive(Debug, Clone, Copy)]
#[non_exhaustive]
pub enum Samples<'a> {
    /// 8 bits, 0 to 255.
    U8(&'a [u8]),
    /// 16 bits with a sign, as of a CT.
    I16(&'a [i16]),
    /// 16 bits, 0 to 65535.
    U16(&'a [u16]),
    /// Floats. What is not finite counts as the padding value of the [`Domain`].
    F32(&'a [f32]),
}

impl Samples<'_> {
    /// How many there are.
    pub fn len(&self) -> usize {
        match self {
            Self::U8(samples) => samples.len(),
            Self::I16(samples) => samples.len(),
            Self::U16(samples) => samples.len(),
            Self::F32(samples) => samples.len(),
        }
    }

    /// Whether there are none.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// Their type.
    pub fn kind(&self) -> SampleKind {
        match self {
            Self::U8(_) => SampleKind::U8,
            Self::I16(_) => SampleKind::I16,
            Self::U16(_) => SampleKind::U16,
            Self::F32(_) => SampleKind::F32,
        }
    }
}

/// A box of a grid of samples: what one texture holds.
#[derive(Debug, Clone, Copy)]
pub struct Volume<'a> {
    samples: Samples<'a>,
    grid: Extent3,
    low: [usize; 3],
    extent: Extent3,
}

impl<'a> Volume<'a> {
    /// A whole grid.
    ///
    /// # Errors
    /// [`TextureError::Samples`] if there are not x·y·z samples.
    pub fn new(samples: Samples<'a>, grid: Extent3) -> Result<Self, TextureError> {
        if samples.len() != grid.voxels() {
            return Err(TextureError::Samples { expected: grid.voxels(), found: samples.len() });
        }
        Ok(Self { samples, grid, low: [0; 3], extent: grid })
    }

    /// The box of `extent` voxels of this volume that begins at voxel `low`.
    ///
    /// # Errors
    /// [`TextureError::Outside`] if the box reaches past the volume.
    pub fn part(self, low: [u32; 3], extent: Extent3) -> Result<Self, TextureError> {
        let (sizes, most) = (extent.sizes(), self.extent.sizes());
        if (0..3).any(|axis| low[axis].checked_add(sizes[axis]).is_none_or(|end| end > most[axis])) {
            return Err(TextureError::Outside { low, extent: sizes, volume: most });
        }
        let low = std::array::from_fn(|axis| self.low[axis] + low[axis] as usize);
        Ok(Self { low, extent, ..self })
    }

    /// The size of the box: of the texture, before it is padded to whole blocks.
    pub fn extent(&self) -> Extent3 {
        self.extent
    }

    /// The type of the samples.
    pub fn kind(&self) -> SampleKind {
        self.samples.kind()
    }

    /// The size of the grid that the box is of.
    pub(super) fn grid(&self) -> Extent3 {
        self.grid
    }

    /// The first voxel of the box in the grid.
    pub(super) fn low(&self) -> [usize; 3] {
        self.low
    }

    /// Where voxel `[x, y, z]` of the box is among the samples.
    #[inline(always)]
    fn offset(&self, [x, y, z]: [usize; 3]) -> usize {
        let [low_x, low_y, low_z] = self.low;
        ((low_z + z) * self.grid.y() + low_y + y) * self.grid.x() + low_x + x
    }

    /// The samples of `len` voxels from `[x, y, z]` of the box on, within one row.
    #[inline(always)]
    pub(super) fn row(&self, at: [usize; 3], len: usize) -> Samples<'a> {
        let first = self.offset(at);
        let at = first..first + len;
        match self.samples {
            Samples::U8(samples) => Samples::U8(&samples[at]),
            Samples::I16(samples) => Samples::I16(&samples[at]),
            Samples::U16(samples) => Samples::U16(&samples[at]),
            Samples::F32(samples) => Samples::F32(&samples[at]),
        }
    }

    /// Asks for the memory of `len` voxels to be fetched, `rows` below those from `[x, y, z]` of the box on.
    #[inline(always)]
    pub(super) fn fetch_ahead(&self, at: [usize; 3], len: usize, rows: usize) {
        let ahead = rows * self.grid.x();
        match self.row(at, len) {
            Samples::U8(row) => lines(row, ahead),
            Samples::I16(row) => lines(row, ahead),
            Samples::U16(row) => lines(row, ahead),
            Samples::F32(row) => lines(row, ahead),
        }
    }

    /// The table indices of `out.len()` voxels from `[x, y, z]` of the box on, within one row.
    #[inline(always)]
    pub(super) fn indices(&self, domain: &Domain, at: [usize; 3], out: &mut [u16]) {
        match self.row(at, out.len()) {
            Samples::U8(row) => domain.indices_u8(row, out),
            Samples::I16(row) => domain.indices_i16(row, out),
            Samples::U16(row) => domain.indices_u16(row, out),
            Samples::F32(row) => domain.indices_f32(row, out),
        }
    }
}

/// Asks for each line of memory that lies `ahead` samples after these.
#[inline(always)]
fn lines<T>(samples: &[T], ahead: usize) {
    for line in samples.chunks(LINE_BYTES / size_of::<T>()) {
        fetch_ahead(line, ahead);
    }
}
