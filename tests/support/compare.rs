//! How far two 8-bit pictures are apart.

use std::path::Path;

use image::RgbImage;

/// A picture file, as 8-bit colour.
pub(crate) fn open_rgb(path: &Path) -> RgbImage {
    image::open(path).unwrap_or_else(|e| panic!("{e}: {}", path.display())).to_rgb8()
}

/// Peak signal-to-noise ratio in decibels (infinite for equal pictures), and the largest difference of a channel.
pub(crate) fn difference(a: &RgbImage, b: &RgbImage) -> (f64, u8) {
    assert_eq!(a.dimensions(), b.dimensions(), "pictures of one size");
    let (mut square, mut largest) = (0.0, 0);
    for (p, q) in a.as_raw().iter().zip(b.as_raw()) {
        let apart = p.abs_diff(*q);
        largest = largest.max(apart);
        square += f64::from(apart).powi(2);
    }
    let mean = square / a.as_raw().len() as f64;
    (if mean == 0.0 { f64::INFINITY } else { 10.0 * (255.0_f64.powi(2) / mean).log10() }, largest)
}

/// How many different colours a picture has: 1 for an empty one.
pub(crate) fn colours(picture: &RgbImage) -> usize {
    picture.pixels().map(|p| p.0).collect::<std::collections::BTreeSet<_>>().len()
}

#[test]
fn one_pixel_in_four_by_full_scale_in_one_channel_is_its_psnr() {
    let a = RgbImage::new(2, 2);
    let mut b = a.clone();
    b.put_pixel(1, 0, image::Rgb([255, 0, 0]));
    let (psnr, largest) = difference(&a, &b);
    assert!((psnr - 10.0 * 12.0_f64.log10()).abs() < 1e-12, "one of twelve values is off by 255: {psnr}");
    assert_eq!((largest, colours(&a), colours(&b)), (255, 1, 2), "largest difference and colours");
    assert!(difference(&a, &a).0.is_infinite(), "equal pictures");
}
