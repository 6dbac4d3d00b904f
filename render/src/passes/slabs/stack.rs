//! The common stack of slabs: which members each tile of each slab holds, and the vertices and draws that follow, front to
//! back. What a tile holds is integrated together; tiles share no pixel, so nothing is drawn twice.

use super::coverage::{Coverage, Rectangle, Sets, Shown, Tiles, each};
use super::polygons::{Proxy, bounds, clipped};
use super::{Kind, SATURATE_EVERY, SLOTS};
use crate::view::View;

/// Something that takes part in a slab: a fragment of a volume, or the room of a mesh.
#[derive(Debug)]
pub(crate) struct Member {
    pub(crate) proxy: Proxy,
    /// Index into the fragment buffer, what its texture is, and its index among the textures; `None` for
    /// a mesh.
    pub(crate) volume: Option<(u32, Kind, usize)>,
    /// What of a volume is not clear, where that is known.
    pub(crate) shown: Option<Shown>,
}

/// One corner of a run of tiles; `slab` is a sub-step where those are drawn one by one.
#[repr(C)]
#[derive(Debug, Clone, Copy, PartialEq, bytemuck::Pod, bytemuck::Zeroable)]
pub(crate) struct Vertex {
    pub(crate) ndc: [f32; 2],
    pub(crate) slab: u32,
    pub(crate) component: u32,
}

/// What the slots of a draw hold: kind and texture of each.
pub(crate) type Slots = [(Kind, usize); SLOTS];

/// What a draw does with the fragments that it integrates.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) enum Stage {
    /// They are all that meet there: the picture passes through them and through the surfaces among them.
    Whole,
    /// More meet than a draw takes: their optical depths are added up first.
    Sum,
    /// The picture passes through what was added up, and through the surfaces.
    Mix,
}

/// Consecutive triangles with the same slots.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Draw {
    pub(crate) stage: Stage,
    pub(crate) slots: Slots,
    /// Whether surfaces may lie in it.
    pub(crate) surfaces: bool,
    pub(crate) vertices: std::ops::Range<u32>,
    /// The slabs that it begins and ends with.
    pub(crate) slabs: [u32; 2],
}

/// Where the slabs lie.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Spacing {
    /// Depth of the first slab's front, mm.
    pub(crate) near_mm: f64,
    pub(crate) step_mm: f64,
    /// Sub-steps a slab.
    pub(crate) steps: u32,
    pub(crate) slabs: u32,
}

/// Slabs at most; beyond it each has more sub-steps.
const MAX_SLABS: f64 = 2048.0;

impl Spacing {
    /// A stack over all members with sub-steps of `step_mm`; `None` where none is before the eye.
    pub(crate) fn new(members: &[Member], step_mm: f64, steps: u32) -> Option<Self> {
        let near = members.iter().map(|m| m.proxy.depth[0]).fold(f64::INFINITY, f64::min).max(0.0);
        let far = members.iter().map(|m| m.proxy.depth[1]).fold(f64::NEG_INFINITY, f64::max);
        if far <= near {
            return None;
        }
        // A little room at both ends, so that no surface lies exactly on the stack's own faces.
        let room = (far - near) * 1e-4 + 1e-4;
        let needed = ((far - near + 2.0 * room) / (step_mm * f64::from(steps))).ceil();
        let steps =
            if needed > MAX_SLABS { (f64::from(steps) * needed / MAX_SLABS).ceil() as u32 } else { steps };
        // Slabs are counted from the eye's plane: what else is in the scene, or is skipped, does not move them.
        let slab_mm = step_mm * f64::from(steps);
        let first = ((near - room) / slab_mm).floor().max(0.0);
        let slabs = ((far + room) / slab_mm).ceil() - first;
        Some(Self { near_mm: first * slab_mm, step_mm, steps, slabs: slabs as u32 })
    }

    pub(crate) fn slab_mm(&self) -> f64 {
        self.step_mm * f64::from(self.steps)
    }

    pub(crate) fn depth_mm(&self) -> f64 {
        self.slab_mm() * f64::from(self.slabs)
    }
}

/// Vertices, components and draws of a frame.
#[derive(Debug, Default)]
pub(crate) struct Stack {
    pub(crate) vertices: Vec<Vertex>,
    /// Fragments of each component, by slot.
    pub(crate) components: Vec<[u32; SLOTS]>,
    pub(crate) draws: Vec<Draw>,
    /// Slabs with something in them.
    pub(crate) occupied: u32,
    /// Members of slabs that lie outside the picture.
    pub(crate) off_screen: u32,
    /// The most fragments integrated together.
    pub(crate) most_overlapping: usize,
    /// Tiles of all slabs, and those in which nothing shows.
    pub(crate) tiles: u64,
    pub(crate) tiles_skipped: u64,
}

impl Stack {
    pub(crate) fn new(members: &[Member], view: &View, spacing: &Spacing) -> Self {
        let mut stack = Self::default();
        let tiles = Tiles::new(view.size);
        let coverage = |m: &Member| Some(Coverage::new(m.shown.as_ref()?, tiles, view, spacing));
        let coverages: Vec<Option<Coverage>> = members.iter().map(coverage).collect();
        for slab in 0..spacing.slabs {
            let near = spacing.near_mm + f64::from(slab) * spacing.slab_mm();
            let far = near + spacing.slab_mm();
            let mut sets = Sets::new(tiles, members.len());
            for (index, (member, coverage)) in members.iter().zip(&coverages).enumerate() {
                if member.proxy.depth[1] < near || member.proxy.depth[0] > far {
                    continue;
                }
                let polygon = member.proxy.polygon(view, near, far);
                if polygon.is_empty() {
                    stack.off_screen += 1;
                    continue;
                }
                let [low, high] = bounds(&polygon);
                let Some(within) = tiles.between(low, high) else { continue };
                for tile in each(within) {
                    let shows = match coverage {
                        Some(coverage) => coverage.has(slab, tile),
                        None => !clipped(polygon.clone(), tiles.rectangle([tile[0]; 2], tile[1])).is_empty(),
                    };
                    sets.look(tile, index, shows);
                }
            }
            stack.tiles += sets.looked;
            stack.tiles_skipped += sets.looked - sets.shown;
            stack.occupied += u32::from(sets.shown > 0);
            for (set, pieces) in sets.runs() {
                stack.add([slab, spacing.steps], members, &set, &pieces);
            }
        }
        stack
    }

    fn add(&mut self, [slab, steps]: [u32; 2], members: &[Member], set: &[usize], pieces: &[Rectangle]) {
        let surfaces = set.iter().any(|&m| members[m].volume.is_none());
        let mut volumes: Vec<_> = set.iter().filter_map(|&m| members[m].volume).collect();
        self.most_overlapping = self.most_overlapping.max(volumes.len());
        // By kind, so that fewer different shaders are made.
        volumes.sort_by_key(|&(fragment, kind, _)| (kind, fragment));
        if volumes.len() <= SLOTS {
            self.draw([slab; 2], Stage::Whole, &volumes, surfaces, pieces);
            return;
        }
        for step in slab * steps..(slab + 1) * steps {
            for chunk in volumes.chunks(SLOTS) {
                self.draw([slab, step], Stage::Sum, chunk, false, pieces);
            }
            self.draw([slab, step], Stage::Mix, &[], surfaces, pieces);
        }
    }

    /// Draws a slab, or a sub-step of one where what is in it is added up.
    fn draw(
        &mut self,
        [slab, drawn]: [u32; 2],
        stage: Stage,
        volumes: &[(u32, Kind, usize)],
        surfaces: bool,
        pieces: &[Rectangle],
    ) {
        let mut slots: Slots = [(Kind::None, 0); SLOTS];
        let mut fragments = [u32::MAX; SLOTS];
        for (slot, &(fragment, kind, texture)) in volumes.iter().enumerate() {
            slots[slot] = (kind, texture);
            fragments[slot] = fragment;
        }
        let known = self.components.iter().rposition(|c| *c == fragments);
        let component = known.unwrap_or_else(|| {
            self.components.push(fragments);
            self.components.len() - 1
        }) as u32;
        let first = self.vertices.len() as u32;
        let corner = |p: [f64; 2]| Vertex { ndc: p.map(|c| c as f32), slab: drawn, component };
        for [x, y] in pieces {
            let corners = [[0, 0], [1, 0], [1, 1], [0, 0], [1, 1], [0, 1]];
            self.vertices.extend(corners.map(|[i, j]: [usize; 2]| corner([x[i], y[j]])));
        }
        let end = self.vertices.len() as u32;
        match self.draws.last_mut() {
            Some(last)
                if stage == Stage::Whole
                    && (last.stage, last.slots, last.surfaces) == (stage, slots, surfaces)
                    && slab - last.slabs[0] < SATURATE_EVERY =>
            {
                (last.vertices.end, last.slabs[1]) = (end, slab);
            }
            _ => {
                self.draws.push(Draw { stage, slots, surfaces, vertices: first..end, slabs: [slab; 2] });
            }
        }
    }
}
