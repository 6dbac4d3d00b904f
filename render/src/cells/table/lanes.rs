//! Pieces as eight numbers at once look them up.

use super::Piece;
use crate::simd::Eight;

/// Pieces of which one number each fits into a register, and into two.
const FEW: [usize; 2] = [8, 16];

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
    few: Option<Box<Halves>>,
}

/// By what pieces have: the first eight and the next.
type Halves = [[[f32; 8]; 2]; 16];

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
    /// Which positions do not lie in the pieces of these numbers, a bit each.
    fn beyond(&self, numbers: E::Numbers, positions: E) -> u32;
    fn pieces(&self, numbers: E::Numbers) -> Pieces<E>;
}

/// From one register for each number, or from two.
pub(super) struct Few<'a, const REGISTERS: usize>(&'a Halves);

/// From memory.
pub(super) struct Many<'a>(&'a super::Table);

impl Lanes {
    pub(super) fn new(pieces: &[Piece]) -> Self {
        let rows: Vec<Row> = pieces.iter().map(Row::new).collect();
        let few = (rows.len() <= FEW[1]).then(|| {
            // Where there are no more, nothing begins that could be reached.
            let none = Row([[f32::NAN; 8]; 2]);
            let number = |piece: usize, n: usize| rows.get(piece).unwrap_or(&none).0[n / 8][n % 8];
            let half = |from: usize, n: usize| std::array::from_fn(|piece| number(from + piece, n));
            Box::new(std::array::from_fn(|n| [half(0, n), half(8, n)]))
        });
        Self { rows, few }
    }

    /// If pieces are few enough for so many registers.
    #[inline(always)]
    pub(super) fn few<const REGISTERS: usize>(&self) -> Option<Few<'_, REGISTERS>> {
        self.few.as_deref().filter(|_| self.rows.len() <= FEW[REGISTERS - 1]).map(Few)
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

impl<const REGISTERS: usize> Few<'_, REGISTERS> {
    #[inline(always)]
    fn of<E: Eight>(&self, what: usize, numbers: E::Numbers) -> E {
        let halves = &self.0[what];
        if REGISTERS == 1 { E::of_table(&halves[0], numbers) } else { E::of_tables(halves, numbers) }
    }
}

impl<E: Eight, const REGISTERS: usize> Source<E> for Few<'_, REGISTERS> {
    #[inline(always)]
    fn numbers(&self, positions: E) -> E::Numbers {
        // All have reached the first.
        positions.reached(&self.0[BEGIN].as_flattened()[1..8 * REGISTERS])
    }

    #[inline(always)]
    fn beyond(&self, numbers: E::Numbers, positions: E) -> u32 {
        outside(positions, self.of(BEGIN, numbers), self.of(END, numbers))
    }

    #[inline(always)]
    fn pieces(&self, numbers: E::Numbers) -> Pieces<E> {
        Pieces {
            begin: self.of(BEGIN, numbers),
            end: self.of(END, numbers),
            origin: self.of(ORIGIN, numbers),
            scale: self.of(SCALE, numbers),
            extinction: [
                self.of(EXTINCTION, numbers),
                self.of(EXTINCTION + 1, numbers),
                self.of(EXTINCTION + 2, numbers),
                self.of(EXTINCTION + 3, numbers),
            ],
            color: [self.of(COLOR, numbers), self.of(COLOR + 1, numbers), self.of(COLOR + 2, numbers)],
            varies: self.of(VARIES, numbers),
            turn: [self.of(TURN, numbers), self.of(TURN + 1, numbers), self.of(TURN + 2, numbers)],
        }
    }
}

/// Which positions do not lie from one up to but not at another, a bit each.
#[inline(always)]
fn outside<E: Eight>(positions: E, begin: E, end: E) -> u32 {
    positions.bits_below(begin) | !positions.bits_below(end) & 0xff
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
    fn beyond(&self, numbers: E::Numbers, positions: E) -> u32 {
        let of = |what: usize, number: u32| self.0.lanes.rows[number as usize].0[what / 8][what % 8];
        let numbers = E::numbers_to_array(numbers);
        outside(
            positions,
            E::from_array(numbers.map(|n| of(BEGIN, n))),
            E::from_array(numbers.map(|n| of(END, n))),
        )
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
