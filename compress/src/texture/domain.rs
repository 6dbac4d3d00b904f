//! From a stored sample to a place in a table of at most 65536 entries.

/// The type of stored samples.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
#[non_exhaustive]
pub enum SampleKind {
    /// [`u8`].
    U8,
    /// [`i16`].
    I16,
    /// [`u16`].
    U16,
    /// [`f32`].
    F32,
}

impl SampleKind {
    /// The least and the greatest stored number of a type of whole numbers.
    fn whole_range(self) -> Option<[f64; 2]> {
        match self {
            Self::U8 => Some([0.0, 255.0]),
            Self::I16 => Some([-32768.0, 32767.0]),
            Self::U16 => Some([0.0, 65535.0]),
            Self::F32 => None,
        }
    }
}

/// 1.5·2²³: adding it rounds an `f32` below 2²² to a whole number in its low bits, ties to even.
const ROUND: f32 = 12_582_912.0;

/// A closed range of stored values, in steps: what lies outside is clamped to its ends.
///
/// Of whole numbers, each has its own step as far as the type reaches, so nothing is lost. A range of floats is
/// divided into 65535 steps, and a sample counts as the nearest: an error of at most 1/131070 of the range.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Domain {
    kind: SampleKind,
    /// The value of index 0, what one step is, and the last index.
    low: f64,
    step: f64,
    last: u16,
    /// The index of what is not finite.
    padding: u16,
}

impl Domain {
    /// The domain of the samples of `kind` in `[low, high]`, both finite and `low` ≤ `high`; `padding` is what
    /// floats that are not finite count as.
    pub(super) fn new(kind: SampleKind, [low, high]: [f64; 2], padding: f64) -> Self {
        let mut domain = match kind.whole_range() {
            Some([least, most]) => {
                let low = low.floor().clamp(least, most);
                let last = (high.ceil().clamp(least, most) - low) as u16;
                Self { kind, low, step: 1.0, last, padding: 0 }
            }
            None if high > low => {
                Self { kind, low, step: (high - low) / f64::from(u16::MAX), last: u16::MAX, padding: 0 }
            }
            None => Self { kind, low, step: 1.0, last: 0, padding: 0 },
        };
        domain.padding = domain.index(padding);
        domain
    }

    /// The type of the samples.
    pub fn kind(&self) -> SampleKind {
        self.kind
    }

    /// The last index; the first is 0.
    pub fn last(&self) -> u16 {
        self.last
    }

    /// What one step of the index is, in stored units.
    pub fn step(&self) -> f64 {
        self.step
    }

    /// The value that an index stands for.
    pub fn value(&self, index: u16) -> f64 {
        self.low + f64::from(index) * self.step
    }

    /// The index of a stored value. It never falls where the value rises.
    pub(super) fn index(&self, value: f64) -> u16 {
        let mut index = [0];
        match self.kind {
            SampleKind::F32 => self.indices_f32(&[value as f32], &mut index),
            _ => index[0] = (value - self.low).round().clamp(0.0, f64::from(self.last)) as u16,
        }
        index[0]
    }

    #[inline(always)]
    pub(super) fn indices_u8(&self, samples: &[u8], out: &mut [u16]) {
        let (low, high) = (self.low as u8, (self.low as u16 + self.last) as u8);
        for (out, sample) in out.iter_mut().zip(samples) {
            *out = u16::from((*sample).max(low).min(high) - low);
        }
    }

    #[inline(always)]
    pub(super) fn indices_i16(&self, samples: &[i16], out: &mut [u16]) {
        let low = self.low as i16;
        let high = low.wrapping_add_unsigned(self.last);
        for (out, sample) in out.iter_mut().zip(samples) {
            *out = (*sample).max(low).min(high).wrapping_sub(low) as u16;
        }
    }

    #[inline(always)]
    pub(super) fn indices_u16(&self, samples: &[u16], out: &mut [u16]) {
        let low = self.low as u16;
        let high = low + self.last;
        for (out, sample) in out.iter_mut().zip(samples) {
            *out = (*sample).max(low).min(high) - low;
        }
    }

    #[inline(always)]
    pub(super) fn indices_f32(&self, samples: &[f32], out: &mut [u16]) {
        let (low, per_unit, last) = (self.low as f32, (1.0 / self.step) as f32, f32::from(self.last));
        for (out, sample) in out.iter_mut().zip(samples) {
            let place = (sample - low) * per_unit;
            let place = if place > 0.0 { place } else { 0.0 };
            let place = if place < last { place } else { last };
            let index = (place + ROUND).to_bits() as u16;
            *out = if sample.is_finite() { index } else { self.padding };
        }
    }
}
