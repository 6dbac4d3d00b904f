//! A step of a series file as the renderer takes it.

use compress::container::{Figures, Header, StepCodec};
use compress::pvtc::packed::Packing;
use render::volume::{Affine, PackedError, PackedFormat, PackedStep, Rescale, SharedBytes, SpaceError};
use thiserror::Error;

/// Why a header and its bytes are not a step that can be drawn.
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum StepError {
    /// The place in the world is none.
    #[error("its place in the world cannot be: {0}")]
    Place(#[from] SpaceError),
    /// The bytes are not those of a step.
    #[error(transparent)]
    Packed(#[from] PackedError),
}

/// The renderer's name for a codec.
pub fn format_of(codec: StepCodec) -> PackedFormat {
    match codec {
        StepCodec::Raw8 => PackedFormat::R8,
        StepCodec::Raw16 => PackedFormat::R16,
        StepCodec::Pvtc(layout) => PackedFormat::Pvtc { s: layout.s(), t: layout.t() },
        StepCodec::Packed(Packing::Te) => PackedFormat::Te,
        StepCodec::Packed(Packing::Se) => PackedFormat::Se,
    }
}

/// Step `within` (from 0) of a chunk's payload.
///
/// # Errors
/// [`StepError`] for a header that no volume has, or a payload of another length.
pub fn packed_step(
    header: &Header,
    figures: Figures,
    payload: SharedBytes,
    within: usize,
) -> Result<PackedStep, StepError> {
    let place = Affine::from_row_major(&header.world_from_voxel)?;
    let rescale = Rescale { slope: header.value_scale, intercept: header.value_offset };
    let extent = header.extent.sizes().map(|n| n as usize);
    let step = PackedStep::new(format_of(header.codec), extent, place, rescale, payload, within)?;
    let lossless = figures.largest_error == Some(0.0);
    let psnr_db = figures.psnr_db.unwrap_or(if lossless { f64::INFINITY } else { f64::NAN });
    Ok(step.with_error(figures.largest_error.unwrap_or(f64::NAN), psnr_db))
}
