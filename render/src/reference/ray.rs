//! From a pixel to its colour: its ray, and the events along it in order.

use super::cells::{Cells, Linear};
use super::field::Field;
use super::integrate::{DARK, Gathered, Meets};
use super::intervals::Intervals;
use super::modes::Layered;
use super::surface::{Hit, Surfaces};
use super::walk::{Part, Walker};
use super::{Options, ReferenceError};
use crate::scene::{CameraFrame, Projection, Scene, VolumeMode};
use crate::volume::Vector;

/// The volumes of a scene, ready for rays; none for those without pieces.
pub(super) fn fields<'a>(scene: &'a Scene, options: Options) -> Vec<Option<Field<'a>>> {
    let field = |item: &'a crate::scene::VolumeItem| {
        let skip_empty = options.skip_empty && item.mode == VolumeMode::Composite;
        (!item.pieces.is_empty()).then(|| Field::of(item, skip_empty))
    };
    scene.volumes.iter().map(field).collect()
}

/// Where a piece, or a cell, begins or ends along a ray.
#[derive(Debug, Clone, Copy)]
struct Edge {
    at: f64,
    of: Of,
    begins: bool,
}

#[derive(Debug, Clone, Copy)]
enum Of {
    Part(usize),
    Cell(usize),
}

/// What a thread keeps from ray to ray.
#[derive(Debug, Default)]
pub(super) struct Scratch {
    intervals: Intervals,
    edges: Vec<Edge>,
    hits: Vec<Hit>,
}

/// A scene ready for rays.
#[derive(Debug)]
pub(super) struct Tracer<'a> {
    parts: Vec<Part<'a>>,
    layered: Vec<Layered<'a>>,
    surfaces: Surfaces,
    grids: Vec<Cells>,
    frame: CameraFrame,
    projection: Projection,
    size: [u32; 2],
    /// As in [`Options::parts`].
    cuts: u32,
}

impl<'a> Tracer<'a> {
    /// `fields` are those of the scene.
    pub(super) fn new(
        scene: &'a Scene,
        fields: &'a [Option<Field<'a>>],
        size: [u32; 2],
        options: Options,
    ) -> Result<Self, ReferenceError> {
        let frame = scene.camera.frame()?;
        let eye = &scene.camera.eye;
        let (mut parts, mut layered) = (Vec::new(), Vec::new());
        for (item, field) in scene.volumes.iter().zip(fields) {
            if let Some(field) = field
                && item.mode != VolumeMode::Composite
            {
                layered.push(Layered::of(field, item, eye));
            } else if let Some(field) = field {
                parts.extend(item.pieces.iter().map(|piece| Part::new(field, item, piece, eye)));
            }
        }
        let place = |(grid, item)| Cells::of(item, eye).ok_or(ReferenceError::Grid { grid });
        let grids = scene.grids.iter().enumerate().map(place).collect::<Result<_, _>>()?;
        let surfaces = Surfaces::of(&scene.meshes, eye);
        let projection = scene.camera.projection;
        Ok(Self { parts, layered, surfaces, grids, frame, projection, size, cuts: options.parts.max(1) })
    }

    /// The ray of a pixel: its start relative to the eye, and its direction.
    fn ray(&self, x: u32, y: u32) -> (Vector, Vector) {
        let [width, height] = self.size.map(f64::from);
        let across = (2.0 * f64::from(x) + 1.0 - width) / height;
        let up = (height - 2.0 * f64::from(y) - 1.0) / height;
        let in_plane = self.frame.right * across + self.frame.up * up;
        match self.projection {
            Projection::Perspective { fov_rad } => {
                let direction = self.frame.forward + in_plane * (0.5 * fov_rad).tan();
                (Vector::zeros(), direction / direction.norm())
            }
            Projection::Parallel { height_mm } => (in_plane * (0.5 * height_mm), self.frame.forward),
        }
    }

    /// Premultiplied red, green, blue and opacity of a pixel.
    pub(super) fn pixel(&self, x: u32, y: u32, scratch: &mut Scratch) -> [f64; 4] {
        let (offset, direction) = self.ray(x, y);
        self.surfaces.hits(&offset, &direction, &mut scratch.hits);
        if !self.layered.is_empty() {
            for volume in &self.layered {
                volume.hits(&offset, &direction, &mut scratch.intervals, &mut scratch.hits);
            }
            // Stable: at one distance surfaces come first, then volumes in their order.
            scratch.hits.sort_by(|a, b| a.at.total_cmp(&b.at));
        }
        scratch.edges.clear();
        for (part, piece) in self.parts.iter().enumerate() {
            let line = piece.line(&offset, &direction);
            piece.stretches(&line, &offset, &direction, &mut scratch.intervals);
            for &[from, to] in scratch.intervals.stretches() {
                scratch.edges.push(Edge { at: from, of: Of::Part(part), begins: true });
                scratch.edges.push(Edge { at: to, of: Of::Part(part), begins: false });
            }
        }
        let mut inside: Vec<Linear<'_>> = Vec::new();
        for grid in &self.grids {
            grid.stretches(&offset, &direction, &mut inside);
        }
        for (i, cell) in inside.iter().enumerate() {
            scratch.edges.push(Edge { at: cell.from, of: Of::Cell(i), begins: true });
            scratch.edges.push(Edge { at: cell.to, of: Of::Cell(i), begins: false });
        }
        scratch.edges.sort_unstable_by(|a, b| a.at.total_cmp(&b.at));
        let mut gathered = Gathered::START;
        let mut walkers: Vec<Walker<'_>> = Vec::new();
        let mut cells: Vec<Linear<'_>> = Vec::new();
        let mut at = 0.0;
        let (mut edges, mut hits) = (scratch.edges.iter().peekable(), scratch.hits.iter().peekable());
        while gathered.through >= DARK {
            let next_edge = edges.peek().map_or(f64::INFINITY, |e| e.at);
            let next_hit = hits.peek().map_or(f64::INFINITY, |h| h.at);
            let next = next_edge.min(next_hit);
            if next == f64::INFINITY {
                break;
            }
            self.march(&mut walkers, &cells, [at, next], &mut gathered);
            at = next;
            if next_hit <= next_edge {
                if let Some(hit) = hits.next() {
                    gathered.surface(hit.color, hit.opacity);
                }
            } else if let Some(edge) = edges.next() {
                match edge.of {
                    Of::Part(part) if edge.begins => {
                        walkers.push(Walker::start(&self.parts[part], &offset, direction, edge.at));
                    }
                    Of::Part(part) => walkers.retain(|walker| !walker.is_in(&self.parts[part])),
                    Of::Cell(i) if edge.begins => cells.push(inside[i]),
                    // Those that end at the same place may go with it.
                    Of::Cell(_) => cells.retain(|cell| cell.to > edge.at),
                }
            }
        }
        let [r, g, b] = gathered.color;
        [r, g, b, 1.0 - gathered.through]
    }

    /// Along a stretch on which no piece begins or ends and no surface is.
    fn march(
        &self,
        walkers: &mut [Walker<'_>],
        cells: &[Linear<'_>],
        [from, to]: [f64; 2],
        gathered: &mut Gathered,
    ) {
        if walkers.is_empty() && cells.is_empty() {
            return;
        }
        let mut at = from;
        while at < to && gathered.through >= DARK {
            let mut end = to;
            for walker in walkers.iter_mut() {
                while walker.end <= at {
                    walker.advance();
                }
                end = end.min(walker.end);
            }
            if !cells.is_empty() || walkers.iter().any(|walker| !walker.clear) {
                gathered.stretch(Meets { walkers, cells }, at, end, self.cuts);
            }
            at = end;
        }
    }
}
