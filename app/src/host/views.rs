//! What the views show, beside the case: crosshair, sections, windows. All of it may be lost on exit.

use std::collections::BTreeMap;

use egui::Color32;
use render::scene::Piece;
use render::section::{Layer, Section, SectionError, Window};
use render::volume::{Grid, Point, Vector};

use super::camera::Ball;
use crate::case::{Assets, Case, Volume};
use crate::scene;

/// Values below this are air: only CT, in HU, stores such.
pub const AIR_BELOW: f64 = -500.0;

/// A cross-section along the body's axes.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Orientation {
    /// Across the body, seen from the feet: the patient's right is on the left.
    Axial,
    /// From the front.
    Coronal,
    /// From the patient's left, so that the front is on the picture's left.
    Sagittal,
}

impl Orientation {
    /// In the order shown.
    pub const ALL: [Self; 3] = [Self::Axial, Self::Coronal, Self::Sagittal];

    /// For people.
    pub fn title(self) -> &'static str {
        match self {
            Self::Axial => "Axial",
            Self::Coronal => "Coronal",
            Self::Sagittal => "Sagittal",
        }
    }

    /// Towards the picture's right and lower edge; LPS unit vectors.
    pub fn axes(self) -> [Vector; 2] {
        match self {
            Self::Axial => [Vector::x(), Vector::y()],
            Self::Coronal => [Vector::x(), -Vector::z()],
            Self::Sagittal => [Vector::y(), -Vector::z()],
        }
    }

    /// The world axis across the section: 0, 1, 2 for x, y, z.
    pub fn normal_axis(self) -> usize {
        match self {
            Self::Axial => 2,
            Self::Coronal => 1,
            Self::Sagittal => 0,
        }
    }

    /// The colour of its frame, and of its line in the other sections: the one 3D Slicer has made usual.
    pub fn color(self) -> Color32 {
        match self {
            Self::Axial => Color32::from_rgb(235, 90, 80),
            Self::Coronal => Color32::from_rgb(105, 200, 95),
            Self::Sagittal => Color32::from_rgb(235, 205, 80),
        }
    }

    /// Position in [`Orientation::ALL`].
    pub fn index(self) -> usize {
        match self {
            Self::Axial => 0,
            Self::Coronal => 1,
            Self::Sagittal => 2,
        }
    }
}

/// One of the four views.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum ViewId {
    /// The rendered picture.
    Spatial,
    /// A cross-section.
    Section(Orientation),
}

/// Pan and zoom of one section; what is `None` fits the volumes.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct SectionState {
    /// World place in the middle of the picture; its part across the section is the crosshair's.
    pub centre: Option<Point>,
    /// Millimetres per point of the screen.
    pub mm_per_point: Option<f64>,
}

/// The state of all views.
#[derive(Debug, Clone, Default)]
pub struct Views {
    /// Where the sections cross; world mm. `None` until a volume is there.
    pub crosshair: Option<Point>,
    /// Pan and zoom, by [`Orientation::index`].
    pub sections: [SectionState; 3],
    /// Window and level, by volume id.
    pub windows: BTreeMap<String, Window>,
    /// How much of the second and later volumes shows over the first; 0 to 1.
    pub fusion: f64,
    /// The one view that fills the window; none shows all four.
    pub only: Option<ViewId>,
}

impl Views {
    /// All views at their first state: everything fits.
    pub fn new() -> Self {
        Self { fusion: 0.5, ..Self::default() }
    }

    /// Gives volumes that are new a window, and the crosshair a place.
    pub fn adopt(&mut self, case: &Case, assets: &Assets) {
        for volume in &case.volumes {
            let Some(grid) = assets.grid(volume) else { continue };
            if !self.windows.contains_key(&volume.id) {
                self.windows.insert(volume.id.clone(), default_window(&grid));
            }
            if self.crosshair.is_none() && volume.visible {
                self.crosshair = Some(ball_of(volume, &grid).centre);
            }
        }
    }

    /// The visible volumes as the sections show them: the first grey, later ones tinted.
    pub fn layers(&self, case: &Case, assets: &Assets) -> Vec<Layer> {
        const TINTS: [[f64; 3]; 4] = [[1.0, 1.0, 1.0], [1.0, 0.72, 0.35], [0.45, 0.8, 1.0], [0.7, 1.0, 0.5]];
        let shown = case.volumes.iter().filter(|v| v.visible);
        shown
            .filter_map(|volume| Some((volume, assets.grid(volume)?)))
            .enumerate()
            .map(|(index, (volume, grid))| Layer {
                pose: volume.pose,
                pieces: pieces_of(case, volume),
                window: self.windows.get(&volume.id).copied().unwrap_or_else(|| default_window(&grid)),
                grid,
                color: TINTS[index.min(TINTS.len() - 1)],
                share: self.fusion,
            })
            .collect()
    }

    /// The section of `orientation` through the crosshair, on a picture of `size_points` with
    /// `pixels_per_point` pixels a point.
    ///
    /// # Errors
    /// [`SectionError`] where the numbers make none.
    pub fn section(
        &self,
        orientation: Orientation,
        ball: Ball,
        size_points: [f64; 2],
        pixels_per_point: f64,
    ) -> Result<Section, SectionError> {
        let state = &self.sections[orientation.index()];
        let axis = orientation.normal_axis();
        let mut centre = state.centre.unwrap_or(ball.centre);
        centre[axis] = self.crosshair.unwrap_or(ball.centre)[axis];
        let mm_per_point = state.mm_per_point.unwrap_or_else(|| fit(ball, size_points));
        let [right, down] = orientation.axes();
        let size = size_points.map(|s| (s * pixels_per_point).round().max(1.0) as usize);
        Section::new(centre, right, down, mm_per_point / pixels_per_point, size)
    }

    /// Everything fits again.
    pub fn fit(&mut self) {
        self.sections = [SectionState::default(); 3];
    }
}

/// Millimetres per point at which a ball fits a picture.
fn fit(ball: Ball, size_points: [f64; 2]) -> f64 {
    // A box's section is smaller than its ball's: 0.8 of it is what a body fills.
    0.8 * 2.0 * ball.radius_mm / size_points[0].min(size_points[1]).max(1.0)
}

/// The pieces of a volume that are drawn.
pub fn pieces_of(case: &Case, volume: &Volume) -> Vec<Piece> {
    if case.fragments_of(&volume.id).next().is_none() {
        return vec![Piece::whole()];
    }
    case.fragments_of(&volume.id).filter(|f| f.visible).map(|f| case.piece(f)).collect()
}

/// The ball about a volume where it was acquired and placed, its fragments unmoved.
pub fn ball_of(volume: &Volume, grid: &Grid) -> Ball {
    Ball::about(grid.corners_in_world().map(|p| volume.pose.point(&p)))
}

/// The ball about everything visible and loaded, fragments where they were moved to.
pub fn ball_of_case(case: &Case, assets: &Assets) -> Ball {
    let scene = scene::scene(case, assets);
    Ball::about(scene::bounds(&scene.volumes, &scene.meshes).into_iter().flatten())
}

/// The window a volume gets before anybody has chosen: bone for CT (values below −500 are air), and
/// otherwise from the 1st to the 99th percentile of about 30 000 samples.
pub fn default_window(grid: &Grid) -> Window {
    let [low, high] = grid.range();
    if low < AIR_BELOW {
        return Window { level: 350.0, width: 1800.0 };
    }
    let count = grid.samples().len();
    let stride = (count / 30_000).max(1);
    let mut seen: Vec<f64> = (0..count).step_by(stride).map(|i| grid.value_at(i)).collect();
    seen.sort_by(f64::total_cmp);
    let at = |part: f64| seen.get((part * (seen.len().max(1) - 1) as f64) as usize).copied();
    let (low, high) = (at(0.01).unwrap_or(low), at(0.99).unwrap_or(high));
    let width = if high > low { high - low } else { 1.0 };
    Window { level: low + width / 2.0, width }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::host::camera::Facing;
    use render::volume::{Affine, Rescale, Samples};

    #[test]
    fn sections_lie_as_radiology_reads_them() {
        let letters = |o: Orientation| o.axes().map(|v| Facing::letters(&v));
        assert_eq!(letters(Orientation::Axial), ["L", "P"], "patient's right on the left, front on top");
        assert_eq!(letters(Orientation::Coronal), ["L", "I"], "as seen from the front");
        assert_eq!(letters(Orientation::Sagittal), ["P", "I"], "front on the left");
    }

    #[test]
    fn every_section_goes_through_the_crosshair() {
        let views = Views { crosshair: Some(Point::new(3.0, -40.0, 25.0)), ..Views::new() };
        let ball = Ball { centre: Point::new(100.0, 50.0, 0.0), radius_mm: 120.0 };
        for orientation in Orientation::ALL {
            let section = views.section(orientation, ball, [400.0, 300.0], 1.5).expect("section");
            let depth = section.depth_mm(&Point::new(3.0, -40.0, 25.0));
            assert!(depth.abs() < 1e-9, "{orientation:?} passes {depth} mm beside it");
            assert_eq!(section.size(), [600, 450], "in pixels, not points");
        }
    }

    #[test]
    fn the_first_window_is_bone_for_ct_and_the_bulk_of_the_values_otherwise() {
        let grid = |v: Vec<f32>| {
            Grid::new([v.len(), 1, 1], Samples::F32(v), Rescale::default(), Affine::identity()).expect("grid")
        };
        let ct = default_window(&grid(vec![-1000.0, 0.0, 900.0]));
        assert_eq!((ct.level, ct.width), (350.0, 1800.0), "bone");
        let mut values: Vec<f32> = (0..1000).map(|i| i as f32).collect();
        values.push(1e6);
        let mr = default_window(&grid(values));
        assert!((mr.level - 500.0).abs() < 15.0 && (mr.width - 980.0).abs() < 15.0, "one hot voxel: {mr:?}");
        assert_eq!(default_window(&grid(vec![5.0, 5.0])).width, 1.0, "a flat volume has a width");
    }
}
