//! What all block formats share.

/// Voxels of a block.
pub(super) const TEXELS: usize = 16;
