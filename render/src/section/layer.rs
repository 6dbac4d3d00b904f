//! A volume as a section shows it, and what is asked of it at one place.

use std::sync::Arc;

use super::Window;
use crate::scene::{Labels, Piece};
use crate::volume::{Affine, Body, Grid, Point, label_at};

/// A volume as a section shows it.
#[derive(Debug, Clone)]
pub struct Layer {
    /// Its samples, as loaded.
    pub grid: Arc<Grid>,
    /// `world_from_patient`, as in [`crate::scene::VolumeItem`].
    pub pose: Affine,
    /// The pieces to show; none shows nothing.
    pub pieces: Vec<Piece>,
    /// What is black and what is white.
    pub window: Window,
    /// Display colour of white; 0 to 1.
    pub color: [f64; 3],
    /// How much it counts where other layers have a value too, 0 or more; with 0 it is not seen.
    pub weight: f64,
    /// What is painted on it.
    pub labels: Option<Labels>,
}

/// What one piece needs per pixel, prepared once.
pub(super) struct Prepared {
    /// The bodies of the cutters, and whether their inside is kept.
    pub(super) keep: Vec<(Body, bool)>,
    pub(super) unmoved_from_world: Affine,
    pub(super) voxel_from_world: Affine,
    /// To the voxels of the labels, where there are any.
    pub(super) label_from_world: Option<Affine>,
}

impl Layer {
    pub(super) fn prepare(&self) -> Vec<Prepared> {
        let voxel_from_unmoved = (self.pose * *self.grid.world_from_voxel()).inverse();
        let label_from_unmoved =
            self.labels.as_ref().map(|l| (l.pose * *l.grid.world_from_voxel()).inverse());
        let prepare = |piece: &Piece| {
            let unmoved_from_world = piece.pose.inverse();
            Prepared {
                keep: piece.keep.iter().map(|(cutter, side)| cutter.solid(*side)).collect(),
                unmoved_from_world,
                voxel_from_world: voxel_from_unmoved * unmoved_from_world,
                label_from_world: label_from_unmoved.map(|label| label * unmoved_from_world),
            }
        };
        self.pieces.iter().map(prepare).collect()
    }

    /// The value at a world place, of the last piece that lies there; `None` where none does.
    pub fn value(&self, p: &Point) -> Option<f64> {
        self.at(p).map(|(_, value)| value)
    }

    /// The label at a world place, of the last piece that lies there; 0 where there is none.
    pub fn label(&self, p: &Point) -> u32 {
        let (Some(labels), Some((piece, _))) = (&self.labels, self.at(p)) else { return 0 };
        let label_from_world = self.prepare()[piece].label_from_world;
        label_from_world.map_or(0, |affine| label_at(&labels.grid, &affine.point(p)))
    }

    /// The piece that is seen at a world place, by its position in [`Layer::pieces`].
    pub fn piece_at(&self, p: &Point) -> Option<usize> {
        self.at(p).map(|(piece, _)| piece)
    }

    fn at(&self, p: &Point) -> Option<(usize, f64)> {
        self.prepare().iter().enumerate().rev().find_map(|(index, piece)| {
            // The box is the cheaper question, so it comes first.
            let value = self.grid.sample(&piece.voxel_from_world.point(p))?;
            let unmoved = piece.unmoved_from_world.point(p);
            let kept = piece.keep.iter().all(|(body, inside)| body.holds(&unmoved) == *inside);
            kept.then_some((index, value))
        })
    }
}
