//! Volumes by proxy slices: one stack of slabs, perpendicular to the view, for all fragments and meshes.
//!
//! [`stack`] decides on the CPU, in `f64`, which tiles of which slabs to draw; `slabs.wgsl` integrates the slab in each
//! pixel; `saturate.wgsl` now and then marks finished pixels in the depth buffer.
//!
//! Source: Doi, section 3 (view-aligned slices of each part's own texture, mixed with polygons by depth);
//! Engel et al. 2001 (pre-integration). Differs: a slice integrates its slab instead of sampling a point,
//! overlapping parts are summed before the exponential, surfaces split the slab at their exact depth.

mod coverage;
mod polygons;
mod stack;
mod tables;

use std::collections::BTreeMap;
use std::sync::Arc;

pub(crate) use coverage::Shown;
pub(crate) use polygons::Proxy;
pub(crate) use stack::{Draw, Member, Spacing, Stack, Stage, Vertex};
pub(crate) use tables::{GpuTable, TableCache};

use crate::gpu::{Gpu, GpuError};
use crate::target::{Target, accumulation_format, bind_picture, buffer_entry, depth_state, texture_entry};
use crate::texture::VolumeTexture;
use crate::{shader, target};

/// Fragments that one draw integrates together. More would be exact for more, but a software driver takes
/// 9 s to compile a shader of 4, and 107 s of 8.
pub(crate) const SLOTS: usize = 4;
/// Cylinders, domes and blades whose outside one fragment may keep.
pub(crate) const MAX_GAPS: usize = 8;
/// Slabs between two looks for finished pixels.
const SATURATE_EVERY: u32 = 6;

/// What a slot of the shader holds.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) enum Kind {
    None = 0,
    Scalar = 1,
    ScalarLit = 2,
    Color = 3,
    Stacked = 4,
    StackedLit = 5,
}

/// GPU mirrors of `slabs.wgsl`.
pub(crate) mod gpu_data {
    use crate::view::Form;

    /// `Fragment`.
    #[repr(C)]
    #[derive(Debug, Clone, Copy, PartialEq, bytemuck::Pod, bytemuck::Zeroable)]
    pub(crate) struct Fragment {
        pub(crate) u: Form,
        pub(crate) v: Form,
        pub(crate) w: Form,
        pub(crate) gradient_x: [f32; 4],
        pub(crate) gradient_y: [f32; 4],
        pub(crate) gradient_z: [f32; 4],
        pub(crate) table_scale: f32,
        pub(crate) table_offset: f32,
        pub(crate) table_row: u32,
        pub(crate) unit_mm: f32,
        pub(crate) plane_first: u32,
        pub(crate) plane_end: u32,
        pub(crate) round_first: u32,
        pub(crate) round_end: u32,
        pub(crate) block_first: u32,
        pub(crate) block_end: u32,
        pub(crate) rest_scale: f32,
        pub(crate) rise_scale: f32,
        pub(crate) low: [f32; 4],
        pub(crate) high: [f32; 4],
        pub(crate) channel: [f32; 4],
        pub(crate) stack: [f32; 4],
    }

    /// `Round`.
    #[repr(C)]
    #[derive(Debug, Clone, Copy, PartialEq, bytemuck::Pod, bytemuck::Zeroable)]
    pub(crate) struct Round {
        pub(crate) u: Form,
        pub(crate) v: Form,
        pub(crate) w: Form,
        pub(crate) radius_mm: f32,
        pub(crate) outside: u32,
        pub(crate) pad_0: u32,
        pub(crate) pad_1: u32,
    }
}

/// What the slabs of one frame read.
#[derive(Debug)]
pub(crate) struct Inputs<'a> {
    pub(crate) stack: &'a Stack,
    pub(crate) fragments: &'a [gpu_data::Fragment],
    pub(crate) planes: &'a [crate::view::Form],
    pub(crate) rounds: &'a [gpu_data::Round],
    pub(crate) tables: &'a wgpu::TextureView,
    /// Whether any transfer function jumps.
    pub(crate) jumps: bool,
    pub(crate) textures: &'a [Arc<VolumeTexture>],
}

#[derive(Debug)]
pub(crate) struct Slabs {
    module: wgpu::ShaderModule,
    layout: wgpu::PipelineLayout,
    volumes: wgpu::BindGroupLayout,
    scene: wgpu::BindGroupLayout,
    surfaces: wgpu::BindGroupLayout,
    picture: wgpu::BindGroupLayout,
    saturate: wgpu::RenderPipeline,
    sampler: wgpu::Sampler,
    empty: wgpu::TextureView,
    pipelines: BTreeMap<Variant, wgpu::RenderPipeline>,
}

/// What a shader is specialised to.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
struct Variant {
    stage: Stage,
    kinds: [Kind; SLOTS],
    jumps: bool,
    gaps: bool,
    surfaces: bool,
    /// Whether any surface of the picture is translucent.
    layers: bool,
}

/// The buffers and groups of one frame, ready to be recorded.
#[derive(Debug)]
pub(crate) struct Prepared {
    vertices: wgpu::Buffer,
    scene: wgpu::BindGroup,
    surfaces: wgpu::BindGroup,
    /// The same without what is being added up, and its picture, where more fragments meet than one draw takes.
    summing: Option<(wgpu::BindGroup, wgpu::TextureView)>,
    /// A variant, a group of textures and a range of vertices each.
    draws: Vec<(Variant, wgpu::BindGroup, Draw)>,
}

impl Slabs {
    pub(crate) fn new(gpu: &Gpu, frame: &wgpu::BindGroupLayout) -> Result<Self, GpuError> {
        use wgpu::BufferBindingType::Storage;
        let device = &gpu.device;
        let group = |label, entries: &[wgpu::BindGroupLayoutEntry]| {
            device.create_bind_group_layout(&wgpu::BindGroupLayoutDescriptor { label: Some(label), entries })
        };
        let read =
            |binding| buffer_entry(binding, wgpu::ShaderStages::FRAGMENT, Storage { read_only: true }, false);
        let tables = wgpu::BindGroupLayoutEntry {
            binding: 4,
            visibility: wgpu::ShaderStages::FRAGMENT,
            ty: wgpu::BindingType::Texture {
                sample_type: wgpu::TextureSampleType::Uint,
                view_dimension: wgpu::TextureViewDimension::D2,
                multisampled: false,
            },
            count: None,
        };
        let flat = |binding| texture_entry(binding, wgpu::TextureViewDimension::D2, false);
        let mut entries: Vec<_> =
            (0..SLOTS as u32).map(|b| texture_entry(b, wgpu::TextureViewDimension::D3, true)).collect();
        entries.push(wgpu::BindGroupLayoutEntry {
            binding: SLOTS as u32,
            visibility: wgpu::ShaderStages::FRAGMENT,
            ty: wgpu::BindingType::Sampler(wgpu::SamplerBindingType::Filtering),
            count: None,
        });
        let volumes = group("slabs.volumes", &entries);
        let scene = group("slabs.scene", &[read(0), read(1), read(2), read(3), tables]);
        let surfaces = group("slabs.surfaces", &[read(0), read(1), flat(2), flat(3), flat(4)]);
        let picture = target::picture_layout(gpu);
        let layout = device.create_pipeline_layout(&wgpu::PipelineLayoutDescriptor {
            label: Some("slabs.layout"),
            bind_group_layouts: &[Some(frame), Some(&volumes), Some(&scene), Some(&surfaces)],
            immediate_size: 0,
        });
        let saturate = target::fullscreen_pipeline(
            gpu,
            "saturate.pipeline",
            &shader::module(device, "passes/slabs/saturate.wgsl"),
            &[Some(frame), Some(&picture)],
            None,
        );
        let sampler = device.create_sampler(&wgpu::SamplerDescriptor {
            label: Some("slabs.linear"),
            mag_filter: wgpu::FilterMode::Linear,
            min_filter: wgpu::FilterMode::Linear,
            ..Default::default()
        });
        let empty = device.create_texture(&wgpu::TextureDescriptor {
            label: Some("slabs.empty"),
            size: wgpu::Extent3d { width: 1, height: 1, depth_or_array_layers: 1 },
            mip_level_count: 1,
            sample_count: 1,
            dimension: wgpu::TextureDimension::D3,
            format: wgpu::TextureFormat::R8Unorm,
            usage: wgpu::TextureUsages::TEXTURE_BINDING,
            view_formats: &[],
        });
        let module = shader::module(device, "passes/slabs/slabs.wgsl");
        gpu.check()?;
        Ok(Self {
            module,
            layout,
            volumes,
            scene,
            surfaces,
            picture,
            saturate,
            sampler,
            empty: empty.create_view(&wgpu::TextureViewDescriptor::default()),
            pipelines: BTreeMap::new(),
        })
    }

    /// Uploads what the frame needs. `lists` are the heads and layers of the translucent surfaces,
    /// where there are any.
    pub(crate) fn prepare(
        &mut self,
        gpu: &Gpu,
        inputs: &Inputs<'_>,
        target: &Target,
        lists: Option<[&wgpu::Buffer; 2]>,
    ) -> Result<Prepared, GpuError> {
        let storage = wgpu::BufferUsages::STORAGE;
        let components: Vec<[u32; SLOTS]> = inputs.stack.components.clone();
        let [fragments, planes, rounds, components] = [
            upload(gpu, "slabs.fragments", bytemuck::cast_slice(inputs.fragments), storage),
            upload(gpu, "slabs.planes", bytemuck::cast_slice(inputs.planes), storage),
            upload(gpu, "slabs.rounds", bytemuck::cast_slice(inputs.rounds), storage),
            upload(gpu, "slabs.components", bytemuck::cast_slice(&components), storage),
        ];
        let scene = gpu.device.create_bind_group(&wgpu::BindGroupDescriptor {
            label: Some("slabs.scene"),
            layout: &self.scene,
            entries: &[
                entry(0, fragments.as_entire_binding()),
                entry(1, planes.as_entire_binding()),
                entry(2, rounds.as_entire_binding()),
                entry(3, components.as_entire_binding()),
                entry(4, wgpu::BindingResource::TextureView(inputs.tables)),
            ],
        });
        // Any buffer does where the shader never looks.
        let [heads, layers] = lists.unwrap_or([&fragments; 2]);
        let bind_surfaces = |optical: &wgpu::TextureView| {
            gpu.device.create_bind_group(&wgpu::BindGroupDescriptor {
                label: Some("slabs.surfaces"),
                layout: &self.surfaces,
                entries: &[
                    entry(0, heads.as_entire_binding()),
                    entry(1, layers.as_entire_binding()),
                    entry(2, wgpu::BindingResource::TextureView(&target.opaque_color_view)),
                    entry(3, wgpu::BindingResource::TextureView(&target.opaque_zeta_view)),
                    entry(4, wgpu::BindingResource::TextureView(optical)),
                ],
            })
        };
        let sums = inputs.stack.draws.iter().any(|d| d.stage == Stage::Sum);
        // Any picture does where the shader never looks.
        let unused = &target.opaque_zeta_view;
        let (surfaces, summing) = if sums {
            let optical = optical(gpu, target.size);
            (bind_surfaces(&optical), Some((bind_surfaces(unused), optical)))
        } else {
            (bind_surfaces(unused), None)
        };
        let gaps = inputs.rounds.iter().any(|r| r.outside == 1)
            || inputs.fragments.iter().any(|f| f.block_first < f.block_end);
        let mut groups: BTreeMap<[usize; SLOTS], wgpu::BindGroup> = BTreeMap::new();
        let mut draws = Vec::with_capacity(inputs.stack.draws.len());
        for draw in &inputs.stack.draws {
            let variant = Variant {
                stage: draw.stage,
                kinds: draw.slots.map(|s| s.0),
                jumps: inputs.jumps,
                gaps,
                surfaces: draw.surfaces,
                layers: lists.is_some(),
            };
            let textures = draw.slots.map(|(kind, texture)| match kind {
                Kind::None => usize::MAX,
                _ => texture,
            });
            let group = groups
                .entry(textures)
                .or_insert_with(|| self.bind_volumes(gpu, &textures, inputs.textures))
                .clone();
            if !self.pipelines.contains_key(&variant) {
                let pipeline = self.pipeline(gpu, variant);
                self.pipelines.insert(variant, pipeline);
            }
            draws.push((variant, group, draw.clone()));
        }
        let vertices = upload(
            gpu,
            "slabs.vertices",
            bytemuck::cast_slice(&inputs.stack.vertices),
            wgpu::BufferUsages::VERTEX,
        );
        gpu.check()?;
        Ok(Prepared { vertices, scene, surfaces, summing, draws })
    }

    fn bind_volumes(
        &self,
        gpu: &Gpu,
        textures: &[usize; SLOTS],
        known: &[Arc<VolumeTexture>],
    ) -> wgpu::BindGroup {
        let view = |texture: usize| known.get(texture).map_or(&self.empty, |t| &t.view);
        let mut entries: Vec<_> = textures
            .iter()
            .enumerate()
            .map(|(slot, &t)| entry(slot as u32, wgpu::BindingResource::TextureView(view(t))))
            .collect();
        entries.push(entry(SLOTS as u32, wgpu::BindingResource::Sampler(&self.sampler)));
        gpu.device.create_bind_group(&wgpu::BindGroupDescriptor {
            label: Some("slabs.volumes"),
            layout: &self.volumes,
            entries: &entries,
        })
    }

    fn pipeline(&self, gpu: &Gpu, variant: Variant) -> wgpu::RenderPipeline {
        const NAMES: [&str; SLOTS] = ["KIND_0", "KIND_1", "KIND_2", "KIND_3"];
        let mut constants: Vec<(&str, f64)> =
            NAMES.iter().zip(variant.kinds).map(|(name, kind)| (*name, f64::from(kind as u32))).collect();
        let flags = [
            ("JUMPS", variant.jumps),
            ("GAPS", variant.gaps),
            ("SURFACES", variant.surfaces),
            ("LAYERS", variant.layers),
            ("SINGLE", variant.stage != Stage::Whole),
        ];
        constants.extend(flags.map(|(name, on)| (name, f64::from(u8::from(on)))));
        let options = wgpu::PipelineCompilationOptions { constants: &constants, ..Default::default() };
        // Front to back: what is there already lets (1 - its opacity) of the new through.
        let under = wgpu::BlendComponent {
            src_factor: wgpu::BlendFactor::OneMinusDstAlpha,
            dst_factor: wgpu::BlendFactor::One,
            operation: wgpu::BlendOperation::Add,
        };
        let add = wgpu::BlendComponent { dst_factor: wgpu::BlendFactor::One, ..under };
        let add = wgpu::BlendComponent { src_factor: wgpu::BlendFactor::One, ..add };
        let (entry_point, blend, depth_stencil) = match variant.stage {
            Stage::Whole => ("fs_main", under, Some(depth_state(false, wgpu::CompareFunction::GreaterEqual))),
            Stage::Sum => ("fs_sum", add, None),
            Stage::Mix => ("fs_mix", under, Some(depth_state(false, wgpu::CompareFunction::GreaterEqual))),
        };
        gpu.device.create_render_pipeline(&wgpu::RenderPipelineDescriptor {
            label: Some("slabs.pipeline"),
            layout: Some(&self.layout),
            vertex: wgpu::VertexState {
                module: &self.module,
                entry_point: Some("vs_main"),
                compilation_options: options.clone(),
                buffers: &[Some(wgpu::VertexBufferLayout {
                    array_stride: size_of::<Vertex>() as u64,
                    step_mode: wgpu::VertexStepMode::Vertex,
                    attributes: &wgpu::vertex_attr_array![0 => Float32x2, 1 => Uint32, 2 => Uint32],
                })],
            },
            primitive: Default::default(),
            depth_stencil,
            multisample: Default::default(),
            fragment: Some(wgpu::FragmentState {
                module: &self.module,
                entry_point: Some(entry_point),
                compilation_options: options,
                targets: &[Some(wgpu::ColorTargetState {
                    format: accumulation_format(gpu),
                    blend: Some(wgpu::BlendState { color: blend, alpha: blend }),
                    write_mask: wgpu::ColorWrites::ALL,
                })],
            }),
            multiview_mask: None,
            cache: None,
        })
    }

    /// Records all slabs into the rows `rows` of the picture, with looks for finished pixels between.
    /// Returns how many of those looks there were.
    pub(crate) fn draw(
        &self,
        gpu: &Gpu,
        encoder: &mut wgpu::CommandEncoder,
        prepared: &Prepared,
        target: &Target,
        frame: &wgpu::BindGroup,
        rows: std::ops::Range<u32>,
        skip_finished: bool,
    ) -> u32 {
        let picture = bind_picture(gpu, &self.picture, &target.picture_view);
        let mut looks = 0;
        let mut next = 0;
        let mut until = SATURATE_EVERY;
        while let Some((_, _, first)) = prepared.draws.get(next) {
            let slab = first.slabs[0];
            if slab >= until {
                until = slab + SATURATE_EVERY;
                if next > 0 && skip_finished {
                    looks += 1;
                    self.saturate(encoder, target, frame, &picture, &rows);
                }
            }
            let summing = prepared.summing.as_ref().filter(|_| first.stage == Stage::Sum);
            let (surfaces, view, load, depth) = match summing {
                Some((surfaces, optical)) => {
                    (surfaces, optical, wgpu::LoadOp::Clear(wgpu::Color::TRANSPARENT), None)
                }
                None => (
                    &prepared.surfaces,
                    &target.picture_view,
                    wgpu::LoadOp::Load,
                    Some(depth_attachment(target)),
                ),
            };
            let mut pass = encoder.begin_render_pass(&wgpu::RenderPassDescriptor {
                label: Some("slabs"),
                color_attachments: &[Some(wgpu::RenderPassColorAttachment {
                    view,
                    depth_slice: None,
                    resolve_target: None,
                    ops: wgpu::Operations { load, store: wgpu::StoreOp::Store },
                })],
                depth_stencil_attachment: depth,
                ..Default::default()
            });
            pass.set_scissor_rect(0, rows.start, target.size[0], rows.end - rows.start);
            pass.set_bind_group(0, frame, &[]);
            pass.set_bind_group(2, &prepared.scene, &[]);
            pass.set_bind_group(3, surfaces, &[]);
            pass.set_vertex_buffer(0, prepared.vertices.slice(..));
            while let Some((variant, volumes, draw)) = prepared.draws.get(next) {
                let is_sum = draw.stage == Stage::Sum;
                if is_sum != summing.is_some() || draw.slabs[0] >= until {
                    break;
                }
                if let Some(pipeline) = self.pipelines.get(variant) {
                    pass.set_pipeline(pipeline);
                    pass.set_bind_group(1, volumes, &[]);
                    pass.draw(draw.vertices.clone(), 0..1);
                }
                next += 1;
            }
        }
        looks
    }

    /// Marks the pixels that are finished in the depth buffer.
    fn saturate(
        &self,
        encoder: &mut wgpu::CommandEncoder,
        target: &Target,
        frame: &wgpu::BindGroup,
        picture: &wgpu::BindGroup,
        rows: &std::ops::Range<u32>,
    ) {
        let mut pass = encoder.begin_render_pass(&wgpu::RenderPassDescriptor {
            label: Some("saturate"),
            depth_stencil_attachment: Some(depth_attachment(target)),
            ..Default::default()
        });
        pass.set_scissor_rect(0, rows.start, target.size[0], rows.end - rows.start);
        pass.set_pipeline(&self.saturate);
        pass.set_bind_group(0, frame, &[]);
        pass.set_bind_group(1, picture, &[]);
        pass.draw(0..3, 0..1);
    }
}

/// A picture to add optical depths up in.
fn optical(gpu: &Gpu, [width, height]: [u32; 2]) -> wgpu::TextureView {
    gpu.count_call();
    let texture = gpu.device.create_texture(&wgpu::TextureDescriptor {
        label: Some("slabs.optical"),
        size: wgpu::Extent3d { width, height, depth_or_array_layers: 1 },
        mip_level_count: 1,
        sample_count: 1,
        dimension: wgpu::TextureDimension::D2,
        format: accumulation_format(gpu),
        usage: wgpu::TextureUsages::RENDER_ATTACHMENT | wgpu::TextureUsages::TEXTURE_BINDING,
        view_formats: &[],
    });
    texture.create_view(&wgpu::TextureViewDescriptor::default())
}

fn depth_attachment(target: &Target) -> wgpu::RenderPassDepthStencilAttachment<'_> {
    wgpu::RenderPassDepthStencilAttachment {
        view: &target.depth_view,
        depth_ops: Some(wgpu::Operations { load: wgpu::LoadOp::Load, store: wgpu::StoreOp::Store }),
        stencil_ops: None,
    }
}

fn entry(binding: u32, resource: wgpu::BindingResource<'_>) -> wgpu::BindGroupEntry<'_> {
    wgpu::BindGroupEntry { binding, resource }
}

/// A buffer with `bytes` in it, never empty: a binding must hold at least one element.
pub(crate) fn upload(
    gpu: &Gpu,
    label: &'static str,
    bytes: &[u8],
    usage: wgpu::BufferUsages,
) -> wgpu::Buffer {
    gpu.count_call();
    let buffer = gpu.device.create_buffer(&wgpu::BufferDescriptor {
        label: Some(label),
        size: (bytes.len() as u64).max(256).next_multiple_of(4),
        usage: usage | wgpu::BufferUsages::COPY_DST,
        mapped_at_creation: false,
    });
    if !bytes.is_empty() {
        gpu.queue.write_buffer(&buffer, 0, bytes);
    }
    buffer
}
