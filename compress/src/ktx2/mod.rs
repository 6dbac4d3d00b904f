//! KTX2, Khronos's file for textures: one volume of blocks or of plain samples, with or without zstd.
//!
//! [`write()`] makes a file that other KTX2 tools read; [`read()`] reads such files of any writer, checks
//! everything it uses, and allocates nothing that the file's own size and the caller's [`Limits`](crate::Limits)
//! do not cover. A [`Texture`] is what stands between the two.
//!
//! **Kept to:** a 3D texture (`pixelDepth` = slices), not an array, one face, one level, of the formats in
//! [`TextureFormat`]; supercompression none (0) or Zstandard (2), one frame with its checksum. Of a file with
//! more levels the first is read. Data are little-endian, as the standard says.
//!
//! Parts: `dfd` builds and checks the data format descriptor, `write` and `read` are the two ways.
//!
//! Source: *KTX2*, sections "File Structure" to "Mip Level Array"; *KDFS*, chapter "Khronos Data Format
//! Descriptor" for the descriptor.

mod dfd;
mod read;
mod write;

use std::collections::BTreeMap;

pub use read::{ReadError, read};
pub use write::{WriteError, write};

use crate::{BlockFormat, Extent3};

/// Key of the 4×4 matrix that takes voxel indices to the world: 16 numbers, row-major, as text with spaces
/// between. World is DICOM patient space, LPS, mm.
pub const KEY_WORLD_FROM_VOXEL: &str = "osteotome.worldFromVoxel";

/// Key of the values that the stored 0 and 1 stand for (HU in a CT): two numbers, as text with a space between.
pub const KEY_RANGE: &str = "osteotome.range";

/// Key of the program that wrote the file: text. The standard's own.
pub const KEY_WRITER: &str = "KTXwriter";

/// The first 12 bytes of every KTX2 file.
const IDENTIFIER: [u8; 12] = [0xAB, b'K', b'T', b'X', b' ', b'2', b'0', 0xBB, b'\r', b'\n', 0x1A, b'\n'];

/// Bytes of the identifier, the header and the index; the level index begins here.
const HEADER_BYTES: usize = 80;

/// Bytes of one entry of the level index.
const LEVEL_BYTES: usize = 24;

/// The values of `supercompressionScheme` known here.
const SCHEME_NONE: u32 = 0;
const SCHEME_ZSTD: u32 = 2;

/// What the voxels of a texture are. The set is closed.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum TextureFormat {
    /// Blocks of 4×4×1 voxels, as [`crate::bc`] makes them.
    Block(BlockFormat),
    /// One channel of 8 bits, 0…255 standing for 0…1.
    R8,
    /// One channel of 16 bits, little-endian, 0…65535 standing for 0…1.
    R16,
    /// R, G, B, A of 8 bits each.
    Rgba8,
}

impl TextureFormat {
    /// Every format.
    pub const ALL: [Self; 8] = [
        Self::Block(BlockFormat::Bc1),
        Self::Block(BlockFormat::Bc3),
        Self::Block(BlockFormat::Bc4),
        Self::Block(BlockFormat::Bc5),
        Self::Block(BlockFormat::Bc7),
        Self::R8,
        Self::R16,
        Self::Rgba8,
    ];

    /// The number of the format in Vulkan's `VkFormat`.
    pub fn vk_format(self) -> u32 {
        match self {
            Self::Block(BlockFormat::Bc1) => 133, // VK_FORMAT_BC1_RGBA_UNORM_BLOCK
            Self::Block(BlockFormat::Bc3) => 137, // VK_FORMAT_BC3_UNORM_BLOCK
            Self::Block(BlockFormat::Bc4) => 139, // VK_FORMAT_BC4_UNORM_BLOCK
            Self::Block(BlockFormat::Bc5) => 141, // VK_FORMAT_BC5_UNORM_BLOCK
            Self::Block(BlockFormat::Bc7) => 145, // VK_FORMAT_BC7_UNORM_BLOCK
            Self::R8 => 9,                        // VK_FORMAT_R8_UNORM
            Self::R16 => 70,                      // VK_FORMAT_R16_UNORM
            Self::Rgba8 => 37,                    // VK_FORMAT_R8G8B8A8_UNORM
        }
    }

    /// Bytes of one block, or of one voxel where there are no blocks.
    pub fn element_bytes(self) -> usize {
        match self {
            Self::Block(format) => format.block_bytes(),
            Self::R8 => 1,
            Self::R16 => 2,
            Self::Rgba8 => 4,
        }
    }

    /// Bytes of a volume of `extent`.
    pub fn data_len(self, extent: Extent3) -> usize {
        match self {
            Self::Block(format) => format.encoded_len(extent),
            Self::R8 | Self::R16 | Self::Rgba8 => extent.voxels() * self.element_bytes(),
        }
    }

    /// The header's `typeSize`: bytes of the numbers that a big-endian machine must turn round.
    fn type_size(self) -> u32 {
        if self == Self::R16 { 2 } else { 1 }
    }
}

/// How the data are packed in the file.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Supercompression {
    /// As they are.
    None,
    /// One Zstandard frame. Level 1 is fastest; past 9 little is gained on blocks.
    Zstd {
        /// The level of zstd, 1 to 22.
        level: i32,
    },
}

/// One volume, as a file holds it.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Texture {
    /// What the voxels are.
    pub format: TextureFormat,
    /// The volume's size in voxels, without the padding of blocks.
    pub extent: Extent3,
    /// [`TextureFormat::data_len`] bytes: blocks in sliced-3D order, or voxels `[x, y, z]`, x fastest.
    pub data: Vec<u8>,
    /// What else the file says, by key. Text ends with a zero byte: see [`Texture::set_text`]. The map's order, by
    /// bytes of UTF-8, is that of the file, by code points.
    pub entries: BTreeMap<String, Vec<u8>>,
}

impl Texture {
    /// A texture that says nothing else.
    pub fn new(format: TextureFormat, extent: Extent3, data: Vec<u8>) -> Self {
        Self { format, extent, data, entries: BTreeMap::new() }
    }

    /// Sets an entry to a text.
    pub fn set_text(&mut self, key: &str, text: &str) {
        let mut value = text.as_bytes().to_vec();
        value.push(0);
        self.entries.insert(key.to_owned(), value);
    }

    /// An entry's text without the zero byte at its end; `None` if there is no such entry or it is not text.
    pub fn text(&self, key: &str) -> Option<&str> {
        let value = self.entries.get(key)?;
        std::str::from_utf8(value.strip_suffix(&[0]).unwrap_or(value)).ok()
    }
}
