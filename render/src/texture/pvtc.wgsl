// PVTC <S,T> to one byte a voxel: one invocation a sub-volume (Yamada), one step at a time.
//
// The heads of all sub-volumes stand first, their tables after them, so neighbouring invocations read
// neighbouring words. Integers only: the bytes are those of the CPU's decoder.

struct Decode {
    // Sub-volumes along x, y and z, and the first z of this dispatch.
    columns: u32,
    rows: u32,
    layers: u32,
    layer_first: u32,
    // Slices of a sub-volume, and of the volume.
    s: u32,
    slices: u32,
    // Words of a row of voxels in the output, padded.
    pitch: u32,
    // Word at which the tables begin.
    table_first: u32,
    // Lowest bit of the step's field in each of the two 16-bit words of a head, and its greatest number.
    shift: u32,
    top: u32,
    pad_0: u32,
    pad_1: u32,
}

@group(0) @binding(0) var<uniform> decode: Decode;
@group(0) @binding(1) var<storage, read> packed: array<u32>;
@group(0) @binding(2) var<storage, read_write> samples: array<u32>;

// A mixture of end points, 0 to 3 times `top`, as a number of 0 to 255, rounded to the nearest.
fn level(w: u32) -> u32 {
    return (170u * w + decode.top) / (2u * decode.top);
}

@compute @workgroup_size(64)
fn decode_sub_volumes(@builtin(global_invocation_id) id: vec3<u32>) {
    let column = id.x;
    let row = id.y;
    let layer = decode.layer_first + id.z;
    if column >= decode.columns || row >= decode.rows || layer >= decode.layers {
        return;
    }
    let index = (layer * decode.rows + row) * decode.columns + column;
    let head = packed[index];
    let u = (head >> decode.shift) & decode.top;
    let d = (head >> (decode.shift + 16u)) & decode.top;
    let levels = vec4<u32>(level(3u * u), level(2u * u + d), level(u + 2u * d), level(3u * d));
    for (var slice = 0u; slice < decode.s; slice++) {
        let z = layer * decode.s + slice;
        if z < decode.slices {
            let table = packed[decode.table_first + index * decode.s + slice];
            let first = ((z - decode.layer_first * decode.s) * decode.rows + row) * 4u;
            for (var line = 0u; line < 4u; line++) {
                let indices = table >> (8u * line);
                samples[(first + line) * decode.pitch + column] = levels[indices & 3u]
                    | (levels[(indices >> 2u) & 3u] << 8u)
                    | (levels[(indices >> 4u) & 3u] << 16u)
                    | (levels[(indices >> 6u) & 3u] << 24u);
            }
        }
    }
}
