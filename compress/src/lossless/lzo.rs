//! LZO1X, the second stage of *Nagayasu*: a compressor of the fast kind, and a decompressor for hostile bytes.
//!
//! # Format
//! A stream of instructions, each a few literals (bytes to copy from the stream) or a match (a length and a distance
//! back in the output). What an opcode means depends on how many literals came just before: none (state 0), 1 to 3,
//! or a run (state 4).
//!
//! | opcode | state | means |
//! |---|---|---|
//! | `0..=15` | 0 | run of `3 + L` literals, L the opcode; 0 is followed by L as a long number over 15 |
//! | `0000DDSS H` | 1 to 3 | match of 2, distance `(H << 2) + D + 1` |
//! | `0000DDSS H` | 4 | match of 3, distance `(H << 2) + D + 2049` |
//! | `0001HLLL` and a word w | any | match of `2 + L` (0: long number over 7), distance `(H << 14) + (w >> 2) + 16384`; exactly 16384 ends the stream |
//! | `001LLLLL` and a word w | any | match of `2 + L` (0: long number over 31), distance `(w >> 2) + 1` |
//! | `LLLDDDSS H`, L ≥ 2 | any | match of `1 + L`, distance `(H << 3) + D + 1` |
//!
//! After a match, S (or `w & 3`) literals follow; their number is the next state. A long number is 255 for each zero
//! byte, then a byte that is not zero. A first byte over 17 stands for a run of so many less 17 literals. Words are
//! little-endian.
//!
//! Source: the description in the Linux kernel, `Documentation/staging/lzo.rst`, without its run-length extension.
//! The oracles in the tests are two other implementations.
#![warn(clippy::arithmetic_side_effects, clippy::indexing_slicing)]

use super::Fault;

/// The instruction that ends every stream.
const END: [u8; 3] = [0b0001_0001, 0, 0];

/// The farthest a match of each kind reaches back.
const NEAR: usize = 1 << 11;
const MIDDLE: usize = 1 << 14;
const FAR: usize = (1 << 14) + (1 << 15) - 1;

/// The longest match that a near one can say.
const NEAR_LEN: usize = 8;

/// The shortest match that the compressor looks for.
const LEAST_MATCH: usize = 4;

/// Bits of the compressor's hash of 4 bytes.
const HASH_BITS: u32 = 14;

/// A step of the search grows by one for each so many bytes without a match.
const SKIP_AFTER: u32 = 6;

/// Bytes that a match is copied by where there is room.
const STRIDE: usize = 16;

/// The most bytes that `len` bytes can pack to.
pub(super) fn worst_len(len: usize) -> usize {
    len.saturating_add(len / 255).saturating_add(16)
}

/// The compressor, with the table it searches by; one serves any number of inputs.
#[derive(Debug)]
pub(super) struct Compressor {
    /// For each hash, where such 4 bytes were last, plus 1.
    last: Vec<u32>,
}

impl Compressor {
    pub(super) fn new() -> Self {
        Self { last: vec![0; 1 << HASH_BITS] }
    }

    /// Appends the packed `input` to `output`. Inputs from 4 GiB on are packed as literals only.
    #[expect(
        clippy::arithmetic_side_effects,
        clippy::indexing_slicing,
        reason = "positions are in the input, which is the writer's own"
    )]
    pub(super) fn compress(&mut self, input: &[u8], output: &mut Vec<u8>) {
        self.last.fill(0);
        let mut literals = 0; // where those begin that are not written yet
        let mut at = 0;
        let mut misses = 0_u32;
        let start = output.len();
        let searched = if u32::try_from(input.len()).is_ok() { input.len() } else { 0 };
        while let Some(word) = input[..searched].get(at..).and_then(|rest| rest.first_chunk::<LEAST_MATCH>())
        {
            let hash = (u32::from_le_bytes(*word).wrapping_mul(0x9E37_79B1) >> (32 - HASH_BITS)) as usize;
            let before = std::mem::replace(&mut self.last[hash], at as u32 + 1) as usize;
            let found = before
                .checked_sub(1)
                .filter(|&before| at - before <= FAR && input[before..].starts_with(word));
            let Some(before) = found else {
                at += 1 + (misses >> SKIP_AFTER) as usize;
                misses += 1;
                continue;
            };
            misses = 0;
            let len = LEAST_MATCH + same(&input[before + LEAST_MATCH..], &input[at + LEAST_MATCH..]);
            write_literals(&input[literals..at], start, output);
            write_match(at - before, len, output);
            at += len;
            literals = at;
        }
        write_literals(&input[literals..], start, output);
        output.extend(END);
    }
}

/// How many bytes the two begin with in common.
#[expect(clippy::arithmetic_side_effects, reason = "counts of bytes that exist")]
fn same(a: &[u8], b: &[u8]) -> usize {
    let (a_words, b_words) = (a.as_chunks::<8>().0, b.as_chunks::<8>().0);
    let words = a_words.iter().zip(b_words).take_while(|(a, b)| a == b).count() * 8;
    let rest = a.iter().skip(words).zip(b.iter().skip(words));
    words + rest.take_while(|(a, b)| a == b).count()
}

/// Writes literals after a match, or first in a stream that begins at `start`.
#[expect(
    clippy::arithmetic_side_effects,
    clippy::indexing_slicing,
    reason = "a match was written before, of which the state's byte is the last but one"
)]
fn write_literals(literals: &[u8], start: usize, output: &mut Vec<u8>) {
    match literals.len() {
        0 => {}
        len if output.len() == start && len <= 238 => output.push(17 + len as u8),
        len @ 1..=3 => {
            let state = output.len() - 2;
            output[state] |= len as u8;
        }
        len => write_len(0, len - 3, 15, output),
    }
    output.extend_from_slice(literals);
}

/// Writes a match of at least [`LEAST_MATCH`] bytes. The last byte but one holds the state in its two low bits.
#[expect(clippy::arithmetic_side_effects, reason = "distances are in 1..=FAR")]
fn write_match(distance: usize, len: usize, output: &mut Vec<u8>) {
    if len <= NEAR_LEN && distance <= NEAR {
        let distance = distance - 1;
        output.push(((len - 1) << 5 | (distance & 7) << 2) as u8);
        output.push((distance >> 3) as u8);
        return;
    }
    let word = if distance <= MIDDLE {
        write_len(0b0010_0000, len - 2, 31, output);
        distance - 1
    } else {
        let distance = distance - MIDDLE;
        write_len(0b0001_0000 | (distance >> 14 << 3) as u8, len - 2, 7, output);
        distance & (MIDDLE - 1)
    };
    output.extend(((word << 2) as u16).to_le_bytes());
}

/// Writes an opcode with a length in its low bits, up to `most`, or after it.
#[expect(
    clippy::arithmetic_side_effects,
    reason = "lengths are at least 1, and only larger than `most` here"
)]
fn write_len(opcode: u8, len: usize, most: usize, output: &mut Vec<u8>) {
    if len <= most {
        output.push(opcode | len as u8);
        return;
    }
    output.push(opcode);
    let over = len - most - 1;
    output.resize(output.len() + over / 255, 0);
    output.push((over % 255 + 1) as u8);
}

/// Unpacks `input` into `output`, all of which it must fill.
pub(super) fn decompress(input: &[u8], output: &mut [u8]) -> Result<(), Fault> {
    let mut input = Input { rest: input };
    let mut at = 0_usize;
    let mut state = 0;
    if let Some(&first @ 18..) = input.rest.first() {
        input.byte()?;
        let literals = usize::from(first.saturating_sub(17));
        input.copy_to(output, &mut at, literals)?;
        state = literals.min(4);
    }
    loop {
        let opcode = usize::from(input.byte()?);
        let (len, distance, next) = match opcode {
            0..16 if state == 0 => {
                let literals = input.len(opcode, 15)?.saturating_add(3);
                input.copy_to(output, &mut at, literals)?;
                state = 4;
                continue;
            }
            0..16 => {
                let distance = usize::from(input.byte()?) << 2 | opcode >> 2;
                let (len, least) = if state == 4 { (3, 2049) } else { (2, 1) };
                (len, distance.saturating_add(least), opcode)
            }
            16..32 => {
                let len = input.len(opcode & 7, 7)?;
                let word = input.word()?;
                let distance = (opcode & 8) << 11 | word >> 2;
                if distance == 0 {
                    let whole = input.rest.is_empty() && at == output.len() && len == 1;
                    return if whole { Ok(()) } else { Err(Fault::Length) };
                }
                (len.saturating_add(2), distance.saturating_add(MIDDLE), word)
            }
            32..64 => {
                let len = input.len(opcode & 31, 31)?.saturating_add(2);
                let word = input.word()?;
                (len, (word >> 2).saturating_add(1), word)
            }
            _ => {
                let distance = usize::from(input.byte()?) << 3 | opcode >> 2 & 7;
                ((opcode >> 5).saturating_add(1), distance.saturating_add(1), opcode)
            }
        };
        copy_match(output, &mut at, distance, len)?;
        state = next & 3;
        input.copy_to(output, &mut at, state)?;
    }
}

/// Copies `len` bytes from `distance` back to `at`, and moves it on. A distance below the length repeats bytes.
#[inline(always)]
fn copy_match(output: &mut [u8], at: &mut usize, distance: usize, len: usize) -> Result<(), Fault> {
    let from = at.checked_sub(distance).ok_or(Fault::Distance)?;
    let end = at.checked_add(len).filter(|&end| end <= output.len()).ok_or(Fault::Length)?;
    if distance >= STRIDE && end.saturating_add(STRIDE) <= output.len() {
        // What is written past the end is written again by what follows.
        let (mut from, mut to) = (from, *at);
        while to < end {
            output.copy_within(from..from.saturating_add(STRIDE), to);
            from = from.saturating_add(STRIDE);
            to = to.saturating_add(STRIDE);
        }
    } else if distance == 1 {
        let byte = output.get(from).copied().unwrap_or_default();
        output.get_mut(*at..end).unwrap_or_default().fill(byte);
    } else {
        // Each round doubles what can be copied without overlap.
        let mut to = *at;
        while to < end {
            let count = to.saturating_sub(from).min(end.saturating_sub(to));
            output.copy_within(from..from.saturating_add(count), to);
            to = to.saturating_add(count);
        }
    }
    *at = end;
    Ok(())
}

/// What is left of a stream.
struct Input<'a> {
    rest: &'a [u8],
}

impl Input<'_> {
    #[inline(always)]
    fn byte(&mut self) -> Result<u8, Fault> {
        let (&byte, rest) = self.rest.split_first().ok_or(Fault::End)?;
        self.rest = rest;
        Ok(byte)
    }

    #[inline(always)]
    fn word(&mut self) -> Result<usize, Fault> {
        let (word, rest) = self.rest.split_first_chunk().ok_or(Fault::End)?;
        self.rest = rest;
        Ok(usize::from(u16::from_le_bytes(*word)))
    }

    /// The length `short`, or where that is 0 a long number over `most`.
    #[inline(always)]
    fn len(&mut self, short: usize, most: usize) -> Result<usize, Fault> {
        if short != 0 {
            return Ok(short);
        }
        let zeros = self.rest.iter().take_while(|&&byte| byte == 0).count();
        self.rest = self.rest.get(zeros..).unwrap_or_default();
        let last = usize::from(self.byte()?);
        Ok(zeros.saturating_mul(255).saturating_add(last).saturating_add(most))
    }

    /// Copies `count` literals to `at`, and moves it on.
    #[inline(always)]
    fn copy_to(&mut self, output: &mut [u8], at: &mut usize, count: usize) -> Result<(), Fault> {
        let end = at.saturating_add(count);
        let room = output.get_mut(*at..).unwrap_or_default();
        if count <= STRIDE
            && let Some(literals) = self.rest.first_chunk::<STRIDE>()
            && let Some(room) = room.first_chunk_mut::<STRIDE>()
        {
            // What is written past the end is written again by what follows.
            *room = *literals;
        } else {
            let literals = self.rest.get(..count).ok_or(Fault::End)?;
            room.get_mut(..count).ok_or(Fault::Length)?.copy_from_slice(literals);
        }
        self.rest = self.rest.get(count..).ok_or(Fault::End)?;
        *at = end;
        Ok(())
    }
}

#[cfg(test)]
#[expect(clippy::arithmetic_side_effects, clippy::indexing_slicing, reason = "a test's own numbers")]
mod tests {
    use super::*;

    /// Bytes of several kinds: none, few, constant, repeating at every distance, noise, noise with far repeats.
    fn inputs() -> Vec<Vec<u8>> {
        let noise = |len: usize, seed: u32| -> Vec<u8> {
            let mut state = seed;
            (0..len)
                .map(|_| {
                    state = state.wrapping_mul(1664525).wrapping_add(1013904223);
                    (state >> 24) as u8
                })
                .collect()
        };
        let mut inputs: Vec<Vec<u8>> = (0..40).map(|len| noise(len, 1)).collect();
        inputs.extend([237, 238, 239, 240, 255, 256, 273, 274, 275, 100_000].map(|len| noise(len, 2)));
        inputs.extend([4, 5, 9, 10, 33, 34, 35, 288, 289, 300, 70_000].map(|len| vec![7; len]));
        for period in [2, 3, 5, 15, 16, 17, 2047, 2048, 2049, 16383, 16384, 16385, 32768, 49151, 49152] {
            inputs.push(noise(period, 3).into_iter().cycle().take(3 * period + 11).collect());
        }
        for literals in 0..24 {
            let mut mixed = noise(40, 4);
            for distance in [30, 2000, 2100, 16000, 17000, 48000] {
                let from = mixed.len().saturating_sub(distance);
                mixed.extend(noise(literals, distance as u32));
                mixed.extend(mixed[from..from + 4 + literals].to_vec());
                mixed.extend(noise(distance / 3, 5));
            }
            inputs.push(mixed);
        }
        inputs
    }

    #[test]
    fn what_is_packed_here_others_unpack_and_so_do_we() {
        let mut compressor = Compressor::new();
        for input in inputs() {
            let mut packed = Vec::new();
            compressor.compress(&input, &mut packed);
            assert!(packed.len() <= worst_len(input.len()), "{} of {}", packed.len(), input.len());
            let mut ours = vec![0; input.len()];
            decompress(&packed, &mut ours).unwrap();
            assert!(ours == input, "our own, {} bytes", input.len());
            let mut theirs = vec![0; input.len()];
            assert_eq!(lzo::decompress_into(&packed, &mut theirs), Ok(input.len()), "lzo");
            assert!(theirs == input, "lzo, {} bytes", input.len());
            theirs.fill(0);
            assert_eq!(lzokay::decompress::decompress(&packed, &mut theirs), Ok(input.len()), "lzokay");
            assert!(theirs == input, "lzokay, {} bytes", input.len());
        }
    }

    #[test]
    fn what_others_packed_is_unpacked_here() {
        // Of no bytes that crate makes a stream that LZO does not define.
        for input in inputs().into_iter().filter(|input| !input.is_empty()) {
            let packed = lzokay::compress::compress(&input).unwrap();
            let mut ours = vec![0; input.len()];
            let unpacked = decompress(&packed, &mut ours);
            assert!(unpacked.is_ok() && ours == input, "{unpacked:?} of {} bytes", input.len());
        }
    }

    #[test]
    fn a_stream_that_is_cut_or_has_another_length_is_refused() {
        let input: Vec<u8> = (0..1000_u32).map(|i| (i * i / 77) as u8).collect();
        let mut packed = Vec::new();
        Compressor::new().compress(&input, &mut packed);
        let mut output = vec![0; input.len()];
        for len in 0..packed.len() {
            assert!(decompress(&packed[..len], &mut output).is_err(), "cut to {len}");
        }
        for len in [0, 1, 999, 1001] {
            assert!(decompress(&packed, &mut vec![0; len]).is_err(), "into {len}");
        }
        packed.push(0);
        assert!(decompress(&packed, &mut output).is_err(), "with a byte more");
    }

    #[test]
    fn a_match_before_the_first_byte_is_refused() {
        // Two literals, then a match of 3 from 2049 back.
        assert!(
            matches!(decompress(&[19, 1, 2, 0b0100_0000, 255], &mut [0; 5]), Err(Fault::Distance)),
            "far"
        );
    }
}
