//! How much a reader may allocate for a file that may lie about its size.

/// What a reader of files may spend. A file that asks for more is refused by name before anything is allocated.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Limits {
    /// Most bytes of samples or blocks that one file may unpack to.
    pub decoded_bytes: u64,
}

impl Default for Limits {
    /// 4 GiB: a volume of 1024×1024×2048 voxels of 16 bits, which is more than a clinical scanner makes.
    fn default() -> Self {
        Self { decoded_bytes: 4 << 30 }
    }
}
