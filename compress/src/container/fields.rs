//! Numbers and texts of a record of fixed length, one after the other.

/// What is left of a record to read. Past its end everything is zero: a record's length is checked before.
pub(super) struct Fields<'a>(pub(super) &'a [u8]);

impl<'a> Fields<'a> {
    pub(super) fn bytes<const N: usize>(&mut self) -> [u8; N] {
        let Some((bytes, rest)) = self.0.split_first_chunk() else { return [0; N] };
        self.0 = rest;
        *bytes
    }

    pub(super) fn u32(&mut self) -> u32 {
        u32::from_le_bytes(self.bytes())
    }

    pub(super) fn u64(&mut self) -> u64 {
        u64::from_le_bytes(self.bytes())
    }

    pub(super) fn f64(&mut self) -> f64 {
        f64::from_le_bytes(self.bytes())
    }

    /// A text of at most `len` bytes with zeros after it; none if it is not that.
    pub(super) fn text(&mut self, len: usize) -> Option<&'a str> {
        let (field, rest) = self.0.split_at_checked(len)?;
        self.0 = rest;
        let end = field.iter().position(|&byte| byte == 0).unwrap_or(len);
        let (text, zeros) = field.split_at_checked(end)?;
        if zeros.iter().any(|&byte| byte != 0) {
            return None;
        }
        std::str::from_utf8(text).ok()
    }
}

/// Appends a text and zeros up to `len` bytes; the text is cut there.
pub(super) fn push_text(record: &mut Vec<u8>, text: &str, len: usize) {
    let end = record.len().saturating_add(len);
    record.extend(text.as_bytes().iter().take(len));
    record.resize(end, 0);
}

/// The CRC-32 of the format page.
pub(super) fn crc(bytes: &[u8]) -> u32 {
    crc32fast::hash(bytes)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_checksum_is_the_one_of_the_format_page() {
        assert_eq!(crc(b"123456789"), 0xCBF4_3926, "the check value of CRC-32/ISO-HDLC");
    }
}
