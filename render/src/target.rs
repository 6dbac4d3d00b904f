//! What a frame draws into, and the small pieces that passes over a whole picture share.

use crate::gpu::Gpu;

/// Format of depth for the depth test: reversed, 1 near.
pub(crate) const DEPTH: wgpu::TextureFormat = wgpu::TextureFormat::Depth32Float;
/// Format of the opaque surfaces' zeta.
pub(crate) const ZETA: wgpu::TextureFormat = wgpu::TextureFormat::R32Float;

/// The textures of one picture size.
#[derive(Debug)]
pub(crate) struct Target {
    pub(crate) size: [u32; 2],
    /// Premultiplied colour and opacity, accumulated front to back.
    pub(crate) picture: wgpu::Texture,
    pub(crate) picture_view: wgpu::TextureView,
    pub(crate) depth_view: wgpu::TextureView,
    pub(crate) opaque_color_view: wgpu::TextureView,
    pub(crate) opaque_zeta_view: wgpu::TextureView,
    pub(crate) display_view: wgpu::TextureView,
}

impl Target {
    pub(crate) fn new(gpu: &Gpu, size: [u32; 2]) -> Self {
        use wgpu::TextureUsages as U;
        gpu.count_call();
        let texture = |label, format, usage| {
            gpu.device.create_texture(&wgpu::TextureDescriptor {
                label: Some(label),
                size: wgpu::Extent3d { width: size[0], height: size[1], depth_or_array_layers: 1 },
                mip_level_count: 1,
                sample_count: 1,
                dimension: wgpu::TextureDimension::D2,
                format,
                usage,
                view_formats: &[],
            })
        };
        let view = |t: &wgpu::Texture| t.create_view(&wgpu::TextureViewDescriptor::default());
        let drawn = U::RENDER_ATTACHMENT | U::TEXTURE_BINDING;
        let picture = texture("target.picture", accumulation_format(gpu), drawn | U::COPY_SRC);
        let depth = texture("target.depth", DEPTH, U::RENDER_ATTACHMENT);
        let opaque_color = texture("target.opaque_color", wgpu::TextureFormat::Rgba32Float, drawn);
        let opaque_zeta = texture("target.opaque_zeta", ZETA, drawn);
        let display = texture("target.display", crate::passes::present::DISPLAY, drawn | U::COPY_SRC);
        Self {
            size,
            picture_view: view(&picture),
            depth_view: view(&depth),
            opaque_color_view: view(&opaque_color),
            opaque_zeta_view: view(&opaque_zeta),
            display_view: view(&display),
            picture,
        }
    }
}

/// 32-bit float where it blends, else 16-bit: then 512 faint slices err by about 1/255.
pub(crate) fn accumulation_format(gpu: &Gpu) -> wgpu::TextureFormat {
    if gpu.caps().float_blend { wgpu::TextureFormat::Rgba32Float } else { wgpu::TextureFormat::Rgba16Float }
}

/// A group of one float texture that is read texel by texel.
pub(crate) fn picture_layout(gpu: &Gpu) -> wgpu::BindGroupLayout {
    gpu.device.create_bind_group_layout(&wgpu::BindGroupLayoutDescriptor {
        label: Some("picture.layout"),
        entries: &[texture_entry(0, wgpu::TextureViewDimension::D2, false)],
    })
}

/// A float texture for the fragment stage.
pub(crate) fn texture_entry(
    binding: u32,
    view_dimension: wgpu::TextureViewDimension,
    filterable: bool,
) -> wgpu::BindGroupLayoutEntry {
    wgpu::BindGroupLayoutEntry {
        binding,
        visibility: wgpu::ShaderStages::FRAGMENT,
        ty: wgpu::BindingType::Texture {
            sample_type: wgpu::TextureSampleType::Float { filterable },
            view_dimension,
            multisampled: false,
        },
        count: None,
    }
}

/// A buffer for the stages named.
pub(crate) fn buffer_entry(
    binding: u32,
    visibility: wgpu::ShaderStages,
    ty: wgpu::BufferBindingType,
    has_dynamic_offset: bool,
) -> wgpu::BindGroupLayoutEntry {
    wgpu::BindGroupLayoutEntry {
        binding,
        visibility,
        ty: wgpu::BindingType::Buffer { ty, has_dynamic_offset, min_binding_size: None },
        count: None,
    }
}

pub(crate) fn bind_picture(
    gpu: &Gpu,
    layout: &wgpu::BindGroupLayout,
    picture: &wgpu::TextureView,
) -> wgpu::BindGroup {
    gpu.device.create_bind_group(&wgpu::BindGroupDescriptor {
        label: Some("picture"),
        layout,
        entries: &[wgpu::BindGroupEntry {
            binding: 0,
            resource: wgpu::BindingResource::TextureView(picture),
        }],
    })
}

/// One triangle over everything. With a colour format it writes that and no depth; without, it writes
/// depth only.
pub(crate) fn fullscreen_pipeline(
    gpu: &Gpu,
    label: &'static str,
    module: &wgpu::ShaderModule,
    groups: &[Option<&wgpu::BindGroupLayout>],
    color: Option<wgpu::TextureFormat>,
) -> wgpu::RenderPipeline {
    let layout = gpu.device.create_pipeline_layout(&wgpu::PipelineLayoutDescriptor {
        label: Some(label),
        bind_group_layouts: groups,
        immediate_size: 0,
    });
    let target = color.map(Into::into);
    gpu.device.create_render_pipeline(&wgpu::RenderPipelineDescriptor {
        label: Some(label),
        layout: Some(&layout),
        vertex: wgpu::VertexState {
            module,
            entry_point: Some("vs_main"),
            compilation_options: Default::default(),
            buffers: &[],
        },
        primitive: Default::default(),
        depth_stencil: color.is_none().then(|| depth_state(true, wgpu::CompareFunction::Always)),
        multisample: Default::default(),
        fragment: Some(wgpu::FragmentState {
            module,
            entry_point: Some("fs_main"),
            compilation_options: Default::default(),
            targets: if color.is_some() { std::slice::from_ref(&target) } else { &[] },
        }),
        multiview_mask: None,
        cache: None,
    })
}

pub(crate) fn depth_state(write: bool, compare: wgpu::CompareFunction) -> wgpu::DepthStencilState {
    wgpu::DepthStencilState {
        format: DEPTH,
        depth_write_enabled: Some(write),
        depth_compare: Some(compare),
        stencil: Default::default(),
        bias: Default::default(),
    }
}
