//! A grid as [`compress::texture`] takes it: its samples in a type that encoders know, its values as stored numbers.

use std::borrow::Cow;

use compress::texture::{ColourPoint, ColourTable, SampleKind, TextureError, Volume, Window};
use compress::{Extent3, ExtentError, texture};
use rayon::prelude::*;
use thiserror::Error;

use crate::volume::{ControlPoint, Grid, Samples, Transfer};

/// Why no texture can be made of a grid.
#[derive(Debug, Error, Clone, PartialEq)]
#[non_exhaustive]
pub enum SourceError {
    /// Its sizes cannot be those of a texture.
    #[error(transparent)]
    Extent(#[from] ExtentError),
    /// What the encoder says.
    #[error(transparent)]
    Texture(#[from] TextureError),
}

/// A grid's samples for the encoders: borrowed where they have the type, converted else.
///
/// Whole numbers stay whole where 16 bits hold them; wider ones and 64-bit floats become 32-bit floats.
#[derive(Debug)]
pub struct GridSource<'a> {
    grid: &'a Grid,
    samples: Typed<'a>,
    extent: Extent3,
}

#[derive(Debug)]
enum Typed<'a> {
    U8(&'a [u8]),
    I16(Cow<'a, [i16]>),
    U16(Cow<'a, [u16]>),
    F32(Cow<'a, [f32]>),
}

impl<'a> GridSource<'a> {
    /// All of a grid.
    ///
    /// # Errors
    /// [`SourceError::Extent`] for sizes past what a texture can have.
    pub fn new(grid: &'a Grid) -> Result<Self, SourceError> {
        let extent = Extent3::new(grid.extent().map(|n| u32::try_from(n).unwrap_or(u32::MAX)))?;
        Ok(Self { grid, samples: typed(grid), extent })
    }

    /// The samples.
    ///
    /// # Errors
    /// [`SourceError::Texture`], never for the samples of a grid.
    pub fn volume(&self) -> Result<Volume<'_>, SourceError> {
        Ok(Volume::new(self.borrowed(), self.extent)?)
    }

    /// A transfer function as colours of the stored numbers.
    ///
    /// # Errors
    /// [`SourceError::Texture`] for points that are none.
    pub fn table(&self, transfer: &Transfer) -> Result<ColourTable, SourceError> {
        let points = self.points(transfer);
        Ok(ColourTable::new(&points, self.kind(), self.stored(self.grid.padding()))?)
    }

    /// The same, every value opaque: what BC1 can hold.
    ///
    /// # Errors
    /// Those of [`GridSource::table`].
    pub fn opaque_table(&self, transfer: &Transfer) -> Result<ColourTable, SourceError> {
        let points = self.points(transfer);
        Ok(ColourTable::opaque(&points, self.kind(), self.stored(self.grid.padding()))?)
    }

    /// A range of values as stored numbers.
    ///
    /// # Errors
    /// [`SourceError::Texture`] for a range that is none.
    pub fn window(&self, range: [f64; 2]) -> Result<Window, SourceError> {
        let [a, b] = range.map(|value| self.stored(value));
        Ok(Window::new([a.min(b), a.max(b)], self.kind(), self.stored(self.grid.padding()))?)
    }

    /// The values that the least and the greatest number of a texture of scalars stand for: 0 and 65 535 where it is
    /// `wide`, 0 and 255 else. They differ.
    pub fn values(&self, window: &Window, wide: bool) -> [f64; 2] {
        let domain = window.domain();
        let first = domain.value(0);
        // A texel of 16 bits is the index itself, of 65 536 that there could be.
        let length = if wide { domain.step() * 65535.0 } else { window.range()[1] - first };
        let rescale = self.grid.rescale();
        let value = |stored: f64| rescale.slope * stored + rescale.intercept;
        [value(first), value(first + if length > 0.0 { length } else { 1.0 })]
    }

    /// Value of one stored unit, > 0.
    pub fn unit(&self) -> f64 {
        self.grid.rescale().slope.abs()
    }

    fn stored(&self, value: f64) -> f64 {
        let rescale = self.grid.rescale();
        (value - rescale.intercept) / rescale.slope
    }

    fn points(&self, transfer: &Transfer) -> Vec<ColourPoint> {
        let point = |p: &ControlPoint| ColourPoint { value: self.stored(p.value), rgba: p.rgba };
        let mut points: Vec<ColourPoint> = transfer.points().iter().map(point).collect();
        if self.grid.rescale().slope < 0.0 {
            points.reverse();
        }
        points
    }

    fn kind(&self) -> SampleKind {
        self.borrowed().kind()
    }

    fn borrowed(&self) -> texture::Samples<'_> {
        match &self.samples {
            Typed::U8(s) => texture::Samples::U8(s),
            Typed::I16(s) => texture::Samples::I16(s),
            Typed::U16(s) => texture::Samples::U16(s),
            Typed::F32(s) => texture::Samples::F32(s),
        }
    }
}

fn typed(grid: &Grid) -> Typed<'_> {
    let rescale = grid.rescale();
    let ends = grid.range().map(|v| ((v - rescale.intercept) / rescale.slope).round());
    let (low, high) = (ends[0].min(ends[1]), ends[0].max(ends[1]));
    match grid.samples() {
        Samples::U8(s) => Typed::U8(s),
        Samples::I16(s) => Typed::I16(Cow::Borrowed(s)),
        Samples::U16(s) => Typed::U16(Cow::Borrowed(s)),
        Samples::F32(s) => Typed::F32(Cow::Borrowed(s)),
        Samples::I8(s) => Typed::I16(converted(s, i16::from)),
        Samples::I32(s) if low >= -32768.0 && high <= 32767.0 => Typed::I16(converted(s, |v| v as i16)),
        Samples::U32(s) if high <= 65535.0 => Typed::U16(converted(s, |v| v as u16)),
        Samples::I32(s) => Typed::F32(converted(s, |v| v as f32)),
        Samples::U32(s) => Typed::F32(converted(s, |v| v as f32)),
        Samples::F64(s) => Typed::F32(converted(s, |v| v as f32)),
    }
}

fn converted<T: Copy + Sync, U: Clone + Send>(
    samples: &[T],
    convert: impl Fn(T) -> U + Sync,
) -> Cow<'_, [U]> {
    Cow::Owned(samples.par_iter().map(|&v| convert(v)).collect())
}

#[cfg(test)]
mod tests {
    use compress::texture::{Mapping, Source, TexelFormat};

    use super::*;
    use crate::volume::{Affine, Rescale};

    fn words(samples: Samples, rescale: Rescale) -> (Vec<u16>, [f64; 2]) {
        let grid = Grid::new([samples.len(), 1, 1], samples, rescale, Affine::identity()).expect("a grid");
        let source = GridSource::new(&grid).expect("a source");
        let window = source.window(grid.range()).expect("a window");
        let volume = source.volume().expect("a volume");
        let texture = Source::new(volume, Mapping::Scalars(&window)).expect("a texture");
        let bytes = texture.texels(TexelFormat::R16).expect("texels");
        let (words, _) = bytes.as_chunks::<2>();
        (words.iter().map(|w| u16::from_le_bytes(*w)).collect(), source.values(&window, true))
    }

    #[test]
    fn whole_numbers_of_any_type_and_rescale_keep_their_values() {
        let kinds = [
            Samples::I8(vec![-5, 0, 100]),
            Samples::I16(vec![-5, 0, 100]),
            Samples::I32(vec![-5, 0, 100]),
            Samples::U8(vec![5, 0, 100]),
            Samples::U32(vec![5, 0, 60_000]),
        ];
        for samples in kinds {
            for slope in [1.0, 0.5, -2.0] {
                let rescale = Rescale { slope, intercept: -1000.0 };
                let grid =
                    Grid::new([3, 1, 1], samples.clone(), rescale, Affine::identity()).expect("a grid");
                let (words, [first, last]) = words(samples.clone(), rescale);
                for (i, word) in words.iter().enumerate() {
                    let value = first + (last - first) * f64::from(*word) / 65535.0;
                    assert!((value - grid.value_at(i)).abs() < 1e-6, "{} x {slope}: {value}", samples.kind());
                }
            }
        }
    }

    #[test]
    fn floats_spread_over_all_16_bits_and_nan_is_padding() {
        let samples = Samples::F32(vec![0.0, 0.25, 1.0, f32::NAN]);
        let (words, values) = words(samples, Rescale { slope: 2.0, intercept: -1000.0 });
        assert_eq!([words[0], words[2], words[3]], [0, 65535, 0], "end to end, and the least value for NaN");
        assert_eq!(values, [-1000.0, -998.0], "the values' own range");
    }

    #[test]
    fn a_flat_grid_divides_by_nothing() {
        let (words, [first, last]) = words(Samples::U8(vec![5; 4]), Rescale::default());
        assert_eq!((words, first), (vec![0; 4], 5.0), "the foot of the range");
        assert!(last > first, "texels differ in what they stand for");
    }
}
