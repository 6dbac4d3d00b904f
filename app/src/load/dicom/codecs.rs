//! JPEG and JPEG 2000 through the crates that dicom-rs uses too; here their size is checked before they
//! may take memory.

use super::walk::Fault;

/// A JPEG of the baseline, extended (8 bits) or lossless (2 to 16 bits) process, one component; samples
/// as coded.
///
/// # Errors
/// A [`Fault`]: another size than asked for, a process that is not read, damaged data.
pub(super) fn jpeg(bytes: &[u8], columns: usize, rows: usize) -> Result<Vec<u16>, Fault> {
    let mut decoder = jpeg_decoder::Decoder::new(bytes);
    let fault = |e: jpeg_decoder::Error| format!("the JPEG data cannot be decoded ({e})");
    decoder.read_info().map_err(fault)?;
    let info = decoder.info().ok_or_else(|| "the JPEG data have no header".to_owned())?;
    same_size((usize::from(info.width), usize::from(info.height)), (columns, rows), "JPEG")?;
    let wide = match info.pixel_format {
        jpeg_decoder::PixelFormat::L8 => false,
        jpeg_decoder::PixelFormat::L16 => true,
        _ => return Err("the JPEG picture has more than one component".to_owned()),
    };
    let data = decoder.decode().map_err(fault)?;
    Ok(if wide {
        data.as_chunks::<2>().0.iter().map(|pair| u16::from_ne_bytes(*pair)).collect()
    } else {
        data.into_iter().map(u16::from).collect()
    })
}

/// A JPEG 2000 codestream of one component; samples as coded, the low bits of two's complement.
///
/// # Errors
/// A [`Fault`]: another size than asked for, damaged data.
pub(super) fn jpeg2000(bytes: &[u8], columns: usize, rows: usize) -> Result<Vec<i32>, Fault> {
    // SIZ (ISO/IEC 15444-1 A.5.1): the size is checked before the decoder may take memory for it.
    let word = |at: usize| {
        let four = bytes.get(at..).and_then(|b| b.first_chunk::<4>());
        four.map(|w| u32::from_be_bytes(*w))
            .ok_or_else(|| "the JPEG 2000 data end in their header".to_owned())
    };
    if word(0)? != 0xFF4F_FF51 {
        return Err("the JPEG 2000 data do not begin with their marker".to_owned());
    }
    let span = |end: u32, start: u32| usize::try_from(end.saturating_sub(start)).unwrap_or(usize::MAX);
    let size = (span(word(8)?, word(16)?), span(word(12)?, word(20)?));
    same_size(size, (columns, rows), "JPEG 2000")?;
    let fault = |e| format!("the JPEG 2000 data cannot be decoded ({e})");
    let image = jpeg2k::Image::from_bytes(bytes).map_err(fault)?;
    match image.components() {
        [one] if one.data().len() == columns.saturating_mul(rows) => Ok(one.data().to_vec()),
        [_] => Err("the JPEG 2000 picture is smaller than its header says".to_owned()),
        _ => Err("the JPEG 2000 picture has more than one component".to_owned()),
    }
}

fn same_size(found: (usize, usize), wanted: (usize, usize), codec: &str) -> Result<(), Fault> {
    if found == wanted {
        return Ok(());
    }
    Err(format!("the {codec} picture is {}x{}, the header says {}x{}", found.0, found.1, wanted.0, wanted.1))
}
