// What every pass knows of the picture. Mirror: `view::gpu_data::Frame`.
//
// A place in the picture is `zeta`, the depth in mm behind the near plane of the slab stack, on the ray
// of a pixel. Whatever is linear in space is, on that ray, a `Form`: its value at the near plane and its
// growth per mm of zeta, each affine in the pixel's normalised coordinates. The forms are made in f64 on
// the CPU, so that no large coordinate ever reaches the f32 of a shader.

struct Frame {
    // Pixels.
    size: vec2<f32>,
    // First row of the band being drawn.
    band_first: u32,
    // Layers that fit in the pool.
    layer_capacity: u32,
    // Tangents of half the field of view (perspective) or half the picture in mm (parallel).
    lens: vec2<f32>,
    // 1 for perspective, 0 for parallel.
    perspective: f32,
    // Depth of the near plane behind the eye, mm.
    near_mm: f32,
    // Depth of the stack behind the near plane, mm.
    depth_mm: f32,
    // Depth of a sub-step, mm.
    step_mm: f32,
    // Sub-steps in a slab.
    steps: u32,
    // Most translucent layers on one pixel.
    layer_most: u32,
    background: vec4<f32>,
    // A pixel that lets less than this through is finished.
    through: f32,
    pad_0: f32,
    pad_1: f32,
    pad_2: f32,
}

struct Form {
    at_near: vec4<f32>,
    per_mm: vec4<f32>,
}

@group(0) @binding(0) var<uniform> frame: Frame;

// Normalised coordinates of a pixel's centre: x right, y up, -1 to 1.
fn ndc_of(pixel: vec2<u32>) -> vec2<f32> {
    let part = (vec2<f32>(pixel) + 0.5) / frame.size;
    return vec2<f32>(part.x * 2.0 - 1.0, 1.0 - part.y * 2.0);
}

// Path length of one mm of zeta.
fn mm_per_zeta(ndc: vec2<f32>) -> f32 {
    let slope = ndc * frame.lens * frame.perspective;
    return sqrt(1.0 + dot(slope, slope));
}

// Unit direction of the ray in view space: x right, y up, z into the picture.
fn ray_direction(ndc: vec2<f32>) -> vec3<f32> {
    return normalize(vec3<f32>(ndc * frame.lens * frame.perspective, 1.0));
}

// Reversed depth for the depth test: 1 near, 0 far.
fn depth_of(zeta: f32) -> f32 {
    if frame.perspective > 0.5 {
        return min(1.0, NEAR_CLIP_MM / (frame.near_mm + zeta));
    }
    return 1.0 - zeta / frame.depth_mm;
}

// Surfaces nearer to a perspective eye than this are not told apart. The depth is a float, which keeps its digits
// however small it gets.
const NEAR_CLIP_MM: f32 = 1e-6;
