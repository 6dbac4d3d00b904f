//! Messages between workers, as bytes: little endian, the kind first.

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
    /// Clusters to do instead of the sender, and how many it has left.
    Work(Vec<u32>, u32),
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

const SEGMENT: usize = 32;

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
            Self::Work(list, left) => list.iter().fold(out.byte(3).word(*left), |out, id| out.word(*id)),
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
                let left = rest.word()?;
                Self::Work(rest.all(4, Reader::word)?, left)
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

struct Writer(Vec<u8>);

impl Writer {
    fn put(&mut self, bytes: &[u8]) -> &mut Self {
        self.0.extend_from_slice(bytes);
        self
    }

    fn byte(&mut self, v: u8) -> &mut Self {
        self.put(&[v])
    }

    fn word(&mut self, v: u32) -> &mut Self {
        self.put(&v.to_le_bytes())
    }

    fn long(&mut self, v: u64) -> &mut Self {
        self.put(&v.to_le_bytes())
    }

    fn rgba(&mut self, v: &[f32; 4]) -> &mut Self {
        v.iter().fold(self, |out, c| out.word(c.to_bits()))
    }

    fn segment(&mut self, v: &Segment) -> &mut Self {
        // Joined first: there are many, and each addition costs.
        let [a, b] = [v.front, v.back].map(|d| u128::from(d.to_bits()));
        let colors = v.rgba.iter().rev().fold(0, |all, c| all << 32 | u128::from(c.to_bits()));
        self.put(&(a | b << 64).to_le_bytes()).put(&colors.to_le_bytes())
    }
}

struct Reader<'a>(&'a [u8]);

impl Reader<'_> {
    fn take<const N: usize>(&mut self) -> Option<[u8; N]> {
        let (first, rest) = self.0.split_first_chunk::<N>()?;
        self.0 = rest;
        Some(*first)
    }

    fn word(&mut self) -> Option<u32> {
        self.take().map(u32::from_le_bytes)
    }

    fn long(&mut self) -> Option<u64> {
        self.take().map(u64::from_le_bytes)
    }

    fn rgba(&mut self) -> Option<[f32; 4]> {
        let mut rgba = [0.0; 4];
        for c in &mut rgba {
            *c = f32::from_bits(self.word()?);
        }
        Some(rgba)
    }

    fn segment(&mut self) -> Option<Segment> {
        let [depths, colors] = [self.take().map(u128::from_le_bytes)?, self.take().map(u128::from_le_bytes)?];
        let [front, back] = [depths as u64, (depths >> 64) as u64].map(f64::from_bits);
        let rgba = std::array::from_fn(|c| f32::from_bits((colors >> (32 * c)) as u32));
        Some(Segment { front, back, rgba })
    }

    /// So many, each of so many bytes, which must be there.
    fn some<T>(&mut self, count: u32, bytes: usize, read: impl Fn(&mut Self) -> Option<T>) -> Option<Vec<T>> {
        if (count as usize).checked_mul(bytes)? > self.0.len() {
            return None;
        }
        let mut list = Vec::with_capacity(count as usize);
        for _ in 0..count {
            list.push(read(self)?);
        }
        Some(list)
    }

    /// As many as there are bytes for.
    fn all<T>(&mut self, bytes: usize, read: impl Fn(&mut Self) -> Option<T>) -> Option<Vec<T>> {
        let count = u32::try_from(self.0.len() / bytes).ok()?;
        let list = self.some(count, bytes, read)?;
        self.0.is_empty().then_some(list)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn messages_come_back_as_they_were_and_damage_is_refused() {
        let segment = Segment { front: 1.5, back: -0.0, rgba: [0.1, 0.2, f32::NAN, 1.0] };
        let messages = [
            Message::Left(7),
            Message::Terminated(vec![(3, 1.25), (9, f64::INFINITY)]),
            Message::Ask,
            Message::Work(vec![5, 1, 4], 2),
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
