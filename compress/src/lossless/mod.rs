//! The second stage: what a block codec made, or raw samples, packed without loss by a byte codec.
//!
//! A [`Packer`] separates a payload into [`Planes`] of what is alike and packs them with a [`ByteCodec`]; what does
//! not become smaller by a stated part is stored as it is. An [`Unpacker`] does the inverse into a buffer of the
//! caller, so that playing allocates nothing. [`Form`] is what a reader must know of a packed payload, next to its
//! [`Shape`]; its two ids stand in files.
//!
//! Parts: `planes` the separation, `lzo` that codec, `pack` and `unpack` the two ways, [`trial`] what each codec
//! costs and saves.
//!
//! Source: *Nagayasu*, section 3.2.3, whose second stage is LZO on the blocks as they are. Differs: planes, LZ4 and
//! zstd beside LZO, and storing what does not pay, which Nagayasu's section 4.1 found to be needed.

mod lzo;
mod pack;
mod planes;
pub mod trial;
mod unpack;

pub use pack::{PackError, PackOptions, Packed, Packer};
pub use planes::{Planes, Shape};
pub use unpack::{Fault, UnpackError, Unpacker, unpack};

/// How bytes are packed without loss. The set is closed, and the ids stand in files.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum ByteCodec {
    /// As they are.
    Store,
    /// LZO1X: Nagayasu's second stage.
    Lzo,
    /// One LZ4 block, without the frame around it.
    Lz4,
    /// One Zstandard frame.
    Zstd,
}

impl ByteCodec {
    /// All, in the order of their ids.
    pub const ALL: [Self; 4] = [Self::Store, Self::Lzo, Self::Lz4, Self::Zstd];

    /// The id that stands in files.
    pub fn id(self) -> u8 {
        match self {
            Self::Store => 0,
            Self::Lzo => 1,
            Self::Lz4 => 2,
            Self::Zstd => 3,
        }
    }

    /// What `id` stands for; none if nothing.
    pub fn from_id(id: u8) -> Option<Self> {
        Self::ALL.into_iter().find(|codec| codec.id() == id)
    }

    /// A short name: `"store"`, `"lzo"`, `"lz4"`, `"zstd"`.
    pub fn name(self) -> &'static str {
        match self {
            Self::Store => "store",
            Self::Lzo => "lzo",
            Self::Lz4 => "lz4",
            Self::Zstd => "zstd",
        }
    }

    /// What `name` stands for; none if nothing.
    pub fn from_name(name: &str) -> Option<Self> {
        Self::ALL.into_iter().find(|codec| codec.name() == name)
    }
}

/// How a payload was packed: all that a reader must know, next to the payload's [`Shape`].
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub struct Form {
    /// The codec of the bytes.
    pub codec: ByteCodec,
    /// The planes that were given to it.
    pub planes: Planes,
}

impl Form {
    /// A payload as it is.
    pub const STORED: Self = Self { codec: ByteCodec::Store, planes: Planes::AsIs };
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ids_and_names_lead_back_to_their_codec() {
        assert_eq!(ByteCodec::ALL.map(ByteCodec::id), [0, 1, 2, 3], "the ids of the format page");
        for codec in ByteCodec::ALL {
            assert_eq!(ByteCodec::from_id(codec.id()), Some(codec), "id");
            assert_eq!(ByteCodec::from_name(codec.name()), Some(codec), "name");
        }
        assert_eq!(ByteCodec::from_id(4), None, "an id that is not known");
    }
}
