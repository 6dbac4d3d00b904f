//! The common stack of slabs: which members each slab holds, which of them must be integrated together,
//! and the vertices and draws that follow, front to back.

use super::coverage::{Coverage, Shown, TileSet, Tiles};
use super::polygons::{Polygon, Proxy, bounds, clipped, hull, overlap};
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

/// One corner of a proxy polygon.
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

    /// The same stack with one sub-step a slab.
    pub(crate) fn single_steps(self) -> Self {
        Self { steps: 1, slabs: self.slabs * self.steps, ..self }
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
            let mut present: Vec<(usize, Polygon)> = Vec::new();
            for (index, member) in members.iter().enumerate() {
                if member.proxy.depth[1] < near || member.proxy.depth[0] > far {
                    continue;
                }
                let polygon = member.proxy.polygon(view, near, far);
                if polygon.is_empty() {
                    stack.off_screen += 1;
                } else {
                    present.push((index, polygon));
                }
            }
            let drawn = stack.vertices.len();
            for group in groups(present) {
                let pieces = stack.pieces(slab, tiles, &coverages, &group);
                if !pieces.is_empty() {
                    stack.add(slab, members, &group, &pieces);
                }
            }
            stack.occupied += u32::from(stack.vertices.len() > drawn);
        }
        stack
    }

    /// What of a group's outline may show anything, in convex pieces that share no pixel.
    fn pieces(
        &mut self,
        slab: u32,
        tiles: Tiles,
        coverages: &[Option<Coverage>],
        group: &Group,
    ) -> Vec<Polygon> {
        let [low, high] = bounds(&group.outline);
        let Some(within) = tiles.between(low, high) else { return Vec::new() };
        let mut set = TileSet::new(tiles);
        for (member, [low, high]) in group.members.iter().zip(&group.bounds) {
            match (&coverages[*member], tiles.between(*low, *high)) {
                (Some(coverage), _) => coverage.add_to(slab, &mut set),
                (None, Some(around)) => set.insert(around),
                (None, None) => {}
            }
        }
        let runs = set.runs(within);
        let wide = |[first, last]: [u32; 2]| u64::from(last - first + 1);
        let all = wide(within[0]) * wide(within[1]);
        let shown: u64 = runs.iter().map(|(columns, _)| wide(*columns)).sum();
        self.tiles += all;
        self.tiles_skipped += all - shown;
        if shown == all {
            return vec![group.outline.clone()];
        }
        let piece = |(columns, row)| clipped(group.outline.clone(), tiles.rectangle(columns, row));
        runs.into_iter().map(piece).filter(|piece| piece.len() > 2).collect()
    }

    fn add(&mut self, slab: u32, members: &[Member], group: &Group, pieces: &[Polygon]) {
        let surfaces = group.members.iter().any(|&m| members[m].volume.is_none());
        let mut volumes: Vec<_> = group.members.iter().filter_map(|&m| members[m].volume).collect();
        self.most_overlapping = self.most_overlapping.max(volumes.len());
        // By kind, so that fewer different shaders are made.
        volumes.sort_by_key(|&(fragment, kind, _)| (kind, fragment));
        if volumes.len() <= SLOTS {
            self.draw(slab, Stage::Whole, &volumes, surfaces, pieces);
            return;
        }
        for chunk in volumes.chunks(SLOTS) {
            self.draw(slab, Stage::Sum, chunk, false, pieces);
        }
        self.draw(slab, Stage::Mix, &[], surfaces, pieces);
    }

    fn draw(
        &mut self,
        slab: u32,
        stage: Stage,
        volumes: &[(u32, Kind, usize)],
        surfaces: bool,
        pieces: &[Polygon],
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
        let corner = |p: [f64; 2]| Vertex { ndc: p.map(|c| c as f32), slab, component };
        for piece in pieces {
            for pair in piece[1..].windows(2) {
                self.vertices.extend([piece[0], pair[0], pair[1]].map(corner));
            }
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

/// Members to be integrated together, and the convex polygon around them.
struct Group {
    members: Vec<usize>,
    /// Of each member's own outline.
    bounds: Vec<[[f64; 2]; 2]>,
    outline: Polygon,
}

/// Members joined until no two outlines touch: then no pixel lies in two groups, and nothing is drawn
/// twice.
fn groups(present: Vec<(usize, Polygon)>) -> Vec<Group> {
    let mut groups: Vec<Group> = Vec::new();
    for (member, polygon) in present {
        let mut joined = Group { members: vec![member], bounds: vec![bounds(&polygon)], outline: polygon };
        while let Some(touching) = groups.iter().position(|g| overlap(&g.outline, &joined.outline)) {
            let other = groups.swap_remove(touching);
            joined.members.extend(other.members);
            joined.bounds.extend(other.bounds);
            joined.outline.extend(other.outline);
            joined.outline = hull(joined.outline);
        }
        groups.push(joined);
    }
    groups
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn members_join_through_others_and_around_them() {
        let square = |x: f64, y: f64| vec![[x, y], [x + 1.0, y], [x + 1.0, y + 1.0], [x, y + 1.0]];
        // 0 and 1 meet through 3; 4 touches neither, but lies in the hull of 5 and 6.
        let present = vec![
            (0, square(0.0, 0.0)),
            (1, square(1.5, 0.0)),
            (2, square(5.0, 0.0)),
            (3, square(0.8, 0.0)),
            (4, square(10.0, 2.5)),
            (5, vec![[10.0, 0.0], [14.0, 0.0], [14.0, 0.5], [10.0, 0.5]]),
            (6, vec![[13.0, 0.2], [14.0, 0.2], [14.0, 9.0], [13.0, 9.0]]),
        ];
        let mut found: Vec<Vec<usize>> = groups(present).into_iter().map(|g| g.members).collect();
        for group in &mut found {
            group.sort_unstable();
        }
        found.sort();
        assert_eq!(found, [vec![0, 1, 3], vec![2], vec![4, 5, 6]], "joined groups");
    }
}
