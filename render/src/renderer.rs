//! The renderer: draws a [`Scene`] with the passes, in their order, and says what it cost.

use std::sync::Arc;
use std::time::Instant;

use crate::cpu::{Finish, Skips};
use crate::gather::{Caches, Counts, Gathered, Limits};
use crate::gpu::{Gpu, GpuError, read_texture};
use crate::image::FloatImage;
use crate::passes::present::Present;
use crate::passes::slabs::{Inputs, Slabs, Spacing, Stack, upload};
use crate::passes::surfaces::{LAYER_BYTES, Surfaces};
use crate::scene::Scene;
use crate::target::{Target, buffer_entry};
use crate::texture::{StepDecoder, TextureSummary, VolumeTexture};
use crate::view::{View, gpu_data};
use crate::volume::{Grid, PackedStep};

/// How fine the sub-steps along a ray are.
#[derive(Debug, Clone, Copy, PartialEq)]
#[non_exhaustive]
pub enum Quality {
    /// Two voxels: while the hand moves.
    Draft,
    /// One voxel.
    Good,
    /// An eighth of a voxel.
    Finest,
    /// This many voxels, for measurements; > 0.
    Spacing(f64),
}

impl Quality {
    /// Sub-step in voxels of the finest volume.
    pub fn voxels(self) -> f64 {
        match self {
            Self::Draft => 2.0,
            Self::Good => 1.0,
            Self::Finest => 0.125,
            Self::Spacing(voxels) => voxels.max(1e-3),
        }
    }
}

/// Where nothing else is asked for, at most this part of what lies behind a pixel is left out: 1/16 of a display step.
const THROUGH: f32 = 1.0 / 4096.0;
/// Sub-steps in a slab, unless a stack would have too many slabs.
const STEPS: u32 = 12;
/// What all textures may take at first. No interface tells how much memory there is: a small graphics card has it.
const TEXTURE_BYTES: u64 = 1 << 30;
/// Below this, memory is not what is short.
const LEAST_TEXTURE_BYTES: u64 = 1 << 22;
/// Layers a pixel that room is made for at first.
const LAYERS_AT_FIRST: u32 = 4;

/// What a frame did, skipped and cost.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Stats {
    /// From the call to the finished picture, ms.
    pub frame_ms: f64,
    /// Part of it before anything was drawn: textures, tables, polygons; ms.
    pub prepare_ms: f64,
    /// Sub-step, mm of depth.
    pub step_mm: f64,
    /// Slabs of the stack.
    pub slabs: u32,
    /// Slabs with something in them.
    pub slabs_occupied: u32,
    /// Sub-steps in a slab.
    pub steps_per_slab: u32,
    /// Draw calls of slabs.
    pub draws: u32,
    /// The most fragments that were integrated together.
    pub most_overlapping: u32,
    /// Fragments drawn.
    pub fragments: u32,
    /// Fragments left out: their transfer function or their cutters leave nothing.
    pub fragments_skipped: u32,
    /// Min-max bricks looked at.
    pub bricks: u64,
    /// Bricks that the transfer function makes clear.
    pub bricks_skipped: u64,
    /// Parts of slabs left out because they lie beside the picture.
    pub off_screen_skipped: u32,
    /// Looks for finished pixels.
    pub saturate_looks: u32,
    /// Crossings of surfaces: of translucent ones by the GPU, of all by the CPU.
    pub layers: u64,
    /// Tiles of the picture, by the CPU once for each fragment, by the GPU for each slab.
    pub tiles: u64,
    /// Those in which nothing shows.
    pub tiles_skipped: u64,
    /// By the CPU: cells of volumes that rays went through.
    pub cells: u64,
    /// By the CPU: tetrahedra of unstructured grids.
    pub tetrahedra: u64,
    /// By the CPU: those scan-converted, once for each strip of the picture that they are before; the others are clear or
    /// beside the picture.
    pub tetrahedra_scanned: u64,
    /// How a grid that is alone in the scene was drawn.
    pub grid: Option<crate::cells::Stats>,
    /// By the CPU: pixels that were done before their ray's end.
    pub pixels_finished: u64,
    /// By the CPU: volumes made ready for this picture; the others were.
    pub volumes_prepared: u32,
    /// By the CPU: transfer functions made ready for this picture; the others were.
    pub transfers_prepared: u32,
    /// Bands that the picture was drawn in.
    pub bands: u32,
    /// Textures made and sent for this frame; the others were there.
    pub textures_sent: u64,
    /// Textures, one an entry.
    pub textures: Vec<TextureSummary>,
    /// What was replaced or reduced, in sentences.
    pub notes: Vec<String>,
}

/// Draws scenes. Keeps textures and meshes from frame to frame.
#[derive(Debug)]
pub struct Renderer {
    gpu: Arc<Gpu>,
    frame_layout: wgpu::BindGroupLayout,
    slabs: Slabs,
    surfaces: Surfaces,
    present: Present,
    caches: Caches,
    /// The step last sent ahead of its picture.
    sent: Option<Arc<VolumeTexture>>,
    target: Option<Target>,
    /// What all textures of a picture may take where their format is left to the renderer; bytes.
    texture_bytes: u64,
    skips: Skips,
}

impl Renderer {
    /// A renderer on a device.
    ///
    /// # Errors
    /// What the device reports while pipelines are made.
    pub fn new(gpu: Arc<Gpu>) -> Result<Self, GpuError> {
        let frame_layout = gpu.device.create_bind_group_layout(&wgpu::BindGroupLayoutDescriptor {
            label: Some("frame"),
            entries: &[buffer_entry(0, wgpu::ShaderStages::all(), wgpu::BufferBindingType::Uniform, false)],
        });
        let slabs = Slabs::new(&gpu, &frame_layout)?;
        let surfaces = Surfaces::new(&gpu, &frame_layout)?;
        let present = Present::new(&gpu, &frame_layout)?;
        Ok(Self {
            gpu,
            frame_layout,
            slabs,
            surfaces,
            present,
            caches: Caches::default(),
            sent: None,
            target: None,
            texture_bytes: TEXTURE_BYTES,
            skips: Skips::default(),
        })
    }

    /// The device.
    pub fn gpu(&self) -> &Arc<Gpu> {
        &self.gpu
    }

    /// What decodes the steps of time series from now on; [`StepDecoder::Auto`] at first.
    pub fn set_step_decoder(&mut self, decoder: StepDecoder) {
        self.caches.textures.set_decoder(decoder);
    }

    /// What all textures of a picture may take from now on where their format is left to the renderer; bytes. Each
    /// volume has an equal share: where 16 bits a voxel do not fit there, blocks are taken, and then fewer voxels,
    /// with a note.
    pub fn set_texture_bytes(&mut self, bytes: u64) {
        self.texture_bytes = bytes;
        self.caches.textures.clear();
    }

    /// What is skipped from now on; all that can be at first.
    pub fn set_skips(&mut self, skips: Skips) {
        self.skips = skips;
    }

    /// Takes `new` for `old` from now on, which differs from it only in the voxels from `touched[0]` to before
    /// `touched[1]` (after painting): of textures in BC3, BC4 and BC7 only the blocks that hold those are encoded and
    /// sent. Returns the blocks sent, and those that could stay.
    ///
    /// # Errors
    /// [`GpuError`]: what the encoder or the device reports.
    pub fn replace_grid(
        &mut self,
        old: &Arc<Grid>,
        new: &Arc<Grid>,
        touched: [[usize; 3]; 2],
    ) -> Result<[u64; 2], GpuError> {
        self.caches.textures.replace(&self.gpu, old, new, touched)
    }

    /// Sends a step of a time series to the device before it is drawn, and keeps it for the next picture in place of
    /// the one sent before. The device may still be at work on return: see [`Renderer::finish`].
    ///
    /// # Errors
    /// [`GpuError`]: memory, a lost device, bytes that do not decode.
    pub fn send_step(&mut self, step: &PackedStep) -> Result<(), GpuError> {
        let gpu = Arc::clone(&self.gpu);
        self.sent = None;
        self.caches.textures.forget_unused();
        self.sent = Some(self.caches.textures.step(&gpu, step)?);
        // Work begins without waiting for a picture.
        gpu.submit(None);
        Ok(())
    }

    /// Waits until the device has done all that was sent.
    ///
    /// # Errors
    /// [`GpuError`]: what the device reports, or that it is lost.
    pub fn finish(&mut self) -> Result<(), GpuError> {
        self.gpu.wait()
    }

    /// The picture last drawn over its background, display RGBA; `None` before the first.
    pub fn display(&self) -> Option<&wgpu::TextureView> {
        self.target.as_ref().map(|t| &t.display_view)
    }

    /// Draws a scene into a picture of `size` pixels and waits for it. Where memory runs out, it tries again with half
    /// of what textures may take, and says so in a note.
    ///
    /// # Errors
    /// [`GpuError`]: a camera that shows nothing, a size the device does not allow, memory, a lost device.
    pub fn render(&mut self, scene: &Scene, size: [u32; 2], quality: Quality) -> Result<Stats, GpuError> {
        let mut reduced = false;
        loop {
            match self.render_once(scene, size, quality) {
                Err(GpuError::OutOfMemory { .. }) if self.texture_bytes > LEAST_TEXTURE_BYTES => {
                    self.target = None;
                    self.set_texture_bytes(self.texture_bytes / 2);
                    reduced = true;
                }
                Ok(mut stats) => {
                    if reduced {
                        let mib = self.texture_bytes >> 20;
                        stats
                            .notes
                            .push(format!("the GPU ran out of memory: textures now take {mib} MiB at most"));
                    }
                    return Ok(stats);
                }
                Err(error) => return Err(error),
            }
        }
    }

    fn render_once(&mut self, scene: &Scene, size: [u32; 2], quality: Quality) -> Result<Stats, GpuError> {
        let start = Instant::now();
        let gpu = Arc::clone(&self.gpu);
        self.resize(size)?;
        let view = View::new(&scene.camera, size)?;
        let limits = Limits { texture_bytes: self.texture_bytes, skips: self.skips };
        let gathered = Gathered::new(&gpu, scene, &view, &mut self.caches, limits)?;
        let mut stats = self.stats(&gathered);
        let step_mm = gathered.finest_mm.map(|voxel| voxel * quality.voxels());
        let depth = |side: usize, start: f64, pick: fn(f64, f64) -> f64| {
            gathered.members.iter().map(|m| m.proxy.depth[side]).fold(start, pick)
        };
        // Surfaces alone need no fine steps: their depth is exact in any.
        let alone = (depth(1, f64::NEG_INFINITY, f64::max) - depth(0, f64::INFINITY, f64::min)) / 64.0;
        let step_mm = step_mm.unwrap_or_else(|| alone.max(1e-6));
        let spacing = Spacing::new(&gathered.members, step_mm, STEPS);
        let target =
            self.target.as_ref().ok_or(GpuError::EmptyPicture { width: size[0], height: size[1] })?;

        let mut encoder = gpu.device.create_command_encoder(&wgpu::CommandEncoderDescriptor::default());
        clear(&mut encoder, &target.picture_view);
        let nothing = Spacing { near_mm: 0.0, step_mm, steps: STEPS, slabs: 1 };
        let mut whole =
            bind_frame(&gpu, &self.frame_layout, &frame_data(scene, &view, &nothing, self.skips.finished));
        if let Some(spacing) = spacing {
            let stack = Stack::new(&gathered.members, &view, &spacing);
            let frame = frame_data(scene, &view, &spacing, self.skips.finished);
            whole = bind_frame(&gpu, &self.frame_layout, &frame);
            let (fragments, planes, rounds) = gathered.to_gpu(&view, &spacing);
            let tables = self.caches.tables.texture(&gpu);
            let inputs = Inputs {
                stack: &stack,
                fragments: &fragments,
                planes: &planes,
                rounds: &rounds,
                tables: &tables,
                jumps: self.caches.tables.has_jumps(),
                textures: &gathered.textures,
            };
            let meshes = self.surfaces.prepare(&gpu, &scene.meshes, &view, spacing.near_mm);
            self.surfaces.draw_opaque(&mut encoder, &meshes, target, &whole);
            gpu.submit(Some(encoder));
            stats.prepare_ms = start.elapsed().as_secs_f64() * 1e3;
            stats.step_mm = spacing.step_mm;
            stats.steps_per_slab = spacing.steps;
            stats.slabs = spacing.slabs;
            stats.slabs_occupied = stack.occupied;
            stats.off_screen_skipped = stack.off_screen;
            stats.tiles = stack.tiles;
            stats.tiles_skipped = stack.tiles_skipped;
            stats.most_overlapping = stack.most_overlapping as u32;
            let finished = self.skips.finished != Finish::Never;
            let most = gpu.caps().storage_bytes;
            let width = u64::from(size[0]);
            let mut bands: Vec<std::ops::Range<u32>> = std::iter::once(0..size[1]).collect();
            while let Some(rows) = bands.pop() {
                let pixels = width * u64::from(rows.end - rows.start);
                let mut band = frame;
                band.band_first = rows.start;
                if meshes.has_layers() {
                    let room = (pixels * u64::from(LAYERS_AT_FIRST)).min(most / LAYER_BYTES);
                    self.surfaces.reserve(&gpu, pixels as u32, room as u32);
                    band.layer_capacity = self.surfaces.capacity();
                    let bound = bind_frame(&gpu, &self.frame_layout, &band);
                    let (found, most_on_pixel) =
                        self.surfaces.capture(&gpu, &meshes, target, &bound, rows.clone())?;
                    if found > self.surfaces.capacity() {
                        // Too little room: make it, or draw the band in two.
                        if u64::from(found) * LAYER_BYTES <= most {
                            self.surfaces.reserve(&gpu, pixels as u32, found);
                            bands.push(rows);
                        } else if rows.end - rows.start > 1 {
                            let middle = rows.start + (rows.end - rows.start) / 2;
                            bands.extend([middle..rows.end, rows.start..middle]);
                        } else {
                            return Err(GpuError::TooLarge {
                                what: "the list of translucent surfaces in one row",
                                needed: u64::from(found) * LAYER_BYTES,
                                allowed: most,
                            });
                        }
                        continue;
                    }
                    band.layer_most = most_on_pixel;
                    stats.layers += u64::from(found);
                }
                let bound = bind_frame(&gpu, &self.frame_layout, &band);
                let lists = meshes.has_layers().then(|| self.surfaces.lists());
                let ready = self.slabs.prepare(&gpu, &inputs, target, lists)?;
                let mut encoder =
                    gpu.device.create_command_encoder(&wgpu::CommandEncoderDescriptor::default());
                stats.saturate_looks +=
                    self.slabs.draw(&gpu, &mut encoder, &ready, target, &bound, rows, finished);
                gpu.submit(Some(encoder));
                stats.draws += stack.draws.len() as u32;
                stats.bands += 1;
            }
            encoder = gpu.device.create_command_encoder(&wgpu::CommandEncoderDescriptor::default());
        }
        self.present.draw(&gpu, &mut encoder, &whole, &target.picture_view, &target.display_view);
        gpu.submit(Some(encoder));
        gpu.wait()?;
        stats.frame_ms = start.elapsed().as_secs_f64() * 1e3;
        Ok(stats)
    }

    /// The picture last drawn: premultiplied, without background.
    ///
    /// # Errors
    /// [`GpuError::EmptyPicture`] before the first; what the device reports.
    pub fn read(&self) -> Result<FloatImage, GpuError> {
        let target = self.target.as_ref().ok_or(GpuError::EmptyPicture { width: 0, height: 0 })?;
        let [width, height] = target.size;
        let pixels = if self.gpu.caps().float_blend {
            bytemuck::pod_collect_to_vec(&read_texture(&self.gpu, &target.picture, 16)?)
        } else {
            let bytes = read_texture(&self.gpu, &target.picture, 8)?;
            let half = |b: &[u8]| half::f16::from_le_bytes([b[0], b[1]]).to_f32();
            bytes.chunks_exact(8).map(|p| std::array::from_fn(|c| half(&p[2 * c..]))).collect()
        };
        Ok(FloatImage { width, height, pixels })
    }

    fn resize(&mut self, size: [u32; 2]) -> Result<(), GpuError> {
        let [width, height] = size;
        if width == 0 || height == 0 {
            return Err(GpuError::EmptyPicture { width, height });
        }
        let allowed = self.gpu.caps().texture_2d;
        let needed = width.max(height);
        if needed > allowed {
            let (needed, allowed) = (u64::from(needed), u64::from(allowed));
            return Err(GpuError::TooLarge { what: "a side of the picture", needed, allowed });
        }
        if self.target.as_ref().is_none_or(|t| t.size != size) {
            self.target = None;
            self.target = Some(Target::new(&self.gpu, size));
            self.gpu.check()?;
        }
        Ok(())
    }

    fn stats(&self, gathered: &Gathered) -> Stats {
        let Counts { bricks, bricks_occupied, fragments, fragments_empty } = gathered.counts;
        let mut notes = gathered.notes.clone();
        if !self.gpu.caps().float_blend {
            notes.push("this GPU accumulates in 16-bit floats: faint slices may err by 1/255".to_owned());
        }
        Stats {
            fragments,
            fragments_skipped: fragments_empty,
            bricks,
            bricks_skipped: bricks - bricks_occupied,
            textures_sent: gathered.textures_sent,
            textures: gathered.textures.iter().map(|t| t.summary.clone()).collect(),
            notes,
            ..Stats::default()
        }
    }
}

fn frame_data(scene: &Scene, view: &View, spacing: &Spacing, finished: Finish) -> gpu_data::Frame {
    let [r, g, b] = scene.background.map(|c| c as f32);
    gpu_data::Frame {
        size: view.size.map(|n| n as f32),
        band_first: 0,
        layer_capacity: 0,
        lens: view.lens.map(|l| l as f32),
        perspective: f32::from(u8::from(view.perspective)),
        near_mm: spacing.near_mm as f32,
        depth_mm: spacing.depth_mm() as f32,
        step_mm: spacing.step_mm as f32,
        steps: spacing.steps,
        layer_most: 0,
        background: [r, g, b, 1.0],
        through: match finished {
            Finish::Never => 0.0,
            Finish::WithQuality => THROUGH,
            Finish::Below(part) => part,
        },
        pad_0: 0.0,
        pad_1: 0.0,
        pad_2: 0.0,
    }
}

fn bind_frame(gpu: &Gpu, layout: &wgpu::BindGroupLayout, frame: &gpu_data::Frame) -> wgpu::BindGroup {
    let buffer = upload(gpu, "frame", bytemuck::bytes_of(frame), wgpu::BufferUsages::UNIFORM);
    gpu.device.create_bind_group(&wgpu::BindGroupDescriptor {
        label: Some("frame"),
        layout,
        entries: &[wgpu::BindGroupEntry { binding: 0, resource: buffer.as_entire_binding() }],
    })
}

fn clear(encoder: &mut wgpu::CommandEncoder, picture: &wgpu::TextureView) {
    encoder.begin_render_pass(&wgpu::RenderPassDescriptor {
        label: Some("clear"),
        color_attachments: &[Some(wgpu::RenderPassColorAttachment {
            view: picture,
            depth_slice: None,
            resolve_target: None,
            ops: wgpu::Operations {
                load: wgpu::LoadOp::Clear(wgpu::Color::TRANSPARENT),
                store: wgpu::StoreOp::Store,
            },
        })],
        ..Default::default()
    });
}
