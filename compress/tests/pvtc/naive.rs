//! PVTC straight from the papers and the format's page: one voxel at a time, in real numbers, sharing nothing with the
//! crate.
//!
//! Source: Yamada, Eq. (1), section 3.2 for the order of heads and tables; the page of `compress::pvtc` for bits.

/// Widths of the end points of each step, in bits.
fn widths(steps: usize) -> &'static [u32] {
    match steps {
        1 => &[16],
        2 => &[8, 8],
        3 => &[5, 6, 5],
        _ => &[4, 4, 4, 4],
    }
}

/// A layout of sub-volumes of 4×4×`s` and `t` steps, and the extent it is about.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Naive {
    pub(crate) s: usize,
    pub(crate) t: usize,
    pub(crate) extent: [usize; 3],
}

impl Naive {
    fn counts(self) -> [usize; 3] {
        let [x, y, z] = self.extent;
        [x.div_ceil(4), y.div_ceil(4), z.div_ceil(self.s)]
    }

    pub(crate) fn encoded_len(self) -> usize {
        let [x, y, z] = self.counts();
        x * y * z * 4 + x * y * z * 4 * self.s
    }

    /// U and D of a step as real numbers from 0 to 1.
    fn ends(self, head: &[u8], step: usize) -> [f64; 2] {
        let first: u32 = widths(self.t)[..=step].iter().sum();
        let most = (1_u32 << widths(self.t)[step]) - 1;
        [0, 2].map(|at: usize| {
            let word = u32::from(head[at]) + 256 * u32::from(head[at + 1]);
            f64::from((word >> (16 - first)) & most) / f64::from(most)
        })
    }

    /// Eq. (1), from 0 to 1.
    fn mixture([u, d]: [f64; 2], index: u32) -> f64 {
        match index {
            0 => u,
            1 => 2.0 * u / 3.0 + d / 3.0,
            2 => u / 3.0 + 2.0 * d / 3.0,
            _ => d,
        }
    }

    /// Voxel `[x, y, z]` of a step.
    pub(crate) fn voxel(self, bytes: &[u8], step: usize, [x, y, z]: [usize; 3]) -> u8 {
        let [across, down, deep] = self.counts();
        let sub_volume = (z / self.s * down + y / 4) * across + x / 4;
        let head = &bytes[4 * sub_volume..][..4];
        let table = &bytes[4 * across * down * deep + 4 * self.s * sub_volume..][..4 * self.s];
        let bit = 2 * (z % self.s * 16 + y % 4 * 4 + x % 4);
        let index = u32::from(table[bit / 8]) >> (bit % 8) & 3;
        // The small number is for values that floating point made less; no mixture is a half.
        (Self::mixture(self.ends(head, step), index) * 255.0 + 0.5 + 1e-9).floor() as u8
    }

    /// A step, decoded.
    pub(crate) fn decode(self, bytes: &[u8], step: usize) -> Vec<u8> {
        let [across, down, deep] = self.extent;
        let voxels = (0..deep).flat_map(|z| (0..down).flat_map(move |y| (0..across).map(move |x| [x, y, z])));
        voxels.map(|at| self.voxel(bytes, step, at)).collect()
    }

    /// The encoder of the papers.
    pub(crate) fn encode_min_max(self, steps: &[&[u8]]) -> Vec<u8> {
        let [across, down, deep] = self.counts();
        let (mut heads, mut tables) = (Vec::new(), Vec::new());
        for sub_volume in 0..across * down * deep {
            let origin = [
                sub_volume % across * 4,
                sub_volume / across % down * 4,
                sub_volume / across / down * self.s,
            ];
            let sample = |step: usize, i: usize| {
                let [x, y, z]: [usize; 3] = std::array::from_fn(|axis| {
                    (origin[axis] + [i % 4, i / 4 % 4, i / 16][axis]).min(self.extent[axis] - 1)
                });
                steps[step.min(steps.len() - 1)][(z * self.extent[1] + y) * self.extent[0] + x]
            };
            let mut words = [0_u32; 2];
            for (step, width) in widths(self.t).iter().enumerate() {
                let values = || (0..16 * self.s).map(|i| f64::from(sample(step, i)));
                let (most, least) = (values().fold(0.0, f64::max), values().fold(255.0, f64::min));
                for (word, value) in words.iter_mut().zip([most, least]) {
                    *word = *word << width | (value / 255.0 * f64::from((1_u32 << width) - 1)).round() as u32;
                }
            }
            let head: Vec<u8> =
                words.iter().flat_map(|&word| [(word % 256) as u8, (word / 256) as u8]).collect();
            let mut table = vec![0_u8; 4 * self.s];
            for i in 0..16 * self.s {
                let distance = |index: u32| -> u64 {
                    let off = |step: usize| {
                        let value = (Self::mixture(self.ends(&head, step), index) * 255.0).round();
                        value as i64 - i64::from(sample(step, i))
                    };
                    (0..self.t).map(|step| off(step).pow(2) as u64).sum()
                };
                // The first of the nearest.
                let mut index = 0;
                for other in 1..4 {
                    if distance(other) < distance(index) {
                        index = other;
                    }
                }
                table[i / 4] |= (index as u8) << (i % 4 * 2);
            }
            heads.extend(head);
            tables.extend(table);
        }
        [heads, tables].concat()
    }
}
