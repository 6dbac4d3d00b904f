//! A ray's way through one piece of a volume, from one place where the integrand is not smooth to the
//! next: cell walls, knots of the transfer function, turns of the gradient.

use nalgebra::Matrix3;

use super::cubic::Cubic;
use super::field::{Field, along};
use super::intervals::{Cut, Intervals};
use super::labels::{self, Painting};
use super::light;
use super::slope::Slope;
use crate::scene::{Piece, VolumeItem};
use crate::volume::{Point, Vector};

/// A piece of a volume, ready for rays.
#[derive(Debug)]
pub(super) struct Part<'a> {
    pub(super) field: &'a Field<'a>,
    pub(super) painting: Option<Painting<'a>>,
    voxel_from_world: Matrix3<f64>,
    /// Takes a gradient per voxel to one per mm of world.
    pub(super) gradient_to_world: Matrix3<f64>,
    /// The centre of the first voxel, relative to the eye; mm.
    first_voxel: Vector,
    cuts: Vec<Cut>,
}

impl<'a> Part<'a> {
    /// A piece as it lies in the world, seen from `eye`.
    pub(super) fn new(field: &'a Field<'a>, item: &'a VolumeItem, piece: &Piece, eye: &Point) -> Self {
        let world_from_voxel = piece.pose * item.pose * *item.grid.world_from_voxel();
        let voxel_from_world = world_from_voxel.inverse().linear();
        let cuts = piece.keep.iter().map(|(cutter, side)| Cut::new(cutter, *side, &piece.pose, eye));
        Self {
            field,
            painting: item.labels.as_ref().map(|labels| Painting::of(labels, piece, eye)),
            voxel_from_world,
            gradient_to_world: voxel_from_world.transpose(),
            first_voxel: world_from_voxel.point(&Point::origin()) - eye,
            cuts: cuts.collect(),
        }
    }

    /// A ray in voxel space. `offset` is its start relative to the eye.
    pub(super) fn line(&self, offset: &Vector, direction: &Vector) -> Line {
        let origin = self.voxel_from_world * (offset - self.first_voxel);
        Line { origin: origin.into(), step: (self.voxel_from_world * direction).into() }
    }

    /// The stretches of a ray inside the piece, none before its start; mm.
    pub(super) fn stretches(&self, line: &Line, offset: &Vector, direction: &Vector, into: &mut Intervals) {
        let (mut from, mut to) = (0.0_f64, f64::INFINITY);
        for axis in 0..3 {
            let [low, high] = [-0.5, self.field.extent[axis] as f64 - 0.5];
            let (o, d) = (line.origin[axis], line.step[axis]);
            if d == 0.0 {
                if o < low || o > high {
                    to = f64::NEG_INFINITY;
                }
            } else {
                let (a, b) = ((low - o) / d, (high - o) / d);
                from = from.max(a.min(b));
                to = to.min(a.max(b));
            }
        }
        into.reset(from, to);
        for cut in &self.cuts {
            if into.stretches().is_empty() {
                return;
            }
            cut.apply(offset, direction, into);
        }
    }
}

/// A ray in voxel space: `origin + t·step`, t in mm of world.
#[derive(Debug, Clone, Copy)]
pub(super) struct Line {
    pub(super) origin: [f64; 3],
    pub(super) step: [f64; 3],
}

impl Line {
    pub(super) fn at(&self, axis: usize, t: f64) -> f64 {
        self.origin[axis] + self.step[axis] * t
    }

    /// When the coordinate of an axis is `place`; never, if it does not change.
    pub(super) fn reaches(&self, axis: usize, place: f64) -> f64 {
        if self.step[axis] == 0.0 { f64::INFINITY } else { (place - self.origin[axis]) / self.step[axis] }
    }
}

/// A place on the way through a piece: the smooth span that ends at `end`.
#[derive(Debug)]
pub(super) struct Walker<'a> {
    part: &'a Part<'a>,
    line: Line,
    /// The ray in the voxel space of the labels.
    label_line: Option<Line>,
    direction: Vector,
    cell: [i64; 3],
    /// The last cell of each axis that is left at once: the cell itself, or the far side of a clear brick.
    last: [i64; 3],
    exit_axis: usize,
    /// Where the cubics have their zero; mm along the ray.
    entry: f64,
    exit: f64,
    /// Ends of spans inside the cell, after `entry`, rising.
    breaks: Vec<f64>,
    next_break: usize,
    value: Cubic,
    slope: Slope,
    /// End of the current span; mm along the ray.
    pub(super) end: f64,
    /// Whether the current span absorbs nothing.
    pub(super) clear: bool,
    class: usize,
    lit: bool,
    /// The colour of the label that all of the span lies in.
    paint: Option<[f64; 4]>,
}

impl<'a> Walker<'a> {
    /// At `t` on a ray that lies inside the piece's grid there. `offset` is the ray's start relative to the eye.
    pub(super) fn start(part: &'a Part<'a>, offset: &Vector, direction: Vector, t: f64) -> Self {
        let line = part.line(offset, &direction);
        let cell =
            std::array::from_fn(|a| (line.at(a, t).floor() as i64).clamp(-1, part.field.extent[a] - 1));
        let mut walker = Self {
            part,
            line,
            label_line: part.painting.as_ref().map(|p| p.line(offset, &direction)),
            direction,
            cell,
            last: cell,
            exit_axis: 0,
            entry: t,
            exit: t,
            breaks: Vec::new(),
            next_break: 0,
            value: Cubic::ZERO,
            slope: Slope::ZERO,
            end: t,
            clear: true,
            class: 0,
            lit: false,
            paint: None,
        };
        walker.enter();
        walker
    }

    /// Whether this walks through `part`.
    pub(super) fn is_in(&self, part: &Part<'_>) -> bool {
        std::ptr::eq(std::ptr::from_ref(self.part).cast::<()>(), std::ptr::from_ref(part).cast::<()>())
    }

    /// On to the next span.
    pub(super) fn advance(&mut self) {
        if self.next_break <= self.breaks.len() {
            self.next_span();
            return;
        }
        for axis in 0..3 {
            let step = self.line.step[axis];
            let forward = if step < 0.0 { -1 } else { 1 };
            if axis == self.exit_axis {
                self.cell[axis] = self.last[axis] + forward;
            } else if self.last[axis] != self.cell[axis] {
                let reached = self.line.at(axis, self.exit).floor() as i64;
                let (from, to) = (self.cell[axis], self.last[axis]);
                self.cell[axis] = reached.clamp(from.min(to), from.max(to));
            }
        }
        self.entry = self.end;
        self.enter();
    }

    /// Sets up the cell that `cell` names, from `entry` on.
    fn enter(&mut self) {
        let field = self.part.field;
        self.breaks.clear();
        // Only by rounding, where the box and the cells both end.
        if (0..3).any(|a| self.cell[a] < -1 || self.cell[a] >= field.extent[a]) {
            (self.clear, self.end, self.next_break) = (true, f64::INFINITY, 1);
            return;
        }
        let brick = field.clear_brick(self.cell);
        let block = brick.unwrap_or_else(|| self.cell.map(|i| [i, i]));
        self.exit = f64::INFINITY;
        for (axis, [first, last]) in block.into_iter().enumerate() {
            let forward = self.line.step[axis] >= 0.0;
            self.last[axis] = if forward { last } else { first };
            let wall = if forward { last + 1 } else { first };
            let at = self.line.reaches(axis, wall as f64);
            if at < self.exit {
                (self.exit, self.exit_axis) = (at, axis);
            }
        }
        self.exit = self.exit.max(self.entry);
        if brick.is_some() {
            (self.clear, self.end, self.next_break) = (true, self.exit, 1);
            return;
        }
        self.enter_cell();
    }

    fn enter_cell(&mut self) {
        let field = self.part.field;
        let corners = field.corners(self.cell);
        let low = corners.iter().copied().fold(f64::INFINITY, f64::min);
        let high = corners.iter().copied().fold(f64::NEG_INFINITY, f64::max);
        self.class = field.classes.find(low);
        let one_class = field.classes.find(high) == self.class;
        if one_class && field.classes.is_clear(self.class) {
            (self.clear, self.end, self.next_break) = (true, self.exit, 1);
            return;
        }
        let from = std::array::from_fn(|a| self.line.at(a, self.entry) - self.cell[a] as f64);
        let length = self.exit - self.entry;
        self.value = along(&corners, from, self.line.step);
        if !one_class {
            let knots = field.classes.knots_between(self.value.bounds(0.0, length));
            self.value.crossings(length, knots, &mut self.breaks);
        }
        if field.lit {
            let per_voxel = field.gradients(self.cell).map(|g| along(&g, from, self.line.step));
            self.slope = Slope::new(&per_voxel, &self.part.gradient_to_world, &self.direction);
            self.slope.breaks(length, field.flat_per_mm, &mut self.breaks);
        }
        if let (Some(painting), Some(line)) = (&self.part.painting, &self.label_line) {
            painting.walls(line, [self.entry, self.exit], &mut self.breaks);
        }
        self.breaks.sort_unstable_by(f64::total_cmp);
        for at in &mut self.breaks {
            *at += self.entry;
        }
        (self.end, self.next_break) = (self.entry, 0);
        self.next_span();
    }

    /// On to the next span of this cell.
    fn next_span(&mut self) {
        let from = self.end;
        self.end = self.breaks.get(self.next_break).copied().unwrap_or(self.exit).max(from);
        self.next_break += 1;
        // Inside a span the class cannot change; its middle tells it even where the ends lie on knots.
        let middle = 0.5 * (from + self.end) - self.entry;
        let field = self.part.field;
        self.class = field.classes.find(self.value.at(middle));
        self.clear = field.classes.is_clear(self.class);
        self.lit = field.lit && !self.clear && self.slope.lights(middle, field.flat_per_mm);
        self.paint = match (&self.part.painting, &self.label_line) {
            (Some(painting), Some(line)) if !self.clear => painting.color_at(line, middle + self.entry),
            _ => None,
        };
    }

    /// Colour and extinction (1/mm) at `t` in the current span.
    pub(super) fn classify(&self, t: f64) -> ([f64; 3], f64) {
        let u = t - self.entry;
        let (color, tau) = self.painted(u);
        if self.lit { (light::lit(color, self.slope.facing(u)), tau) } else { (color, tau) }
    }

    /// Colour with its label, unlit, and extinction (1/mm) at `u` mm after `entry`.
    fn painted(&self, u: f64) -> ([f64; 3], f64) {
        let (color, tau) = self.part.field.classes.classify(self.class, self.value.at(u));
        (labels::painted(color, self.paint), tau)
    }

    /// Whether the gradient hardly turns between two places, and no channel starts or ends being held
    /// within the display's range.
    fn light_is_smooth(&self, a: f64, b: f64) -> bool {
        let classes = &self.part.field.classes;
        let held = |u: f64| light::held(self.painted(u).0, self.slope.facing(u));
        let glares = classes.glares(self.class) || self.paint.is_some();
        self.slope.is_steady(a, b)
            && (!glares || {
                let middle = held(0.5 * (a + b));
                held(a) == middle && held(b) == middle
            })
    }

    /// The greatest extinction (1/mm) within `[from, to]` of the current span, or `None` where the
    /// integrand varies there by more than one panel of the rule follows.
    pub(super) fn smooth(&self, from: f64, to: f64, heed_light: bool) -> Option<f64> {
        let classes = &self.part.field.classes;
        let (a, b) = (from - self.entry, to - self.entry);
        if self.lit && heed_light && !self.light_is_smooth(a, b) {
            return None;
        }
        classes.smooth(self.class, self.value.bounds(a, b), b - a)
    }
}
