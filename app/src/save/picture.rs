//! Pictures as files: PNG over the background for people, EXR as accumulated for programs. Both carry
//! what must be said of them: a picture that shows lossy data names the format and the error.

use std::io::Cursor;

use image::ImageEncoder as _;
use render::image::FloatImage;

/// The chunk that a statement goes into; any PNG viewer shows it.
const KEYWORD: &[u8] = b"Comment\0";

/// An 8-bit RGB PNG of a picture over a background, with a statement in its metadata (empty: none).
///
/// # Errors
/// What the encoder says, which is only about sizes it does not take.
pub fn png(picture: &FloatImage, background: [f64; 3], statement: &str) -> image::ImageResult<Vec<u8>> {
    let mut bytes = Vec::new();
    image::codecs::png::PngEncoder::new(&mut bytes).write_image(
        &picture.to_rgb8(background),
        picture.width,
        picture.height,
        image::ExtendedColorType::Rgb8,
    )?;
    // Signature and IHDR are 8 and 25 bytes, always the first (PNG 1.2, 4.1.1).
    if !statement.is_empty() && bytes.len() > 33 {
        bytes.splice(33..33, text_chunk(statement));
    }
    Ok(bytes)
}

/// A `tEXt` chunk (PNG 1.2, 4.2.3.1), which is Latin-1: other letters become question marks.
fn text_chunk(statement: &str) -> Vec<u8> {
    let latin = statement.chars().map(|c| u8::try_from(u32::from(c)).unwrap_or(b'?'));
    let content: Vec<u8> = b"tEXt".iter().chain(KEYWORD).copied().chain(latin).collect();
    let mut crc = flate2::Crc::new();
    crc.update(&content);
    let length = u32::try_from(content.len() - 4).unwrap_or(0);
    [&length.to_be_bytes()[..], &content[..], &crc.sum().to_be_bytes()[..]].concat()
}

/// A 32-bit float RGBA EXR of a picture as accumulated: premultiplied, without background; with a
/// statement as its comment (empty: none).
///
/// # Errors
/// What the encoder says, which is only about sizes it does not take.
pub fn exr(picture: &FloatImage, statement: &str) -> exr::error::Result<Vec<u8>> {
    use exr::prelude::{Image, LineOrder, SpecificChannels, Text, Vec2, WritableImage as _};
    let width = picture.width as usize;
    let pixel = |at: Vec2<usize>| {
        let [r, g, b, a] = picture.pixels[at.y() * width + at.x()];
        (r, g, b, a)
    };
    let size = (width, picture.height as usize);
    let mut image = Image::from_channels(size, SpecificChannels::rgba(pixel));
    // Else blocks stand in the order in which threads were done with them.
    image.layer_data.encoding.line_order = LineOrder::Increasing;
    if !statement.is_empty() {
        image.layer_data.attributes.comments = Text::new_or_none(statement);
    }
    let mut bytes = Vec::new();
    image.write().to_buffered(Cursor::new(&mut bytes))?;
    Ok(bytes)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn picture() -> FloatImage {
        let mut picture = FloatImage::clear(5, 3);
        for (i, p) in picture.pixels.iter_mut().enumerate() {
            *p = [i as f32 * 1e-7, 0.25, i as f32, 1.0 / (1.0 + i as f32)];
        }
        picture
    }

    #[test]
    fn an_exr_gives_back_every_bit() {
        for statement in ["", "lossy: bc4"] {
            let bytes = exr(&picture(), statement).expect("written");
            let read = image::load_from_memory(&bytes).expect("read").to_rgba32f();
            assert_eq!(read.dimensions(), (5, 3), "size");
            for (found, wanted) in read.pixels().zip(&picture().pixels) {
                assert_eq!(found.0.map(f32::to_bits), wanted.map(f32::to_bits), "bits");
            }
            assert_eq!(bytes.windows(10).any(|w| w == b"lossy: bc4"), !statement.is_empty(), "comment");
        }
    }

    #[test]
    fn an_exr_has_the_same_bytes_each_time() {
        let mut picture = FloatImage::clear(300, 400);
        for (i, p) in picture.pixels.iter_mut().enumerate() {
            *p = [(i as f32).sin(); 4];
        }
        let known = exr(&picture, "").expect("written");
        for _ in 0..5 {
            assert!(exr(&picture, "").expect("written") == known, "whichever thread is done first");
        }
    }

    #[test]
    fn a_png_is_the_picture_over_its_background_and_carries_the_statement() {
        let plain = png(&picture(), [0.5; 3], "").expect("written");
        let said = png(&picture(), [0.5; 3], "lossy: bc4, 3 \u{b5}m").expect("written");
        for bytes in [&plain, &said] {
            let read = image::load_from_memory(bytes).expect("every checksum is right").to_rgb8();
            assert_eq!(read.as_raw(), &picture().to_rgb8([0.5; 3]), "pixels");
        }
        assert!(said.windows(13).any(|w| w == b"Comment\0lossy"), "the statement");
        assert!(said.len() == plain.len() + 12 + 8 + 16, "one chunk more, one byte a letter");
    }
}
