//! Codecs on samples and bytes: block textures of volumes, and the KTX2 file that carries them.
//!
//! The crate knows arrays and bytes, and nothing of space, GPUs, windows or medicine. A volume is a slice of
//! samples and an [`Extent3`]; its order is `[x, y, z]`, x fastest.
//!
//! | codec | block | bits per voxel | lossless? | channels | status |
//! |---|---|---|---|---|---|
//! | [`BlockFormat::Bc1`] | 4×4×1 voxels in 8 bytes | 4 | no | R, G, B (opaque) | encoder and decoder |
//! | [`BlockFormat::Bc3`] | 4×4×1 voxels in 16 bytes | 8 | no | R, G, B, A | encoder and decoder |
//! | [`BlockFormat::Bc4`] | 4×4×1 voxels in 8 bytes | 4 | no | one, 8-bit | encoder and decoder |
//! | [`ktx2`], zstd inside | the whole level | by content | yes | those of its format | writer and reader |
//!
//! How they go together: [`texture::Source`] turns the samples of a scan into blocks, through a transfer function or
//! a window, and [`bc::encode_volume`] does so with texels; [`ktx2::write()`] puts blocks into a file,
//! [`ktx2::read()`] checks a file and gives them back, [`bc::decode_volume`] makes samples of them again, and
//! [`quality::compare`] says what was lost. What a lossy codec loses is always measured against the samples
//! that were given to it.
//!
//! # References
//! - *KDFS*: The Khronos Group, "Khronos Data Format Specification", version 1.4. Chapter "S3TC Compressed Texture
//!   Image Formats" defines BC1 and BC3, chapter "RGTC Compressed Texture Image Formats" BC4; the data format
//!   descriptor of a KTX2 file is defined there too.
//! - *KTX2*: The Khronos Group, "KTX File Format Specification", version 2.0, document revision 4.
//! - *RFC 8878*: Y. Collet, M. Kucherawy, "Zstandard Compression and the 'application/zstd' Media Type", 2021.
//! - *Doi*: the 4×4×4 work unit of [`bc`] follows Doi's encoder of volumes in DXT5 (BC3).

pub mod bc;
mod extent;
pub mod ktx2;
mod limits;
pub mod quality;
mod simd;
pub mod texture;

pub use bc::BlockFormat;
pub use extent::{Extent3, ExtentError};
pub use limits::Limits;
