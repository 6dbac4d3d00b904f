//! From layers to values and to a picture, row by row on all cores.

use rayon::prelude::*;

use super::cells::cell_values;
use super::layer::{Layer, Prepared};
use super::stations::{Gathered, Station, stations};
use super::sweep::{Row, sweep};
use super::{Section, SlabMode};
use crate::scene::CellItem;
use crate::volume::label_at;

/// A layer ready for rows.
struct Ready<'a> {
    layer: &'a Layer,
    pieces: Vec<(Prepared, Vec<Station>)>,
}

impl<'a> Ready<'a> {
    fn of(section: &Section, layer: &'a Layer) -> Self {
        let extent = layer.grid.extent();
        let with_stations = |piece: Prepared| {
            let stations = stations(section, &piece.voxel_from_world, extent);
            (piece, stations)
        };
        Self { layer, pieces: layer.prepare().into_iter().map(with_stations).collect() }
    }

    /// The values of row `j`; NaN where there is nothing.
    fn values(&self, section: &Section, j: usize, kept: &mut [bool], row: &mut [f64]) {
        let grid = &self.layer.grid;
        if section.slab.thickness_mm == 0.0 {
            row.fill(f64::NAN);
            for (piece, _) in &self.pieces {
                sweep(grid, piece, &Row::of(section, j, 0.0), kept, |i, value| row[i] = value);
            }
            return;
        }
        // One loop for each mode, so that the innermost asks no question.
        match section.slab.mode {
            SlabMode::Mean => self.gather(section, j, kept, row, |g, v, w| g.take(SlabMode::Mean, v, w)),
            SlabMode::Mip => self.gather(section, j, kept, row, |g, v, w| g.take(SlabMode::Mip, v, w)),
            SlabMode::MinIp => self.gather(section, j, kept, row, |g, v, w| g.take(SlabMode::MinIp, v, w)),
        }
    }

    fn gather(
        &self,
        section: &Section,
        j: usize,
        kept: &mut [bool],
        row: &mut [f64],
        take: impl Fn(&mut Gathered, f64, f64),
    ) {
        let mut gathered = vec![Gathered::NOTHING; row.len()];
        for (piece, stations) in &self.pieces {
            for station in stations {
                let places = Row::of(section, j, station.offset_mm);
                sweep(&self.layer.grid, piece, &places, kept, |i, value| {
                    take(&mut gathered[i], value, station.weight);
                });
            }
        }
        for (slot, gathered) in row.iter_mut().zip(gathered) {
            *slot = gathered.result(section.slab.mode);
        }
    }

    /// The paint of row `j` in the middle plane, of the last piece that lies there.
    fn paint(&self, section: &Section, j: usize, kept: &mut [bool], row: &mut [Option<[f64; 4]>]) {
        row.fill(None);
        let Some(labels) = &self.layer.labels else { return };
        let places = Row::of(section, j, 0.0);
        for (piece, _) in &self.pieces {
            let Some(label_from_world) = &piece.label_from_world else { continue };
            let in_labels = places.in_space(label_from_world);
            sweep(&self.layer.grid, piece, &places, kept, |i, _| {
                row[i] = labels.color(label_at(&labels.grid, &in_labels.at(i)));
            });
        }
    }
}

/// The values of one layer, row by row from the top; NaN where there is nothing.
pub fn values(section: &Section, layer: &Layer) -> Vec<f64> {
    let [width, _] = section.size;
    let ready = Ready::of(section, layer);
    let mut values = vec![f64::NAN; section.size.iter().product()];
    values.par_chunks_mut(width).enumerate().for_each(|(j, row)| {
        ready.values(section, j, &mut vec![false; width], row);
    });
    values
}

/// The picture of all layers and grids: opaque RGBA, 4 bytes a pixel, rows from the top.
///
/// Each pixel is the mean by weight of those that have a value there, over `background` (display values, 0 to 1). A grid
/// counts as a layer of weight 1 where its transfer function is not clear.
pub fn picture(section: &Section, layers: &[Layer], grids: &[CellItem], background: [f64; 3]) -> Vec<u8> {
    let [width, height] = section.size;
    let ready: Vec<Ready<'_>> =
        layers.iter().filter(|l| l.weight > 0.0).map(|layer| Ready::of(section, layer)).collect();
    let colored: Vec<(&CellItem, Vec<f64>)> =
        grids.iter().map(|item| (item, cell_values(section, item))).collect();
    let mut bytes = vec![255_u8; width * height * 4];
    bytes.par_chunks_mut(width * 4).enumerate().for_each(|(j, bytes)| {
        let mut kept = vec![false; width];
        let (mut row, mut paint) = (vec![f64::NAN; width], vec![None; width]);
        let mut sum = vec![[0.0_f64; 4]; width];
        for ready in &ready {
            let layer = ready.layer;
            ready.values(section, j, &mut kept, &mut row);
            ready.paint(section, j, &mut kept, &mut paint);
            for ((sum, value), paint) in sum.iter_mut().zip(&row).zip(&paint) {
                if value.is_nan() {
                    continue;
                }
                let grey = layer.window.grey(*value);
                for c in 0..3 {
                    let color = layer.color[c] * grey;
                    let painted = paint.map_or(color, |p| (1.0 - p[3]) * color + p[3] * p[c]);
                    sum[c] += layer.weight * painted;
                }
                sum[3] += layer.weight;
            }
        }
        for (item, values) in &colored {
            for (sum, value) in sum.iter_mut().zip(&values[j * width..]).filter(|(_, v)| !v.is_nan()) {
                let [r, g, b, opacity] = item.transfer.rgba(*value);
                if opacity > 0.0 {
                    *sum = [sum[0] + r, sum[1] + g, sum[2] + b, sum[3] + 1.0];
                }
            }
        }
        for (pixel, sum) in bytes.chunks_exact_mut(4).zip(&sum) {
            for c in 0..3 {
                let color = if sum[3] > 0.0 { sum[c] / sum[3] } else { background[c] };
                pixel[c] = (color.clamp(0.0, 1.0) * 255.0).round() as u8;
            }
        }
    });
    bytes
}
