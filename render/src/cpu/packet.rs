//! Eight neighbouring rays at once through one piece: what [`super::march`] does, lane by lane the same numbers.
//!
//! Each lane walks its own cells; a round takes every lane one cell, or one clear box, further. Only where something
//! absorbs is a lane looked at by itself, since the table's nodes lie apart.

use std::arch::x86_64::{
    __m128, __m256d, _CMP_EQ_OQ, _CMP_GT_OQ, _CMP_LE_OQ, _CMP_LT_OQ, _mm_add_ps, _mm_mul_ps, _mm_set1_ps,
    _mm_setzero_ps, _mm256_add_epi32, _mm256_add_pd, _mm256_add_ps, _mm256_and_ps, _mm256_and_si256,
    _mm256_andnot_ps, _mm256_castsi256_ps, _mm256_ceil_ps, _mm256_cmp_ps, _mm256_cmpgt_epi32,
    _mm256_cvtepi32_ps, _mm256_cvtpd_ps, _mm256_cvtps_pd, _mm256_cvttps_epi32, _mm256_div_ps,
    _mm256_floor_ps, _mm256_max_epi32, _mm256_max_ps, _mm256_min_epi32, _mm256_min_ps, _mm256_movemask_ps,
    _mm256_mul_ps, _mm256_mullo_epi32, _mm256_or_ps, _mm256_set1_epi32, _mm256_set1_ps, _mm256_setzero_pd,
    _mm256_setzero_ps, _mm256_setzero_si256, _mm256_srai_epi32, _mm256_sub_epi32, _mm256_sub_pd,
    _mm256_sub_ps,
};

use super::field::EDGE;
use super::lanes::{
    Floats, Wholes, absorbed, as_mask, bytes_at, clamp_whole, four, four_wide, load, pairs_at, select,
    select_whole, store, store_four, store_whole,
};
use super::march::{Manner, Work};
use super::piece::Placed;
use super::table::{EVEN, Table};
use super::walker::Ray;

/// Rays of a packet.
pub(super) const LANES: usize = 8;

/// A packet's rays before they are drawn.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Lanes {
    pub(super) lens: [[f64; 2]; LANES],
    pub(super) rays: [Ray; LANES],
    /// Stretches of zeta; a ray whose stretch does not rise stays dark.
    pub(super) from: [f32; LANES],
    pub(super) to: [f32; LANES],
}

/// Rays in voxel space, lane by lane.
struct Lines {
    start: [Floats; 3],
    growth: [Floats; 3],
    inverse: [Floats; 3],
    /// Where the coordinate falls, and where it does not change.
    falls: [Floats; 3],
    still: [Floats; 3],
}

impl Lines {
    #[inline]
    #[target_feature(enable = "avx2")]
    fn new(piece: &Placed<'_>, lens: &[[f64; 2]; LANES]) -> Self {
        let (mut starts, mut growths) = ([[0.0_f32; LANES]; 3], [[0.0_f32; LANES]; 3]);
        for (lane, lens) in lens.iter().enumerate() {
            let (start, growth) = piece.voxel_line(*lens);
            for axis in 0..3 {
                starts[axis][lane] = start[axis] as f32;
                growths[axis][lane] = growth[axis] as f32;
            }
        }
        let zero = _mm256_setzero_ps();
        let growth = [load(&growths[0]), load(&growths[1]), load(&growths[2])];
        let one = _mm256_set1_ps(1.0);
        Self {
            start: [load(&starts[0]), load(&starts[1]), load(&starts[2])],
            growth,
            inverse: [
                _mm256_div_ps(one, growth[0]),
                _mm256_div_ps(one, growth[1]),
                _mm256_div_ps(one, growth[2]),
            ],
            falls: [
                _mm256_cmp_ps::<_CMP_LT_OQ>(growth[0], zero),
                _mm256_cmp_ps::<_CMP_LT_OQ>(growth[1], zero),
                _mm256_cmp_ps::<_CMP_LT_OQ>(growth[2], zero),
            ],
            still: [
                _mm256_cmp_ps::<_CMP_EQ_OQ>(growth[0], zero),
                _mm256_cmp_ps::<_CMP_EQ_OQ>(growth[1], zero),
                _mm256_cmp_ps::<_CMP_EQ_OQ>(growth[2], zero),
            ],
        }
    }

    #[inline]
    #[target_feature(enable = "avx2")]
    fn at(&self, axis: usize, zeta: Floats) -> Floats {
        _mm256_add_ps(self.start[axis], _mm256_mul_ps(self.growth[axis], zeta))
    }

    /// The cell of an axis at `zeta`; on a wall, the one ahead.
    #[inline]
    #[target_feature(enable = "avx2")]
    fn cell(&self, axis: usize, zeta: Floats) -> Wholes {
        let at = self.at(axis, zeta);
        let ahead = _mm256_cvttps_epi32(_mm256_floor_ps(at));
        let behind = _mm256_sub_epi32(_mm256_cvttps_epi32(_mm256_ceil_ps(at)), _mm256_set1_epi32(1));
        select_whole(self.falls[axis], behind, ahead)
    }
}

/// The corners of a cell in each lane; bits are x, y, z.
struct Cells {
    low: [Floats; 3],
    corners: [Floats; 8],
}

impl Cells {
    #[inline]
    #[target_feature(enable = "avx2")]
    fn new(piece: &Placed<'_>, cell: &[Wholes; 3], mask: Floats) -> Self {
        let [nx, ny, nz] = piece.volume.field.extent;
        let zero = _mm256_setzero_si256();
        let last = |n: i32| _mm256_set1_epi32((n - 2).max(0));
        let low = [
            clamp_whole(cell[0], zero, last(nx)),
            clamp_whole(cell[1], zero, last(ny)),
            clamp_whole(cell[2], zero, last(nz)),
        ];
        let rows = _mm256_add_epi32(low[1], _mm256_mullo_epi32(low[2], _mm256_set1_epi32(ny)));
        let base = _mm256_add_epi32(low[0], _mm256_mullo_epi32(rows, _mm256_set1_epi32(nx)));
        let y = _mm256_set1_epi32(if ny > 1 { nx } else { 0 });
        let z = _mm256_set1_epi32(if nz > 1 { nx * ny } else { 0 });
        let values = piece.volume.field.values();
        let above = _mm256_add_epi32(base, z);
        let [c0, c1] = pairs_at(values, base, mask);
        let [c2, c3] = pairs_at(values, _mm256_add_epi32(base, y), mask);
        let [c4, c5] = pairs_at(values, above, mask);
        let [c6, c7] = pairs_at(values, _mm256_add_epi32(above, y), mask);
        Self {
            low: [_mm256_cvtepi32_ps(low[0]), _mm256_cvtepi32_ps(low[1]), _mm256_cvtepi32_ps(low[2])],
            corners: [c0, c1, c2, c3, c4, c5, c6, c7],
        }
    }

    /// The table position at a zeta.
    #[inline]
    #[target_feature(enable = "avx2")]
    fn position(&self, lines: &Lines, piece: &Placed<'_>, zeta: Floats) -> Floats {
        let (zero, one) = (_mm256_setzero_ps(), _mm256_set1_ps(1.0));
        let part = |axis: usize| {
            let part = _mm256_sub_ps(lines.at(axis, zeta), self.low[axis]);
            _mm256_min_ps(_mm256_max_ps(part, zero), one)
        };
        let [x, y, z] = [part(0), part(1), part(2)];
        let between =
            |a: Floats, b: Floats, part: Floats| _mm256_add_ps(a, _mm256_mul_ps(_mm256_sub_ps(b, a), part));
        let c = &self.corners;
        let low = between(between(c[0], c[1], x), between(c[2], c[3], x), y);
        let high = between(between(c[4], c[5], x), between(c[6], c[7], x), y);
        let (scale, offset) = (piece.volume.table.scale, piece.volume.table.offset);
        _mm256_add_ps(_mm256_mul_ps(between(low, high, z), _mm256_set1_ps(scale)), _mm256_set1_ps(offset))
    }
}

/// Where table positions lie among the nodes.
struct Places {
    position: [f32; LANES],
    node: [i32; LANES],
    part: [f32; LANES],
}

impl Places {
    #[inline]
    #[target_feature(enable = "avx2")]
    fn new(table: &Table, position: Floats) -> Self {
        let last = _mm256_set1_epi32(table.nodes().len() as i32 - 1);
        let node = _mm256_cvttps_epi32(_mm256_max_ps(position, _mm256_setzero_ps()));
        let node = _mm256_min_epi32(node, last);
        let part = _mm256_sub_ps(position, _mm256_cvtepi32_ps(node));
        Self { position: store(position), node: store_whole(node), part: store(part) }
    }

    /// [`Table::sum`] in a lane.
    #[inline]
    #[target_feature(enable = "avx2")]
    fn sum(&self, table: &Table, lane: usize) -> __m256d {
        let nodes = table.nodes();
        let node = &nodes[(self.node[lane] as usize).min(nodes.len() - 1)];
        if node.half_rise[3].is_nan() {
            return four_wide(&table.sum(self.position[lane]));
        }
        let part = _mm_set1_ps(self.part[lane]);
        let rise = _mm_mul_ps(part, four(&node.half_rise));
        let inner = _mm_mul_ps(part, _mm_add_ps(four(&node.from), rise));
        _mm256_add_pd(four_wide(&node.sum), _mm256_cvtps_pd(inner))
    }
}

/// What a piece needs so that packets may go through it: indices of 32 bits and pairs along x.
pub(super) fn suits(piece: &Placed<'_>) -> bool {
    let field = piece.volume.field;
    let samples: u64 = field.extent.iter().map(|&n| n as u64).product();
    field.extent[0] > 1 && samples < 1 << 31 && piece.is_convex() && piece.painting.is_none()
}

/// A packet on its way through a piece that [`suits`].
struct Packet<'a> {
    piece: &'a Placed<'a>,
    lanes: &'a Lanes,
    manner: Manner,
    lines: Lines,
    mm_per_zeta: Floats,
    extent: [Wholes; 3],
    cell: [Wholes; 3],
    /// The last sampled table position, and the lanes in which it is that of the present place.
    position: Floats,
    known: Floats,
    /// The antiderivative there, and the lanes in which it is known, as bits.
    sums: [__m256d; LANES],
    sums_known: u32,
    /// Red, green and blue so far, and what still comes through.
    colors: [__m128; LANES],
    through: Floats,
    /// Lanes that go on.
    active: Floats,
}

/// What is ahead of each lane.
struct Ahead {
    clear: Floats,
    wall: [Wholes; 3],
    /// Which axis' wall is met first, and where.
    by: [Floats; 3],
    exit: Floats,
}

/// The pixel of each ray through a piece that [`suits`].
#[target_feature(enable = "avx2")]
pub(super) fn march(piece: &Placed<'_>, lanes: &Lanes, manner: Manner, work: &mut Work) -> [[f32; 4]; LANES] {
    let to = load(&lanes.to);
    let mut at = load(&lanes.from);
    let mut packet = Packet::new(piece, lanes, manner);
    while _mm256_movemask_ps(packet.active) != 0 {
        let ahead = packet.look_ahead();
        let end = _mm256_min_ps(ahead.exit, to);
        let inside = _mm256_andnot_ps(ahead.clear, packet.active);
        packet.known = _mm256_and_ps(packet.known, inside);
        let entered = (_mm256_movemask_ps(inside) as u32).count_ones();
        if entered > 0 {
            work.cells += u64::from(entered);
            let inside = _mm256_and_ps(inside, _mm256_cmp_ps::<_CMP_GT_OQ>(end, at));
            packet.cross([at, end], inside, work);
        }
        at = _mm256_max_ps(at, end);
        packet.active = _mm256_and_ps(packet.active, _mm256_cmp_ps::<_CMP_LT_OQ>(ahead.exit, to));
        packet.advance(&ahead);
    }
    let through = store(packet.through);
    let mut pixels = [[0.0; 4]; LANES];
    for (lane, pixel) in pixels.iter_mut().enumerate() {
        *pixel = store_four(packet.colors[lane]);
        pixel[3] = 1.0 - through[lane];
    }
    pixels
}

impl<'a> Packet<'a> {
    #[inline]
    #[target_feature(enable = "avx2")]
    fn new(piece: &'a Placed<'a>, lanes: &'a Lanes, manner: Manner) -> Self {
        let lines = Lines::new(piece, &lanes.lens);
        let [nx, ny, nz] = piece.volume.field.extent;
        let extent = [_mm256_set1_epi32(nx), _mm256_set1_epi32(ny), _mm256_set1_epi32(nz)];
        let (one, minus_one) = (_mm256_set1_epi32(1), _mm256_set1_epi32(-1));
        let at = load(&lanes.from);
        let mut cell = extent;
        for axis in 0..3 {
            let last = _mm256_sub_epi32(extent[axis], one);
            cell[axis] = clamp_whole(lines.cell(axis, at), minus_one, last);
        }
        let mut mm_per_zeta = [0.0; LANES];
        for (mm, ray) in mm_per_zeta.iter_mut().zip(&lanes.rays) {
            *mm = ray.mm_per_zeta;
        }
        Self {
            piece,
            lanes,
            manner,
            lines,
            mm_per_zeta: load(&mm_per_zeta),
            extent,
            cell,
            position: _mm256_setzero_ps(),
            known: _mm256_setzero_ps(),
            sums: [_mm256_setzero_pd(); LANES],
            sums_known: 0,
            colors: [_mm_setzero_ps(); LANES],
            through: _mm256_set1_ps(1.0),
            active: _mm256_cmp_ps::<_CMP_LT_OQ>(at, load(&lanes.to)),
        }
    }

    /// The walls of the cell, or of the clear box that the cell's brick is the middle of.
    #[inline]
    #[target_feature(enable = "avx2")]
    #[expect(clippy::needless_range_loop, reason = "several arrays run along")]
    fn look_ahead(&self) -> Ahead {
        let volume = &self.piece.volume;
        let (one, minus_one) = (_mm256_set1_epi32(1), _mm256_set1_epi32(-1));
        let edge = _mm256_set1_epi32(EDGE);
        let mut brick = self.cell;
        for axis in 0..3 {
            brick[axis] =
                _mm256_srai_epi32::<{ EDGE.ilog2() as i32 }>(_mm256_add_epi32(self.cell[axis], one));
        }
        let [bricks_x, bricks_y, _] = volume.field.bricks;
        let rows = _mm256_mullo_epi32(brick[2], _mm256_set1_epi32(bricks_y as i32));
        let rows = _mm256_mullo_epi32(_mm256_add_epi32(rows, brick[1]), _mm256_set1_epi32(bricks_x as i32));
        let index = _mm256_add_epi32(rows, brick[0]);
        let distance = bytes_at(&volume.occupancy.distance, index, self.active);
        let clear = as_mask(_mm256_cmpgt_epi32(distance, _mm256_setzero_si256()));
        let (mut wall, mut next) = (brick, [self.position; 3]);
        for axis in 0..3 {
            let falls = self.lines.falls[axis];
            let of_cell = select_whole(falls, self.cell[axis], _mm256_add_epi32(self.cell[axis], one));
            let ahead = _mm256_add_epi32(brick[axis], distance);
            let ahead = _mm256_sub_epi32(_mm256_mullo_epi32(ahead, edge), one);
            let ahead = _mm256_min_epi32(ahead, self.extent[axis]);
            let behind = _mm256_add_epi32(_mm256_sub_epi32(brick[axis], distance), one);
            let behind = _mm256_sub_epi32(_mm256_mullo_epi32(behind, edge), one);
            let behind = _mm256_max_epi32(behind, minus_one);
            wall[axis] = select_whole(clear, select_whole(falls, behind, ahead), of_cell);
            let to_wall = _mm256_sub_ps(_mm256_cvtepi32_ps(wall[axis]), self.lines.start[axis]);
            let met = _mm256_mul_ps(to_wall, self.lines.inverse[axis]);
            next[axis] = select(self.lines.still[axis], _mm256_set1_ps(f32::INFINITY), met);
        }
        let [x, y, z] = next;
        let by_x = _mm256_and_ps(_mm256_cmp_ps::<_CMP_LE_OQ>(x, y), _mm256_cmp_ps::<_CMP_LE_OQ>(x, z));
        let by_y = _mm256_andnot_ps(by_x, _mm256_cmp_ps::<_CMP_LE_OQ>(y, z));
        let by_z = _mm256_andnot_ps(_mm256_or_ps(by_x, by_y), _mm256_castsi256_ps(minus_one));
        Ahead { clear, wall, by: [by_x, by_y, by_z], exit: _mm256_min_ps(_mm256_min_ps(x, y), z) }
    }

    /// Through one cell in the lanes of `inside`, in as many steps as each needs.
    #[inline]
    #[target_feature(enable = "avx2")]
    fn cross(&mut self, [at, end]: [Floats; 2], inside: Floats, work: &mut Work) {
        let cells = Cells::new(self.piece, &self.cell, inside);
        let fresh = _mm256_andnot_ps(self.known, inside);
        let fresh_bits = _mm256_movemask_ps(fresh) as u32;
        if fresh_bits != 0 {
            self.position = select(fresh, cells.position(&self.lines, self.piece, at), self.position);
            self.sums_known &= !fresh_bits;
        }
        self.known = _mm256_or_ps(self.known, inside);
        let stretch = _mm256_sub_ps(end, at);
        let length_mm = _mm256_mul_ps(stretch, self.mm_per_zeta);
        let count = _mm256_ceil_ps(_mm256_div_ps(length_mm, _mm256_set1_ps(self.manner.step_mm)));
        let count = _mm256_max_ps(count, _mm256_set1_ps(1.0));
        let length = _mm256_div_ps(stretch, count);
        let most = store(_mm256_and_ps(count, inside)).iter().fold(0.0_f32, |a, &b| a.max(b)) as u32;
        let limits = self.piece.volume.table.clear_limits();
        let (below, above) = (_mm256_set1_ps(limits[0]), _mm256_set1_ps(limits[1]));
        let mut before = at;
        let mut stepping = inside;
        for i in 1..=most {
            let i = _mm256_set1_ps(i as f32);
            stepping = _mm256_and_ps(stepping, _mm256_cmp_ps::<_CMP_LE_OQ>(i, count));
            let is_last = _mm256_cmp_ps::<_CMP_EQ_OQ>(i, count);
            let here = select(is_last, end, _mm256_add_ps(at, _mm256_mul_ps(length, i)));
            let reached = cells.position(&self.lines, self.piece, here);
            let under = _mm256_cmp_ps::<_CMP_LT_OQ>(_mm256_max_ps(self.position, reached), below);
            let over = _mm256_cmp_ps::<_CMP_GT_OQ>(_mm256_min_ps(self.position, reached), above);
            let shows = _mm256_andnot_ps(_mm256_or_ps(under, over), stepping);
            let lit = _mm256_movemask_ps(shows) as u32;
            self.sums_known &= lit | !(_mm256_movemask_ps(stepping) as u32);
            if lit != 0 {
                self.absorb(lit, [before, here], reached);
                let dark = _mm256_cmp_ps::<_CMP_LT_OQ>(self.through, _mm256_set1_ps(self.manner.dark));
                let done = _mm256_and_ps(dark, stepping);
                work.finished += u64::from((_mm256_movemask_ps(done) as u32).count_ones());
                stepping = _mm256_andnot_ps(done, stepping);
                self.active = _mm256_andnot_ps(done, self.active);
            }
            self.position = select(stepping, reached, self.position);
            before = select(stepping, here, before);
        }
    }

    /// A step in each of the lanes `lit`, along which the table position runs on to `reached`.
    #[inline]
    #[target_feature(enable = "avx2")]
    fn absorb(&mut self, lit: u32, [before, here]: [Floats; 2], reached: Floats) {
        let table = self.piece.volume.table;
        let mm = _mm256_mul_ps(_mm256_sub_ps(here, before), self.mm_per_zeta);
        let rise = _mm256_sub_ps(reached, self.position);
        let size = _mm256_andnot_ps(_mm256_set1_ps(-0.0), rise);
        let rises = _mm256_movemask_ps(_mm256_cmp_ps::<_CMP_GT_OQ>(size, _mm256_set1_ps(EVEN))) as u32;
        let by = store(_mm256_div_ps(mm, rise));
        let at_begin = Places::new(table, self.position);
        let at_end = Places::new(table, reached);
        let mut depths = [_mm_setzero_ps(); LANES];
        let mut optical = [0.0_f32; LANES];
        let mut left = lit;
        while left != 0 {
            let lane = left.trailing_zeros() as usize % LANES;
            left &= left - 1;
            let begin =
                if self.sums_known >> lane & 1 == 1 { self.sums[lane] } else { at_begin.sum(table, lane) };
            let end = at_end.sum(table, lane);
            self.sums[lane] = end;
            let depth = if rises >> lane & 1 == 1 {
                _mm_mul_ps(_mm256_cvtpd_ps(_mm256_sub_pd(end, begin)), _mm_set1_ps(by[lane]))
            } else {
                let middle = 0.5 * (at_begin.position[lane] + at_end.position[lane]);
                four(&table.even(middle, store(mm)[lane]))
            };
            depths[lane] = depth;
            optical[lane] = store_four(depth)[3];
        }
        self.sums_known |= lit;
        if self.piece.lit {
            self.light(lit, [before, here], &mut depths, &optical);
        }
        let optical = load(&optical);
        let (through, weight) = absorbed(optical);
        let absorbs = _mm256_cmp_ps::<_CMP_GT_OQ>(optical, _mm256_setzero_ps());
        let weight = store(_mm256_mul_ps(weight, self.through));
        let mut left = lit & _mm256_movemask_ps(absorbs) as u32;
        while left != 0 {
            let lane = left.trailing_zeros() as usize % LANES;
            left &= left - 1;
            let more = _mm_mul_ps(depths[lane], _mm_set1_ps(weight[lane]));
            self.colors[lane] = _mm_add_ps(self.colors[lane], more);
        }
        self.through = select(absorbs, _mm256_mul_ps(self.through, through), self.through);
    }

    /// Lights the steps by their middles.
    #[target_feature(enable = "avx2")]
    fn light(
        &self,
        lit: u32,
        [before, here]: [Floats; 2],
        depths: &mut [__m128; LANES],
        optical: &[f32; LANES],
    ) {
        let middles = store(_mm256_mul_ps(_mm256_set1_ps(0.5), _mm256_add_ps(before, here)));
        for lane in (0..LANES).filter(|lane| lit >> lane & 1 == 1 && optical[*lane] > 0.0) {
            let (start, growth) = self.piece.voxel_line(self.lanes.lens[lane]);
            let mut place = [0.0_f32; 3];
            for axis in 0..3 {
                place[axis] = start[axis] as f32 + growth[axis] as f32 * middles[lane];
            }
            let mut depth = store_four(depths[lane]);
            self.piece.light(&mut depth, place, self.lanes.rays[lane].direction);
            depths[lane] = four(&depth);
        }
    }

    /// On to the next cell, or past the clear box.
    #[inline]
    #[target_feature(enable = "avx2")]
    fn advance(&mut self, ahead: &Ahead) {
        for axis in 0..3 {
            let falls = self.lines.falls[axis];
            let (cell, wall) = (self.cell[axis], ahead.wall[axis]);
            let before_wall = _mm256_sub_epi32(wall, _mm256_set1_epi32(1));
            // Across a clear box from where it was to its far side, whatever rounding says.
            let reached = self.lines.cell(axis, ahead.exit);
            let (low, high) = (select_whole(falls, wall, cell), select_whole(falls, cell, before_wall));
            let moved = select_whole(ahead.clear, clamp_whole(reached, low, high), cell);
            let passed = select_whole(falls, before_wall, wall);
            let cell = select_whole(ahead.by[axis], passed, moved);
            let inside = _mm256_and_si256(
                _mm256_cmpgt_epi32(cell, _mm256_set1_epi32(-2)),
                _mm256_cmpgt_epi32(self.extent[axis], cell),
            );
            self.cell[axis] = cell;
            self.active = _mm256_and_ps(self.active, as_mask(inside));
        }
    }
}
