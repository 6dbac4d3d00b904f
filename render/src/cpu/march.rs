//! Along a pixel's ray: the pieces and surfaces that it meets, front to back.

use super::layered::Layered;
use super::piece::{Placed, Stretches};
use super::surfaces::Hit;
use super::walker::{Ray, Walker};
use crate::cells;

/// What has come through so far.
#[derive(Debug, Clone, Copy)]
struct Light {
    color: [f32; 3],
    through: f32,
}

impl Light {
    const START: Self = Self { color: [0.0; 3], through: 1.0 };

    /// Passes what has this optical depth times colour, and optical depth.
    #[inline(always)]
    fn absorb(&mut self, [r, g, b, depth]: [f32; 4]) {
        let (left, weight) = absorbed(depth);
        let weight = weight * self.through;
        self.color = [self.color[0] + r * weight, self.color[1] + g * weight, self.color[2] + b * weight];
        self.through *= left;
    }

    /// Passes what has this colour, premultiplied, and opacity.
    fn layer(&mut self, [r, g, b, opacity]: [f32; 4]) {
        for (sum, c) in self.color.iter_mut().zip([r, g, b]) {
            *sum += self.through * c;
        }
        self.through *= 1.0 - opacity;
    }

    fn surface(&mut self, hit: &Hit) {
        let weight = self.through * hit.opacity;
        for c in 0..3 {
            self.color[c] += weight * hit.color[c];
        }
        self.through *= 1.0 - hit.opacity;
    }

    fn pixel(self) -> [f32; 4] {
        let [r, g, b] = self.color;
        [r, g, b, 1.0 - self.through]
    }
}

/// exp(-t), and (1 - exp(-t)) / t without loss for small t; t > 0.
#[inline(always)]
fn absorbed(t: f32) -> (f32, f32) {
    if t < 0.05 {
        let weight = 1.0 - t * (0.5 - t * (1.0 / 6.0 - t * (1.0 / 24.0 - t * (1.0 / 120.0))));
        return (1.0 - t * weight, weight);
    }
    let left = exp_minus(t);
    (left, (1.0 - left) / t)
}

/// exp(-t) for t >= 0, within 2 units in the last place; 0 beyond 87.
#[inline(always)]
fn exp_minus(t: f32) -> f32 {
    let t = t.min(87.0);
    // 2^-whole times exp of what is left, which is at most half of ln 2.
    let whole = (t * std::f32::consts::LOG2_E).round_ties_even();
    let rest = (whole * LN_2_HIGH - t) + whole * LN_2_LOW;
    let mut power = 1.0 / 5040.0;
    for k in EXP_TERMS {
        power = power * rest + k;
    }
    power * f32::from_bits(((127 - whole as i32) as u32) << 23)
}

/// The series of exp, from its seventh power down, but for the first term.
pub(super) const EXP_TERMS: [f32; 7] = [1.0 / 720.0, 1.0 / 120.0, 1.0 / 24.0, 1.0 / 6.0, 0.5, 1.0, 1.0];

/// ln 2 in two parts, the first of so few digits that its products with whole numbers are exact.
pub(super) const LN_2_HIGH: f32 = 0.693_359_4;
pub(super) const LN_2_LOW: f32 = -2.121_944_4e-4;

/// How rays are walked.
#[derive(Debug, Clone, Copy)]
pub(super) struct Manner {
    /// Longest step; mm of zeta for one mm of ray.
    pub(super) step_mm: f32,
    /// Steps at least between two places where a cell begins or ends, where several cells and nothing else are.
    pub(super) steps_in_cells: u32,
    /// A pixel is done when no more than this comes through.
    pub(super) dark: f32,
}

/// Work counted.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Work {
    pub(super) cells: u64,
    pub(super) finished: u64,
}

/// What a thread keeps from ray to ray.
#[derive(Debug, Default)]
pub(super) struct Scratch {
    stretches: Stretches,
    stops: Vec<Stop>,
    hits: Vec<Hit>,
}

/// Where something begins, ends, or is crossed.
#[derive(Debug, Clone, Copy)]
struct Stop {
    zeta: f32,
    what: What,
}

#[derive(Debug, Clone, Copy)]
enum What {
    Begin(u32),
    End(u32),
    Surface(u32),
    /// A grid begins or ends.
    Grid,
}

/// A piece that may show in a tile, with its depths there.
pub(super) type Shown<'a> = (&'a Placed<'a>, [f32; 2]);

/// The colour of a ray: premultiplied, with its opacity.
#[inline(always)]
pub(super) fn pixel(
    shown: &[Shown<'_>],
    layered: &[Layered<'_>],
    hits: &[Hit],
    grids: &[cells::Spans<'_>],
    lens: [f64; 2],
    ray: &Ray,
    manner: Manner,
    scratch: &mut Scratch,
    work: &mut Work,
) -> [f32; 4] {
    let mut light = Light::START;
    scratch.hits.clear();
    if !layered.is_empty() {
        scratch.hits.extend_from_slice(hits);
        for volume in layered {
            volume.hits(lens, ray, &mut scratch.stretches, &mut scratch.hits);
        }
    }
    let hits = if layered.is_empty() { hits } else { &scratch.hits[..] };
    if let ([(piece, depths)], [], []) = (shown, hits, grids) {
        piece.stretches(lens, [f64::from(depths[0]), f64::from(depths[1])], &mut scratch.stretches);
        for &[from, to] in &scratch.stretches {
            let (from, to) = (from as f32, to as f32);
            let mut walker = Walker::new(piece, lens, from);
            march(&mut walker, [from, to], ray, manner, &mut light);
            work.cells += u64::from(walker.cells);
            if light.through < manner.dark {
                work.finished += 1;
                break;
            }
        }
        return light.pixel();
    }
    scratch.stops.clear();
    for (index, (piece, depths)) in shown.iter().enumerate() {
        piece.stretches(lens, [f64::from(depths[0]), f64::from(depths[1])], &mut scratch.stretches);
        for &[from, to] in &scratch.stretches {
            scratch.stops.push(Stop { zeta: from as f32, what: What::Begin(index as u32) });
            scratch.stops.push(Stop { zeta: to as f32, what: What::End(index as u32) });
        }
    }
    for (index, hit) in hits.iter().enumerate() {
        scratch.stops.push(Stop { zeta: hit.zeta, what: What::Surface(index as u32) });
    }
    for grid in grids {
        scratch.stops.extend(grid.ends().map(|zeta| Stop { zeta, what: What::Grid }));
    }
    // Stable: surfaces at one depth stay in their order.
    scratch.stops.sort_by(|a, b| a.zeta.total_cmp(&b.zeta));
    let mut walkers: Vec<(u32, Walker<'_>)> = Vec::new();
    let mut cells: Vec<cells::Walker<'_>> = grids.iter().map(|spans| spans.walker()).collect();
    let mut at = scratch.stops.first().map_or(0.0, |stop| stop.zeta);
    for stop in &scratch.stops {
        if stop.zeta > at {
            match (&mut walkers[..], &mut cells[..]) {
                ([], []) => {}
                ([(_, walker)], []) => march(walker, [at, stop.zeta], ray, manner, &mut light),
                (many, cells) => march_many(many, cells, [at, stop.zeta], ray, manner, &mut light),
            }
            at = stop.zeta;
        }
        match stop.what {
            What::Begin(piece) => {
                walkers.push((piece, Walker::new(shown[piece as usize].0, lens, stop.zeta)));
            }
            What::End(piece) => walkers.retain(|(other, walker)| {
                let ends = *other == piece;
                work.cells += if ends { u64::from(walker.cells) } else { 0 };
                !ends
            }),
            What::Surface(hit) => light.surface(&hits[hit as usize]),
            What::Grid => {}
        }
        if light.through < manner.dark {
            work.finished += 1;
            break;
        }
    }
    work.cells += walkers.iter().map(|(_, w)| u64::from(w.cells)).sum::<u64>();
    light.pixel()
}

/// Passes a stretch in equal steps, `least` of them at least and each no longer than they may be, through what `step` says of
/// it; whether the pixel is finished.
#[inline(always)]
fn pass(
    [from, to]: [f32; 2],
    least: u32,
    ray: &Ray,
    manner: Manner,
    light: &mut Light,
    mut step: impl FnMut(f32, f32) -> Option<[f32; 4]>,
) -> bool {
    let count = (((to - from) * ray.mm_per_zeta / manner.step_mm).ceil() as u32).max(least);
    let length = (to - from) / count as f32;
    let mut before = from;
    for i in 1..=count {
        let here = if i == count { to } else { from + length * i as f32 };
        if let Some(depth) = step(before, here) {
            light.absorb(depth);
            if light.through < manner.dark {
                return true;
            }
        }
        before = here;
    }
    false
}

/// Through one piece.
#[inline(always)]
fn march(walker: &mut Walker<'_>, [from, to]: [f32; 2], ray: &Ray, manner: Manner, light: &mut Light) {
    let mut at = from;
    loop {
        let end = walker.next_bend(at).min(to);
        if !walker.clear
            && end > at
            && pass([at, end], 1, ray, manner, light, |before, here| walker.step(before, here, ray))
        {
            return;
        }
        at = at.max(end);
        if at >= to {
            return;
        }
        if at >= walker.exit {
            walker.advance();
        }
    }
}

/// Through several pieces and cells of grids at once: their extinctions add up.
fn march_many(
    walkers: &mut [(u32, Walker<'_>)],
    cells: &mut [cells::Walker<'_>],
    [from, to]: [f32; 2],
    ray: &Ray,
    manner: Manner,
    light: &mut Light,
) {
    let mut at = from;
    loop {
        if let ([], [grid]) = (&walkers, &mut *cells) {
            at = grid.run([at, to], |seen| {
                light.layer(seen);
                light.through >= manner.dark
            });
            if light.through < manner.dark {
                return;
            }
        }
        let mut end = walkers.iter().map(|(_, w)| w.next_bend(at)).fold(to, f32::min);
        for grid in cells.iter_mut() {
            grid.reach(at);
            end = end.min(grid.next_bend());
        }
        let in_cells = cells.iter().filter(|grid| !grid.is_clear()).count();
        let in_pieces = walkers.iter().any(|(_, w)| !w.clear);
        let alone = cells.iter_mut().find(|grid| !grid.is_clear() && !grid.is_many());
        if let Some(grid) = alone.filter(|_| end > at && !in_pieces && in_cells == 1) {
            light.layer(grid.segment([at, end], ray.mm_per_zeta));
            if light.through < manner.dark {
                return;
            }
        } else if end > at && (in_pieces || in_cells > 0) {
            let step = |before: f32, here: f32| {
                let mut depth = [0.0; 4];
                for (_, walker) in walkers.iter_mut().filter(|(_, w)| !w.clear) {
                    let part = walker.step(before, here, ray).unwrap_or_default();
                    for c in 0..4 {
                        depth[c] += part[c];
                    }
                }
                for grid in cells.iter_mut().filter(|grid| !grid.is_clear()) {
                    let part = grid.step([before, here], ray.mm_per_zeta);
                    depth = std::array::from_fn(|c| depth[c] + part[c]);
                }
                (depth[3] > 0.0).then_some(depth)
            };
            let least = if in_pieces { 1 } else { manner.steps_in_cells };
            if pass([at, end], least, ray, manner, light, step) {
                return;
            }
        }
        at = at.max(end);
        if at >= to {
            return;
        }
        for (_, walker) in walkers.iter_mut() {
            if walker.exit <= at {
                walker.advance();
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn absorption_is_that_of_the_exponential() {
        for i in 0..20_000 {
            let t = 10.0_f32.powf(-8.0 + 10.0 * i as f32 / 20_000.0).min(87.0);
            let (left, weight) = absorbed(t);
            let known = (-f64::from(t)).exp();
            assert!((f64::from(left) - known).abs() <= 3e-7 * known.max(1e-30), "exp(-{t}) is not {left}");
            let known = -(-f64::from(t)).exp_m1() / f64::from(t);
            assert!((f64::from(weight) - known).abs() <= 3e-6 * known, "weight {weight} at {t}");
        }
    }

    #[test]
    fn ten_to_the_five_faint_steps_keep_their_light() {
        let mut light = Light::START;
        let depth = 2.0 / 1e5;
        for _ in 0..100_000 {
            light.absorb([depth * 0.8, depth * 0.4, 0.0, depth]);
        }
        let known = 1.0 - (-2.0_f64).exp();
        let [r, g, b, a] = light.pixel().map(f64::from);
        let within = 0.25 / 255.0;
        assert!((a - known).abs() < within && (r - 0.8 * known).abs() < within, "{a} and {r}");
        assert!((g - 0.4 * known).abs() < within && b == 0.0, "{g} and {b}");
    }
}
