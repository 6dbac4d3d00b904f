//! Triangle meshes: opaque ones into colour, zeta and depth; translucent ones into a list of layers for each
//! pixel, which the slabs then composite at their exact depth.
//!
//! Source: Yang 2010. Differs: the lists stay unsorted; a slab picks the next layer by its depth.

use std::sync::Arc;

use crate::gpu::{Gpu, GpuError, read_buffer};
use crate::passes::slabs::upload;
use crate::scene::{MeshItem, Shading};
use crate::shader;
use crate::target::{Target, ZETA, buffer_entry, depth_state, texture_entry};
use crate::view::View;
use crate::volume::{Affine, Point, TriangleMesh, Vector};

/// Bytes of `Layer` in `shared/layers.wgsl`.
pub(crate) const LAYER_BYTES: u64 = 32;
/// Bytes of a list's head.
const HEAD_BYTES: u64 = 8;
/// Distance between two meshes' uniforms; the guaranteed alignment of a dynamic offset.
const SURFACE_STRIDE: usize = 256;

/// GPU mirrors of `surfaces.wgsl`.
pub(crate) mod gpu_data {
    /// `Surface`.
    #[repr(C)]
    #[derive(Debug, Clone, Copy, PartialEq, bytemuck::Pod, bytemuck::Zeroable)]
    pub(crate) struct Surface {
        pub(crate) view_from_mesh: glam::Mat4,
        pub(crate) normal_x: [f32; 4],
        pub(crate) normal_y: [f32; 4],
        pub(crate) normal_z: [f32; 4],
        pub(crate) color: [f32; 4],
        pub(crate) lit: u32,
        pub(crate) mesh: u32,
        pub(crate) pad_0: u32,
        pub(crate) pad_1: u32,
    }
}

/// A mesh's triangles on the GPU, relative to the middle of its bounds.
#[derive(Debug)]
struct Uploaded {
    mesh: Arc<TriangleMesh>,
    middle: Vector,
    triangles: wgpu::Buffer,
    count: u32,
}

#[derive(Debug)]
pub(crate) struct Surfaces {
    surface_layout: wgpu::BindGroupLayout,
    capture_layout: wgpu::BindGroupLayout,
    opaque: wgpu::RenderPipeline,
    capture: wgpu::RenderPipeline,
    uploaded: Vec<Arc<Uploaded>>,
    lists: Lists,
}

/// The pool of layers and the heads of the lists.
#[derive(Debug)]
struct Lists {
    heads: wgpu::Buffer,
    layers: wgpu::Buffer,
    totals: wgpu::Buffer,
    capacity: u32,
}

/// One mesh of a frame: what it reads, where its uniform begins, and its vertices.
#[derive(Debug)]
struct Draw {
    group: wgpu::BindGroup,
    offset: u32,
    vertices: u32,
}

/// The meshes of one frame.
#[derive(Debug)]
pub(crate) struct Prepared {
    opaque: Vec<Draw>,
    translucent: Vec<Draw>,
}

impl Prepared {
    pub(crate) fn has_layers(&self) -> bool {
        !self.translucent.is_empty()
    }
}

impl Surfaces {
    pub(crate) fn new(gpu: &Gpu, frame: &wgpu::BindGroupLayout) -> Result<Self, GpuError> {
        use wgpu::{BufferBindingType as B, ShaderStages as S};
        let device = &gpu.device;
        let group = |label, entries: &[wgpu::BindGroupLayoutEntry]| {
            device.create_bind_group_layout(&wgpu::BindGroupLayoutDescriptor { label: Some(label), entries })
        };
        let surface_layout = group(
            "surfaces.surface",
            &[
                buffer_entry(0, S::VERTEX | S::FRAGMENT, B::Uniform, true),
                buffer_entry(1, S::VERTEX, B::Storage { read_only: true }, false),
            ],
        );
        let write = B::Storage { read_only: false };
        let capture_layout = group(
            "surfaces.capture",
            &[
                buffer_entry(0, S::FRAGMENT, write, false),
                buffer_entry(1, S::FRAGMENT, write, false),
                buffer_entry(2, S::FRAGMENT, write, false),
                texture_entry(3, wgpu::TextureViewDimension::D2, false),
            ],
        );
        let module = shader::module(device, "passes/surfaces/surfaces.wgsl");
        let layout = |label, groups: &[Option<&wgpu::BindGroupLayout>]| {
            device.create_pipeline_layout(&wgpu::PipelineLayoutDescriptor {
                label: Some(label),
                bind_group_layouts: groups,
                immediate_size: 0,
            })
        };
        let plain = |format: wgpu::TextureFormat| Some(format.into());
        let draw = |label, layout: &wgpu::PipelineLayout, entry, targets: &[_], depth| {
            device.create_render_pipeline(&wgpu::RenderPipelineDescriptor {
                label: Some(label),
                layout: Some(layout),
                vertex: wgpu::VertexState {
                    module: &module,
                    entry_point: Some("vs_main"),
                    compilation_options: Default::default(),
                    buffers: &[],
                },
                primitive: Default::default(),
                depth_stencil: depth,
                multisample: Default::default(),
                fragment: Some(wgpu::FragmentState {
                    module: &module,
                    entry_point: Some(entry),
                    compilation_options: Default::default(),
                    targets,
                }),
                multiview_mask: None,
                cache: None,
            })
        };
        let opaque = draw(
            "surfaces.opaque",
            &layout("surfaces.opaque", &[Some(frame), Some(&surface_layout)]),
            "fs_opaque",
            &[plain(wgpu::TextureFormat::Rgba32Float), plain(ZETA)],
            Some(depth_state(true, wgpu::CompareFunction::Greater)),
        );
        let capture = draw(
            "surfaces.capture",
            &layout("surfaces.capture", &[Some(frame), Some(&surface_layout), Some(&capture_layout)]),
            "fs_capture",
            &[],
            Some(depth_state(false, wgpu::CompareFunction::Always)),
        );
        let lists = Lists::new(gpu, 1, 1);
        gpu.check()?;
        let uploaded = Vec::new();
        Ok(Self { surface_layout, capture_layout, opaque, capture, uploaded, lists })
    }

    /// Uploads meshes that are new and the place and colour of all. `near_mm` is where zeta is 0.
    pub(crate) fn prepare(&mut self, gpu: &Gpu, meshes: &[MeshItem], view: &View, near_mm: f64) -> Prepared {
        let mut uniforms = vec![0_u8; meshes.len().max(1) * SURFACE_STRIDE];
        let mut drawn = Vec::new();
        for (index, item) in meshes.iter().enumerate() {
            if item.opacity <= 0.0 {
                continue;
            }
            let uploaded = self.uploaded(gpu, &item.mesh);
            let to_near = Affine::translation(Vector::new(0.0, 0.0, -near_mm));
            let zeta_from_mesh =
                to_near * view.view_from_world * item.pose * Affine::translation(uploaded.middle);
            let normal = |axis: usize| {
                let mut n = Vector::zeros();
                n[axis] = 1.0;
                let n = zeta_from_mesh.normal(&n);
                [n.x as f32, n.y as f32, n.z as f32, 0.0]
            };
            let [r, g, b] = item.color.map(|c| c as f32);
            let surface = gpu_data::Surface {
                view_from_mesh: glam::DMat4::from_cols_slice(zeta_from_mesh.matrix().as_slice()).as_mat4(),
                normal_x: normal(0),
                normal_y: normal(1),
                normal_z: normal(2),
                color: [r, g, b, item.opacity as f32],
                lit: u32::from(item.shading == Shading::Lit),
                mesh: index as u32,
                pad_0: 0,
                pad_1: 0,
            };
            let offset = index * SURFACE_STRIDE;
            let bytes = bytemuck::bytes_of(&surface);
            uniforms[offset..offset + bytes.len()].copy_from_slice(bytes);
            drawn.push((uploaded, offset as u32, item.opacity >= 1.0));
        }
        // What no mesh of this frame uses is let go of.
        self.uploaded.retain(|u| meshes.iter().any(|m| Arc::ptr_eq(&m.mesh, &u.mesh)));
        let buffer = upload(gpu, "surfaces.uniforms", &uniforms, wgpu::BufferUsages::UNIFORM);
        let (mut opaque, mut translucent) = (Vec::new(), Vec::new());
        for (mesh, offset, is_opaque) in drawn {
            let group = gpu.device.create_bind_group(&wgpu::BindGroupDescriptor {
                label: Some("surfaces.surface"),
                layout: &self.surface_layout,
                entries: &[
                    wgpu::BindGroupEntry {
                        binding: 0,
                        resource: wgpu::BindingResource::Buffer(wgpu::BufferBinding {
                            buffer: &buffer,
                            offset: 0,
                            size: std::num::NonZeroU64::new(size_of::<gpu_data::Surface>() as u64),
                        }),
                    },
                    wgpu::BindGroupEntry { binding: 1, resource: mesh.triangles.as_entire_binding() },
                ],
            });
            let list = if is_opaque { &mut opaque } else { &mut translucent };
            list.push(Draw { group, offset, vertices: mesh.count * 6 });
        }
        Prepared { opaque, translucent }
    }

    fn uploaded(&mut self, gpu: &Gpu, mesh: &Arc<TriangleMesh>) -> Arc<Uploaded> {
        if let Some(found) = self.uploaded.iter().find(|u| Arc::ptr_eq(&u.mesh, mesh)) {
            return Arc::clone(found);
        }
        let [low, high] = mesh.bounds();
        let middle = (low.coords + high.coords) / 2.0;
        let triangle = |t: usize| {
            let [a, b, c] = mesh.corners(t);
            // Unit length before rounding: a model in metres has normals of 1e-6.
            let n = (b - a).cross(&(c - a)).try_normalize(0.0).unwrap_or_else(Vector::zeros);
            let at = |p: Point| p.coords - middle;
            [at(a), at(b), at(c), n].map(|v| [v.x as f32, v.y as f32, v.z as f32, 0.0])
        };
        let triangles: Vec<[[f32; 4]; 4]> = (0..mesh.triangles().len()).map(triangle).collect();
        let made = Arc::new(Uploaded {
            mesh: Arc::clone(mesh),
            middle,
            count: triangles.len() as u32,
            triangles: upload(
                gpu,
                "surfaces.triangles",
                bytemuck::cast_slice(&triangles),
                wgpu::BufferUsages::STORAGE,
            ),
        });
        self.uploaded.push(Arc::clone(&made));
        made
    }

    /// Records the opaque meshes over the whole picture and clears depth and zeta for the frame.
    pub(crate) fn draw_opaque(
        &self,
        encoder: &mut wgpu::CommandEncoder,
        prepared: &Prepared,
        target: &Target,
        frame: &wgpu::BindGroup,
    ) {
        let clear = |view, red: f64| {
            let value = wgpu::Color { r: red, g: 0.0, b: 0.0, a: 0.0 };
            Some(wgpu::RenderPassColorAttachment {
                view,
                depth_slice: None,
                resolve_target: None,
                ops: wgpu::Operations { load: wgpu::LoadOp::Clear(value), store: wgpu::StoreOp::Store },
            })
        };
        let mut pass = encoder.begin_render_pass(&wgpu::RenderPassDescriptor {
            label: Some("surfaces.opaque"),
            color_attachments: &[
                clear(&target.opaque_color_view, 0.0),
                clear(&target.opaque_zeta_view, f64::from(f32::MAX)),
            ],
            depth_stencil_attachment: Some(wgpu::RenderPassDepthStencilAttachment {
                view: &target.depth_view,
                depth_ops: Some(wgpu::Operations {
                    load: wgpu::LoadOp::Clear(0.0),
                    store: wgpu::StoreOp::Store,
                }),
                stencil_ops: None,
            }),
            ..Default::default()
        });
        pass.set_pipeline(&self.opaque);
        pass.set_bind_group(0, frame, &[]);
        for draw in &prepared.opaque {
            pass.set_bind_group(1, &draw.group, &[draw.offset]);
            pass.draw(0..draw.vertices, 0..1);
        }
    }

    /// Makes room for the lists of `pixels` pixels and at least `layers` layers.
    pub(crate) fn reserve(&mut self, gpu: &Gpu, pixels: u32, layers: u32) {
        if self.lists.heads.size() < u64::from(pixels) * HEAD_BYTES || self.lists.capacity < layers {
            self.lists = Lists::new(gpu, pixels, layers.max(self.lists.capacity));
        }
    }

    /// Layers that the pool holds.
    pub(crate) fn capacity(&self) -> u32 {
        self.lists.capacity
    }

    /// Heads and layers, for the slabs.
    pub(crate) fn lists(&self) -> [&wgpu::Buffer; 2] {
        [&self.lists.heads, &self.lists.layers]
    }

    /// Captures the translucent layers of the rows that `frame` names, and waits for it. Returns how many
    /// there are, which is more than were kept if it is more than [`Self::capacity`], and the most on one
    /// pixel.
    pub(crate) fn capture(
        &self,
        gpu: &Gpu,
        prepared: &Prepared,
        target: &Target,
        frame: &wgpu::BindGroup,
        rows: std::ops::Range<u32>,
    ) -> Result<(u32, u32), GpuError> {
        let lists = &self.lists;
        let entry = |binding, resource| wgpu::BindGroupEntry { binding, resource };
        let capture = gpu.device.create_bind_group(&wgpu::BindGroupDescriptor {
            label: Some("surfaces.capture"),
            layout: &self.capture_layout,
            entries: &[
                entry(0, lists.heads.as_entire_binding()),
                entry(1, lists.layers.as_entire_binding()),
                entry(2, lists.totals.as_entire_binding()),
                entry(3, wgpu::BindingResource::TextureView(&target.opaque_zeta_view)),
            ],
        });
        let mut encoder = gpu.device.create_command_encoder(&wgpu::CommandEncoderDescriptor::default());
        let empty = vec![0xff_u8; lists.heads.size() as usize];
        gpu.queue.write_buffer(&lists.heads, 0, &empty);
        encoder.clear_buffer(&lists.totals, 0, None);
        {
            let mut pass = encoder.begin_render_pass(&wgpu::RenderPassDescriptor {
                label: Some("surfaces.capture"),
                depth_stencil_attachment: Some(wgpu::RenderPassDepthStencilAttachment {
                    view: &target.depth_view,
                    depth_ops: Some(wgpu::Operations {
                        load: wgpu::LoadOp::Load,
                        store: wgpu::StoreOp::Store,
                    }),
                    stencil_ops: None,
                }),
                ..Default::default()
            });
            pass.set_scissor_rect(0, rows.start, target.size[0], rows.end - rows.start);
            pass.set_pipeline(&self.capture);
            pass.set_bind_group(0, frame, &[]);
            pass.set_bind_group(2, &capture, &[]);
            for draw in &prepared.translucent {
                pass.set_bind_group(1, &draw.group, &[draw.offset]);
                pass.draw(0..draw.vertices, 0..1);
            }
        }
        gpu.submit(Some(encoder));
        let totals: Vec<u32> = bytemuck::pod_collect_to_vec(&read_buffer(gpu, &lists.totals, 8)?);
        Ok((totals[0], totals[1]))
    }
}

impl Lists {
    fn new(gpu: &Gpu, pixels: u32, capacity: u32) -> Self {
        let buffer = |label, size, more| {
            gpu.device.create_buffer(&wgpu::BufferDescriptor {
                label: Some(label),
                size,
                usage: wgpu::BufferUsages::STORAGE | more,
                mapped_at_creation: false,
            })
        };
        let target = wgpu::BufferUsages::COPY_DST;
        Self {
            heads: buffer("surfaces.heads", u64::from(pixels) * HEAD_BYTES, target),
            layers: buffer("surfaces.layers", u64::from(capacity) * LAYER_BYTES, wgpu::BufferUsages::empty()),
            totals: buffer("surfaces.totals", 8, target | wgpu::BufferUsages::COPY_SRC),
            capacity,
        }
    }
}
