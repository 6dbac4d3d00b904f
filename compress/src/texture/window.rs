//! What a stored sample becomes in a texture of scalars: a number of 8 or 16 bits.

use super::TextureError;
use super::domain::{Domain, SampleKind};

/// 1.5·2²³: adding it rounds an `f32` below 2²² to a whole number in its low bits, ties to even.
const ROUND: f32 = 12_582_912.0;

/// The stored values that the darkest and the brightest texel stand for; what lies outside is clamped.
///
/// In 16 bits a texel is the [`Domain`]'s index itself: of whole numbers nothing is lost. In 8 bits a texel `t` stands
/// for `low + t/255·(high − low)` and is the nearest to its sample; the error of a float is that of the domain more.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Window {
    domain: Domain,
    /// Texels of 8 bits per index.
    per_index: f32,
}

impl Window {
    /// The window `[low, high]` of stored values of `kind`; of whole numbers it is widened to whole ones. Floats that
    /// are not finite count as `padding`.
    ///
    /// # Errors
    /// [`TextureError::Window`] unless both are finite and `low` ≤ `high`.
    pub fn new([low, high]: [f64; 2], kind: SampleKind, padding: f64) -> Result<Self, TextureError> {
        if !(low.is_finite() && high.is_finite() && low <= high) {
            return Err(TextureError::Window { low, high });
        }
        let domain = Domain::new(kind, [low, high], padding);
        let per_index = if domain.last() > 0 { 255.0 / f32::from(domain.last()) } else { 0.0 };
        Ok(Self { domain, per_index })
    }

    /// The values that samples are clamped to, and their steps.
    pub fn domain(&self) -> &Domain {
        &self.domain
    }

    /// The values that texels of 8 bits stand for, of texel 0 and of 255.
    pub fn range(&self) -> [f64; 2] {
        [self.domain.value(0), self.domain.value(self.domain.last())]
    }

    /// The texel of 8 bits of an index.
    #[inline(always)]
    pub(super) fn texel(&self, index: u16) -> u8 {
        (f32::from(index) * self.per_index + ROUND).to_bits() as u8
    }
}
