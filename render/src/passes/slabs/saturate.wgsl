// Finished pixels: writes the nearest depth where the picture lets less through than the frame says, so that the
// depth test drops every later slab there.

#import "shared/frame.wgsl"

@group(1) @binding(0) var picture: texture_2d<f32>;

@vertex
fn vs_main(@builtin(vertex_index) index: u32) -> @builtin(position) vec4<f32> {
    let corner = vec2<f32>(f32(index & 1u) * 4.0 - 1.0, f32(index >> 1u) * 4.0 - 1.0);
    return vec4<f32>(corner, 1.0, 1.0);
}

@fragment
fn fs_main(@builtin(position) position: vec4<f32>) {
    if textureLoad(picture, vec2<u32>(position.xy), 0).a < 1.0 - frame.through {
        discard;
    }
}
