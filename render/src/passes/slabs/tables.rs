//! Transfer functions as `slabs.wgsl` reads them, kept from frame to frame.

use std::sync::Arc;

use crate::gpu::Gpu;
use crate::transfer::{Extinction, Node, Parts, Table};
use crate::volume::Transfer;

/// Nodes beside the first; with it as many as the texture is wide.
const NODES: usize = 4095;
/// Texels from one side of the texture to the other.
const WIDTH: u32 = NODES as u32 + 1;
/// Rows of a table: of texels of 128 bits, what `look` in `slabs.wgsl` takes them for.
const ROWS: u32 = 4;

/// One transfer function over the values of one volume.
#[derive(Debug)]
pub(crate) struct GpuTable {
    /// Value from one node to the next.
    pub(crate) step: f64,
    /// Position of the value 0.
    pub(crate) origin: f64,
    /// First of its rows.
    pub(crate) row: u32,
    /// What a 1 of 16 bits stands for: of the sums' rest, and of rises.
    pub(crate) rest_scale: f32,
    pub(crate) rise_scale: f32,
}

#[derive(Debug)]
struct Kept {
    transfer: Arc<Transfer>,
    range: [f64; 2],
    table: Arc<GpuTable>,
    used: bool,
}

/// The tables of the volumes that were drawn last, in one texture.
#[derive(Debug, Default)]
pub(crate) struct TableCache {
    kept: Vec<Kept>,
    texels: Vec<[u32; 4]>,
    jumps: bool,
    sent: Option<wgpu::TextureView>,
}

impl TableCache {
    /// Begins a frame: where the one before did not use a table, all are made anew.
    pub(crate) fn begin(&mut self) {
        if self.kept.iter().any(|k| !k.used) {
            *self = Self::default();
        }
        for kept in &mut self.kept {
            kept.used = false;
        }
    }

    /// The table of a function over the values between `range[0]` and `range[1]`.
    pub(crate) fn get(&mut self, transfer: &Arc<Transfer>, range: [f64; 2]) -> Arc<GpuTable> {
        let same = |k: &&mut Kept| k.range == range && Transfer::same(&k.transfer, transfer);
        if let Some(found) = self.kept.iter_mut().find(same) {
            found.used = true;
            return Arc::clone(&found.table);
        }
        let made = Table::new(transfer, range, NODES);
        let row = self.kept.len() as u32 * ROWS;
        let packed: Vec<Packed> = made.nodes.iter().map(Packed::new).collect();
        let largest = |of: fn(&Packed) -> [f32; 4]| {
            packed.iter().flat_map(of).fold(f32::MIN_POSITIVE, |most, v| most.max(v.abs()))
        };
        let (rest_scale, rise_scale) = (largest(|p| p.rest), largest(|p| p.rise));
        let texels = packed.iter().map(|p| p.texels(rest_scale, rise_scale)).collect::<Vec<_>>();
        for part in 0..ROWS as usize {
            self.texels.extend(texels.iter().map(|t| t[part]));
        }
        self.jumps |= packed.iter().any(|p| p.jump.is_some());
        self.sent = None;
        let (step, origin) = (made.step, made.position(0.0));
        let table = Arc::new(GpuTable { step, origin, row, rest_scale, rise_scale });
        let (transfer, kept) = (Arc::clone(transfer), Arc::clone(&table));
        self.kept.push(Kept { transfer, range, table: kept, used: true });
        table
    }

    /// Whether any of the functions jumps.
    pub(crate) fn has_jumps(&self) -> bool {
        self.jumps
    }

    /// All tables on the device.
    pub(crate) fn texture(&mut self, gpu: &Gpu) -> wgpu::TextureView {
        self.sent.get_or_insert_with(|| send(gpu, &self.texels)).clone()
    }
}

fn send(gpu: &Gpu, texels: &[[u32; 4]]) -> wgpu::TextureView {
    let height = (texels.len() as u32 / WIDTH).max(1);
    let texture = gpu.device.create_texture(&wgpu::TextureDescriptor {
        label: Some("slabs.tables"),
        size: wgpu::Extent3d { width: WIDTH, height, depth_or_array_layers: 1 },
        mip_level_count: 1,
        sample_count: 1,
        dimension: wgpu::TextureDimension::D2,
        format: wgpu::TextureFormat::Rgba32Uint,
        usage: wgpu::TextureUsages::TEXTURE_BINDING | wgpu::TextureUsages::COPY_DST,
        view_formats: &[],
    });
    if !texels.is_empty() {
        gpu.queue.write_texture(
            texture.as_image_copy(),
            bytemuck::cast_slice(texels),
            wgpu::TexelCopyBufferLayout {
                offset: 0,
                bytes_per_row: Some(WIDTH * 16),
                rows_per_image: Some(height),
            },
            texture.size(),
        );
    }
    texture.create_view(&wgpu::TextureViewDescriptor::default())
}

/// A node in single precision. Of several jumps within it, the largest stands for all, and a line for its bends; the sums
/// stay right.
struct Packed {
    /// Antiderivative at its begin: rounded, and what that left.
    sum: [f32; 4],
    rest: [f32; 4],
    /// Extinction without a jump: its mean, and its rise from begin to end.
    level: [f32; 4],
    rise: [f32; 4],
    /// With one: where it is, 0 to 1, and what extinction is after it; `level` is what it is before.
    jump: Option<(f32, [f32; 4])>,
}

impl Packed {
    fn new(node: &Node) -> Self {
        let sum = node.sum.map(|s| s as f32);
        let rest = std::array::from_fn(|c| (node.sum[c] - f64::from(sum[c])) as f32);
        let narrow = |e: Extinction| e.map(|v| v as f32);
        let (mut level, mut rise, mut jump) = (narrow(node.parts.mean([0.0, 1.0])), [0.0; 4], None);
        match &node.parts {
            Parts::Whole([from, to]) => rise = std::array::from_fn(|c| (to[c] - from[c]) as f32),
            Parts::Bends(parts) => {
                let [from, to] = [parts[0].ends[0], parts[parts.len() - 1].ends[1]].map(narrow);
                // A line of the same mean that is nowhere below nothing.
                rise = std::array::from_fn(|c| (to[c] - from[c]).max(-2.0 * level[c]).min(2.0 * level[c]));
            }
            Parts::Jumps(parts) => {
                let height = |i: &usize| (parts[i + 1].ends[0][3] - parts[*i].ends[1][3]).abs();
                let largest = (0..parts.len() - 1).max_by(|a, b| height(a).total_cmp(&height(b)));
                if let Some(split) = largest.map(|i| parts[i].end) {
                    level = narrow(node.parts.mean([0.0, split]));
                    jump = Some((split as f32, narrow(node.parts.mean([split, 1.0]))));
                }
            }
        }
        Self { sum, rest, level, rise, jump }
    }

    fn texels(&self, rest_scale: f32, rise_scale: f32) -> [[u32; 4]; ROWS as usize] {
        let pair = |low: u16, high: u16| u32::from(low) | u32::from(high) << 16;
        let rest = self.rest.map(|v| (v / rest_scale * 32767.0).round() as i16 as u16);
        let rise = self.rise.map(|v| half::f16::from_f32(v / rise_scale).to_bits());
        let mut fine =
            [pair(rest[0], rest[1]), pair(rest[2], rest[3]), pair(rise[0], rise[1]), pair(rise[2], rise[3])];
        let mut level = self.level.map(f32::to_bits);
        let mut after = [0; 4];
        if let Some((split, extinction)) = self.jump {
            // The sign says that there is one: extinction has none.
            level[3] |= 1 << 31;
            (fine[2], fine[3]) = (split.to_bits(), 0);
            after = extinction.map(f32::to_bits);
        }
        [self.sum.map(f32::to_bits), level, fine, after]
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::volume::ControlPoint;

    fn function(points: &[(f64, f64)]) -> Arc<Transfer> {
        let points = points.iter().map(|&(value, a)| ControlPoint { value, rgba: [1.0, 0.25, 0.0, a] });
        Arc::new(Transfer::new(points.collect(), 1.0).expect("transfer"))
    }

    #[test]
    fn faint_values_after_a_dense_stretch_keep_their_digits() {
        let transfer = function(&[(-1000.0, 0.9), (0.0, 0.0), (3000.0, 0.001)]);
        let mut cache = TableCache::default();
        let table = cache.get(&transfer, [-1e9, 1e9]);
        let whole = |j: usize| {
            let rest = (cache.texels[2 * WIDTH as usize + j][1] >> 16) as u16 as i16;
            let sum = f32::from_bits(cache.texels[j][3]);
            f64::from(sum) + f64::from(rest) / 32767.0 * f64::from(table.rest_scale)
        };
        let mean = (whole(3005) - whole(3000)) / 5.0;
        let truth = transfer.extinction_of(transfer.rgba((3002.5 - table.origin) * table.step)[3]);
        assert!((mean / truth - 1.0).abs() < 1e-6, "{mean} is not {truth}");
    }

    #[test]
    fn tables_are_made_once_and_forgotten_when_unused() {
        let [a, b] = [function(&[(0.0, 0.1)]), function(&[(0.0, 0.2)])];
        let mut cache = TableCache::default();
        cache.begin();
        let [first, second] = [cache.get(&a, [0.0, 1.0]), cache.get(&b, [0.0, 1.0])];
        assert_eq!([first.row, second.row], [0, ROWS], "one after the other");
        cache.begin();
        let equal = function(&[(0.0, 0.2)]);
        assert!(Arc::ptr_eq(&second, &cache.get(&equal, [0.0, 1.0])), "an equal function is the same");
        cache.begin();
        assert_eq!(cache.get(&b, [0.0, 1.0]).row, 0, "the unused one is gone");
    }
}
