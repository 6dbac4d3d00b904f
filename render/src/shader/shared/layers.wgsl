// Translucent surfaces of a pixel: a linked list in a pool, in no order. The heads buffer has two numbers
// a pixel: the first layer's place in the pool, and the list's length less 1 (both 2^32 - 1 when empty).
// Mirror: `passes::surfaces::{LAYER_BYTES, HEAD_BYTES}`.

struct Layer {
    // Display colour and opacity.
    color: vec4<f32>,
    zeta: f32,
    next: u32,
    // Which mesh: decides between equal depths.
    mesh: u32,
    pad_0: u32,
}

const NO_LAYER: u32 = 0xffffffffu;

fn list_index(pixel: vec2<u32>) -> u32 {
    return (pixel.y - frame.band_first) * u32(frame.size.x) + pixel.x;
}

// The order in which layers composite: by depth, then by mesh, then by place in the pool. Only layers of
// one mesh, which look alike, are told apart by their place, so the picture does not depend on the order
// in which the rasteriser came by.
fn precedes(a: Layer, node_a: u32, b: Layer, node_b: u32) -> bool {
    if a.zeta != b.zeta {
        return a.zeta < b.zeta;
    }
    if a.mesh != b.mesh {
        return a.mesh < b.mesh;
    }
    return node_a < node_b;
}
