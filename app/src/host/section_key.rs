//! What the picture of a section depends on: it is drawn anew only where that changed.

use std::sync::Arc;

use render::scene::{CellItem, Piece};
use render::section::{Layer, Section, Window};
use render::volume::cells::Scalar;
use render::volume::{Affine, Transfer};

use crate::sections::ShownGrid;

/// All of it; samples and cells by the address of their grid, which is never changed.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Key {
    section: Section,
    layers: Vec<LayerKey>,
    grids: Vec<GridKey>,
}

impl Key {
    pub(super) fn of(section: Section, layers: &[Layer], grids: &[ShownGrid]) -> Self {
        Self {
            section,
            layers: layers.iter().map(LayerKey::of).collect(),
            grids: grids.iter().map(|shown| GridKey::of(&shown.item)).collect(),
        }
    }
}

#[derive(Debug, Clone, PartialEq)]
struct LayerKey {
    grid: usize,
    pose: Affine,
    pieces: Vec<Piece>,
    window: Window,
    weight: f64,
    /// The address of the labels' grid, and their colours.
    labels: Option<(usize, Arc<[[f64; 4]]>)>,
}

impl LayerKey {
    fn of(layer: &Layer) -> Self {
        Self {
            grid: Arc::as_ptr(&layer.grid) as usize,
            pose: layer.pose,
            pieces: layer.pieces.clone(),
            window: layer.window,
            weight: layer.weight,
            labels: layer.labels.as_ref().map(|l| (Arc::as_ptr(&l.grid) as usize, Arc::clone(&l.colors))),
        }
    }
}

#[derive(Debug, Clone, PartialEq)]
struct GridKey {
    grid: usize,
    step: usize,
    scalar: Scalar,
    pose: Affine,
    transfer: Arc<Transfer>,
}

impl GridKey {
    fn of(item: &CellItem) -> Self {
        Self {
            grid: Arc::as_ptr(&item.grid) as usize,
            step: item.step,
            scalar: item.scalar.clone(),
            pose: item.pose,
            transfer: Arc::clone(&item.transfer),
        }
    }
}
