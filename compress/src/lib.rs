//! Codecs on samples and bytes: block textures of volumes and of series of them, and the KTX2 file of a texture.
//!
//! The crate knows arrays and bytes, and nothing of space, GPUs, windows or medicine. A volume is a slice of
//! samples and an [`Extent3`]; its order is `[x, y, z]`, x fastest.
//!
//! | codec | block | bits per voxel | lossless? | channels | status |
//! |---|---|---|---|---|---|
//! | [`BlockFormat::Bc1`] | 4×4×1 voxels in 8 bytes | 4 | no | R, G, B (opaque) | encoder and decoder |
//! | [`BlockFormat::Bc3`] | 4×4×1 voxels in 16 bytes | 8 | no | R, G, B, A | encoder and decoder |
//! | [`BlockFormat::Bc4`] | 4×4×1 voxels in 8 bytes | 4 | no | one, 8-bit | encoder and decoder |
//! | [`BlockFormat::Bc5`] | 4×4×1 voxels in 16 bytes | 8 | no | two, 8-bit, or one in [two planes](bc::two_plane) | encoder and decoder |
//! | [`BlockFormat::Bc7`] | 4×4×1 voxels in 16 bytes | 8 | no | R, G, B, A | encoder and decoder |
//! | [`pvtc`] <S, T> | 4×4×S voxels, T steps in 4 + 4·S bytes | 8·(4 + 4·S)/(16·S·T) | no | one, 8-bit, over time | encoders and decoder |
//! | [`pvtc::packed`], TE and SE | 4×4×1 texels, three samples each, in 8 bytes | 4/3 | no | one, 8-bit, over time | encoder and decoder |
//! | [`lossless`]: LZO, LZ4, zstd | a chunk of a series | by content | yes | any bytes | packer and unpacker |
//! | [`ktx2`], zstd inside | the whole level | by content | yes | those of its format | writer and reader |
//!
//! How they go together: [`texture::Source`] turns the samples of a scan into blocks, through a transfer function or
//! a window, and [`bc::encode_volume`] does so with texels; [`ktx2::write()`] puts blocks into a file,
//! [`ktx2::read()`] checks a file and gives them back, [`bc::decode_volume`] makes samples of them again, and
//! [`quality::compare`] says what was lost. A series goes through [`pvtc`] and [`lossless`] into the file of
//! [`container`], and comes back through [`stream`], ahead of its player. What a lossy codec loses is always measured against the samples
//! that were given to it.
//!
//! # References
//! - *KDFS*: The Khronos Group, "Khronos Data Format Specification", version 1.4. Chapter "S3TC Compressed Texture
//!   Image Formats" defines BC1 and BC3, chapter "RGTC Compressed Texture Image Formats" BC4 and BC5,
//!   chapter "BPTC Compressed Texture Image Formats" BC7; the data format descriptor of a KTX2 file is defined there too.
//! - *KTX2*: The Khronos Group, "KTX File Format Specification", version 2.0, document revision 4.
//! - *RFC 8878*: Y. Collet, M. Kucherawy, "Zstandard Compression and the 'application/zstd' Media Type", 2021.
//! - *Yamada*: M. Yamada, F. Ino, K. Hagihara, "Lossy Compression Method for Controlling Rendering Speed of
//!   Time-Varying Volume" (in Japanese), about 2011: the layouts <S, T> of [`pvtc`].
//! - *Nagayasu*: D. Nagayasu, F. Ino, K. Hagihara, "Performance and Image Quality Evaluation of Two-Stage Compression
//!   Method for Accelerating GPU-Based Volume Rendering of Time-Varying Data" (in Japanese), 2006: PVTC-TE and PVTC-SE.
//! - *LZO*: "LZO stream format as understood by Linux's LZO decompressor", Linux kernel documentation.
//! - *LZ4*: Y. Collet, "LZ4 Block Format Description", 2022.
//! - *Doi*: the 4×4×4 work unit of [`bc`] follows Doi's encoder of volumes in DXT5 (BC3).

pub mod bc;
pub mod container;
mod extent;
pub mod ktx2;
mod limits;
pub mod lossless;
pub mod pvtc;
pub mod quality;
mod simd;
pub mod stream;
pub mod texture;

pub use bc::BlockFormat;
pub use extent::{Extent3, ExtentError};
pub use limits::Limits;
