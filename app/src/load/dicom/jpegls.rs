//! JPEG-LS decoder, lossless and near-lossless, one component of 2 to 16 bits.
//!
//! No crate in plain Rust reads it, so here it is. Source: ISO/IEC 14495-1 (ITU-T T.87), Annex A for the
//! coding, Annex C for the markers; the letters of the standard (A, B, C, N, Q, k, Ra..Rd, Px) are kept.
//! Left out, as DICOM's grey images do not use it: interleaved components, mapping tables, restart
//! intervals, point transform.
#![expect(
    clippy::arithmetic_side_effects,
    clippy::indexing_slicing,
    reason = "the standard's arithmetic on i32, bounded by MAXVAL < 2^16; indices by construction of the line buffers and of the 367 contexts"
)]

use super::walk::Fault;

/// Run-length orders (A.7.1.2, table J).
const J: [u32; 32] =
    [0, 0, 0, 0, 1, 1, 1, 1, 2, 2, 2, 2, 3, 3, 3, 3, 4, 4, 5, 5, 6, 6, 7, 7, 8, 9, 10, 11, 12, 13, 14, 15];

/// Decodes one picture of `columns` × `rows`; `[x, y]`, x fastest, unsigned as coded.
///
/// # Errors
/// A [`Fault`]: another size than asked for, a marker that is missing or not supported, data that end
/// early.
pub(super) fn decode(bytes: &[u8], columns: usize, rows: usize) -> Result<Vec<u16>, Fault> {
    let (coding, at) = Coding::read(bytes, columns, rows)?;
    let mut decoder = Decoder::new(&coding, bytes.get(at..).unwrap_or_default());
    let mut picture = vec![0_u16; columns * rows];
    // One sample before the line and one after it, so that neighbours need no special case.
    let mut above = vec![0_i32; columns + 2];
    let mut line = vec![0_i32; columns + 2];
    for out in picture.chunks_exact_mut(columns) {
        above[columns + 1] = above[columns];
        line[0] = above[1];
        decoder.line(&above, &mut line)?;
        for (slot, value) in out.iter_mut().zip(&line[1..]) {
            *slot = u16::try_from(*value).unwrap_or(0);
        }
        std::mem::swap(&mut above, &mut line);
    }
    Ok(picture)
}

/// What the markers say (C.2).
#[derive(Debug, Clone, Copy)]
struct Coding {
    maxval: i32,
    near: i32,
    thresholds: [i32; 3],
    reset: i32,
}

impl Coding {
    fn read(bytes: &[u8], columns: usize, rows: usize) -> Result<(Self, usize), Fault> {
        let ends = || "the JPEG-LS stream ends in its header".to_owned();
        let u16_at = |at: usize| {
            let pair = bytes.get(at..).and_then(|b| b.first_chunk::<2>());
            pair.map(|p| usize::from(u16::from_be_bytes(*p))).ok_or_else(ends)
        };
        let byte = |at: usize| bytes.get(at).copied().ok_or_else(ends);
        if u16_at(0)? != 0xFFD8 {
            return Err("the JPEG-LS stream does not begin with its marker".to_owned());
        }
        let (mut at, mut precision, mut preset) = (2, None, [0_usize; 5]);
        loop {
            let marker = u16_at(at)?;
            let body = at + 4;
            let next = at + 2 + u16_at(at + 2)?.max(2);
            match marker {
                0xFFF7 => {
                    let size = (u16_at(body + 3)?, u16_at(body + 1)?);
                    if size != (columns, rows) {
                        return Err(format!(
                            "the JPEG-LS picture is {}x{}, the header says {columns}x{rows}",
                            size.0, size.1
                        ));
                    }
                    if byte(body + 5)? != 1 {
                        return Err("the JPEG-LS picture has more than one component".to_owned());
                    }
                    precision = Some(u32::from(byte(body)?)).filter(|p| (2..=16).contains(p));
                }
                0xFFF8 if byte(body)? == 1 => {
                    for (i, slot) in preset.iter_mut().enumerate() {
                        *slot = u16_at(body + 1 + 2 * i)?;
                    }
                }
                0xFFDA => {
                    let precision = precision
                        .ok_or_else(|| "the JPEG-LS stream has no usable frame header".to_owned())?;
                    let (near, transform) = (byte(body + 3)?, byte(body + 5)?);
                    if byte(body)? != 1 || byte(body + 2)? != 0 || transform != 0 {
                        return Err("the JPEG-LS scan uses a mapping table or point transform".to_owned());
                    }
                    return Ok((Self::new(precision, i32::from(near), preset)?, next));
                }
                0xFFF8 | 0xFFDD => {
                    return Err("the JPEG-LS stream uses mapping tables or restart intervals".to_owned());
                }
                0xFFE0..=0xFFEF | 0xFFFE => {}
                _ => return Err(format!("the JPEG-LS stream has an unexpected marker {marker:04X}")),
            }
            at = next;
        }
    }

    /// Defaults of C.2.4.1.1 where the stream gives none.
    fn new(precision: u32, near: i32, preset: [usize; 5]) -> Result<Self, Fault> {
        let [maxval, t1, t2, t3, reset] = preset.map(|v| i32::try_from(v).unwrap_or(0));
        let top = (1 << precision) - 1;
        let maxval = if maxval == 0 { top } else { maxval };
        if maxval > top || near > 255.min(maxval / 2) {
            return Err("the JPEG-LS parameters contradict each other".to_owned());
        }
        let clamp = |i: i32, low: i32| if i > maxval || i < low { low } else { i };
        let defaults = if maxval >= 128 {
            let factor = (maxval.min(4095) + 128) / 256;
            let t1 = clamp(factor + 2 + 3 * near, near + 1);
            let t2 = clamp(factor * 4 + 3 + 5 * near, t1);
            [t1, t2, clamp(factor * 17 + 4 + 7 * near, t2)]
        } else {
            let factor = 256 / (maxval + 1);
            let t1 = clamp((3 / factor + 3 * near).max(2), near + 1);
            let t2 = clamp((7 / factor + 5 * near).max(3), t1);
            [t1, t2, clamp((21 / factor + 7 * near).max(4), t2)]
        };
        let mut thresholds = [t1, t2, t3];
        for (given, default) in thresholds.iter_mut().zip(defaults) {
            if *given == 0 {
                *given = default;
            }
        }
        Ok(Self { maxval, near, thresholds, reset: if reset == 0 { 64 } else { reset } })
    }
}

/// Bits of the scan; after a byte of 0xFF only seven bits follow (A.1).
struct Bits<'a> {
    bytes: &'a [u8],
    at: usize,
    window: u64,
    held: u32,
    after_ff: bool,
    /// Bits made up after the end of the data.
    invented: u32,
}

impl Bits<'_> {
    fn fill(&mut self) {
        while self.held <= 48 {
            let (byte, width) = match self.bytes.get(self.at) {
                // A marker: the scan is over.
                Some(&b) if self.after_ff && b & 0x80 != 0 => (0, 0),
                Some(&b) => (b, if self.after_ff { 7 } else { 8 }),
                None => (0, 0),
            };
            if width == 0 {
                self.window <<= 8;
                self.held += 8;
                self.invented += 8;
                continue;
            }
            self.window = self.window << width | u64::from(byte);
            self.held += width;
            self.after_ff = byte == 0xFF;
            self.at += 1;
        }
    }

    fn take(&mut self, count: u32) -> Result<i32, Fault> {
        if count == 0 {
            return Ok(0);
        }
        if self.held < count {
            self.fill();
        }
        self.held -= count;
        if self.held < self.invented {
            return Err("the JPEG-LS data end before the picture is complete".to_owned());
        }
        let value = self.window >> self.held & ((1 << count) - 1);
        Ok(i32::try_from(value).unwrap_or(0))
    }

    /// Zeros up to the next one, which is taken too.
    fn zeros(&mut self, most: u32) -> Result<u32, Fault> {
        let mut count = 0;
        while self.take(1)? == 0 {
            count += 1;
            if count > most {
                return Err("the JPEG-LS data hold a code that is too long".to_owned());
            }
        }
        Ok(count)
    }

    /// A.5.3: limited-length Golomb code of order `k`.
    fn golomb(&mut self, k: u32, limit: u32, qbpp: u32) -> Result<i32, Fault> {
        let most = limit - qbpp - 1;
        let high = self.zeros(most)?;
        if high < most {
            return Ok((i32::try_from(high).unwrap_or(0) << k) | self.take(k)?);
        }
        Ok(self.take(qbpp)? + 1)
    }
}

#[derive(Debug, Clone, Copy)]
struct Context {
    a: i32,
    b: i32,
    c: i32,
    n: i32,
}

struct Decoder<'a> {
    coding: Coding,
    bits: Bits<'a>,
    contexts: Vec<Context>,
    /// Negative errors of the two run-interruption contexts (Nn).
    negative: [i32; 2],
    run_index: usize,
    range: i32,
    qbpp: u32,
    limit: u32,
}

impl<'a> Decoder<'a> {
    fn new(coding: &Coding, bytes: &'a [u8]) -> Self {
        let step = 2 * coding.near + 1;
        let range = (coding.maxval + 2 * coding.near) / step + 1;
        let bits_of = |count: i32| (count - 1).checked_ilog2().map_or(0, |l| l + 1);
        let bpp = bits_of(coding.maxval + 1).max(2);
        let start = Context { a: ((range + 32) / 64).max(2), b: 0, c: 0, n: 1 };
        Self {
            coding: *coding,
            bits: Bits { bytes, at: 0, window: 0, held: 0, after_ff: false, invented: 0 },
            contexts: vec![start; 367],
            negative: [0; 2],
            run_index: 0,
            range,
            qbpp: bits_of(range),
            limit: 2 * (bpp + bpp.max(8)),
        }
    }

    /// `above` and `line` have one sample more on either side; `line[0]` is set.
    fn line(&mut self, above: &[i32], line: &mut [i32]) -> Result<(), Fault> {
        let end = line.len() - 1;
        let mut x = 1;
        while x < end {
            let (a, b, c, d) = (line[x - 1], above[x], above[x - 1], above[x + 1]);
            let q = 81 * self.quantized(d - b) + 9 * self.quantized(b - c) + self.quantized(c - a);
            if q != 0 {
                line[x] = self.regular(q, a, b, c)?;
                x += 1;
                continue;
            }
            let run = self.run(end - x)?;
            line[x..x + run.length].fill(a);
            x += run.length;
            if run.interrupted {
                line[x] = self.interruption(a, above[x])?;
                self.run_index = self.run_index.saturating_sub(1);
                x += 1;
            }
        }
        Ok(())
    }

    /// A.3.3.
    fn quantized(&self, d: i32) -> i32 {
        let [t1, t2, t3] = self.coding.thresholds;
        let size = match d.abs() {
            s if s >= t3 => 4,
            s if s >= t2 => 3,
            s if s >= t1 => 2,
            s if s > self.coding.near => 1,
            _ => 0,
        };
        if d < 0 { -size } else { size }
    }

    /// A.4 to A.6: a sample by prediction.
    fn regular(&mut self, q: i32, a: i32, b: i32, c: i32) -> Result<i32, Fault> {
        let sign = q.signum();
        let index = usize::try_from(q.abs()).unwrap_or(0);
        let Context { a: size, b: bias, c: correction, n } = self.contexts[index];
        let predicted = if c >= a.max(b) {
            a.min(b)
        } else if c <= a.min(b) {
            a.max(b)
        } else {
            a + b - c
        };
        let predicted = (predicted + sign * correction).clamp(0, self.coding.maxval);
        let k = order(n, size)?;
        let mapped = self.bits.golomb(k, self.limit, self.qbpp)?;
        let plain = if mapped & 1 == 1 { -(mapped + 1) / 2 } else { mapped / 2 };
        let turned = self.coding.near == 0 && k == 0 && 2 * bias <= -n;
        let error = if turned { -plain - 1 } else { plain };
        self.contexts[index].learn(error, 2 * self.coding.near + 1, self.coding.reset);
        Ok(self.restored(predicted, sign * error))
    }

    /// A.4.4, A.4.5 in reverse.
    fn restored(&self, predicted: i32, error: i32) -> i32 {
        let Coding { maxval, near, .. } = self.coding;
        let step = 2 * near + 1;
        let mut value = predicted + error * step;
        if value < -near {
            value += self.range * step;
        } else if value > maxval + near {
            value -= self.range * step;
        }
        value.clamp(0, maxval)
    }

    /// A.7.1: how far the run goes, and whether something else than the line's end ended it.
    fn run(&mut self, remaining: usize) -> Result<Run, Fault> {
        let mut length = 0;
        while self.bits.take(1)? == 1 {
            let whole = 1_usize << J[self.run_index];
            if whole > remaining - length {
                return Ok(Run { length: remaining, interrupted: false });
            }
            length += whole;
            self.run_index = (self.run_index + 1).min(31);
            if length == remaining {
                return Ok(Run { length, interrupted: false });
            }
        }
        length += usize::try_from(self.bits.take(J[self.run_index])?).unwrap_or(0);
        if length >= remaining {
            return Err("the JPEG-LS data hold a run beyond the end of its line".to_owned());
        }
        Ok(Run { length, interrupted: true })
    }

    /// A.7.2: the sample that ended a run.
    fn interruption(&mut self, a: i32, b: i32) -> Result<i32, Fault> {
        let same = (a - b).abs() <= self.coding.near;
        let kind = i32::from(same);
        let (slot, which) = if same { (366, 1) } else { (365, 0) };
        let Context { a: size, n, .. } = self.contexts[slot];
        let k = order(n, if same { size + n / 2 } else { size })?;
        let limit = self.limit - J[self.run_index] - 1;
        let mapped = self.bits.golomb(k, limit, self.qbpp)?;
        let coded = mapped + kind;
        let odd = coded & 1 == 1;
        let size = coded / 2 + i32::from(odd);
        let error = if (k != 0 || 2 * self.negative[which] >= n) == odd { -size } else { size };
        if error < 0 {
            self.negative[which] += 1;
        }
        let context = &mut self.contexts[slot];
        context.a += (mapped + 1 - kind) / 2;
        if context.n == self.coding.reset {
            context.a /= 2;
            context.n /= 2;
            self.negative[which] /= 2;
        }
        context.n += 1;
        let sign = if !same && a > b { -1 } else { 1 };
        Ok(self.restored(if same { a } else { b }, sign * error))
    }
}

struct Run {
    length: usize,
    interrupted: bool,
}

impl Context {
    /// A.6.1 and A.6.2.
    fn learn(&mut self, error: i32, step: i32, reset: i32) {
        self.b += error * step;
        self.a += error.abs();
        if self.n == reset {
            self.a >>= 1;
            self.b >>= 1;
            self.n >>= 1;
        }
        self.n += 1;
        if self.b <= -self.n {
            self.b = (self.b + self.n).max(1 - self.n);
            self.c = (self.c - 1).max(-128);
        } else if self.b > 0 {
            self.b = (self.b - self.n).min(0);
            self.c = (self.c + 1).min(127);
        }
    }
}

/// A.5.1: the Golomb order for a context.
fn order(n: i32, size: i32) -> Result<u32, Fault> {
    (0..24).find(|&k| n << k >= size).ok_or_else(|| "the JPEG-LS data are damaged".to_owned())
}

#[cfg(test)]
mod tests {
    use super::*;

    /// ISO/IEC 14495-1 Annex H.3: a 4×4 picture of 8 bits, thresholds and all, with its code.
    #[test]
    fn the_example_of_the_standard_decodes() {
        let code = [
            0xFF, 0xD8, 0xFF, 0xF7, 0x00, 0x0B, 0x08, 0x00, 0x04, 0x00, 0x04, 0x01, 0x01, 0x11, 0x00, 0xFF,
            0xDA, 0x00, 0x08, 0x01, 0x01, 0x00, 0x00, 0x00, 0x00, 0xC0, 0x00, 0x00, 0x6C, 0x80, 0x20, 0x8E,
            0x01, 0xC0, 0x00, 0x00, 0x57, 0x40, 0x00, 0x00, 0x6E, 0xE6, 0x00, 0x00, 0x01, 0xBC, 0x18, 0x00,
            0x00, 0x05, 0xD8, 0x00, 0x00, 0x91, 0x60, 0xFF, 0xD9,
        ];
        let picture = decode(&code, 4, 4).expect("the example is right");
        let expected = [0, 0, 90, 74, 68, 50, 43, 205, 64, 145, 145, 145, 100, 145, 145, 145];
        assert_eq!(picture, expected, "H.3, figure H.4");
    }

    #[test]
    fn damaged_streams_are_refused() {
        assert!(decode(&[0xFF, 0xD8], 4, 4).is_err(), "no header");
        let code = [
            0xFF, 0xD8, 0xFF, 0xF7, 0x00, 0x0B, 0x08, 0x00, 0x04, 0x00, 0x04, 0x01, 0x01, 0x11, 0x00, 0xFF,
            0xDA, 0x00, 0x08, 0x01, 0x01, 0x00, 0x00, 0x00, 0x00, 0xC0, 0x00,
        ];
        assert!(decode(&code, 4, 4).is_err(), "too little data");
        assert!(decode(&code, 5, 4).is_err(), "another size than the header says");
    }
}
