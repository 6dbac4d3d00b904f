//! `accuracy`: how fast the error falls as a picture is refined, on scenes whose pictures are known.
//!
//! A renderer is right if its error vanishes at the order that its rule promises, in slice spacing, in voxels and in
//! pixels; a defect shows as a smaller order or as a floor, where a golden picture would show nothing. Errors are of
//! float pictures, over all pixels and channels. Source: Etiene, Jönsson, Ropinski, Scheidegger, Comba, Nonato, Kirby,
//! Ynnerman, Silva 2014, "Verifying Volume Rendering Using Discretization Error Analysis", IEEE TVCG 20(1).
//! Differs: scenes of closed form beside their sum of plane waves, and errors against the truth, not between levels.
//!
//! Pixels are refined at a fixed field of view: the mean of a picture's pixels in each of 8×8 cells against the mean
//! of what is seen there, a midpoint rule of order 2.
//!
//! Textures that lose something have a floor. That it is theirs and not of the steps is shown by a second error, against
//! the same texture at the finest steps: it falls on where the error stays.

mod known;
mod ray;

use std::sync::Arc;

use ::render::gpu::Gpu;
use ::render::image::FloatImage;
use ::render::scene::TextureFormat;
use rayon::prelude::*;
use serde_json::json;

use self::known::Known;
use super::painter::{MAKERS, Painter};
use super::{Bench, Row, number};
use crate::headless::Failure;
use crate::headless::plot::{Chart, Scale, Series};

/// The pictures whose slices or voxels are refined; pixels.
const SIZE: u32 = 64;
/// Slice spacings, voxels.
const SPACINGS: [f64; 9] = [2.0, 1.0, 0.5, 0.25, 0.125, 1.0 / 16.0, 1.0 / 32.0, 1.0 / 64.0, 1.0 / 128.0];
/// Those that a texture's floor is looked for with.
const COARSE: [f64; 5] = [2.0, 1.0, 0.5, 0.25, 0.125];
/// Halvings that an order is also told over: steps that never leave a cell are not halved by each.
const HALVINGS: usize = 4;
/// Voxels a side.
const COUNTS: [usize; 5] = [8, 16, 32, 64, 128];
/// Pixels a side.
const SIDES: [u32; 5] = [8, 16, 32, 64, 128];
/// Cells a side that pixels are averaged over.
const CELLS: u32 = 8;
/// Slice spacing where something else is refined, voxels.
const FINE: f64 = 0.03125;
/// Below this, 1/255, no order is told: rounding of the picture's floats is near.
const ROUNDING: f64 = 2e-4;
/// Half the picture's places and weights of Gauss and Legendre with six points.
const GAUSS: [(f64, f64); 3] = [
    (0.238_619_186_083_196_9, 0.467_913_934_572_691_05),
    (0.661_209_386_466_264_5, 0.360_761_573_048_138_6),
    (0.932_469_514_203_152, 0.171_324_492_379_170_36),
];

/// Measures every renderer.
pub(super) fn run(bench: &mut Bench) -> Result<(), Failure> {
    let gpu = Arc::new(Gpu::headless()?);
    for make in MAKERS {
        let mut painter = make(&gpu)?;
        refine(&mut *painter, bench)?;
        for &format in painter.formats().iter().filter(|format| is_lossy(**format)) {
            with_texture(&mut *painter, format, bench)?;
        }
    }
    Ok(())
}

/// Scenes as exact as the renderer has them.
fn refine(painter: &mut dyn Painter, bench: &mut Bench) -> Result<(), Failure> {
    for known in known::for_spacing()? {
        let truth = truth(&known);
        let spacings = if painter.has_spacing() { &SPACINGS[..] } else { &[FINE] };
        let mut line = Line::new(&*painter, &known, "spacing");
        for &spacing in spacings {
            let picture = painter.paint(&known.scene, [SIZE; 2], spacing)?.picture;
            line.report(bench, spacing, apart(&picture, &truth), None)?;
        }
    }
    let mut line = Line::new(&*painter, &known::ball(COUNTS[0])?, "grid");
    for count in COUNTS {
        let known = known::ball(count)?;
        let picture = painter.paint(&known.scene, [SIZE; 2], FINE)?.picture;
        line.report(bench, 1.0 / count as f64, apart(&picture, &truth(&known)), None)?;
    }
    let known = known::product()?;
    let truth = cells(&known);
    let mut line = Line::new(&*painter, &known, "pixels");
    for side in SIDES {
        let picture = painter.paint(&known.scene, [side; 2], FINE)?.picture;
        line.report(bench, 1.0 / f64::from(side), apart(&means(&picture), &truth), None)?;
    }
    Ok(())
}

/// The same with a texture: the error, and that of the steps alone.
fn with_texture(painter: &mut dyn Painter, format: TextureFormat, bench: &mut Bench) -> Result<(), Failure> {
    for known in known::for_spacing()? {
        let known = known.with_texture(format);
        let truth = truth(&known);
        let limit = painter.paint(&known.scene, [SIZE; 2], FINE)?.picture;
        let limit: Vec<[f64; 4]> = limit.pixels.iter().map(|p| p.map(f64::from)).collect();
        let mut line = Line::new(&*painter, &known, "spacing");
        for spacing in COARSE {
            let picture = painter.paint(&known.scene, [SIZE; 2], spacing)?.picture;
            line.report(bench, spacing, apart(&picture, &truth), Some(apart(&picture, &limit)))?;
        }
    }
    let mut line = Line::new(&*painter, &known::ball(COUNTS[0])?.with_texture(format), "grid");
    for count in COUNTS {
        let known = known::ball(count)?.with_texture(format);
        let picture = painter.paint(&known.scene, [SIZE; 2], FINE)?.picture;
        line.report(bench, 1.0 / count as f64, apart(&picture, &truth(&known)), None)?;
    }
    Ok(())
}

/// Whether what a texture holds differs from the samples by more than the rounding of `f32`.
fn is_lossy(format: TextureFormat) -> bool {
    !matches!(format, TextureFormat::Auto | TextureFormat::R32f)
}

/// One thing that is refined, with what was measured so far: width and error.
struct Line {
    renderer: &'static str,
    scene: &'static str,
    texture: Option<&'static str>,
    refined: &'static str,
    errors: Vec<(f64, f64)>,
}

impl Line {
    fn new(painter: &dyn Painter, known: &Known, refined: &'static str) -> Self {
        let format = known.format();
        let texture = is_lossy(format).then(|| format.name());
        Self { renderer: painter.name(), scene: known.name, texture, refined, errors: Vec::new() }
    }

    /// A row: the error, its order since the last one and since some before, and the error of the steps alone.
    fn report(
        &mut self,
        bench: &mut Bench,
        width: f64,
        [rms, max]: [f64; 2],
        steps: Option<[f64; 2]>,
    ) -> Result<(), Failure> {
        self.errors.push((width, rms));
        let since = |back: usize| {
            let before = self.errors.len().checked_sub(back + 1)?;
            order(self.errors[before], (width, rms))
        };
        let name = self.texture.map_or_else(String::new, |texture| format!(" {texture}"));
        bench.report(json!({
            "bench": "accuracy", "renderer": self.renderer, "texture": self.texture, "refined": self.refined,
            "scene": self.scene, "width": width, "rms_error_255": rms, "max_error_255": max,
            "order": since(1), "order_of_four": since(HALVINGS),
            "steps_rms_255": steps.map(|[rms, _]| rms), "steps_max_255": steps.map(|[_, max]| max),
            "line": format!("{}{name}, {}", self.renderer, self.scene),
        }))
    }
}

/// The power of the width that the error fell by; none where either is of rounding's size.
fn order(before: (f64, f64), after: (f64, f64)) -> Option<f64> {
    let told = before.1 > ROUNDING && after.1 > ROUNDING;
    told.then(|| (before.1 / after.1).ln() / (before.0 / after.0).ln())
}

/// What is seen at the centre of every pixel.
fn truth(known: &Known) -> Vec<[f64; 4]> {
    let place = |i: u32| (f64::from(i) + 0.5) / f64::from(SIZE) * 2.0 - 1.0;
    let seen = |i: u32| known.seen([place(i % SIZE), -place(i / SIZE)]);
    (0..SIZE * SIZE).into_par_iter().map(seen).collect()
}

/// The mean of what is seen in every cell.
fn cells(known: &Known) -> Vec<[f64; 4]> {
    let nodes: Vec<(f64, f64)> = GAUSS.iter().flat_map(|&(x, w)| [(x, w / 2.0), (-x, w / 2.0)]).collect();
    let half = 1.0 / f64::from(CELLS);
    let place = |i: u32| (f64::from(i) + 0.5) * 2.0 * half - 1.0;
    let cell = |i: u32| {
        let (u, v) = (place(i % CELLS), -place(i / CELLS));
        let mut mean = [0.0; 4];
        for &(x, a) in &nodes {
            for &(y, b) in &nodes {
                let seen = known.seen([u + x * half, v + y * half]);
                mean = std::array::from_fn(|c| mean[c] + a * b * seen[c]);
            }
        }
        mean
    };
    (0..CELLS * CELLS).into_par_iter().map(cell).collect()
}

/// The mean of a picture's pixels in every cell.
fn means(picture: &FloatImage) -> FloatImage {
    let side = picture.width / CELLS;
    let mean = |cell: u32| {
        let (left, top) = (cell % CELLS * side, cell / CELLS * side);
        let mut sum = [0.0_f64; 4];
        for y in top..top + side {
            for x in left..left + side {
                let pixel = picture.pixels[(y * picture.width + x) as usize];
                sum = std::array::from_fn(|c| sum[c] + f64::from(pixel[c]));
            }
        }
        sum.map(|s| (s / f64::from(side * side)) as f32)
    };
    FloatImage { width: CELLS, height: CELLS, pixels: (0..CELLS * CELLS).map(mean).collect() }
}

/// Root mean square and largest difference, over all channels, in 1/255.
fn apart(picture: &FloatImage, truth: &[[f64; 4]]) -> [f64; 2] {
    let (mut square, mut max) = (0.0, 0.0_f64);
    for (p, q) in picture.pixels.iter().zip(truth) {
        for c in 0..4 {
            let d = (f64::from(p[c]) - q[c]).abs() * 255.0;
            square += d * d;
            max = if d.is_nan() { f64::INFINITY } else { max.max(d) };
        }
    }
    [(square / (4 * truth.len()) as f64).sqrt(), max]
}

/// A chart for each refinement, and one more where there are textures with a loss.
pub(super) fn charts(rows: &[Row]) -> Vec<(&'static str, Chart)> {
    let [spacing, voxel] = ["slice spacing, voxels", "voxel, parts of the side"];
    let kinds = [
        ("accuracy_spacing.svg", "spacing", spacing, false),
        ("accuracy_grid.svg", "grid", voxel, false),
        ("accuracy_pixels.svg", "pixels", "pixel, parts of the side", false),
        ("accuracy_spacing_textures.svg", "spacing", spacing, true),
        ("accuracy_grid_textures.svg", "grid", voxel, true),
    ];
    // Of the scenes with textures those whose integrand is smooth.
    let shown = |row: &Row, refined: &str, lossy: bool| {
        let fits = !lossy || row["scene"] == "product" || row["scene"] == "ball";
        row["refined"] == refined && row["texture"].is_null() != lossy && fits
    };
    let chart = |(file, refined, x, lossy): (&'static str, &str, &str, bool)| {
        let rows: Vec<Row> = rows.iter().filter(|r| shown(r, refined, lossy)).cloned().collect();
        let point = |row: &Row| (number(row, "width"), number(row, "rms_error_255"), String::new());
        let series: Vec<Series> = super::series(&rows, "line", &point);
        let title = "Error against the known picture".to_owned();
        let y = "root mean square, 1/255".to_owned();
        (file, Chart { title, x: x.to_owned(), y, y_scale: Scale::Log, joined: true, series })
    };
    kinds.map(chart).into()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_quarter_of_the_error_at_half_the_width_is_order_2() {
        assert_eq!(order((0.5, 8.0), (0.25, 2.0)), Some(2.0), "by definition");
        assert_eq!(order((0.5, 1e-6), (0.25, 1e-7)), None, "rounding has no order");
    }

    #[test]
    fn a_wrong_picture_does_not_pass_for_the_known_one() {
        let known = known::product().expect("a scene");
        let truth = truth(&known);
        let exact = FloatImage {
            width: SIZE,
            height: SIZE,
            pixels: truth.iter().map(|p| p.map(|c| c as f32)).collect(),
        };
        assert!(apart(&exact, &truth)[1] < 1e-4, "rounded to f32");
        let mut mirrored = exact.clone();
        for row in mirrored.pixels.chunks_exact_mut(SIZE as usize) {
            row.reverse();
        }
        assert!(apart(&mirrored, &truth)[0] > 5.0, "left and right differ");
    }

    #[test]
    fn the_means_of_finer_pictures_of_the_truth_come_nearer_at_order_2() {
        let known = known::product().expect("a scene");
        let exact = cells(&known);
        let error = |side: u32| {
            let place = |i: u32| (f64::from(i) + 0.5) / f64::from(side) * 2.0 - 1.0;
            let seen = |i: u32| known.seen([place(i % side), -place(i / side)]).map(|c| c as f32);
            let picture =
                FloatImage { width: side, height: side, pixels: (0..side * side).map(seen).collect() };
            apart(&means(&picture), &exact)[0]
        };
        let order = (error(8) / error(16)).log2();
        assert!((order - 2.0).abs() < 0.1, "the midpoint rule: {order}");
    }
}
