// The picture over its background, for the window.

#import "shared/frame.wgsl"

@group(1) @binding(0) var picture: texture_2d<f32>;

@vertex
fn vs_main(@builtin(vertex_index) index: u32) -> @builtin(position) vec4<f32> {
    let corner = vec2<f32>(f32(index & 1u) * 4.0 - 1.0, f32(index >> 1u) * 4.0 - 1.0);
    return vec4<f32>(corner, 0.0, 1.0);
}

@fragment
fn fs_main(@builtin(position) position: vec4<f32>) -> @location(0) vec4<f32> {
    let texel = textureLoad(picture, vec2<u32>(position.xy), 0);
    return vec4<f32>(texel.rgb + (1.0 - texel.a) * frame.background.rgb, 1.0);
}
