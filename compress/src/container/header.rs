//! The first 512 bytes of a series file.

use super::VERSION;
use super::codec::StepCodec;
use super::fields::{Fields, crc, push_text};
use super::read::ReadError;
use super::write::WriteError;
use crate::Extent3;
use crate::lossless::ByteCodec;

/// Bytes of a header.
pub(super) const HEADER_BYTES: usize = 512;

/// Bytes of a header before its checksum.
const CHECKED_BYTES: usize = HEADER_BYTES - 4;

/// The first 8 bytes of every series file.
pub const IDENTIFIER: [u8; 8] = [0x89, b'O', b'S', b'T', b'\r', b'\n', 0x1A, b'\n'];

/// Most bytes of the texts.
const NAME_BYTES: usize = 128;
const KIND_BYTES: usize = 32;
const UNIT_BYTES: usize = 32;

/// What a series is, as far as it is known before its first step.
#[derive(Debug, Clone, PartialEq)]
pub struct Header {
    /// Size of every step's volume, in voxels.
    pub extent: Extent3,
    /// What the chunks decode to.
    pub codec: StepCodec,
    /// The codec that the second stage was asked for; chunks that it does not make smaller are stored.
    pub byte_codec: ByteCodec,
    /// Value of one unit of what is stored; finite, not 0.
    pub value_scale: f64,
    /// Value of a stored 0: value = offset + scale · stored. Finite.
    pub value_offset: f64,
    /// Steps per second at which the series is meant to be played; finite, > 0.
    pub steps_per_sec: f64,
    /// Takes voxel indices to the world, LPS mm: row-major, affine, finite.
    pub world_from_voxel: [f64; 16],
    /// A name for people, at most 128 bytes, without zero bytes.
    pub name: String,
    /// Kind of the data, such as `CT`: at most 32 bytes, without zero bytes.
    pub kind: String,
    /// Unit of the values, such as `HU`: at most 32 bytes, without zero bytes.
    pub unit: String,
}

impl Header {
    /// A header of stored values as they are, one a second, in a world of voxels of 1 mm, without texts.
    pub fn new(extent: Extent3, codec: StepCodec, byte_codec: ByteCodec) -> Self {
        let mut world_from_voxel = [0.0; 16];
        world_from_voxel.iter_mut().step_by(5).for_each(|diagonal| *diagonal = 1.0);
        Self {
            extent,
            codec,
            byte_codec,
            value_scale: 1.0,
            value_offset: 0.0,
            steps_per_sec: 1.0,
            world_from_voxel,
            name: String::new(),
            kind: String::new(),
            unit: String::new(),
        }
    }

    /// The field that cannot be as it is, if there is one.
    fn fault(&self) -> Option<&'static str> {
        let text = |text: &str, most| text.len() <= most && !text.contains('\0');
        let checks = [
            ("scale", self.value_scale.is_finite() && self.value_scale != 0.0),
            ("offset", self.value_offset.is_finite()),
            ("steps per second", self.steps_per_sec.is_finite() && self.steps_per_sec > 0.0),
            ("world_from_voxel", is_affine(&self.world_from_voxel)),
            ("name", text(&self.name, NAME_BYTES)),
            ("kind", text(&self.kind, KIND_BYTES)),
            ("unit", text(&self.unit, UNIT_BYTES)),
        ];
        checks.into_iter().find(|(_, right)| !right).map(|(field, _)| field)
    }

    /// The header as bytes.
    pub(super) fn to_bytes(&self) -> Result<Vec<u8>, WriteError> {
        if let Some(field) = self.fault() {
            return Err(WriteError::Header { field });
        }
        let mut bytes = Vec::with_capacity(HEADER_BYTES);
        bytes.extend(IDENTIFIER);
        bytes.extend(VERSION.to_le_bytes());
        bytes.extend(512_u32.to_le_bytes());
        for size in self.extent.sizes() {
            bytes.extend(size.to_le_bytes());
        }
        bytes.extend(self.codec.ids());
        bytes.push(self.byte_codec.id());
        let numbers = [self.value_scale, self.value_offset, self.steps_per_sec];
        for number in numbers.iter().chain(&self.world_from_voxel) {
            bytes.extend(number.to_le_bytes());
        }
        push_text(&mut bytes, &self.name, NAME_BYTES);
        push_text(&mut bytes, &self.kind, KIND_BYTES);
        push_text(&mut bytes, &self.unit, UNIT_BYTES);
        bytes.resize(CHECKED_BYTES, 0);
        let checksum = crc(&bytes);
        bytes.extend(checksum.to_le_bytes());
        Ok(bytes)
    }

    /// Checks and reads a header.
    pub(super) fn from_bytes(bytes: &[u8; HEADER_BYTES]) -> Result<Self, ReadError> {
        let mut fields = Fields(bytes);
        if fields.bytes() != IDENTIFIER {
            return Err(ReadError::Identifier);
        }
        let version = fields.u32();
        if version != VERSION {
            return Err(ReadError::Version { found: version });
        }
        let invalid = |field| ReadError::Invalid { part: "header", field };
        let (checked, checksum) = bytes.split_at(CHECKED_BYTES);
        if Fields(checksum).u32() != crc(checked) {
            return Err(ReadError::Checksum { part: "header" });
        }
        if fields.u32() as usize != HEADER_BYTES {
            return Err(invalid("length"));
        }
        let extent = Extent3::new([(); 3].map(|()| fields.u32())).map_err(ReadError::Extent)?;
        let codec = StepCodec::from_ids(fields.bytes()).ok_or(invalid("step codec"))?;
        let [byte_codec] = fields.bytes();
        let header = Self {
            extent,
            codec,
            byte_codec: ByteCodec::from_id(byte_codec).ok_or(invalid("byte codec"))?,
            value_scale: fields.f64(),
            value_offset: fields.f64(),
            steps_per_sec: fields.f64(),
            world_from_voxel: [(); 16].map(|()| fields.f64()),
            name: fields.text(NAME_BYTES).ok_or(invalid("name"))?.to_owned(),
            kind: fields.text(KIND_BYTES).ok_or(invalid("kind"))?.to_owned(),
            unit: fields.text(UNIT_BYTES).ok_or(invalid("unit"))?.to_owned(),
        };
        let reserved = checked.get(376..).unwrap_or_default();
        if reserved.iter().any(|&byte| byte != 0) {
            return Err(invalid("reserved part"));
        }
        match header.fault() {
            Some(field) => Err(invalid(field)),
            None => Ok(header),
        }
    }
}

/// Whether a row-major matrix is finite and takes points to points.
fn is_affine(matrix: &[f64; 16]) -> bool {
    matrix.iter().all(|number| number.is_finite()) && matrix.ends_with(&[0.0, 0.0, 0.0, 1.0])
}
