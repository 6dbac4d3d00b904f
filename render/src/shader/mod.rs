//! WGSL sources, joined by one directive: `#import "shared/frame.wgsl"`, each file at most once.
//!
//! Variants are `override` constants or entry points, nothing is conditional in the text.

/// Every WGSL file, by its path below `src/`.
pub const SOURCES: &[(&str, &str)] = &[
    ("shared/frame.wgsl", include_str!("shared/frame.wgsl")),
    ("shared/layers.wgsl", include_str!("shared/layers.wgsl")),
    ("shared/light.wgsl", include_str!("shared/light.wgsl")),
    ("passes/slabs/slabs.wgsl", include_str!("../passes/slabs/slabs.wgsl")),
    ("passes/slabs/saturate.wgsl", include_str!("../passes/slabs/saturate.wgsl")),
    ("passes/surfaces/surfaces.wgsl", include_str!("../passes/surfaces/surfaces.wgsl")),
    ("passes/present/present.wgsl", include_str!("../passes/present/present.wgsl")),
    ("texture/pvtc.wgsl", include_str!("../texture/pvtc.wgsl")),
];

/// The text of `name` with its imports in place; `None` where a name is not in [`SOURCES`].
pub fn joined(name: &str) -> Option<String> {
    let mut seen = Vec::new();
    let mut text = String::new();
    append(name, &mut seen, &mut text).then_some(text)
}

fn append(name: &str, seen: &mut Vec<String>, text: &mut String) -> bool {
    if seen.iter().any(|s| s == name) {
        return true;
    }
    seen.push(name.to_owned());
    let Some((_, source)) = SOURCES.iter().find(|(n, _)| *n == name) else { return false };
    for line in source.lines() {
        if let Some(import) = line.strip_prefix("#import ") {
            if !append(import.trim().trim_matches('"'), seen, text) {
                return false;
            }
        } else {
            text.push_str(line);
            text.push('\n');
        }
    }
    true
}

/// The compiled module of `name`, which must be in [`SOURCES`].
pub(crate) fn module(device: &wgpu::Device, name: &'static str) -> wgpu::ShaderModule {
    // A missing name is an empty module here and a failing test in `tests/shaders.rs`.
    let text = joined(name).unwrap_or_default();
    device.create_shader_module(wgpu::ShaderModuleDescriptor {
        label: Some(name),
        source: wgpu::ShaderSource::Wgsl(text.into()),
    })
}

/// The layout of a struct that Rust writes and a shader reads.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Mirror {
    /// Its name in WGSL.
    pub name: &'static str,
    /// Its members and their offsets in bytes, in order.
    pub fields: Vec<(&'static str, usize)>,
    /// Its size in bytes.
    pub size: usize,
}

/// A [`Mirror`] of a `repr(C)` struct with the fields named.
macro_rules! mirror {
    ($path:path as $name:literal { $($field:ident),* $(,)? }) => {{
        use $path as Struct;
        Mirror {
            name: $name,
            fields: vec![$((stringify!($field), std::mem::offset_of!(Struct, $field))),*],
            size: size_of::<Struct>(),
        }
    }};
}

/// Every struct that is written by Rust and read by a shader, for the test that compares the two.
pub fn mirrors() -> Vec<Mirror> {
    vec![
        mirror!(crate::view::gpu_data::Frame as "Frame" {
            size, band_first, layer_capacity, lens, perspective, near_mm, depth_mm, step_mm, steps, layer_most,
            background, through, pad_0, pad_1, pad_2,
        }),
        mirror!(crate::view::gpu_data::Form as "Form" { at_near, per_mm }),
        mirror!(crate::passes::slabs::gpu_data::Fragment as "Fragment" {
            u, v, w, gradient_x, gradient_y, gradient_z, table_scale, table_offset, table_row, unit_mm,
            plane_first, plane_end, round_first, round_end, block_first, block_end, rest_scale, rise_scale,
            low, high, channel, stack,
        }),
        mirror!(crate::passes::slabs::gpu_data::Round as "Round" {
            u, v, w, radius_mm, outside, pad_0, pad_1,
        }),
        mirror!(crate::texture::gpu_data::Decode as "Decode" {
            columns, rows, layers, layer_first, s, slices, pitch, table_first, shift, top, pad_0, pad_1,
        }),
        mirror!(crate::passes::surfaces::gpu_data::Surface as "Surface" {
            view_from_mesh, normal_x, normal_y, normal_z, color, lit, mesh, pad_0, pad_1,
        }),
    ]
}
