//! Where in the picture, and how deep, a piece may show anything: for each tile of pixels the least and the greatest
//! zeta of the bricks before it that are not clear.

use rayon::prelude::*;

use super::line::Rays;
use super::piece::Placed;
use crate::volume::Point;

/// Pixels along the side of a tile.
pub(super) const TILE: usize = 8;

/// The depths of a piece, tile by tile; empty ranges where it shows nothing.
#[derive(Debug)]
pub(super) struct Depths {
    ranges: Vec<[f32; 2]>,
    across: usize,
    /// Tiles in which the piece shows anything.
    pub(super) shown: usize,
}

/// Room around a box, so that rounding takes nothing away; pixels.
const ROOM: f64 = 1e-3;
/// The same in depth, as a part of the shortest side of a voxel and of the depth itself, which is kept in `f32`.
const DEEP: f64 = 1e-6;

impl Depths {
    pub(super) fn new(placed: &Placed<'_>, rays: &Rays, size: [u32; 2]) -> Self {
        let [across, down] = size.map(|n| (n as usize).div_ceil(TILE));
        let extent = placed.volume.field.grid().extent();
        let boxes: Vec<([usize; 4], [f32; 2])> = placed
            .volume
            .occupancy
            .groups
            .par_iter()
            .with_min_len(64)
            .filter_map(|cells| {
                let [low, high] = [0, 1].map(|end: usize| {
                    [0, 1, 2].map(|a: usize| f64::from(cells[end][a]).clamp(-0.5, extent[a] as f64 - 0.5))
                });
                let corners: [Point; 8] = std::array::from_fn(|c| {
                    let at = [0, 1, 2].map(|a: usize| if c >> a & 1 == 1 { high[a] } else { low[a] });
                    placed.view_from_voxel.point(&Point::from(at))
                });
                let far = corners.iter().map(|p| p.z).fold(f64::NEG_INFINITY, f64::max);
                if far < 0.0 || placed.misses(&corners) {
                    return None;
                }
                let near = corners.iter().map(|p| p.z).fold(f64::INFINITY, f64::min);
                let room = DEEP * (placed.voxel_mm + (far - rays.near_mm).abs());
                let range =
                    [near.max(0.0) - rays.near_mm - room, far - rays.near_mm + room].map(|z| z as f32);
                let mut place = [f64::INFINITY, f64::INFINITY, f64::NEG_INFINITY, f64::NEG_INFINITY];
                for corner in &corners {
                    let Some(lens) = rays.lens_of(&corner.coords) else {
                        // Part of the box is behind the eye: it may be anywhere.
                        return Some(([0, 0, across - 1, down - 1], range));
                    };
                    let [x, y] = rays.pixel(lens);
                    place = [place[0].min(x), place[1].min(y), place[2].max(x), place[3].max(y)];
                }
                let tile = |v: f64, last: usize| ((v / TILE as f64).max(0.0) as usize).min(last);
                let [x0, y0, x1, y1] = place;
                if x1 < -ROOM || y1 < -ROOM || x0 > f64::from(size[0]) || y0 > f64::from(size[1]) {
                    return None;
                }
                let first = [tile(x0 - ROOM, across - 1), tile(y0 - ROOM, down - 1)];
                let last = [tile(x1 + ROOM, across - 1), tile(y1 + ROOM, down - 1)];
                Some(([first[0], first[1], last[0], last[1]], range))
            })
            .collect();
        let mut ranges = vec![[f32::INFINITY, f32::NEG_INFINITY]; across * down];
        for ([x0, y0, x1, y1], [near, far]) in boxes {
            for row in ranges.chunks_exact_mut(across).take(y1 + 1).skip(y0) {
                for range in &mut row[x0..=x1] {
                    *range = [range[0].min(near), range[1].max(far)];
                }
            }
        }
        let shown = ranges.iter().filter(|r| r[0] < r[1]).count();
        Self { ranges, across, shown }
    }

    /// The range of a tile, zeta.
    pub(super) fn tile(&self, x: usize, y: usize) -> [f32; 2] {
        self.ranges[y * self.across + x]
    }
}
