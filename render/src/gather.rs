//! From a scene to what the passes read: the solids, planes, textures and tables of every fragment.

use std::sync::Arc;

use crate::cpu::Skips;
use crate::gpu::{Caps, Gpu, GpuError};
use crate::passes::slabs::{GpuTable, Kind, MAX_GAPS, Member, Proxy, Shown, Spacing, TableCache, gpu_data};
use crate::scene::{Scene, Shading, VolumeItem, VolumeMode, light};
use crate::texture::{Plan, Reading, TextureCache, VolumeTexture};
use crate::view::{Form, View};
use crate::volume::convex::{ConvexSolid, HalfSpace};
use crate::volume::{Affine, Body, Bricks, Face, Grid, Occupied, Point, Transfer, Vector};

/// A fragment with its geometry in view space, before the near plane is known.
#[derive(Debug)]
struct Fragment {
    texture: Arc<VolumeTexture>,
    view_from_voxel: Affine,
    /// Two corners of what is drawn, in voxel space.
    bounds: [Point; 2],
    planes: Vec<HalfSpace>,
    rounds: Vec<Round>,
    /// The faces, inwards, of prisms whose outside is kept.
    blocks: Vec<[HalfSpace; 5]>,
    transfer: Arc<Transfer>,
    /// See [`light::value_span`].
    value_span: f64,
    table: Arc<GpuTable>,
}

/// A cylinder or ball in view space.
#[derive(Debug)]
struct Round {
    point: Point,
    /// Along these its distance counts; the third of a cylinder has no length.
    across: [Vector; 3],
    radius_mm: f64,
    outside: bool,
}

/// What is skipped and done while gathering.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub(crate) struct Counts {
    pub(crate) bricks: u64,
    pub(crate) bricks_occupied: u64,
    pub(crate) fragments: u32,
    pub(crate) fragments_empty: u32,
}

/// The scene as lists for the GPU.
#[derive(Debug, Default)]
pub(crate) struct Gathered {
    fragments: Vec<Fragment>,
    pub(crate) members: Vec<Member>,
    pub(crate) textures: Vec<Arc<VolumeTexture>>,
    pub(crate) textures_sent: u64,
    pub(crate) notes: Vec<String>,
    pub(crate) counts: Counts,
    /// Least distance of samples over all volumes drawn, mm.
    pub(crate) finest_mm: Option<f64>,
}

/// Boxes that say where a volume is not clear, at most.
const MOST_BOXES: usize = 1 << 14;

/// The bricks of a grid, and what a transfer function leaves of them.
#[derive(Debug)]
struct Bricked {
    grid: Arc<Grid>,
    bricks: Arc<Bricks>,
    transfer: Arc<Transfer>,
    occupied: Option<Arc<Occupied>>,
}

impl Bricked {
    fn is_of(&self, item: &VolumeItem) -> bool {
        Arc::ptr_eq(&self.grid, &item.grid) && Transfer::same(&self.transfer, &item.transfer)
    }
}

/// What is kept from frame to frame.
#[derive(Debug, Default)]
pub(crate) struct Caches {
    pub(crate) textures: TextureCache,
    pub(crate) tables: TableCache,
    bricks: Vec<Bricked>,
}

impl Caches {
    /// How many bricks a volume has, and what its transfer function leaves of them.
    fn occupied(&mut self, item: &VolumeItem) -> (usize, Option<Arc<Occupied>>) {
        if let Some(known) = self.bricks.iter().find(|b| b.is_of(item)) {
            return (known.bricks.len(), known.occupied.clone());
        }
        let same_grid = self.bricks.iter().find(|b| Arc::ptr_eq(&b.grid, &item.grid));
        let bricks = same_grid.map_or_else(|| Arc::new(Bricks::of(&item.grid)), |b| Arc::clone(&b.bricks));
        let occupied = bricks.occupied(&item.transfer, MOST_BOXES).map(Arc::new);
        let (count, found) = (bricks.len(), occupied.clone());
        let (grid, transfer) = (Arc::clone(&item.grid), Arc::clone(&item.transfer));
        self.bricks.push(Bricked { grid, bricks, transfer, occupied });
        (count, found)
    }

    fn forget_unused(&mut self, scene: &Scene) {
        self.textures.forget_unused();
        self.bricks.retain(|b| scene.volumes.iter().any(|item| b.is_of(item)));
    }
}

/// What a picture may take and skip.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Limits {
    /// What all textures may take where their format is left to the renderer.
    pub(crate) texture_bytes: u64,
    pub(crate) skips: Skips,
}

impl Gathered {
    pub(crate) fn new(
        gpu: &Gpu,
        scene: &Scene,
        view: &View,
        caches: &mut Caches,
        limits: Limits,
    ) -> Result<Self, GpuError> {
        if !scene.grids.is_empty() {
            return Err(GpuError::CpuOnly { what: "an unstructured grid" });
        }
        let mut all = Self::default();
        caches.tables.begin();
        // Each volume has an equal share of what all may take.
        let texture_budget = limits.texture_bytes / (scene.volumes.len() as u64).max(1);
        let caps = Caps { texture_budget, ..gpu.caps() };
        for item in &scene.volumes {
            all.add_volume(gpu, caps, item, view, caches, limits.skips)?;
        }
        caches.forget_unused(scene);
        all.textures_sent = caches.textures.take_sent();
        for item in &scene.meshes {
            if item.opacity <= 0.0 {
                continue;
            }
            let [low, high] = item.mesh.bounds();
            // A flat mesh has no solid: a hair of room makes one.
            let room = Vector::repeat((high - low).amax() * 1e-6 + 1e-9);
            let solid = ConvexSolid::from_box(low - room, high + room);
            let proxy = Proxy::new(&solid.transformed(&(view.view_from_world * item.pose)));
            all.members.extend(proxy.map(|proxy| Member { proxy, volume: None, shown: None }));
        }
        all.notes.dedup();
        Ok(all)
    }

    fn add_volume(
        &mut self,
        gpu: &Gpu,
        caps: Caps,
        item: &VolumeItem,
        view: &View,
        caches: &mut Caches,
        skips: Skips,
    ) -> Result<(), GpuError> {
        if item.pieces.is_empty() {
            return Ok(());
        }
        if item.mode != VolumeMode::Composite {
            return Err(GpuError::CpuOnly { what: "a volume as MIP or isosurface" });
        }
        if item.labels.is_some() {
            return Err(GpuError::CpuOnly { what: "a volume with labels" });
        }
        let (grid_place, range) = match &item.packed {
            Some(step) => (*step.world_from_voxel(), step.range()),
            None => (*item.grid.world_from_voxel(), item.grid.range()),
        };
        let mut occupied = None;
        let [low, high] = if let Some(step) = &item.packed {
            step.bounds()
        } else if skips.empty {
            let (bricks, found) = caches.occupied(item);
            self.counts.bricks += bricks as u64;
            let Some(found) = found else {
                self.counts.fragments_empty += item.pieces.len() as u32;
                return Ok(());
            };
            self.counts.bricks_occupied += found.bricks as u64;
            let span = found.span;
            occupied = Some(found);
            [0, 1].map(|end| Point::from(span.map(|s| s[end])))
        } else {
            let extent = item.grid.extent().map(|n| n as f64 - 0.5);
            [Point::new(-0.5, -0.5, -0.5), Point::from(extent)]
        };
        let world_from_voxel = item.pose * grid_place;
        let spacing = world_from_voxel.column_lengths().into_iter().fold(f64::INFINITY, f64::min);
        self.finest_mm = Some(self.finest_mm.map_or(spacing, |f| f.min(spacing)));
        let table = caches.tables.get(&item.transfer, range);
        let mut drawn: Option<(Arc<VolumeTexture>, Kind, usize)> = None;
        for piece in &item.pieces {
            let mut solid = ConvexSolid::from_box(low, high);
            let view_from_unmoved = view.view_from_world * piece.pose;
            let view_from_voxel = view_from_unmoved * world_from_voxel;
            let (mut planes, mut rounds, mut blocks) = (Vec::new(), Vec::new(), Vec::new());
            for (cutter, side) in &piece.keep {
                let (body, inside) = cutter.solid(*side);
                let behind = |face: &Face| HalfSpace::new(&face.point, -face.normal);
                let mut keep = |half: HalfSpace| {
                    solid = solid.clipped(&half.transformed(&world_from_voxel.inverse()));
                    planes.push(unit(half.transformed(&view_from_unmoved)));
                };
                match &body {
                    Body::HalfSpace(face) if !inside => keep(HalfSpace::new(&face.point, face.normal)),
                    Body::HalfSpace(face) => keep(behind(face)),
                    Body::Prism(faces) if inside => faces.iter().for_each(|face| keep(behind(face))),
                    Body::Prism(faces) => {
                        blocks.push(faces.map(|face| unit(behind(&face).transformed(&view_from_unmoved))));
                    }
                    Body::Cylinder { point, axis, radius_mm } => {
                        let [u, v] = across(&view_from_unmoved.vector(axis));
                        let (point, across) = (view_from_unmoved.point(point), [u, v, Vector::zeros()]);
                        rounds.push(Round { point, across, radius_mm: *radius_mm, outside: !inside });
                    }
                    Body::Ball { centre, radius_mm } => {
                        let point = view_from_unmoved.point(centre);
                        let across = [Vector::x(), Vector::y(), Vector::z()];
                        rounds.push(Round { point, across, radius_mm: *radius_mm, outside: !inside });
                    }
                }
            }
            let gaps = blocks.len() + rounds.iter().filter(|r| r.outside).count();
            if gaps > MAX_GAPS {
                return Err(GpuError::Gaps { count: gaps, limit: MAX_GAPS });
            }
            let Some(proxy) = Proxy::new(&solid.transformed(&view_from_voxel)) else {
                self.counts.fragments_empty += 1;
                continue;
            };
            self.counts.fragments += 1;
            // One texture for all fragments, of all that the volume shows: cutting it makes none anew.
            let (texture, kind, position) = match &drawn {
                Some(drawn) => drawn.clone(),
                None => {
                    drawn.insert(self.texture(gpu, caps, item, [low, high], &mut caches.textures)?).clone()
                }
            };
            let index = self.fragments.len() as u32;
            let shown = occupied.as_ref().map(|occupied| Shown {
                occupied: Arc::clone(occupied),
                view_from_voxel,
                planes: planes.clone(),
            });
            self.members.push(Member { proxy, volume: Some((index, kind, position)), shown });
            let transfer = Arc::clone(&item.transfer);
            let value_span = light::value_span(&transfer, range);
            self.fragments.push(Fragment {
                texture,
                view_from_voxel,
                bounds: [low, high],
                planes,
                rounds,
                blocks,
                transfer,
                value_span,
                table: Arc::clone(&table),
            });
        }
        Ok(())
    }

    /// The texture of what a volume shows within `bounds`, how it is read, and its place among the textures.
    fn texture(
        &mut self,
        gpu: &Gpu,
        caps: Caps,
        item: &VolumeItem,
        bounds: [Point; 2],
        textures: &mut TextureCache,
    ) -> Result<(Arc<VolumeTexture>, Kind, usize), GpuError> {
        let texture = if let Some(step) = &item.packed {
            textures.step(gpu, step)?
        } else {
            let plan = Plan::new(&item.grid, &item.transfer, item.texture, bounds, caps, &mut self.notes);
            textures.get(gpu, &plan)?
        };
        let kind = match (texture.reading, item.shading) {
            (Reading::Colour, Shading::None) => Kind::Color,
            (Reading::Colour, Shading::Lit) => {
                let note = "a pre-classified texture has no gradient: its volume is drawn unlit";
                self.notes.push(note.to_owned());
                Kind::Color
            }
            (Reading::Scalar { .. }, Shading::None) => Kind::Scalar,
            (Reading::Scalar { .. }, Shading::Lit) => Kind::ScalarLit,
            (Reading::Stacked { .. }, Shading::None) => Kind::Stacked,
            (Reading::Stacked { .. }, Shading::Lit) => Kind::StackedLit,
        };
        let position = self.textures.iter().position(|t| Arc::ptr_eq(t, &texture));
        let position = position.unwrap_or_else(|| {
            self.textures.push(Arc::clone(&texture));
            self.textures.len() - 1
        });
        Ok((texture, kind, position))
    }

    /// The fragments, planes and round bodies as the shader reads them, seen from the stack's near plane.
    pub(crate) fn to_gpu(
        &self,
        view: &View,
        spacing: &Spacing,
    ) -> (Vec<gpu_data::Fragment>, Vec<Form>, Vec<gpu_data::Round>) {
        let near = spacing.near_mm;
        let (mut fragments, mut planes, mut rounds) = (Vec::new(), Vec::new(), Vec::new());
        for fragment in &self.fragments {
            let texture_from_view = fragment.texture.texture_from_voxel * fragment.view_from_voxel.inverse();
            let row = |r| view.row_form(&texture_from_view, r, near);
            let (plane_first, round_first) = (planes.len() as u32, rounds.len() as u32);
            planes.extend(fragment.planes.iter().map(|p| view.form(p, near)));
            let block_first = planes.len() as u32;
            planes.extend(fragment.blocks.iter().flatten().map(|p| view.form(p, near)));
            rounds.extend(fragment.rounds.iter().map(|round| {
                let form = |normal: Vector| view.form(&HalfSpace::new(&round.point, normal), near);
                gpu_data::Round {
                    u: form(round.across[0]),
                    v: form(round.across[1]),
                    w: form(round.across[2]),
                    radius_mm: round.radius_mm as f32,
                    outside: u32::from(round.outside),
                    pad_0: 0,
                    pad_1: 0,
                }
            }));
            let (table, texture) = (&fragment.table, &fragment.texture);
            let gradient = |axis: usize| {
                let mut along = Vector::zeros();
                along[axis] = 1.0;
                let g = fragment.view_from_voxel.normal(&along)
                    * (texture.value_scale / (2.0 * fragment.value_span));
                let step = texture.texture_from_voxel.matrix()[(axis, axis)];
                [g.x as f32, g.y as f32, g.z as f32, step as f32]
            };
            let corner = |end: usize| {
                let p = texture.texture_from_voxel.point(&fragment.bounds[end]);
                [p.x as f32, p.y as f32, p.z as f32, 0.0]
            };
            let mut channel = [0.0; 4];
            let mut stack = [0.0; 4];
            match texture.reading {
                Reading::Scalar { weights } => channel = weights,
                Reading::Stacked { slices } => {
                    stack = [slices as f32, texture.summary.extent[2] as f32, 0.0, 0.0];
                }
                Reading::Colour => {}
            }
            fragments.push(gpu_data::Fragment {
                u: row(0),
                v: row(1),
                w: row(2),
                gradient_x: gradient(0),
                gradient_y: gradient(1),
                gradient_z: gradient(2),
                table_scale: (texture.value_scale / table.step) as f32,
                table_offset: (texture.value_offset / table.step + table.origin) as f32,
                table_row: table.row,
                unit_mm: fragment.transfer.unit_mm() as f32,
                plane_first,
                plane_end: block_first,
                round_first,
                round_end: rounds.len() as u32,
                block_first,
                block_end: planes.len() as u32,
                rest_scale: table.rest_scale,
                rise_scale: table.rise_scale,
                low: corner(0),
                high: corner(1),
                channel,
                stack,
            });
        }
        (fragments, planes, rounds)
    }
}

/// The same half-space with a normal of length 1, so that its value is in mm.
fn unit(half: HalfSpace) -> HalfSpace {
    let length = half.normal.norm();
    if length > 0.0 { HalfSpace { normal: half.normal / length, offset: half.offset / length } } else { half }
}

/// Two directions at right angles to `axis` and to each other, of length 1.
fn across(axis: &Vector) -> [Vector; 2] {
    let axis = axis.try_normalize(0.0).unwrap_or_else(Vector::z);
    let mut other = Vector::zeros();
    other[axis.iamin()] = 1.0;
    let u = axis.cross(&other).try_normalize(0.0).unwrap_or_else(Vector::x);
    [u, axis.cross(&u)]
}
