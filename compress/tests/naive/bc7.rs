//! BC7 straight from the standard: one texel at a time, every table as it is printed there.
//!
//! Source: Khronos Data Format Specification 1.4, "BPTC Compressed Texture Image Formats", section "BC7".

use super::bits;

/// "Mode-dependent BPTC parameters": NS, PB, RB, ISB, CB, AB, EPB, SPB, IB, IB2.
const MODES: [[usize; 10]; 8] = [
    [3, 4, 0, 0, 4, 0, 1, 0, 3, 0],
    [2, 6, 0, 0, 6, 0, 0, 1, 3, 0],
    [3, 6, 0, 0, 5, 0, 0, 0, 2, 0],
    [2, 6, 0, 0, 7, 0, 1, 0, 2, 0],
    [1, 0, 2, 1, 5, 6, 0, 0, 2, 3],
    [1, 0, 2, 0, 7, 8, 0, 0, 2, 2],
    [1, 0, 0, 0, 7, 7, 1, 0, 4, 0],
    [2, 6, 0, 0, 5, 5, 1, 0, 2, 0],
];

/// A texel of a BC7 block.
pub(crate) fn bc7_texel(block: &[u8], x: usize, y: usize) -> [u8; 4] {
    // "It is encoded as zero or more zeros followed by a one."
    let Some(mode) = (0..8).find(|&bit| bits(block, bit, 1) == 1) else {
        // "hardware decoders processing a texel block with a low byte of 0 should return 0 for all channels"
        return [0; 4];
    };
    let [ns, pb, rb, isb, cb, ab, epb, spb, ib, ib2] = MODES[mode];
    // "In increasing bit order after the mode, these fields are: partition pattern selection, rotation, index
    // selection, color, alpha, per-endpoint P-bit, shared P-bit, primary indices, and secondary indices."
    let partition_at = mode + 1;
    let rotation_at = partition_at + pb;
    let selection_at = rotation_at + rb;
    let colour_at = selection_at + isb;
    let alpha_at = colour_at + 3 * 2 * ns * cb;
    let endpoint_p_at = alpha_at + 2 * ns * ab;
    let shared_p_at = endpoint_p_at + 2 * ns * epb;
    let index_at = shared_p_at + ns * spb;
    let index2_at = index_at + 16 * ib - ns;

    let pattern = bits(block, partition_at, pb);
    let subset = subset_of(ns, pattern, 4 * y + x);
    let endpoint = |which: usize, channel: usize| -> u32 {
        // "grouped first by endpoint, then by subset, then by channel"
        let number = 2 * subset + which;
        let (at, count) = match channel {
            3 if ab == 0 => return 255,
            3 => (alpha_at + number * ab, ab),
            _ => (colour_at + (channel * 2 * ns + number) * cb, cb),
        };
        let mut value = bits(block, at, count);
        let mut count = count;
        if epb == 1 {
            value = 2 * value + bits(block, endpoint_p_at + number, 1);
            count += 1;
        }
        if spb == 1 {
            value = 2 * value + bits(block, shared_p_at + subset, 1);
            count += 1;
        }
        // "the top bits of the value are replicated into any remaining bits in the byte"
        value << (8 - count) | value >> (2 * count - 8)
    };
    let index = |at: usize, count: usize| -> (u32, usize) {
        if count == 0 {
            return (0, 0);
        }
        let texel = 4 * y + x;
        let anchors = anchors_of(ns, pattern);
        let before = anchors.iter().filter(|&&anchor| anchor < texel).count();
        let here = usize::from(anchors.contains(&texel));
        (bits(block, at + count * texel - before, count - here), count)
    };
    let (primary, secondary) = (index(index_at, ib), index(index2_at, ib2));
    let selected = isb == 1 && bits(block, selection_at, 1) == 1;
    let colour_index = if selected { secondary } else { primary };
    let alpha_index = if ib2 > 0 && !selected { secondary } else { primary };
    let mix = |channel: usize, (index, count): (u32, usize)| {
        let weight = match count {
            2 => [0, 21, 43, 64][index as usize],
            3 => [0, 9, 18, 27, 37, 46, 55, 64][index as usize],
            _ => [0, 4, 9, 13, 17, 21, 26, 30, 34, 38, 43, 47, 51, 55, 60, 64][index as usize],
        };
        (((64 - weight) * endpoint(0, channel) + weight * endpoint(1, channel) + 32) >> 6) as u8
    };
    let mut texel = [mix(0, colour_index), mix(1, colour_index), mix(2, colour_index), mix(3, alpha_index)];
    match bits(block, rotation_at, rb) {
        1 => texel.swap(3, 0),
        2 => texel.swap(3, 1),
        3 => texel.swap(3, 2),
        _ => {}
    }
    texel
}

/// The subset that the standard's tables print for a texel.
fn subset_of(ns: usize, pattern: u32, texel: usize) -> usize {
    let table = match ns {
        2 => &TWO_SUBSETS,
        3 => &THREE_SUBSETS,
        _ => return 0,
    };
    let digit = table[pattern as usize].bytes().filter(u8::is_ascii_digit).nth(texel).unwrap();
    usize::from(digit - b'0')
}

/// The anchors of the subsets, by the standard's three tables.
fn anchors_of(ns: usize, pattern: u32) -> Vec<usize> {
    let pattern = pattern as usize;
    match ns {
        2 => vec![0, ANCHOR_2[pattern]],
        3 => vec![0, ANCHOR_3_2[pattern], ANCHOR_3_3[pattern]],
        _ => vec![0],
    }
}

const TWO_SUBSETS: [&str; 64] = [
    "0011 0011 0011 0011",
    "0001 0001 0001 0001",
    "0111 0111 0111 0111",
    "0001 0011 0011 0111",
    "0000 0001 0001 0011",
    "0011 0111 0111 1111",
    "0001 0011 0111 1111",
    "0000 0001 0011 0111",
    "0000 0000 0001 0011",
    "0011 0111 1111 1111",
    "0000 0001 0111 1111",
    "0000 0000 0001 0111",
    "0001 0111 1111 1111",
    "0000 0000 1111 1111",
    "0000 1111 1111 1111",
    "0000 0000 0000 1111",
    "0000 1000 1110 1111",
    "0111 0001 0000 0000",
    "0000 0000 1000 1110",
    "0111 0011 0001 0000",
    "0011 0001 0000 0000",
    "0000 1000 1100 1110",
    "0000 0000 1000 1100",
    "0111 0011 0011 0001",
    "0011 0001 0001 0000",
    "0000 1000 1000 1100",
    "0110 0110 0110 0110",
    "0011 0110 0110 1100",
    "0001 0111 1110 1000",
    "0000 1111 1111 0000",
    "0111 0001 1000 1110",
    "0011 1001 1001 1100",
    "0101 0101 0101 0101",
    "0000 1111 0000 1111",
    "0101 1010 0101 1010",
    "0011 0011 1100 1100",
    "0011 1100 0011 1100",
    "0101 0101 1010 1010",
    "0110 1001 0110 1001",
    "0101 1010 1010 0101",
    "0111 0011 1100 1110",
    "0001 0011 1100 1000",
    "0011 0010 0100 1100",
    "0011 1011 1101 1100",
    "0110 1001 1001 0110",
    "0011 1100 1100 0011",
    "0110 0110 1001 1001",
    "0000 0110 0110 0000",
    "0100 1110 0100 0000",
    "0010 0111 0010 0000",
    "0000 0010 0111 0010",
    "0000 0100 1110 0100",
    "0110 1100 1001 0011",
    "0011 0110 1100 1001",
    "0110 0011 1001 1100",
    "0011 1001 1100 0110",
    "0110 1100 1100 1001",
    "0110 0011 0011 1001",
    "0111 1110 1000 0001",
    "0001 1000 1110 0111",
    "0000 1111 0011 0011",
    "0011 0011 1111 0000",
    "0010 0010 1110 1110",
    "0100 0100 0111 0111",
];

const THREE_SUBSETS: [&str; 64] = [
    "0011 0011 0221 2222",
    "0001 0011 2211 2221",
    "0000 2001 2211 2211",
    "0222 0022 0011 0111",
    "0000 0000 1122 1122",
    "0011 0011 0022 0022",
    "0022 0022 1111 1111",
    "0011 0011 2211 2211",
    "0000 0000 1111 2222",
    "0000 1111 1111 2222",
    "0000 1111 2222 2222",
    "0012 0012 0012 0012",
    "0112 0112 0112 0112",
    "0122 0122 0122 0122",
    "0011 0112 1122 1222",
    "0011 2001 2200 2220",
    "0001 0011 0112 1122",
    "0111 0011 2001 2200",
    "0000 1122 1122 1122",
    "0022 0022 0022 1111",
    "0111 0111 0222 0222",
    "0001 0001 2221 2221",
    "0000 0011 0122 0122",
    "0000 1100 2210 2210",
    "0122 0122 0011 0000",
    "0012 0012 1122 2222",
    "0110 1221 1221 0110",
    "0000 0110 1221 1221",
    "0022 1102 1102 0022",
    "0110 0110 2002 2222",
    "0011 0122 0122 0011",
    "0000 2000 2211 2221",
    "0000 0002 1122 1222",
    "0222 0022 0012 0011",
    "0011 0012 0022 0222",
    "0120 0120 0120 0120",
    "0000 1111 2222 0000",
    "0120 1201 2012 0120",
    "0120 2012 1201 0120",
    "0011 2200 1122 0011",
    "0011 1122 2200 0011",
    "0101 0101 2222 2222",
    "0000 0000 2121 2121",
    "0022 1122 0022 1122",
    "0022 0011 0022 0011",
    "0220 1221 0220 1221",
    "0101 2222 2222 0101",
    "0000 2121 2121 2121",
    "0101 0101 0101 2222",
    "0222 0111 0222 0111",
    "0002 1112 0002 1112",
    "0000 2112 2112 2112",
    "0222 0111 0111 0222",
    "0002 1112 1112 0002",
    "0110 0110 0110 2222",
    "0000 0000 2112 2112",
    "0110 0110 2222 2222",
    "0022 0011 0011 0022",
    "0022 1122 1122 0022",
    "0000 0000 0000 2112",
    "0002 0001 0002 0001",
    "0222 1222 0222 1222",
    "0101 2222 2222 2222",
    "0111 2011 2201 2220",
];

/// "BPTC anchor index values for the second subset of two-subset partitioning". Of partition 35 the printed pattern
/// marks texel 2, this table texel 8: decoders in the field, and the OpenGL extension, agree with the table.
const ANCHOR_2: [usize; 64] = [
    15, 15, 15, 15, 15, 15, 15, 15, 15, 15, 15, 15, 15, 15, 15, 15, 15, 2, 8, 2, 2, 8, 8, 15, 2, 8, 2, 2, 8,
    8, 2, 2, 15, 15, 6, 8, 2, 8, 15, 15, 2, 8, 2, 2, 2, 15, 15, 6, 6, 2, 6, 8, 15, 15, 2, 2, 15, 15, 15, 15,
    15, 2, 2, 15,
];

/// "BPTC anchor index values for the second subset of three-subset partitioning".
const ANCHOR_3_2: [usize; 64] = [
    3, 3, 15, 15, 8, 3, 15, 15, 8, 8, 6, 6, 6, 5, 3, 3, 3, 3, 8, 15, 3, 3, 6, 10, 5, 8, 8, 6, 8, 5, 15, 15,
    8, 15, 3, 5, 6, 10, 8, 15, 15, 3, 15, 5, 15, 15, 15, 15, 3, 15, 5, 5, 5, 8, 5, 10, 5, 10, 8, 13, 15, 12,
    3, 3,
];

/// "BPTC anchor index values for the third subset of three-subset partitioning".
const ANCHOR_3_3: [usize; 64] = [
    15, 8, 8, 3, 15, 15, 3, 8, 15, 15, 15, 15, 15, 15, 15, 8, 15, 8, 15, 3, 15, 8, 15, 8, 3, 15, 6, 10, 15,
    15, 10, 8, 15, 3, 15, 10, 10, 8, 9, 10, 6, 15, 8, 15, 3, 6, 6, 8, 15, 3, 15, 15, 15, 15, 15, 15, 15, 15,
    15, 15, 3, 15, 15, 8,
];
