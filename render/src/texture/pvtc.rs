//! The decoder of PVTC <S,T> on the device: one invocation a sub-volume, bytes equal to the CPU's decoder.
//!
//! A shader cannot write the bytes of an R8 texture everywhere, so it writes them into a buffer, four a word, from
//! which they are copied. What a storage binding cannot hold at once is decoded in parts, whole layers of
//! sub-volumes each.

use compress::{Extent3, pvtc};

use super::create;
use crate::gpu::{Gpu, GpuError, read_buffer};
use crate::shader;
use crate::volume::{PackedFormat, PackedStep};

/// Sub-volumes of a workgroup, along x.
const GROUP: u32 = 64;

/// GPU mirror of `pvtc.wgsl`.
pub(crate) mod gpu_data {
    /// `Decode`.
    #[repr(C)]
    #[derive(Debug, Clone, Copy, PartialEq, Default, bytemuck::Pod, bytemuck::Zeroable)]
    pub(crate) struct Decode {
        pub(crate) columns: u32,
        pub(crate) rows: u32,
        pub(crate) layers: u32,
        pub(crate) layer_first: u32,
        pub(crate) s: u32,
        pub(crate) slices: u32,
        pub(crate) pitch: u32,
        pub(crate) table_first: u32,
        pub(crate) shift: u32,
        pub(crate) top: u32,
        pub(crate) pad_0: u32,
        pub(crate) pad_1: u32,
    }
}

/// The pipeline, and the buffers of the step before: the next one is most often of the same size.
#[derive(Debug)]
pub(super) struct Decoder {
    layout: wgpu::BindGroupLayout,
    pipeline: wgpu::ComputePipeline,
    packed: Option<wgpu::Buffer>,
    samples: Option<wgpu::Buffer>,
}

impl Decoder {
    pub(super) fn new(gpu: &Gpu) -> Result<Self, GpuError> {
        let device = &gpu.device;
        let entry =
            |binding, ty| crate::target::buffer_entry(binding, wgpu::ShaderStages::COMPUTE, ty, false);
        let storage = |read_only| wgpu::BufferBindingType::Storage { read_only };
        let layout = device.create_bind_group_layout(&wgpu::BindGroupLayoutDescriptor {
            label: Some("pvtc"),
            entries: &[
                entry(0, wgpu::BufferBindingType::Uniform),
                entry(1, storage(true)),
                entry(2, storage(false)),
            ],
        });
        let module = shader::module(device, "texture/pvtc.wgsl");
        let pipeline = device.create_compute_pipeline(&wgpu::ComputePipelineDescriptor {
            label: Some("pvtc.pipeline"),
            layout: Some(&device.create_pipeline_layout(&wgpu::PipelineLayoutDescriptor {
                label: Some("pvtc.layout"),
                bind_group_layouts: &[Some(&layout)],
                immediate_size: 0,
            })),
            module: &module,
            entry_point: Some("decode_sub_volumes"),
            compilation_options: Default::default(),
            cache: None,
        });
        gpu.check()?;
        Ok(Self { layout, pipeline, packed: None, samples: None })
    }

    /// Records and submits the decoding of a step of `layout` into an R8 texture of its extent.
    pub(super) fn decode(
        &mut self,
        gpu: &Gpu,
        layout: pvtc::Layout,
        step: &PackedStep,
        extent: Extent3,
        texture: &wgpu::Texture,
    ) {
        let plan = Parts::new(gpu, layout, extent);
        let packed = reuse(&mut self.packed, gpu, step.bytes().len() as u64, wgpu::BufferUsages::COPY_DST);
        gpu.queue.write_buffer(&packed, 0, step.bytes());
        let samples =
            reuse(&mut self.samples, gpu, plan.bytes(plan.layers_at_once), wgpu::BufferUsages::COPY_SRC);
        let mut encoder = gpu.device.create_command_encoder(&wgpu::CommandEncoderDescriptor::default());
        for part in plan.parts(layout, step.step()) {
            let uniform = crate::passes::slabs::upload(
                gpu,
                "pvtc.decode",
                bytemuck::bytes_of(&part),
                wgpu::BufferUsages::UNIFORM,
            );
            let group = gpu.device.create_bind_group(&wgpu::BindGroupDescriptor {
                label: Some("pvtc"),
                layout: &self.layout,
                entries: &[(0, &uniform), (1, &packed), (2, &samples)]
                    .map(|(binding, b)| wgpu::BindGroupEntry { binding, resource: b.as_entire_binding() }),
            });
            let layers = (part.layers - part.layer_first).min(plan.layers_at_once);
            let mut pass = encoder.begin_compute_pass(&wgpu::ComputePassDescriptor::default());
            pass.set_pipeline(&self.pipeline);
            pass.set_bind_group(0, &group, &[]);
            pass.dispatch_workgroups(part.columns.div_ceil(GROUP), part.rows, layers);
            drop(pass);
            let first = part.layer_first * part.s;
            encoder.copy_buffer_to_texture(
                wgpu::TexelCopyBufferInfo {
                    buffer: &samples,
                    layout: wgpu::TexelCopyBufferLayout {
                        offset: 0,
                        bytes_per_row: Some(4 * part.pitch),
                        rows_per_image: Some(4 * part.rows),
                    },
                },
                wgpu::TexelCopyTextureInfo {
                    texture,
                    mip_level: 0,
                    origin: wgpu::Origin3d { x: 0, y: 0, z: first },
                    aspect: wgpu::TextureAspect::All,
                },
                wgpu::Extent3d {
                    depth_or_array_layers: (layers * part.s).min(part.slices - first),
                    ..texture.size()
                },
            );
        }
        gpu.submit(Some(encoder));
    }
}

/// How a volume is decoded in parts.
#[derive(Debug)]
struct Parts {
    sub_volumes: [u32; 3],
    s: u32,
    slices: u32,
    /// Words of a row of voxels.
    pitch: u32,
    table_first: u32,
    layers_at_once: u32,
}

impl Parts {
    fn new(gpu: &Gpu, layout: pvtc::Layout, extent: Extent3) -> Self {
        let sub_volumes = layout.sub_volumes(extent).map(|n| n as u32);
        let pitch = sub_volumes[0].next_multiple_of(wgpu::COPY_BYTES_PER_ROW_ALIGNMENT / 4);
        let mut parts = Self {
            sub_volumes,
            s: u32::from(layout.s()),
            slices: extent.z() as u32,
            pitch,
            table_first: (layout.head_len(extent) / 4) as u32,
            layers_at_once: 1,
        };
        let most = gpu.caps().storage_bytes / parts.bytes(1).max(1);
        parts.layers_at_once = (most.min(u64::from(u32::MAX)) as u32).clamp(1, sub_volumes[2]);
        parts
    }

    /// Bytes of the output of some layers of sub-volumes.
    fn bytes(&self, layers: u32) -> u64 {
        u64::from(self.pitch) * 16 * u64::from(self.sub_volumes[1]) * u64::from(self.s) * u64::from(layers)
    }

    fn parts(&self, layout: pvtc::Layout, step: usize) -> Vec<gpu_data::Decode> {
        let [columns, rows, layers] = self.sub_volumes;
        let (shift, top) = layout.field(step).unwrap_or_default();
        (0..layers)
            .step_by(self.layers_at_once as usize)
            .map(|layer_first| gpu_data::Decode {
                columns,
                rows,
                layers,
                layer_first,
                s: self.s,
                slices: self.slices,
                pitch: self.pitch,
                table_first: self.table_first,
                shift,
                top,
                ..Default::default()
            })
            .collect()
    }
}

/// The buffer kept if it is large enough, or a new one in its place.
fn reuse(kept: &mut Option<wgpu::Buffer>, gpu: &Gpu, bytes: u64, usage: wgpu::BufferUsages) -> wgpu::Buffer {
    if let Some(buffer) = kept.as_ref().filter(|b| b.size() >= bytes) {
        return buffer.clone();
    }
    let made = gpu.device.create_buffer(&wgpu::BufferDescriptor {
        label: Some("pvtc.buffer"),
        size: bytes.next_multiple_of(4),
        usage: usage | wgpu::BufferUsages::STORAGE,
        mapped_at_creation: false,
    });
    kept.insert(made).clone()
}

/// The samples of a PVTC step as the device decodes them, `[x, y, z]`, x fastest, one byte each: to compare with the
/// CPU's decoder, and to measure.
///
/// # Errors
/// [`GpuError::Encode`] for a step of another format; what the device reports.
pub fn decode_on_device(gpu: &Gpu, step: &PackedStep) -> Result<Vec<u8>, GpuError> {
    let failed = |e: &dyn std::fmt::Display| GpuError::Encode { reason: e.to_string() };
    let PackedFormat::Pvtc { s, t } = step.format() else {
        return Err(failed(&format!("{} is not decoded by a shader", step.format())));
    };
    let layout = pvtc::Layout::new(s, t).map_err(|e| failed(&e))?;
    let sizes = step.extent().map(|n| n as u32);
    let extent = Extent3::new(sizes).map_err(|e| failed(&e))?;
    let texture = create(gpu, wgpu::TextureFormat::R8Unorm, sizes);
    Decoder::new(gpu)?.decode(gpu, layout, step, extent, &texture);
    let pitch = sizes[0].next_multiple_of(wgpu::COPY_BYTES_PER_ROW_ALIGNMENT);
    let buffer = gpu.device.create_buffer(&wgpu::BufferDescriptor {
        label: Some("pvtc.readback"),
        size: u64::from(pitch) * u64::from(sizes[1]) * u64::from(sizes[2]),
        usage: wgpu::BufferUsages::COPY_DST | wgpu::BufferUsages::COPY_SRC,
        mapped_at_creation: false,
    });
    let mut encoder = gpu.device.create_command_encoder(&wgpu::CommandEncoderDescriptor::default());
    encoder.copy_texture_to_buffer(
        texture.as_image_copy(),
        wgpu::TexelCopyBufferInfo {
            buffer: &buffer,
            layout: wgpu::TexelCopyBufferLayout {
                offset: 0,
                bytes_per_row: Some(pitch),
                rows_per_image: Some(sizes[1]),
            },
        },
        texture.size(),
    );
    gpu.submit(Some(encoder));
    let bytes = read_buffer(gpu, &buffer, buffer.size())?;
    Ok(bytes.chunks(pitch as usize).flat_map(|row| &row[..sizes[0] as usize]).copied().collect())
}
