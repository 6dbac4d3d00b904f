//! Pictures: float RGBA, what is written of them, and how far two are apart.

use thiserror::Error;

/// A picture as accumulated: premultiplied colour and opacity, without background; rows from the top.
#[derive(Debug, Clone, PartialEq)]
pub struct FloatImage {
    /// Pixels along x, > 0.
    pub width: u32,
    /// Pixels along y, > 0.
    pub height: u32,
    /// `width · height` pixels, row by row from the top.
    pub pixels: Vec<[f32; 4]>,
}

/// Why two pictures cannot be compared.
#[derive(Debug, Clone, PartialEq, Error)]
#[error("pictures of {a:?} and {b:?} pixels cannot be compared")]
pub struct SizeError {
    a: (u32, u32),
    b: (u32, u32),
}

/// How far two pictures are apart, over the background, in units of 1/255.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Difference {
    /// Peak signal 255 over all channels and pixels, decibels; infinite where they are equal.
    pub psnr_db: f64,
    /// The largest difference of one channel.
    pub max: f64,
    /// The mean absolute difference.
    pub mean: f64,
}

impl FloatImage {
    /// A picture with nothing in it.
    pub fn clear(width: u32, height: u32) -> Self {
        let count = width as usize * height as usize;
        Self { width, height, pixels: vec![[0.0; 4]; count] }
    }

    /// Display colour of every pixel over a background, not rounded; 0 to 1.
    pub fn over(&self, background: [f64; 3]) -> Vec<[f64; 3]> {
        let through =
            |p: &[f32; 4]| std::array::from_fn(|c| f64::from(p[c]) + (1.0 - f64::from(p[3])) * background[c]);
        self.pixels.iter().map(through).collect()
    }

    /// 8-bit RGB over a background, rounded to nearest; 3 bytes a pixel, rows from the top.
    pub fn to_rgb8(&self, background: [f64; 3]) -> Vec<u8> {
        let byte = |v: f64| (v.clamp(0.0, 1.0) * 255.0).round() as u8;
        self.over(background).into_iter().flat_map(|p| p.map(byte)).collect()
    }

    /// How far `other` is from this, both over `background`, before any rounding.
    ///
    /// # Errors
    /// [`SizeError`] where the sizes differ.
    pub fn difference(&self, other: &Self, background: [f64; 3]) -> Result<Difference, SizeError> {
        let (a, b) = ((self.width, self.height), (other.width, other.height));
        if a != b {
            return Err(SizeError { a, b });
        }
        let (mut square, mut sum, mut max) = (0.0_f64, 0.0_f64, 0.0_f64);
        for (p, q) in self.over(background).iter().zip(other.over(background)) {
            for c in 0..3 {
                let d = (p[c] - q[c]).abs() * 255.0;
                square += d * d;
                sum += d;
                // A NaN must not hide: it counts as the largest difference there is.
                max = if d.is_nan() { f64::INFINITY } else { max.max(d) };
            }
        }
        let count = (self.pixels.len() * 3) as f64;
        let psnr_db =
            if square == 0.0 { f64::INFINITY } else { 10.0 * (255.0 * 255.0 * count / square).log10() };
        Ok(Difference { psnr_db, max, mean: sum / count })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_known_difference_has_its_known_psnr() {
        let a = FloatImage::clear(2, 2);
        let mut b = a.clone();
        b.pixels[0] = [1.0, 1.0, 1.0, 1.0];
        let d = a.difference(&b, [0.0; 3]).expect("same size");
        assert!((d.psnr_db - 10.0 * 4.0_f64.log10()).abs() < 1e-12, "a quarter of the pixels by 255");
        assert_eq!((d.max, d.mean), (255.0, 63.75), "max and mean");
        b.pixels[0][0] = f32::NAN;
        assert!(a.difference(&b, [0.0; 3]).expect("same size").max.is_infinite(), "NaN is seen");
    }
}
