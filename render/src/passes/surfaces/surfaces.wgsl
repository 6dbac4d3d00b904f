// Triangle meshes: opaque ones by depth, translucent ones into the lists of layers.
//
// The rasteriser rounds corners to 1/256 of a pixel, which at a silhouette decides over a whole surface.
// So it only finds candidates: each triangle is drawn as its bounding rectangle with a margin, and the
// pixel's ray is tested against the triangle itself. A shared edge is computed from the same two corners
// in the same order by both its triangles, so every ray crosses exactly one of them
// (Woop, Benthin, Wald 2013, "Watertight ray/triangle intersection").

#import "shared/frame.wgsl"
#import "shared/layers.wgsl"
#import "shared/light.wgsl"

struct Surface {
    // To view space: x right and y up in mm, z = zeta. Column-major.
    view_from_mesh: mat4x4<f32>,
    // Columns of the matrix for normals.
    normal_x: vec4<f32>,
    normal_y: vec4<f32>,
    normal_z: vec4<f32>,
    // Display colour and opacity.
    color: vec4<f32>,
    // 1: lit from the eye.
    lit: u32,
    mesh: u32,
    pad_0: u32,
    pad_1: u32,
}

struct Triangle {
    a: vec4<f32>,
    b: vec4<f32>,
    c: vec4<f32>,
    normal: vec4<f32>,
}

@group(1) @binding(0) var<uniform> surface: Surface;
@group(1) @binding(1) var<storage, read> triangles: array<Triangle>;

@group(2) @binding(0) var<storage, read_write> heads: array<atomic<u32>>;
@group(2) @binding(1) var<storage, read_write> layers: array<Layer>;
// How many layers there are in all, and at most on one pixel.
@group(2) @binding(2) var<storage, read_write> totals: array<atomic<u32>, 2>;
@group(2) @binding(3) var opaque_zeta: texture_2d<f32>;

struct VertexOut {
    @builtin(position) position: vec4<f32>,
    @location(0) @interpolate(flat) a: vec3<f32>,
    @location(1) @interpolate(flat) b: vec3<f32>,
    @location(2) @interpolate(flat) c: vec3<f32>,
    @location(3) @interpolate(flat) normal: vec3<f32>,
}

// Margin of the bounding rectangle, pixels.
const MARGIN: f32 = 0.05;

fn to_view(p: vec4<f32>) -> vec3<f32> {
    return (surface.view_from_mesh * vec4<f32>(p.xyz, 1.0)).xyz;
}

fn ndc_of_view(p: vec3<f32>) -> vec2<f32> {
    if frame.perspective > 0.5 {
        return p.xy / (frame.lens * (frame.near_mm + p.z));
    }
    return p.xy / frame.lens;
}

@vertex
fn vs_main(@builtin(vertex_index) index: u32) -> VertexOut {
    let triangle = triangles[index / 6u];
    var out: VertexOut;
    out.a = to_view(triangle.a);
    out.b = to_view(triangle.b);
    out.c = to_view(triangle.c);
    let n = triangle.normal.xyz;
    out.normal = n.x * surface.normal_x.xyz + n.y * surface.normal_y.xyz + n.z * surface.normal_z.xyz;

    let nearest = frame.near_mm + min(out.a.z, min(out.b.z, out.c.z));
    let farthest = frame.near_mm + max(out.a.z, max(out.b.z, out.c.z));
    var low = vec2<f32>(-1.0);
    var high = vec2<f32>(1.0);
    // A corner that is near the eye beside the others has lost digits there: the whole picture is looked at then.
    if frame.perspective < 0.5 || nearest > max(NEAR_CLIP_MM, 0.01 * farthest) {
        let a = ndc_of_view(out.a);
        let b = ndc_of_view(out.b);
        let c = ndc_of_view(out.c);
        let margin = 2.0 * MARGIN / frame.size;
        low = clamp(min(a, min(b, c)) - margin, vec2<f32>(-1.0), vec2<f32>(1.0));
        high = clamp(max(a, max(b, c)) + margin, vec2<f32>(-1.0), vec2<f32>(1.0));
    } else if farthest < NEAR_CLIP_MM {
        high = low;
    }
    // Two triangles of a rectangle: corners 0 1 2, 2 1 3.
    let corner = array<u32, 6>(0u, 1u, 2u, 2u, 1u, 3u)[index % 6u];
    let part = vec2<f32>(f32(corner & 1u), f32(corner >> 1u));
    out.position = vec4<f32>(low + (high - low) * part, 0.5, 1.0);
    return out;
}

// The side of the ray that the edge p to q passes on: 1 or -1, never 0, and opposite for q to p. `area` is
// twice the signed area that the ray makes with the edge.
struct EdgeSide {
    area: f32,
    side: f32,
}

fn edge_side(p: vec2<f32>, q: vec2<f32>) -> EdgeSide {
    let ordered = p.x < q.x || (p.x == q.x && p.y < q.y);
    let first = select(q, p, ordered);
    let second = select(p, q, ordered);
    let turn = select(-1.0, 1.0, ordered);
    let area = first.x * second.y - first.y * second.x;
    return EdgeSide(turn * area, turn * select(-1.0, 1.0, area >= 0.0));
}

// Where the pixel's ray crosses the triangle; `hit` is 0 where it does not.
struct Crossing {
    zeta: f32,
    hit: bool,
}

fn crossing_of(in: VertexOut) -> Crossing {
    let lens = ndc_of(vec2<u32>(in.position.xy)) * frame.lens;
    let origin = lens * select(1.0, frame.near_mm, frame.perspective > 0.5);
    let slope = lens * frame.perspective;
    // Corners sheared along the ray, so that it becomes the origin of a plane.
    let a = in.a.xy - (origin + slope * in.a.z);
    let b = in.b.xy - (origin + slope * in.b.z);
    let c = in.c.xy - (origin + slope * in.c.z);
    let u = edge_side(b, c);
    let v = edge_side(c, a);
    let w = edge_side(a, b);
    let all = u.area + v.area + w.area;
    let zeta = (u.area * in.a.z + v.area * in.b.z + w.area * in.c.z) / all;
    let hit = u.side == v.side && v.side == w.side && all != 0.0 && frame.near_mm + zeta >= 0.0;
    return Crossing(zeta, hit);
}

fn color_of(in: VertexOut) -> vec3<f32> {
    let size = length(in.normal);
    if surface.lit == 0u || size == 0.0 {
        return surface.color.rgb;
    }
    let ray = ray_direction(ndc_of(vec2<u32>(in.position.xy)));
    return lit(surface.color.rgb, abs(dot(in.normal / size, ray)));
}

struct OpaqueOut {
    @location(0) color: vec4<f32>,
    @location(1) zeta: f32,
    @builtin(frag_depth) depth: f32,
}

@fragment
fn fs_opaque(in: VertexOut) -> OpaqueOut {
    let crossing = crossing_of(in);
    if !crossing.hit {
        discard;
    }
    return OpaqueOut(vec4<f32>(color_of(in), 1.0), crossing.zeta, depth_of(crossing.zeta));
}

@fragment
fn fs_capture(in: VertexOut) {
    let pixel = vec2<u32>(in.position.xy);
    let crossing = crossing_of(in);
    if !crossing.hit || crossing.zeta >= textureLoad(opaque_zeta, pixel, 0).r {
        return;
    }
    let slot = atomicAdd(&totals[0], 1u);
    if slot >= frame.layer_capacity {
        return;
    }
    let list = 2u * list_index(pixel);
    let length = atomicAdd(&heads[list + 1u], 1u) + 2u;
    atomicMax(&totals[1], length);
    let before = atomicExchange(&heads[list], slot);
    layers[slot] =
        Layer(vec4<f32>(color_of(in), surface.color.a), crossing.zeta, before, surface.mesh, 0u);
}
