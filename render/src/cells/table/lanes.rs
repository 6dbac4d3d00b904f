//! Pieces as eight numbers at once look them up.

use super::Piece;
use crate::simd::Eight;

/// Pieces that fit into registers: one number of each.
const FEW: usize = 8;

/// What [`Piece`] has, by place.
const BEGIN: usize = 0;
const END: usize = 1;
const ORIGIN: usize = 2;
const SCALE: usize = 3;
const EXTINCTION: usize = 4;
const COLOR: usize = 8;
const VARIES: usize = 11;
const TURN: usize = 12;

/// All pieces, twice.
#[derive(Debug)]
pub(super) struct Lanes {
    /// By piece, a line of a cache each.
    rows: Vec<Row>,
    /// By what they have, if they are few.
    few: Option<Box<[[f32; FEW]; 16]>>,
}

#[derive(Debug, Clone, Copy)]
#[repr(align(64))]
struct Row([[f32; 8]; 2]);

/// What one piece has for each of eight.
#[derive(Debug, Clone, Copy)]
pub(super) struct Pieces<E> {
    pub(super) begin: E,
    pub(super) end: E,
    origin: E,
    scale: E,
    extinction: [E; 4],
    color: [E; 3],
    turn: [E; 3],
    varies: E,
}

/// [`super::Mean`], of each of eight.
#[derive(Debug, Clone, Copy)]
pub(super) struct Means<E> {
    pub(super) rates: [E; 4],
    pub(super) turn: [E; 3],
    /// How much extinction changes, times the most that a colour does.
    pub(super) rough: E,
}

/// Where pieces are looked up.
pub(super) trait Source<E: Eight> {
    /// The numbers of the pieces of positions.
    fn numbers(&self, positions: E) -> E::Numbers;
    fn pieces(&self, numbers: E::Numbers) -> Pieces<E>;
}

/// From registers.
pub(super) struct Few<'a>(&'a [[f32; FEW]; 16]);

/// From memory.
pub(super) struct Many<'a>(&'a super::Table);

impl Lanes {
    pub(super) fn new(pieces: &[Piece]) -> Self {
        let rows: Vec<Row> = pieces.iter().map(Row::new).collect();
        let few = (rows.len() <= FEW).then(|| {
            // Where there are no more, nothing begins.
            let none = Row([[f32::INFINITY; 8]; 2]);
            let row = |piece: usize| rows.get(piece).unwrap_or(&none);
            Box::new(std::array::from_fn(|n| std::array::from_fn(|piece| row(piece).0[n / 8][n % 8])))
        });
        Self { rows, few }
    }

    /// If pieces are few.
    #[inline(always)]
    pub(super) fn few(&self) -> Option<Few<'_>> {
        self.few.as_deref().map(Few)
    }
}

impl Row {
    fn new(piece: &Piece) -> Self {
        let mut row = [0.0; 16];
        [row[BEGIN], row[END], row[ORIGIN], row[SCALE]] = [piece.begin, piece.end, piece.origin, piece.scale];
        row[EXTINCTION..][..4].copy_from_slice(&piece.extinction);
        row[COLOR..][..3].copy_from_slice(&piece.color);
        row[VARIES] = piece.varies;
        row[TURN..][..3].copy_from_slice(&piece.turn);
        let half = |from: usize| std::array::from_fn(|n| row[from + n]);
        Self([half(0), half(8)])
    }
}

impl<E: Eight> Source<E> for Few<'_> {
    #[inline(always)]
    fn numbers(&self, positions: E) -> E::Numbers {
        positions.reached(&self.0[BEGIN])
    }

    #[inline(always)]
    fn pieces(&self, numbers: E::Numbers) -> Pieces<E> {
        let [a, b, c, d, e, f, g, h, i, j, k, l, m, n, o, _] = self.0;
        Pieces {
            begin: E::of_table(a, numbers),
            end: E::of_table(b, numbers),
            origin: E::of_table(c, numbers),
            scale: E::of_table(d, numbers),
            extinction: [
                E::of_table(e, numbers),
                E::of_table(f, numbers),
                E::of_table(g, numbers),
                E::of_table(h, numbers),
            ],
            color: [E::of_table(i, numbers), E::of_table(j, numbers), E::of_table(k, numbers)],
            varies: E::of_table(l, numbers),
            turn: [E::of_table(m, numbers), E::of_table(n, numbers), E::of_table(o, numbers)],
        }
    }
}

impl<'a> Many<'a> {
    pub(super) fn new(table: &'a super::Table) -> Self {
        Self(table)
    }
}

impl<E: Eight> Source<E> for Many<'_> {
    #[inline(always)]
    fn numbers(&self, positions: E) -> E::Numbers {
        E::numbers(positions.to_array().map(|position| self.0.piece(position) as u32))
    }

    #[inline(always)]
    fn pieces(&self, numbers: E::Numbers) -> Pieces<E> {
        let numbers = E::numbers_to_array(numbers);
        let rows = numbers.map(|number| &self.0.lanes.rows[number as usize].0);
        let [begin, end, origin, scale, e, f, g, h] = E::columns(rows.map(|[first, _]| first));
        let [i, j, k, varies, m, n, o, _] = E::columns(rows.map(|[_, second]| second));
        Pieces {
            begin,
            end,
            origin,
            scale,
            extinction: [e, f, g, h],
            color: [i, j, k],
            varies,
            turn: [m, n, o],
        }
    }
}

impl<E: Eight> Pieces<E> {
    /// As [`Piece::mean`].
    #[inline(always)]
    pub(super) fn means(&self, from: E, to: E) -> Means<E> {
        let (begin, end) = ((from - self.origin) * self.scale, (to - self.origin) * self.scale);
        let (middle, way) = (E::all(0.5) * (begin + end), end - begin);
        let [a, b, c, d] = self.extinction;
        let steep = middle * d;
        let bend = c + (steep + (steep + steep));
        let slope = b + middle * (bend + c);
        let at = a + middle * (b + middle * (c + steep));
        let square = way * way * E::all(1.0 / 12.0);
        let mean = at + square * bend;
        let cube = square * d;
        let slanted = square * (slope + E::all(1.8) * cube);
        let rise = way * (slope + (cube + (cube + cube)));
        Means {
            rates: [
                self.tinted(0, middle, [mean, slanted]),
                self.tinted(1, middle, [mean, slanted]),
                self.tinted(2, middle, [mean, slanted]),
                mean,
            ],
            turn: [self.turn[0] * way, self.turn[1] * way, self.turn[2] * way],
            rough: (rise * self.varies * way).abs(),
        }
    }

    /// The mean of extinction times a colour.
    #[inline(always)]
    fn tinted(&self, c: usize, middle: E, [mean, slanted]: [E; 2]) -> E {
        (self.color[c] + middle * self.turn[c]) * mean + self.turn[c] * slanted
    }
}
