//! Values as the bytes of messages: little endian, without names.

use super::clusters::{Body, Pack};
use super::fold::Segment;

/// Bytes of a segment.
pub(super) const SEGMENT: usize = 32;

/// Puts values behind one another.
pub(super) struct Writer(pub(super) Vec<u8>);

impl Writer {
    fn put(&mut self, bytes: &[u8]) -> &mut Self {
        self.0.extend_from_slice(bytes);
        self
    }

    pub(super) fn byte(&mut self, v: u8) -> &mut Self {
        self.put(&[v])
    }

    pub(super) fn word(&mut self, v: u32) -> &mut Self {
        self.put(&v.to_le_bytes())
    }

    pub(super) fn long(&mut self, v: u64) -> &mut Self {
        self.put(&v.to_le_bytes())
    }

    pub(super) fn flag(&mut self, v: bool) -> &mut Self {
        self.byte(u8::from(v))
    }

    pub(super) fn real(&mut self, v: f64) -> &mut Self {
        self.long(v.to_bits())
    }

    /// Numbers, in half the bytes where nothing is lost: most files keep no more.
    pub(super) fn reals<'n>(&mut self, list: impl Iterator<Item = &'n f64> + Clone) -> &mut Self {
        let short = list.clone().all(|&v| f64::from(v as f32).to_bits() == v.to_bits());
        let out = self.byte(u8::from(short));
        list.fold(out, |out, &v| if short { out.word((v as f32).to_bits()) } else { out.real(v) })
    }

    pub(super) fn pack(&mut self, pack: &Pack) -> &mut Self {
        let Pack { cluster, body, values } = pack;
        let out = self.word(*cluster).word(values.len() as u32).reals(values.iter());
        let Some(Body { points, tetrahedra }) = body else { return out.word(0) };
        let out = out.word(points.len() as u32).reals(points.iter().flatten()).word(tetrahedra.len() as u32);
        // A cluster has fewer points than 16 bits count.
        tetrahedra.iter().flatten().fold(out, |out, &corner| out.put(&corner.to_le_bytes()))
    }

    pub(super) fn rgba(&mut self, v: &[f32; 4]) -> &mut Self {
        v.iter().fold(self, |out, c| out.word(c.to_bits()))
    }

    pub(super) fn segment(&mut self, v: &Segment) -> &mut Self {
        // Joined first: there are many, and each addition costs.
        let [a, b] = [v.front, v.back].map(|d| u128::from(d.to_bits()));
        let colors = v.rgba.iter().rev().fold(0, |all, c| all << 32 | u128::from(c.to_bits()));
        self.put(&(a | b << 64).to_le_bytes()).put(&colors.to_le_bytes())
    }
}

/// Takes values off the front; nothing where there are too few bytes.
pub(super) struct Reader<'a>(pub(super) &'a [u8]);

impl Reader<'_> {
    fn take<const N: usize>(&mut self) -> Option<[u8; N]> {
        let (first, rest) = self.0.split_first_chunk::<N>()?;
        self.0 = rest;
        Some(*first)
    }

    pub(super) fn word(&mut self) -> Option<u32> {
        self.take().map(u32::from_le_bytes)
    }

    pub(super) fn long(&mut self) -> Option<u64> {
        self.take().map(u64::from_le_bytes)
    }

    pub(super) fn byte(&mut self) -> Option<u8> {
        self.take().map(|[byte]| byte)
    }

    pub(super) fn flag(&mut self) -> Option<bool> {
        self.byte().filter(|&byte| byte < 2).map(|byte| byte == 1)
    }

    pub(super) fn real(&mut self) -> Option<f64> {
        self.long().map(f64::from_bits)
    }

    /// What [`Writer::reals`] wrote, `count` numbers.
    pub(super) fn reals(&mut self, count: u32) -> Option<Vec<f64>> {
        match self.byte()? {
            0 => self.some(count, 8, Self::real),
            1 => self.some(count, 4, |r| r.word().map(|bits| f64::from(f32::from_bits(bits)))),
            _ => None,
        }
    }

    /// What [`Writer::pack`] wrote.
    pub(super) fn pack(&mut self) -> Option<Pack> {
        let [cluster, count] = [self.word()?, self.word()?];
        let values = self.reals(count)?;
        let count = self.word()?;
        if count == 0 {
            return Some(Pack { cluster, body: None, values });
        }
        let points = self.reals(count.checked_mul(3)?)?;
        let points = points.as_chunks::<3>().0.to_vec();
        let count = self.word()?;
        let corner = |r: &mut Self| r.take().map(u16::from_le_bytes);
        let tetrahedra = self.some(count, 8, |r| Some([corner(r)?, corner(r)?, corner(r)?, corner(r)?]))?;
        Some(Pack { cluster, body: Some(Body { points, tetrahedra }), values })
    }

    /// As many as there are.
    pub(super) fn packs(&mut self) -> Option<Vec<Pack>> {
        let mut packs = Vec::new();
        while !self.0.is_empty() {
            packs.push(self.pack()?);
        }
        Some(packs)
    }

    pub(super) fn rgba(&mut self) -> Option<[f32; 4]> {
        let mut rgba = [0.0; 4];
        for c in &mut rgba {
            *c = f32::from_bits(self.word()?);
        }
        Some(rgba)
    }

    pub(super) fn segment(&mut self) -> Option<Segment> {
        let [depths, colors] = [self.take().map(u128::from_le_bytes)?, self.take().map(u128::from_le_bytes)?];
        let [front, back] = [depths as u64, (depths >> 64) as u64].map(f64::from_bits);
        let rgba = std::array::from_fn(|c| f32::from_bits((colors >> (32 * c)) as u32));
        Some(Segment { front, back, rgba })
    }

    /// So many, each of so many bytes, which must be there.
    pub(super) fn some<T>(
        &mut self,
        count: u32,
        bytes: usize,
        read: impl Fn(&mut Self) -> Option<T>,
    ) -> Option<Vec<T>> {
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
    pub(super) fn all<T>(&mut self, bytes: usize, read: impl Fn(&mut Self) -> Option<T>) -> Option<Vec<T>> {
        let count = u32::try_from(self.0.len() / bytes).ok()?;
        let list = self.some(count, bytes, read)?;
        self.0.is_empty().then_some(list)
    }
}
