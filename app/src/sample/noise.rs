//! Noise that is the same on every machine and for any number of threads: a hash of the place.

/// The integer mixer of `SplitMix64` (Steele, Lea, Flood 2014).
fn mix(state: u64) -> u64 {
    let z = state.wrapping_add(0x9E37_79B9_7F4A_7C15);
    let z = (z ^ (z >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
    let z = (z ^ (z >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
    z ^ (z >> 31)
}

fn at(seed: u64, x: i64, y: i64, z: i64) -> u64 {
    let place = (x as u64 & 0x1F_FFFF) | (y as u64 & 0x1F_FFFF) << 21 | (z as u64 & 0x1F_FFFF) << 42;
    mix(place ^ seed.wrapping_mul(0xD6E8_FEB8_6659_FD93))
}

/// White, nearly Gaussian noise of mean 0 and standard deviation 1 at a lattice place: the sum of four
/// uniform 16-bit numbers.
pub(super) fn white(seed: u64, x: i64, y: i64, z: i64) -> f32 {
    let bits = at(seed, x, y, z);
    let sum = (bits & 0xFFFF) + (bits >> 16 & 0xFFFF) + (bits >> 32 & 0xFFFF) + (bits >> 48);
    // Four uniforms of width 65 536 have variance 4 · 65536² / 12, less a negligible 1/65536².
    (sum as f32 - 131_070.0) * (1.732_050_8 / 65_536.0)
}

/// Smooth noise of mean 0 within (-1, 1): the random values of a unit lattice, blended by smooth steps.
pub(super) fn smooth(seed: u64, x: f64, y: f64, z: f64) -> f64 {
    let (fx, fy, fz) = (x.floor(), y.floor(), z.floor());
    let (ix, iy, iz) = (fx as i64, fy as i64, fz as i64);
    let ease = |t: f64| t * t * (3.0 - 2.0 * t);
    let (tx, ty, tz) = (ease(x - fx), ease(y - fy), ease(z - fz));
    // One hash gives the two neighbours along x of one lattice row: its halves are independent.
    let row = |dy: i64, dz: i64| {
        let value = |dx: i64| {
            (at(seed, ix + dx, iy + dy, iz + dz) >> 11) as f64 * (2.0 / 9_007_199_254_740_992.0) - 1.0
        };
        let (a, b) = (value(0), value(1));
        a + (b - a) * tx
    };
    let (a, b, c, d) = (row(0, 0), row(1, 0), row(0, 1), row(1, 1));
    let (low, high) = (a + (b - a) * ty, c + (d - c) * ty);
    low + (high - low) * tz
}

/// Weights of the noise's correlation along one axis; their squares add up to 1, so that the filtered
/// noise keeps standard deviation 1. `centre` : `side` = `ratio` : 1.
fn kernel(ratio: f32) -> [f32; 2] {
    let side = 1.0 / (ratio * ratio + 2.0).sqrt();
    [ratio * side, side]
}

/// Noise of standard deviation 1 on `nx · ny` samples of one slice, correlated in plane 2 : 1 with
/// each neighbour and across slices by `across` : 1; x fastest.
pub(super) fn slice(seed: u64, nx: usize, ny: usize, z: i64, across: f32, out: &mut Vec<f32>) {
    let [zc, zs] = kernel(across);
    let [pc, ps] = kernel(2.0);
    let (wide, high) = (nx + 2, ny + 2);
    let mut raw = vec![0.0_f32; wide * high];
    for y in 0..high {
        for x in 0..wide {
            let (gx, gy) = (x as i64, y as i64);
            raw[x + wide * y] =
                zc * white(seed, gx, gy, z) + zs * (white(seed, gx, gy, z - 1) + white(seed, gx, gy, z + 1));
        }
    }
    let mut rows = vec![0.0_f32; nx * high];
    for y in 0..high {
        for x in 0..nx {
            let i = x + wide * y;
            rows[x + nx * y] = pc * raw[i + 1] + ps * (raw[i] + raw[i + 2]);
        }
    }
    out.clear();
    out.extend((0..nx * ny).map(|i| pc * rows[i + nx] + ps * (rows[i] + rows[i + 2 * nx])));
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn noise_has_mean_zero_and_the_stated_deviation() {
        let (mut sum, mut square, mut count) = (0.0_f64, 0.0_f64, 0.0_f64);
        let mut out = Vec::new();
        for z in 0..40 {
            slice(7, 100, 100, z, 4.0, &mut out);
            for &v in &out {
                sum += f64::from(v);
                square += f64::from(v * v);
                count += 1.0;
            }
        }
        let mean = sum / count;
        let sigma = (square / count - mean * mean).sqrt();
        // 400 000 samples, correlated over about ten: 1 / sqrt(40 000) = 0.005.
        assert!(mean.abs() < 0.015, "mean {mean}");
        assert!((sigma - 1.0).abs() < 0.01, "sigma {sigma}");
    }

    #[test]
    fn smooth_noise_is_continuous_and_centred() {
        let mut sum = 0.0;
        for k in 0..20_000 {
            let t = f64::from(k) * 0.37;
            let (a, b) = (smooth(3, t, t * 0.7, -t), smooth(3, t + 1e-6, t * 0.7, -t));
            assert!((a - b).abs() < 1e-5, "jump at {t}");
            sum += a;
        }
        assert!((sum / 20_000.0).abs() < 0.02, "mean {}", sum / 20_000.0);
    }
}
