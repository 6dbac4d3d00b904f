//! The uncompressed texture: a table look-up, or a sum, for each voxel.

use rayon::prelude::*;

use super::Domain;
use super::table::ColourTable;
use super::volume::Volume;
use super::window::Window;
use crate::simd::{Simd, in_each_kind};

/// Voxels of one task, about.
const TASK_VOXELS: usize = 1 << 15;

/// Voxels whose indices are made at a time, in the first cache.
const PIECE: usize = 1024;

/// What is written of a piece of a row.
trait Write<const N: usize>: Copy + Sync {
    fn domain(&self) -> &Domain;
    fn write(self, indices: &[u16], out: &mut [[u8; N]]);
}

impl Write<4> for &ColourTable {
    fn domain(&self) -> &Domain {
        ColourTable::domain(self)
    }

    #[inline(always)]
    fn write(self, indices: &[u16], out: &mut [[u8; 4]]) {
        let texels = self.texels();
        for (out, index) in out.iter_mut().zip(indices) {
            *out = texels[usize::from(*index)];
        }
    }
}

impl Write<1> for &Window {
    fn domain(&self) -> &Domain {
        Window::domain(self)
    }

    #[inline(always)]
    fn write(self, indices: &[u16], out: &mut [[u8; 1]]) {
        for (out, index) in out.iter_mut().zip(indices) {
            *out = [self.texel(*index)];
        }
    }
}

impl Write<2> for &Window {
    fn domain(&self) -> &Domain {
        Window::domain(self)
    }

    #[inline(always)]
    fn write(self, indices: &[u16], out: &mut [[u8; 2]]) {
        for (out, index) in out.iter_mut().zip(indices) {
            *out = index.to_le_bytes();
        }
    }
}

/// Writes colours: R, G, B, A, one byte each.
pub(super) fn rgba8(volume: &Volume<'_>, table: &ColourTable, simd: Simd, out: &mut [u8]) {
    fill(volume, table, simd, out);
}

/// Writes scalars of 8 bits.
pub(super) fn r8(volume: &Volume<'_>, window: &Window, simd: Simd, out: &mut [u8]) {
    fill::<1>(volume, window, simd, out);
}

/// Writes scalars of 16 bits, little-endian.
pub(super) fn r16(volume: &Volume<'_>, window: &Window, simd: Simd, out: &mut [u8]) {
    fill::<2>(volume, window, simd, out);
}

fn fill<const N: usize>(volume: &Volume<'_>, map: impl Write<N>, simd: Simd, out: &mut [u8]) {
    let row = volume.extent().x();
    let rows = (TASK_VOXELS / row).max(1);
    let (texels, _) = out.as_chunks_mut::<N>();
    texels
        .par_chunks_mut(row * rows)
        .enumerate()
        .for_each(|(i, texels)| write_rows::<N>(volume, map, i * rows, texels, simd));
}

in_each_kind! {
    fn write_rows<const N: usize>(volume: &Volume<'_>, map: impl Write<N>, first: usize, out: &mut [[u8; N]]),
    task(volume, map, first, out)
}

/// Writes some rows of voxels, `first` and those after it.
#[inline(always)]
fn task<const N: usize>(volume: &Volume<'_>, map: impl Write<N>, first: usize, out: &mut [[u8; N]]) {
    let extent = volume.extent();
    let mut indices = [0; PIECE];
    for (i, out) in out.chunks_exact_mut(extent.x()).enumerate() {
        let (y, z) = ((first + i) % extent.y(), (first + i) / extent.y());
        for (piece, out) in out.chunks_mut(PIECE).enumerate() {
            let indices = &mut indices[..out.len()];
            volume.indices(map.domain(), [piece * PIECE, y, z], indices);
            map.write(indices, out);
        }
    }
}
