//! How far a lossy copy is from its original: RMSE, PSNR, largest error, 99.9th percentile.
//!
//! One mean hides what a surgeon may look at, so the four are given together: RMSE and PSNR for the whole, the
//! largest error for the worst voxel, the 99.9th percentile for what is bad but not one freak voxel.

use std::ops::Range;

use rayon::prelude::*;
use thiserror::Error;

/// Samples that one task sums. Fixed, so that the sums do not depend on the number of threads.
const CHUNK: usize = 1 << 16;

/// The share of samples that [`Quality::percentile_999`] covers, in thousandths.
const PERCENTILE_PER_MILLE: u128 = 999;

/// Bins that errors are counted in to find their percentile.
const BINS: usize = 1 << 16;

/// What was lost, in units of the samples unless said otherwise.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Quality {
    /// Root of the mean squared error.
    pub rmse: f64,
    /// Peak signal-to-noise ratio, 20·log10(peak / RMSE), in dB; infinite where nothing was lost.
    pub psnr_db: f64,
    /// The peak that [`Quality::psnr_db`] stands on: 255 for 8-bit samples, or the range of values in use.
    pub peak: f64,
    /// The largest absolute error.
    pub largest: f64,
    /// The 99.9th percentile of the absolute error: the least value that 99.9 % of the samples do not exceed.
    /// Exact for samples that are whole numbers of up to 16 bits, else to 1/32768 of the largest error.
    pub percentile_999: f64,
    /// Samples compared.
    pub samples: usize,
}

/// Why two arrays cannot be compared.
#[derive(Debug, Error, Clone, Copy, PartialEq)]
#[non_exhaustive]
pub enum QualityError {
    /// There are no samples.
    #[error("there is nothing to compare: give at least one sample")]
    Empty,
    /// The two arrays differ in length, or are no whole number of voxels.
    #[error(
        "the copy has {decoded} samples and the original {original}, in voxels of {channels}: give the same volume twice"
    )]
    Length {
        /// Samples of the original.
        original: usize,
        /// Samples of the copy.
        decoded: usize,
        /// Samples of one voxel.
        channels: usize,
    },
    /// The channels asked for are not in a voxel.
    #[error("channels {first}..{end} were asked for, but a voxel has {channels}")]
    Channels {
        /// First channel.
        first: usize,
        /// One past the last channel.
        end: usize,
        /// Samples of one voxel.
        channels: usize,
    },
    /// The peak is not a positive, finite number.
    #[error("a peak of {peak} gives no ratio: give the range of the samples, 255 for 8 bits")]
    Peak {
        /// The peak given.
        peak: f64,
    },
    /// A sample is NaN or infinite, so that no mean is defined.
    #[error("sample {index} is not finite: replace such samples by the padding value first")]
    NotFinite {
        /// Where it is.
        index: usize,
    },
}

/// Compares all samples of `decoded` with `original`; `peak` is what PSNR stands on (255 for 8 bits).
///
/// # Errors
/// Those of [`compare_channels`] but [`QualityError::Channels`].
pub fn compare<T>(original: &[T], decoded: &[T], peak: f64) -> Result<Quality, QualityError>
where
    T: Copy + Into<f64> + Sync,
{
    compare_channels(original, decoded, 1, 0..1, peak)
}

/// Compares some channels of two arrays of voxels, `channels` samples a voxel: `4, 0..3` is the colour of RGBA.
///
/// # Errors
/// [`QualityError::Empty`] without samples; [`QualityError::Length`] if the arrays differ in length or are no
/// whole number of voxels; [`QualityError::Channels`] if `which` is empty or not in a voxel;
/// [`QualityError::Peak`] if `peak` is not positive and finite; [`QualityError::NotFinite`] for a NaN or an
/// infinity.
pub fn compare_channels<T>(
    original: &[T],
    decoded: &[T],
    channels: usize,
    which: Range<usize>,
    peak: f64,
) -> Result<Quality, QualityError>
where
    T: Copy + Into<f64> + Sync,
{
    if original.is_empty() {
        return Err(QualityError::Empty);
    }
    if which.is_empty() || which.end > channels {
        return Err(QualityError::Channels { first: which.start, end: which.end, channels });
    }
    if original.len() != decoded.len() || !original.len().is_multiple_of(channels) {
        return Err(QualityError::Length { original: original.len(), decoded: decoded.len(), channels });
    }
    if !(peak.is_finite() && peak > 0.0) {
        return Err(QualityError::Peak { peak });
    }
    let voxels_per_chunk = (CHUNK / channels).max(1);
    let chunk = voxels_per_chunk * channels;
    let parts = || original.par_chunks(chunk).zip(decoded.par_chunks(chunk)).enumerate();
    let sums: Vec<(f64, f64)> = parts()
        .map(|(part, (original, decoded))| {
            let (mut squares, mut largest) = (0.0, 0.0_f64);
            for (at, error) in errors(original, decoded, channels, &which) {
                if !error.is_finite() {
                    return Err(QualityError::NotFinite { index: part * chunk + at });
                }
                squares += error * error;
                largest = largest.max(error);
            }
            Ok((squares, largest))
        })
        .collect::<Result<_, _>>()?;
    // Summed in order, so that the last bits do not depend on which thread was first.
    let squares: f64 = sums.iter().map(|(squares, _)| squares).sum();
    let largest = sums.iter().map(|(_, largest)| *largest).fold(0.0, f64::max);
    let samples = original.len() / channels * which.len();
    let rmse = (squares / samples as f64).sqrt();

    let per_unit = bins_per_unit(largest);
    let bins = parts()
        .fold(
            || vec![0_u64; BINS],
            |mut bins, (_, (original, decoded))| {
                for (_, error) in errors(original, decoded, channels, &which) {
                    bins[((error * per_unit).round() as usize).min(BINS - 1)] += 1;
                }
                bins
            },
        )
        .reduce(|| vec![0; BINS], |a, b| a.iter().zip(&b).map(|(a, b)| a + b).collect());
    let rank = (samples as u128 * PERCENTILE_PER_MILLE).div_ceil(1000) as u64;
    let mut below = 0;
    let bin = bins.iter().position(|count| {
        below += count;
        below >= rank
    });
    Ok(Quality {
        rmse,
        psnr_db: 20.0 * (peak / rmse).log10(),
        peak,
        largest,
        percentile_999: bin.unwrap_or_default() as f64 / per_unit,
        samples,
    })
}

/// The absolute errors of one part, each with its place in the part.
fn errors<T: Copy + Into<f64>>(
    original: &[T],
    decoded: &[T],
    channels: usize,
    which: &Range<usize>,
) -> impl Iterator<Item = (usize, f64)> {
    let voxels = original.chunks_exact(channels).zip(decoded.chunks_exact(channels)).enumerate();
    voxels.flat_map(move |(voxel, (original, decoded))| {
        which.clone().map(move |channel| {
            let error: f64 = decoded[channel].into() - original[channel].into();
            (voxel * channels + channel, error.abs())
        })
    })
}

/// How many bins one unit of error is divided into, so that `largest` is in the last bin or below. A power of two:
/// whole errors are then counted exactly.
fn bins_per_unit(largest: f64) -> f64 {
    if largest > 0.0 { ((BINS - 1) as f64 / largest).log2().floor().exp2() } else { 1.0 }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_perfect_copy_has_an_infinite_ratio_and_no_error() {
        let quality = compare(&[1_u8, 2, 3], &[1, 2, 3], 255.0).unwrap();
        assert_eq!((quality.rmse, quality.largest), (0.0, 0.0), "no error");
        assert_eq!(quality.psnr_db, f64::INFINITY, "no noise");
    }

    #[test]
    fn the_figures_of_a_known_error_are_those_of_the_definition() {
        // 2000 samples: one off by 10, ten off by 3, the rest right. Mean square = (100 + 90) / 2000 = 0.095.
        let original = vec![100_u8; 2000];
        let mut decoded = original.clone();
        decoded[7] = 110;
        for i in 0..10 {
            decoded[100 + 50 * i] = 97;
        }
        let quality = compare(&original, &decoded, 255.0).unwrap();
        assert!((quality.rmse - 0.095_f64.sqrt()).abs() < 1e-12, "rmse {}", quality.rmse);
        let psnr = 10.0 * (255.0_f64 * 255.0 / 0.095).log10();
        assert!((quality.psnr_db - psnr).abs() < 1e-9, "psnr {} for {psnr}", quality.psnr_db);
        assert_eq!(quality.largest, 10.0, "largest");
        // 99.9 % of 2000 is 1998 samples: the 1998th in order is one of the threes.
        assert_eq!(quality.percentile_999, 3.0, "percentile");
    }

    #[test]
    fn the_percentile_of_fractions_is_that_of_the_sorted_errors() {
        let original = vec![0.0_f64; 20_000];
        let decoded: Vec<f64> = (0..20_000).map(|i| (f64::from(i) * 0.37).sin() * 3.3).collect();
        let mut sorted: Vec<f64> = decoded.iter().map(|value| value.abs()).collect();
        sorted.sort_by(f64::total_cmp);
        let quality = compare(&original, &decoded, 1.0).unwrap();
        assert_eq!(quality.largest, sorted[19_999], "largest");
        let off = (quality.percentile_999 - sorted[19_979]).abs();
        assert!(
            off <= quality.largest / 32_768.0,
            "percentile {}, sorted {}",
            quality.percentile_999,
            sorted[19_979]
        );
    }

    #[test]
    fn only_the_channels_asked_for_are_compared() {
        let original = [10_u8, 20, 30, 40, 10, 20, 30, 40];
        let decoded = [10_u8, 20, 30, 90, 11, 20, 30, 40];
        let colour = compare_channels(&original, &decoded, 4, 0..3, 255.0).unwrap();
        assert_eq!((colour.largest, colour.samples), (1.0, 6), "colour");
        let alpha = compare_channels(&original, &decoded, 4, 3..4, 255.0).unwrap();
        assert_eq!((alpha.largest, alpha.samples), (50.0, 2), "alpha");
    }

    #[test]
    fn what_cannot_be_compared_is_refused_by_name() {
        assert_eq!(compare::<u8>(&[], &[], 255.0), Err(QualityError::Empty), "empty");
        let length = QualityError::Length { original: 2, decoded: 1, channels: 1 };
        assert_eq!(compare(&[1_u8, 2], &[1], 255.0), Err(length), "length");
        assert_eq!(compare(&[1_u8], &[1], 0.0), Err(QualityError::Peak { peak: 0.0 }), "peak");
        let original = [0.0, 1.0, f64::NAN];
        assert_eq!(compare(&original, &original, 1.0), Err(QualityError::NotFinite { index: 2 }), "NaN");
        let channels = QualityError::Channels { first: 3, end: 5, channels: 4 };
        assert_eq!(compare_channels(&[0_u8; 4], &[0; 4], 4, 3..5, 255.0), Err(channels), "channels");
    }
}
