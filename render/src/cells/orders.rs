//! What the first process of a group tells the others to do, and what they tell it beside a picture's messages; as bytes.

use super::bytes::{Reader, Writer};
use super::clusters::{Outline, Pack};
use super::early::Early;
use super::lens::Lens;
use super::spread::Spread;
use super::worker::Manner;
use crate::volume::cells::Place;
use crate::volume::{ControlPoint, Point, Transfer};

/// What one process tells another outside a picture.
#[derive(Debug, PartialEq)]
pub(super) enum Order {
    /// The grid that is drawn from now on.
    Grid(Vec<Outline>),
    /// The scalar that is drawn from now on, and each cluster's range of it.
    Field(Place, Vec<[f64; 2]>),
    /// What the receiver has not got of its clusters.
    Cells(Vec<Pack>),
    Draw(Box<Drawing>),
    /// The picture that is being drawn is not wanted any more.
    Stop,
    /// There are no more pictures.
    End,
    /// The sender can do no more, and why.
    Failed(String),
}

/// A picture to draw of the grid and the scalar that were told before.
#[derive(Debug, PartialEq)]
pub(super) struct Drawing {
    /// Its number, > 0.
    pub(super) number: u32,
    pub(super) size: [u32; 2],
    pub(super) lens: Lens,
    pub(super) transfer: Transfer,
    pub(super) manner: Manner,
    pub(super) spread: Spread,
    pub(super) skip_clear: bool,
    pub(super) wide: bool,
}

/// Bytes of an outline.
const OUTLINE: usize = 64;

impl Order {
    pub(super) fn to_bytes(&self) -> Vec<u8> {
        let mut out = Writer(Vec::new());
        match self {
            Self::Grid(outlines) => {
                out.0.reserve(1 + OUTLINE * outlines.len());
                outlines.iter().fold(out.byte(0), |out, o| {
                    let out = out.word(o.points).word(o.tetrahedra).real(o.cell_mm);
                    o.low.iter().chain(o.high.iter()).fold(out, |out, &v| out.real(v))
                })
            }
            Self::Field(place, ranges) => {
                let out = out.byte(1).flag(*place == Place::Cells);
                ranges.iter().flatten().fold(out, |out, &v| out.real(v))
            }
            Self::Cells(packs) => packs.iter().fold(out.byte(2), Writer::pack),
            Self::Draw(drawing) => drawing.write(out.byte(3)),
            Self::Stop => out.byte(4),
            Self::End => out.byte(5),
            Self::Failed(fault) => fault.bytes().fold(out.byte(6), Writer::byte),
        };
        out.0
    }

    /// Reads an order; nothing where it makes no sense.
    pub(super) fn from_bytes(bytes: &[u8]) -> Option<Self> {
        let mut rest = Reader(bytes);
        Some(match rest.byte()? {
            0 => Self::Grid(rest.all(OUTLINE, |r| {
                let [points, tetrahedra] = [r.word()?, r.word()?];
                let cell_mm = r.real()?;
                let mut point = || Some(Point::new(r.real()?, r.real()?, r.real()?));
                Some(Outline { points, tetrahedra, cell_mm, low: point()?, high: point()? })
            })?),
            1 => {
                let place = if rest.flag()? { Place::Cells } else { Place::Points };
                Self::Field(place, rest.all(16, |r| Some([r.real()?, r.real()?]))?)
            }
            2 => Self::Cells(rest.packs()?),
            3 => Self::Draw(Box::new(Drawing::read(&mut rest)?)),
            4 => Self::Stop,
            5 => Self::End,
            6 => Self::Failed(String::from_utf8_lossy(rest.0).into_owned()),
            _ => return None,
        })
    }
}

impl Drawing {
    fn write<'w>(&self, out: &'w mut Writer) -> &'w mut Writer {
        let out = out.word(self.number).word(self.size[0]).word(self.size[1]);
        let out = self.lens.to_list().into_iter().fold(out, Writer::real);
        let out = out.real(self.transfer.unit_mm()).word(self.transfer.points().len() as u32);
        let out = self
            .transfer
            .points()
            .iter()
            .fold(out, |out, point| point.rgba.into_iter().fold(out.real(point.value), Writer::real));
        let Manner { early, side, share, balance, keep } = self.manner;
        let out = out.long(side as u64).flag(share).flag(balance).flag(keep);
        let out = out.flag(self.spread == Spread::Blocks).flag(self.skip_clear).flag(self.wide);
        let out = out.flag(early.is_some());
        match early {
            Some(Early { threshold, subscreens, refreshes }) => {
                out.real(threshold).word(subscreens.unwrap_or(0)).word(refreshes)
            }
            None => out,
        }
    }

    fn read(rest: &mut Reader<'_>) -> Option<Self> {
        let [number, width, height] = [rest.word()?, rest.word()?, rest.word()?];
        let mut list = [0.0; Lens::NUMBERS];
        for v in &mut list {
            *v = rest.real()?;
        }
        let unit_mm = rest.real()?;
        let count = rest.word()?;
        let points = rest.some(count, 40, |r| {
            let value = r.real()?;
            Some(ControlPoint { value, rgba: [r.real()?, r.real()?, r.real()?, r.real()?] })
        })?;
        let side = usize::try_from(rest.long()?).ok().filter(|&side| side > 0)?;
        let [share, balance, keep] = [rest.flag()?, rest.flag()?, rest.flag()?];
        let spread = if rest.flag()? { Spread::Blocks } else { Spread::Columns };
        let [skip_clear, wide, is_early] = [rest.flag()?, rest.flag()?, rest.flag()?];
        let early = if is_early {
            let threshold = rest.real()?;
            let subscreens = Some(rest.word()?).filter(|&count| count > 0);
            Some(Early { threshold, subscreens, refreshes: rest.word()? })
        } else {
            None
        };
        rest.0.is_empty().then_some(())?;
        Some(Self {
            number,
            size: [width, height],
            lens: Lens::from_list(list),
            transfer: Transfer::new(points, unit_mm).ok()?,
            manner: Manner { early, side, share, balance, keep },
            spread,
            skip_clear,
            wide,
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn orders_come_back_as_they_were_and_damage_is_refused() {
        let outline = Outline {
            points: 4,
            tetrahedra: 1,
            low: Point::new(-1.0, 0.1, 2.0),
            high: Point::new(1.0, 0.2, 3.0),
            cell_mm: 0.7,
        };
        let point = |value| ControlPoint { value, rgba: [0.1, 0.2, 0.3, 0.4] };
        let early = Some(Early { subscreens: None, ..Early::TAKAYAMA });
        let drawing = Drawing {
            number: 3,
            size: [64, 48],
            lens: Lens::from_list(std::array::from_fn(|i| (i / 13) as f64)),
            transfer: Transfer::new(vec![point(0.0), point(2.5)], 0.5).expect("a function"),
            manner: Manner { early, side: 7, share: true, balance: false, keep: true },
            spread: Spread::Blocks,
            skip_clear: true,
            wide: false,
        };
        for order in [
            Order::Grid(vec![outline; 2]),
            Order::Field(Place::Cells, vec![[0.0, 1.0], [f64::INFINITY, f64::NEG_INFINITY]]),
            Order::Cells(vec![Pack { cluster: 1, body: None, values: vec![0.5, 0.1] }]),
            Order::Draw(Box::new(drawing)),
            Order::Stop,
            Order::End,
            Order::Failed("worker 1 sent nonsense".to_owned()),
        ] {
            let bytes = order.to_bytes();
            assert_eq!(Order::from_bytes(&bytes).as_ref(), Some(&order), "as it was");
            for cut in 0..bytes.len() {
                // A list may end at any of its members; nothing else may be left off.
                if let Some(short) = Order::from_bytes(&bytes[..cut]) {
                    assert_eq!(short.to_bytes(), bytes[..cut], "{order:?} cut at {cut}");
                }
            }
        }
        assert_eq!(Order::from_bytes(&[99]), None, "no such kind");
    }
}
