//! Messages between workers, as bytes: little endian, the kind first.

use super::bytes::{Reader, SEGMENT, Writer};
use super::clusters::Pack;
use super::fold::Segment;

/// What a worker tells another.
#[derive(Debug, Clone, PartialEq)]
pub(super) enum Message {
    /// So many clusters are left to do.
    Left(u32),
    /// Subscreens that are terminated, and their deepest.
    Terminated(Vec<(u32, f64)>),
    /// Asks for work.
    Ask,
    /// Clusters to do instead of the sender, how many it has left, and what the receiver has not got of those clusters.
    Work(Vec<u32>, u32, Vec<Pack>),
    /// Nothing is left to do or to ask for.
    Finished,
    /// Segments of pixels, and the round of the exchange that this belongs to.
    Runs(u32, Vec<(u32, Segment)>),
    /// A row of the finished picture: its number, colours, and how many segments each pixel has, then these; the counts are
    /// empty where segments are not asked for.
    Row(u32, Vec<[f32; 4]>, Vec<u32>, Vec<Segment>),
    /// There are no more rows; what the sender did.
    Counts(Vec<u64>),
}

impl Message {
    pub(super) fn to_bytes(&self) -> Vec<u8> {
        let mut out = Writer(Vec::new());
        match self {
            Self::Left(left) => out.byte(0).word(*left),
            Self::Terminated(list) => {
                out.0.reserve(1 + 12 * list.len());
                list.iter().fold(out.byte(1), |out, (index, depth)| out.word(*index).long(depth.to_bits()))
            }
            Self::Ask => out.byte(2),
            Self::Work(list, left, packs) => {
                let out = out.byte(3).word(*left).word(list.len() as u32);
                let out = list.iter().fold(out, |out, id| out.word(*id));
                packs.iter().fold(out, Writer::pack)
            }
            Self::Finished => out.byte(4),
            Self::Runs(round, list) => {
                out.0.reserve(5 + (4 + SEGMENT) * list.len());
                list.iter().fold(out.byte(5).word(*round), |out, (pixel, s)| out.word(*pixel).segment(s))
            }
            Self::Row(row, colors, counts, segments) => {
                out.0.reserve(13 + 16 * colors.len() + 4 * counts.len() + SEGMENT * segments.len());
                let out = out.byte(6).word(*row).word(colors.len() as u32).word(counts.len() as u32);
                let out = colors.iter().fold(out, |out, rgba| out.rgba(rgba));
                let out = counts.iter().fold(out, |out, count| out.word(*count));
                segments.iter().fold(out, Writer::segment)
            }
            Self::Counts(list) => list.iter().fold(out.byte(7), |out, count| out.long(*count)),
        };
        out.0
    }

    /// Reads a message; nothing where it makes no sense.
    pub(super) fn from_bytes(bytes: &[u8]) -> Option<Self> {
        let (kind, rest) = bytes.split_first()?;
        let mut rest = Reader(rest);
        Some(match kind {
            0 => Self::Left(rest.word()?),
            1 => Self::Terminated(rest.all(12, |r| Some((r.word()?, f64::from_bits(r.long()?))))?),
            2 => Self::Ask,
            3 => {
                let [left, count] = [rest.word()?, rest.word()?];
                Self::Work(rest.some(count, 4, Reader::word)?, left, rest.packs()?)
            }
            4 => Self::Finished,
            5 => {
                let round = rest.word()?;
                Self::Runs(round, rest.all(4 + SEGMENT, |r| Some((r.word()?, r.segment()?)))?)
            }
            6 => {
                let [row, colors, counts] = [rest.word()?, rest.word()?, rest.word()?];
                let colors = rest.some(colors, 16, Reader::rgba)?;
                let counts = rest.some(counts, 4, Reader::word)?;
                Self::Row(row, colors, counts, rest.all(SEGMENT, Reader::segment)?)
            }
            7 => Self::Counts(rest.all(8, Reader::long)?),
            _ => return None,
        })
    }
}

#[cfg(test)]
mod tests {
    use super::super::clusters::Body;
    use super::*;

    #[test]
    fn messages_come_back_as_they_were_and_damage_is_refused() {
        let segment = Segment { front: 1.5, back: -0.0, rgba: [0.1, 0.2, f32::NAN, 1.0] };
        let body = Body { points: vec![[0.1, 2.0, -3.0], [1.0; 3]], tetrahedra: vec![[0, 1, 1, 0]] };
        let packs = vec![
            Pack { cluster: 5, body: Some(body), values: vec![0.5, f64::NAN] },
            Pack { cluster: 1, body: None, values: vec![0.1] },
        ];
        let messages = [
            Message::Left(7),
            Message::Terminated(vec![(3, 1.25), (9, f64::INFINITY)]),
            Message::Ask,
            Message::Work(vec![5, 1, 4], 2, packs),
            Message::Work(vec![5, 1, 4], 2, Vec::new()),
            Message::Finished,
            Message::Runs(2, vec![(8, segment), (9, segment)]),
            Message::Row(4, vec![[0.5; 4]; 3], vec![1, 0, 1], vec![segment; 2]),
            Message::Counts(vec![1, u64::MAX]),
        ];
        for message in messages {
            let bytes = message.to_bytes();
            let again = Message::from_bytes(&bytes).expect("read");
            assert_eq!(again.to_bytes(), bytes, "{message:?}");
            for cut in 0..bytes.len() {
                // A list may end at any of its members; nothing else may be left off.
                if let Some(short) = Message::from_bytes(&bytes[..cut]) {
                    assert_eq!(short.to_bytes(), bytes[..cut], "{message:?} cut at {cut}");
                }
            }
        }
        assert_eq!(Message::from_bytes(&[]), None, "nothing");
        assert_eq!(Message::from_bytes(&[99]), None, "no such kind");
        let lies = [6_u8, 0, 0, 0, 0, 255, 255, 255, 255, 0, 0, 0, 0];
        assert_eq!(Message::from_bytes(&lies), None, "more than there is");
    }
}
