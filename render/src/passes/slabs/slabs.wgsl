// Proxy slices as slabs: each polygon covers what a slab of the common stack holds of one or more
// fragments, and the pixel integrates its own piece of the ray through them.
//
// A slab is cut into sub-steps. In each, a fragment contributes exactly the part of the sub-step that its
// cutters leave it; the scalar is taken as linear along that part, and extinction and
// extinction x colour are integrated exactly from their antiderivatives (pre-integration with a table of
// one dimension; Engel 2001, Lum 2004; Weiler 2003 for the antiderivative). Overlapping fragments add up
// before the exponential. Surfaces split the sub-step at their own depth.
//
// Loops run the same number of rounds in every pixel and skip what is over: Mesa 22.3's llvmpipe computes
// wrong values where the lanes of a loop leave it at different rounds.

#import "shared/frame.wgsl"
#import "shared/layers.wgsl"
#import "shared/light.wgsl"

struct Fragment {
    // Texture coordinates, 0 to 1 over texel edges.
    u: Form,
    v: Form,
    w: Form,
    // Gradient along each texture axis' voxel step to view space, in value spans per mm; w: step in
    // texture coordinates.
    gradient_x: vec4<f32>,
    gradient_y: vec4<f32>,
    gradient_z: vec4<f32>,
    // Table position of a texel value t: t * table_scale + table_offset.
    table_scale: f32,
    table_offset: f32,
    // First of the rows of the fragment's table.
    table_row: u32,
    // Length that a pre-classified opacity is of, mm.
    unit_mm: f32,
    plane_first: u32,
    plane_end: u32,
    round_first: u32,
    round_end: u32,
    // Among the planes: five for each block whose outside is kept.
    block_first: u32,
    block_end: u32,
    // What a 1 of 16 bits stands for in the table: of the sums' rest, and of rises.
    rest_scale: f32,
    rise_scale: f32,
    // The box that is drawn, in texture coordinates.
    low: vec4<f32>,
    high: vec4<f32>,
    // What each channel of a texel adds to the value; x and y of `stack`: slices and layers of three slices each.
    channel: vec4<f32>,
    stack: vec4<f32>,
}

struct Round {
    // mm from the axis along two directions across it, and nothing; or from the centre of a ball along three.
    u: Form,
    v: Form,
    w: Form,
    radius_mm: f32,
    // 1: the outside is kept; 0: the inside.
    outside: u32,
    pad_0: u32,
    pad_1: u32,
}


// Table positions nearer than this count as one: their quotient would have lost its digits.
const EVEN: f32 = 1e-2;
// Beyond every place of a stack, mm.
const FAR: f32 = 1e30;

struct Component {
    fragments: array<u32, 4>,
}

@group(1) @binding(0) var volume_0: texture_3d<f32>;
@group(1) @binding(1) var volume_1: texture_3d<f32>;
@group(1) @binding(2) var volume_2: texture_3d<f32>;
@group(1) @binding(3) var volume_3: texture_3d<f32>;
@group(1) @binding(4) var linear: sampler;

// Not uniform: with four fragments there, Mesa 22.3 takes 12 GB and a minute to compile the shader.
@group(2) @binding(0) var<storage, read> fragments: array<Fragment>;
@group(2) @binding(1) var<storage, read> planes: array<Form>;
@group(2) @binding(2) var<storage, read> rounds: array<Round>;
@group(2) @binding(3) var<storage, read> components: array<Component>;
@group(2) @binding(4) var tables: texture_2d<u32>;

@group(3) @binding(0) var<storage, read> heads: array<u32>;
@group(3) @binding(1) var<storage, read> layers: array<Layer>;
@group(3) @binding(2) var opaque_color: texture_2d<f32>;
@group(3) @binding(3) var opaque_zeta: texture_2d<f32>;
// What `fs_sum` added up; nothing there while it does.
@group(3) @binding(4) var optical: texture_2d<f32>;

// What is in each slot: one of the kinds below. Fixed when the pipeline is made, so that empty slots and
// unused branches cost nothing.
override KIND_0: u32 = 0u;
override KIND_1: u32 = 0u;
override KIND_2: u32 = 0u;
override KIND_3: u32 = 0u;
// Whether any transfer function jumps.
override JUMPS: bool = false;
// Whether any fragment keeps the outside of a round body or a block.
override GAPS: bool = false;
// Whether surfaces may lie in the slab, and whether any of the picture's is translucent.
override SURFACES: bool = false;
override LAYERS: bool = false;
// Whether a slab is one sub-step: where what is in it is added up by several draws.
override SINGLE: bool = false;

const KIND_NONE: u32 = 0u;
const KIND_SCALAR: u32 = 1u;
const KIND_SCALAR_LIT: u32 = 2u;
const KIND_COLOR: u32 = 3u;
// Three successive slices in the channels of a texel (PVTC-SE).
const KIND_STACKED: u32 = 4u;
const KIND_STACKED_LIT: u32 = 5u;

struct VertexOut {
    @builtin(position) position: vec4<f32>,
    @location(0) @interpolate(flat) slab: u32,
    @location(1) @interpolate(flat) component: u32,
}

@vertex
fn vs_main(
    @location(0) ndc: vec2<f32>,
    @location(1) slab: u32,
    @location(2) component: u32,
) -> VertexOut {
    let zeta = f32(slab * select(frame.steps, 1u, SINGLE)) * frame.step_mm;
    return VertexOut(vec4<f32>(ndc, depth_of(zeta), 1.0), slab, component);
}

// What of a fragment is asked at every place: see there.
struct Scalar {
    channel: vec4<f32>,
    table_scale: f32,
    table_offset: f32,
    table_row: u32,
    rest_scale: f32,
    rise_scale: f32,
}

// A place in a table, its antiderivative as two parts, and extinction there.
struct Looked {
    position: f32,
    sum: vec4<f32>,
    rest: vec4<f32>,
    extinction: vec4<f32>,
}

// A fragment on one ray within one slab.
struct Slot {
    // The kept part of the slab, zeta; start <= end.
    start: f32,
    end: f32,
    // Texture coordinates at the near plane and per mm of zeta.
    origin: vec3<f32>,
    direction: vec3<f32>,
    // The last sampled place, and what was there: a place in the table, or colour as its extinction.
    zeta: f32,
    here: Looked,
    scalar: Scalar,
    // What is cut out, of which no two overlap; as many in every pixel, those that are not met without length.
    gap_count: u32,
    gaps: array<vec2<f32>, 8>,
}

fn along(form: Form, e: vec3<f32>) -> vec2<f32> {
    return vec2<f32>(dot(form.at_near.xyz, e), dot(form.per_mm.xyz, e));
}

// What of a stretch lies where a form is positive.
fn clipped(stretch: vec2<f32>, line: vec2<f32>) -> vec2<f32> {
    let crossing = -line.x / line.y;
    if line.y > 0.0 {
        return vec2<f32>(max(stretch.x, crossing), stretch.y);
    } else if line.y < 0.0 {
        return vec2<f32>(stretch.x, min(stretch.y, crossing));
    } else if line.x < 0.0 {
        return vec2<f32>(stretch.x, stretch.x);
    }
    return stretch;
}

// The stretch within a round body; none where it ends before it starts.
fn inside_round(u: vec2<f32>, v: vec2<f32>, w: vec2<f32>, radius: f32) -> vec2<f32> {
    let a = u.y * u.y + v.y * v.y + w.y * w.y;
    let b = u.x * u.y + v.x * v.y + w.x * w.y;
    let across = vec3<f32>(u.x * v.y - u.y * v.x, v.x * w.y - v.y * w.x, w.x * u.y - w.y * u.x);
    let discriminant = radius * radius * a - dot(across, across);
    if a > 1e-12 {
        if discriminant > 0.0 {
            let root = sqrt(discriminant);
            return vec2<f32>(-b - root, -b + root) / a;
        }
    } else if u.x * u.x + v.x * v.x + w.x * w.x < radius * radius {
        return vec2<f32>(-FAR, FAR);
    }
    return vec2<f32>(1.0, 0.0);
}

// Adds a stretch to what is cut out. It becomes one with those that it overlaps, so that nothing counts twice.
fn add_gap(slot: ptr<function, Slot>, stretch: vec2<f32>) {
    var gap = select(vec2<f32>(0.0), stretch, stretch.x < stretch.y);
    for (var i = 0u; i < (*slot).gap_count; i++) {
        let other = (*slot).gaps[i];
        if other.x < other.y && gap.x < gap.y && other.x <= gap.y && gap.x <= other.y {
            gap = vec2<f32>(min(gap.x, other.x), max(gap.y, other.y));
            (*slot).gaps[i] = vec2<f32>(0.0);
        }
    }
    (*slot).gaps[(*slot).gap_count] = gap;
    (*slot).gap_count++;
}

// The part of [z0, z1] that a fragment's planes and inner round bodies keep, and the gaps of the others.
fn open_slot(id: u32, e: vec3<f32>, z0: f32, z1: f32) -> Slot {
    var slot: Slot;
    let u = along(fragments[id].u, e);
    let v = along(fragments[id].v, e);
    let w = along(fragments[id].w, e);
    slot.origin = vec3<f32>(u.x, v.x, w.x);
    slot.direction = vec3<f32>(u.y, v.y, w.y);
    let before = slot.origin - fragments[id].low.xyz;
    let beyond = fragments[id].high.xyz - slot.origin;
    let still = slot.direction == vec3<f32>(0.0);
    let ends = array<vec3<f32>, 2>(-before / slot.direction, beyond / slot.direction);
    let enters = select(min(ends[0], ends[1]), vec3<f32>(-FAR), still);
    let leaves = select(max(ends[0], ends[1]), vec3<f32>(FAR), still);
    var open = vec2<f32>(
        max(z0, max(enters.x, max(enters.y, enters.z))),
        min(z1, min(leaves.x, min(leaves.y, leaves.z))),
    );
    if any(still & ((before < vec3<f32>(0.0)) | (beyond < vec3<f32>(0.0)))) {
        open.y = open.x;
    }
    for (var i = fragments[id].plane_first; i < fragments[id].plane_end; i++) {
        open = clipped(open, along(planes[i], e));
    }
    for (var i = fragments[id].round_first; i < fragments[id].round_end; i++) {
        let u = along(rounds[i].u, e);
        let v = along(rounds[i].v, e);
        let w = along(rounds[i].w, e);
        let inside = inside_round(u, v, w, rounds[i].radius_mm);
        if rounds[i].outside == 0u {
            open = vec2<f32>(max(open.x, inside.x), min(open.y, inside.y));
            if inside.y < inside.x {
                open.y = open.x;
            }
        } else if GAPS {
            add_gap(&slot, inside);
        }
    }
    if GAPS {
        for (var i = fragments[id].block_first; i < fragments[id].block_end; i += 5u) {
            var inside = vec2<f32>(-FAR, FAR);
            for (var face = 0u; face < 5u; face++) {
                inside = clipped(inside, along(planes[i + face], e));
            }
            add_gap(&slot, inside);
        }
    }
    slot.start = min(open.x, z1);
    slot.end = max(slot.start, open.y);
    slot.zeta = slot.start;
    slot.scalar = Scalar(
        fragments[id].channel,
        fragments[id].table_scale,
        fragments[id].table_offset,
        fragments[id].table_row,
        fragments[id].rest_scale,
        fragments[id].rise_scale,
    );
    return slot;
}

// The last node of each table.
fn last_node() -> f32 {
    return f32(textureDimensions(tables).x) - 1.0;
}

// What a table holds at a position; the first and the last node go on without end. Its rows: the antiderivative at the
// node, rounded; level of extinction; what the rounding left, and the rise of extinction; extinction after a jump.
fn look(position: f32, scalar: Scalar) -> Looked {
    let j = clamp(floor(position), 0.0, last_node());
    let at = vec2<u32>(u32(j), scalar.table_row);
    let sum = bitcast<vec4<f32>>(textureLoad(tables, at, 0));
    let level_bits = textureLoad(tables, at + vec2<u32>(0u, 1u), 0);
    let fine = textureLoad(tables, at + vec2<u32>(0u, 2u), 0);
    let rest = vec4<f32>(unpack2x16snorm(fine.x), unpack2x16snorm(fine.y)) * scalar.rest_scale;
    var level = bitcast<vec4<f32>>(level_bits);
    var rise = vec4<f32>(unpack2x16float(fine.z), unpack2x16float(fine.w)) * scalar.rise_scale;
    let part = position - j;
    // Without a jump extinction is the level in the node's middle, and linear.
    var risen = part - 0.5;
    var sum_of_risen = 0.5 * part * (part - 1.0);
    if JUMPS && (level_bits.w >> 31u) == 1u {
        level.w = -level.w;
        rise = bitcast<vec4<f32>>(textureLoad(tables, at + vec2<u32>(0u, 3u), 0)) - level;
        let split = bitcast<f32>(fine.z);
        risen = select(0.0, 1.0, part >= split);
        sum_of_risen = max(part - split, 0.0);
    }
    return Looked(position, sum, rest + part * level + sum_of_risen * rise, level + risen * rise);
}

fn place(slot: ptr<function, Slot>, zeta: f32) -> vec3<f32> {
    return (*slot).origin + (*slot).direction * zeta;
}

// Extinction x colour, extinction, of a pre-classified texel.
fn extinction_of(texel: vec4<f32>, unit_mm: f32) -> vec4<f32> {
    let tau = -log(1.0 - min(texel.a, 0.999999)) / unit_mm;
    return vec4<f32>(texel.rgb * tau, tau);
}

// A slice of a stacked texture, filtered within itself: the sample is taken at its layer's middle.
fn slice_value(volume: texture_3d<f32>, at: vec2<f32>, slice: f32, layers: f32) -> f32 {
    let layer = floor((slice + 0.5) / 3.0);
    let texel = textureSampleLevel(volume, linear, vec3<f32>(at, (layer + 0.5) / layers), 0.0);
    let channel = slice - 3.0 * layer;
    return select(select(texel.b, texel.g, channel < 1.5), texel.r, channel < 0.5);
}

// The texel value of a fragment at a place.
fn value_at(kind: u32, channel: vec4<f32>, id: u32, volume: texture_3d<f32>, at: vec3<f32>) -> f32 {
    if kind == KIND_STACKED || kind == KIND_STACKED_LIT {
        let slices = fragments[id].stack.x;
        let layers = fragments[id].stack.y;
        let z = clamp(at.z * slices - 0.5, 0.0, slices - 1.0);
        let below = floor(z);
        let a = slice_value(volume, at.xy, below, layers);
        let b = slice_value(volume, at.xy, min(below + 1.0, slices - 1.0), layers);
        return a + (b - a) * (z - below);
    }
    return dot(textureSampleLevel(volume, linear, at, 0.0), channel);
}

// What a fragment holds at a place.
fn sampled(kind: u32, scalar: Scalar, id: u32, volume: texture_3d<f32>, at: vec3<f32>) -> Looked {
    if kind == KIND_COLOR {
        var here: Looked;
        here.extinction = extinction_of(textureSampleLevel(volume, linear, at, 0.0), fragments[id].unit_mm);
        return here;
    }
    let value = value_at(kind, scalar.channel, id, volume, at);
    return look(value * scalar.table_scale + scalar.table_offset, scalar);
}

// Takes the sample at the slot's start.
fn begin(kind: u32, slot: ptr<function, Slot>, id: u32, volume: texture_3d<f32>) {
    (*slot).here = sampled(kind, (*slot).scalar, id, volume, place(slot, (*slot).zeta));
}

// What the slot's gaps leave of [a, b]: where it starts, where it ends, and how much of that is kept.
fn kept(slot: ptr<function, Slot>, a: f32, b: f32) -> vec3<f32> {
    var start = a;
    var end = b;
    for (var i = 0u; i < (*slot).gap_count; i++) {
        let gap = (*slot).gaps[i];
        if gap.x <= a && gap.y > a {
            start = min(gap.y, b);
        }
        if gap.x < b && gap.y >= b {
            end = max(gap.x, a);
        }
    }
    var inner = 0.0;
    for (var i = 0u; i < (*slot).gap_count; i++) {
        let gap = (*slot).gaps[i];
        inner += max(0.0, min(gap.y, end) - max(gap.x, start));
    }
    if start >= end {
        return vec3<f32>(a, b, 0.0);
    }
    return vec3<f32>(start, end, max(0.0, end - start - inner));
}

// |n·v| of the gradient at a place, or -1 where the field is flat.
fn facing(kind: u32, id: u32, volume: texture_3d<f32>, at: vec3<f32>, ray: vec3<f32>) -> f32 {
    let channel = fragments[id].channel;
    let x = vec3<f32>(fragments[id].gradient_x.w, 0.0, 0.0);
    let y = vec3<f32>(0.0, fragments[id].gradient_y.w, 0.0);
    let z = vec3<f32>(0.0, 0.0, fragments[id].gradient_z.w);
    let dx = value_at(kind, channel, id, volume, at + x) - value_at(kind, channel, id, volume, at - x);
    let dy = value_at(kind, channel, id, volume, at + y) - value_at(kind, channel, id, volume, at - y);
    let dz = value_at(kind, channel, id, volume, at + z) - value_at(kind, channel, id, volume, at - z);
    let gradient = dx * fragments[id].gradient_x.xyz
        + dy * fragments[id].gradient_y.xyz
        + dz * fragments[id].gradient_z.xyz;
    let size = length(gradient);
    if size < FLAT {
        return -1.0;
    }
    return abs(dot(gradient / size, ray));
}

// Optical depth x colour and optical depth of the slot from its last place to `zeta`.
fn advance(
    kind: u32,
    slot: ptr<function, Slot>,
    id: u32,
    volume: texture_3d<f32>,
    zeta: f32,
    ray: vec4<f32>,
) -> vec4<f32> {
    let b = clamp(zeta, (*slot).start, (*slot).end);
    let a = (*slot).zeta;
    (*slot).zeta = b;
    var part = vec3<f32>(a, b, b - a);
    if GAPS {
        part = kept(slot, a, b);
    }
    // Where a gap takes an end of the step, the values there: they are linear along it.
    let trimmed = GAPS && (part.x != a || part.y != b);
    let shares = (part.xy - a) / max(b - a, 1e-30);
    var before = (*slot).here;
    let here = sampled(kind, (*slot).scalar, id, volume, place(slot, b));
    (*slot).here = here;
    var mean: vec4<f32>;
    if kind == KIND_COLOR {
        mean = mix(before.extinction, here.extinction, select(0.5, 0.5 * (shares.x + shares.y), trimmed));
    } else {
        var after = here;
        if trimmed {
            let rise = here.position - before.position;
            after = look(before.position + rise * shares.y, (*slot).scalar);
            before = look(before.position + rise * shares.x, (*slot).scalar);
        }
        let beyond = min(before.position, after.position) >= last_node() || max(before.position, after.position) <= 1.0;
        let rise = after.position - before.position;
        if abs(rise) > EVEN && !beyond {
            mean = ((after.sum - before.sum) + (after.rest - before.rest)) / rise;
        } else {
            mean = after.extinction;
        }
        if (kind == KIND_SCALAR_LIT || kind == KIND_STACKED_LIT) && mean.a > 0.0 {
            let toward = facing(kind, id, volume, place(slot, 0.5 * (part.x + part.y)), ray.xyz);
            if toward >= 0.0 {
                mean = vec4<f32>(lit(mean.rgb / mean.a, toward) * mean.a, mean.a);
            }
        }
    }
    return max(mean, vec4<f32>(0.0)) * (part.z * ray.w);
}

// The nearest layer of a pixel at or behind `zeta`.
fn first_layer(pixel: vec2<u32>, zeta: f32) -> u32 {
    var best = NO_LAYER;
    var node = heads[2u * list_index(pixel)];
    for (var i = 0u; i < frame.layer_most; i++) {
        if node == NO_LAYER {
            continue;
        }
        let here = layers[node];
        if here.zeta >= zeta && (best == NO_LAYER || precedes(here, node, layers[best], best)) {
            best = node;
        }
        node = here.next;
    }
    return best;
}

// The layer that follows `last` in the order of compositing. Lists are short and unsorted.
fn layer_after(pixel: vec2<u32>, last: u32) -> u32 {
    let before = layers[last];
    var best = NO_LAYER;
    var node = heads[2u * list_index(pixel)];
    for (var i = 0u; i < frame.layer_most; i++) {
        if node == NO_LAYER {
            continue;
        }
        let here = layers[node];
        if precedes(before, last, here, node) && (best == NO_LAYER || precedes(here, node, layers[best], best)) {
            best = node;
        }
        node = here.next;
    }
    return best;
}

// (1 - exp(-t)) / t, without loss for small t.
fn absorbed_per_depth(t: f32) -> f32 {
    if t < 0.05 {
        return 1.0 - t * (0.5 - t * (1.0 / 6.0 - t * (1.0 / 24.0 - t / 120.0)));
    }
    return (1.0 - exp(-t)) / t;
}

// What has been met on the way so far: premultiplied colour and opacity.
struct Met {
    color: vec3<f32>,
    alpha: f32,
}

// Passes optical depth x colour and optical depth.
fn absorb(met: ptr<function, Met>, depth: vec4<f32>) {
    let part = absorbed_per_depth(depth.a);
    let through = 1.0 - (*met).alpha;
    (*met).color += through * part * depth.rgb;
    (*met).alpha += through * part * depth.a;
}

// Passes a surface.
fn cross_surface(met: ptr<function, Met>, color: vec4<f32>) {
    let through = 1.0 - (*met).alpha;
    (*met).color += through * color.a * color.rgb;
    (*met).alpha += through * color.a;
}

// Ends at the opaque surface, which was met before where it lies in front of the slab.
fn end_at_wall(met: ptr<function, Met>, pixel: vec2<u32>, is_here: bool) {
    let seen = select(0.0, 1.0 - (*met).alpha, is_here);
    (*met).color += seen * textureLoad(opaque_color, pixel, 0).rgb;
    (*met).alpha += seen;
}

@fragment
fn fs_main(in: VertexOut) -> @location(0) vec4<f32> {
    let pixel = vec2<u32>(in.position.xy);
    let ndc = ndc_of(pixel);
    let e = vec3<f32>(1.0, ndc);
    let ray = vec4<f32>(ray_direction(ndc), mm_per_zeta(ndc));
    let first = in.slab * frame.steps;
    let z0 = f32(first) * frame.step_mm;
    let z1 = f32(first + frame.steps) * frame.step_mm;

    let ids = components[in.component].fragments;
    var s0: Slot; var s1: Slot; var s2: Slot; var s3: Slot;
    if KIND_0 != KIND_NONE { s0 = open_slot(ids[0], e, z0, z1); begin(KIND_0, &s0, ids[0], volume_0); }
    if KIND_1 != KIND_NONE { s1 = open_slot(ids[1], e, z0, z1); begin(KIND_1, &s1, ids[1], volume_1); }
    if KIND_2 != KIND_NONE { s2 = open_slot(ids[2], e, z0, z1); begin(KIND_2, &s2, ids[2], volume_2); }
    if KIND_3 != KIND_NONE { s3 = open_slot(ids[3], e, z0, z1); begin(KIND_3, &s3, ids[3], volume_3); }

    // The next surface: a translucent layer or the opaque one, whichever is nearer.
    var layer = NO_LAYER;
    var wall = 3.4e38;
    if SURFACES {
        wall = textureLoad(opaque_zeta, pixel, 0).r;
        if LAYERS {
            layer = first_layer(pixel, z0);
        }
    }

    var met: Met;
    var k = 0u;
    // Each round takes a sub-step or a layer.
    var rounds = frame.steps;
    if LAYERS {
        rounds += frame.layer_most;
    }
    for (var round = 0u; round < rounds; round++) {
        if k >= frame.steps {
            continue;
        }
        let grid = f32(first + k + 1u) * frame.step_mm;
        var end = grid;
        var stop = wall;
        if SURFACES {
            if layer != NO_LAYER {
                stop = min(stop, layers[layer].zeta);
            }
            end = min(end, stop);
        }

        var sum = vec4<f32>(0.0);
        if KIND_0 != KIND_NONE { sum += advance(KIND_0, &s0, ids[0], volume_0, end, ray); }
        if KIND_1 != KIND_NONE { sum += advance(KIND_1, &s1, ids[1], volume_1, end, ray); }
        if KIND_2 != KIND_NONE { sum += advance(KIND_2, &s2, ids[2], volume_2, end, ray); }
        if KIND_3 != KIND_NONE { sum += advance(KIND_3, &s3, ids[3], volume_3, end, ray); }
        absorb(&met, sum);

        var next = k + 1u;
        if SURFACES {
            let at_wall = wall < grid;
            let at_layer = layer != NO_LAYER && stop < grid && stop < wall;
            if at_layer {
                cross_surface(&met, layers[layer].color);
                layer = layer_after(pixel, layer);
                next = k;
            } else if at_wall {
                end_at_wall(&met, pixel, wall >= z0);
                next = frame.steps;
            }
        }
        k = next;
    }
    return vec4<f32>(met.color, met.alpha);
}

// Where more fragments meet than there are slots, sub-steps are drawn one by one: what each fragment holds there of optical
// depth x colour and optical depth is added up by several draws.
@fragment
fn fs_sum(in: VertexOut) -> @location(0) vec4<f32> {
    let ndc = ndc_of(vec2<u32>(in.position.xy));
    let e = vec3<f32>(1.0, ndc);
    let ray = vec4<f32>(ray_direction(ndc), mm_per_zeta(ndc));
    let z0 = f32(in.slab) * frame.step_mm;
    let z1 = f32(in.slab + 1u) * frame.step_mm;
    let ids = components[in.component].fragments;
    var sum = vec4<f32>(0.0);
    if KIND_0 != KIND_NONE {
        var slot = open_slot(ids[0], e, z0, z1);
        begin(KIND_0, &slot, ids[0], volume_0);
        sum += advance(KIND_0, &slot, ids[0], volume_0, z1, ray);
    }
    if KIND_1 != KIND_NONE {
        var slot = open_slot(ids[1], e, z0, z1);
        begin(KIND_1, &slot, ids[1], volume_1);
        sum += advance(KIND_1, &slot, ids[1], volume_1, z1, ray);
    }
    if KIND_2 != KIND_NONE {
        var slot = open_slot(ids[2], e, z0, z1);
        begin(KIND_2, &slot, ids[2], volume_2);
        sum += advance(KIND_2, &slot, ids[2], volume_2, z1, ray);
    }
    if KIND_3 != KIND_NONE {
        var slot = open_slot(ids[3], e, z0, z1);
        begin(KIND_3, &slot, ids[3], volume_3);
        sum += advance(KIND_3, &slot, ids[3], volume_3, z1, ray);
    }
    return sum;
}

// The slab of `fs_sum` and its surfaces; between two of them the sum is taken as even.
@fragment
fn fs_mix(in: VertexOut) -> @location(0) vec4<f32> {
    let pixel = vec2<u32>(in.position.xy);
    let z0 = f32(in.slab) * frame.step_mm;
    let z1 = f32(in.slab + 1u) * frame.step_mm;
    let sum = textureLoad(optical, pixel, 0) / (z1 - z0);
    var layer = NO_LAYER;
    var wall = 3.4e38;
    if SURFACES {
        wall = textureLoad(opaque_zeta, pixel, 0).r;
        if LAYERS {
            layer = first_layer(pixel, z0);
        }
    }
    var met: Met;
    var at = z0;
    var rounds = 1u;
    if LAYERS {
        rounds += frame.layer_most;
    }
    for (var round = 0u; round < rounds; round++) {
        if at >= z1 {
            continue;
        }
        var stop = wall;
        if LAYERS && layer != NO_LAYER {
            stop = min(stop, layers[layer].zeta);
        }
        let end = clamp(stop, at, z1);
        absorb(&met, sum * (end - at));
        at = end;
        if SURFACES {
            if LAYERS && layer != NO_LAYER && stop < z1 && stop < wall {
                cross_surface(&met, layers[layer].color);
                layer = layer_after(pixel, layer);
            } else if wall < z1 {
                end_at_wall(&met, pixel, wall >= z0);
                at = z1;
            }
        }
    }
    return vec4<f32>(met.color, met.alpha);
}
