//! RLE Lossless: each byte of the samples is a plane of its own, packed by runs. Source: DICOM PS3.5
//! Annex G.

use super::walk::Fault;

/// Decodes one frame of `samples` samples of `bytes_per_sample`; little-endian samples.
///
/// # Errors
/// A [`Fault`]: a header that does not fit, a segment that ends early.
pub(super) fn decode(bytes: &[u8], samples: usize, bytes_per_sample: usize) -> Result<Vec<u8>, Fault> {
    let word = |at: usize| {
        let at = at.checked_mul(4)?;
        let word = u32::from_le_bytes(*bytes.get(at..)?.first_chunk::<4>()?);
        usize::try_from(word).ok()
    };
    let broken = || "the RLE header does not fit its data".to_owned();
    let segments = word(0).ok_or_else(broken)?;
    if segments != bytes_per_sample {
        return Err(format!("the RLE data have {segments} segments instead of {bytes_per_sample}"));
    }
    let total = samples.checked_mul(bytes_per_sample).ok_or_else(broken)?;
    let mut out = vec![0_u8; total];
    for segment in 0..segments {
        let start = word(segment.saturating_add(1)).ok_or_else(broken)?;
        let end = if segment.saturating_add(1) < segments {
            word(segment.saturating_add(2)).ok_or_else(broken)?
        } else {
            bytes.len()
        };
        let packed = bytes.get(start..end).ok_or_else(broken)?;
        // The first segment holds the most significant bytes (G.2).
        let lane = bytes_per_sample.saturating_sub(segment).saturating_sub(1);
        let slots = out.iter_mut().skip(lane).step_by(bytes_per_sample);
        unpack(packed, slots)?;
    }
    Ok(out)
}

/// G.3.2: fills the slots from one segment.
fn unpack<'a>(packed: &[u8], slots: impl Iterator<Item = &'a mut u8>) -> Result<(), Fault> {
    let mut input = packed.iter().copied();
    let mut slots = slots.peekable();
    while slots.peek().is_some() {
        let ends = || "the RLE data end before the picture is complete".to_owned();
        let control = input.next().ok_or_else(ends)?;
        match control {
            0..=127 => {
                for _ in 0..=control {
                    let byte = input.next().ok_or_else(ends)?;
                    if let Some(slot) = slots.next() {
                        *slot = byte;
                    }
                }
            }
            128 => {}
            129..=255 => {
                let byte = input.next().ok_or_else(ends)?;
                // 257 − control copies, at least two.
                for slot in slots.by_ref().take(257_usize.saturating_sub(usize::from(control))) {
                    *slot = byte;
                }
            }
        }
    }
    Ok(())
}

#[cfg(test)]
#[expect(clippy::indexing_slicing, clippy::arithmetic_side_effects, reason = "a test may fail loudly")]
mod tests {
    use super::*;

    /// A header for one frame: the number of segments and where they start, 64 bytes.
    fn framed(segments: &[&[u8]]) -> Vec<u8> {
        let mut words = vec![u32::try_from(segments.len()).expect("few")];
        let mut at = 64;
        for segment in segments {
            words.push(at);
            at += u32::try_from(segment.len()).expect("short");
        }
        words.resize(16, 0);
        let mut bytes: Vec<u8> = words.iter().flat_map(|w| w.to_le_bytes()).collect();
        for segment in segments {
            bytes.extend_from_slice(segment);
        }
        bytes
    }

    #[test]
    fn literals_and_runs_make_little_endian_samples() {
        // High bytes: three times 0x12; low bytes: 1, 2, 3.
        let bytes = framed(&[&[254, 0x12], &[128, 2, 1, 2, 3]]);
        let samples = decode(&bytes, 3, 2).expect("it is right");
        assert_eq!(samples, [1, 0x12, 2, 0x12, 3, 0x12], "planes are woven together");
    }

    #[test]
    fn four_byte_samples_have_four_segments() {
        let bytes = framed(&[&[0, 4], &[0, 3], &[0, 2], &[0, 1]]);
        assert_eq!(decode(&bytes, 1, 4).expect("it is right"), [1, 2, 3, 4], "least byte first");
    }

    #[test]
    fn short_data_and_wrong_segments_are_refused() {
        let bytes = framed(&[&[254, 0x12], &[2, 1, 2]]);
        assert!(decode(&bytes, 3, 2).is_err(), "the second segment ends early");
        assert!(decode(&bytes, 3, 1).is_err(), "too many segments");
        assert!(decode(&bytes[..20], 3, 2).is_err(), "segments beyond the end");
        assert!(decode(&[], 3, 2).is_err(), "nothing");
    }
}
