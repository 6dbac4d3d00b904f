//! What the views show, beside the case: crosshair, sections, windows. All of it may be lost on exit.

use std::collections::BTreeMap;

use egui::Color32;
use nalgebra::{Rotation3, Unit};
use render::section::{Layer, Section, SectionError, Slab, Window};
use render::volume::{Grid, Point, Vector};

use super::camera::Ball;
use crate::case::{Assets, Case, Volume};
use crate::{scene, sections};

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

/// Pan, zoom, turn and thickness of one section; what is `None` fits the volumes.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct SectionState {
    /// World place in the middle of the picture; its part across the section is the crosshair's.
    pub centre: Option<Point>,
    /// Millimetres per point of the screen.
    pub mm_per_point: Option<f64>,
    /// How it is turned from the body's planes.
    pub turn: Rotation3<f64>,
    /// How thick it is.
    pub slab: Slab,
}

/// The state of all views.
#[derive(Debug, Clone, Default)]
pub struct Views {
    /// Where the sections cross; world mm. `None` until a volume or a grid is there.
    pub crosshair: Option<Point>,
    /// Pan and zoom, by [`Orientation::index`].
    pub sections: [SectionState; 3],
    /// Window and level, by volume id.
    pub windows: BTreeMap<String, Window>,
    /// The one view that fills the window; none shows all four.
    pub only: Option<ViewId>,
}

impl Views {
    /// All views at their first state: everything fits.
    pub fn new() -> Self {
        Self::default()
    }

    /// Gives volumes that are new a window, and the crosshair a place: the middle of the first volume, or else grid.
    pub fn adopt(&mut self, case: &Case, assets: &Assets) {
        for volume in &case.volumes {
            let Some(grid) = assets.grid(volume) else { continue };
            if !self.windows.contains_key(&volume.id) {
                self.windows.insert(volume.id.clone(), sections::default_window(&grid));
            }
            if self.crosshair.is_none() && volume.visible {
                self.crosshair = Some(ball_of(volume, &grid).centre);
            }
        }
        let waits = case.volumes.iter().any(|v| v.visible && assets.grid(v).is_none());
        if self.crosshair.is_none() && !waits {
            let first = case.grids.iter().find_map(|grid| scene::grid(case, grid, assets));
            self.crosshair = first.map(|item| {
                let [low, high] = item.grid.bounds();
                item.pose.point(&nalgebra::center(&low, &high))
            });
        }
    }

    /// The visible volumes as the sections show them.
    pub fn layers(&self, case: &Case, assets: &Assets) -> Vec<Layer> {
        sections::layers(case, assets, &self.windows)
    }

    /// Towards the right and the lower edge of a section as it is turned; LPS unit vectors.
    pub fn axes(&self, orientation: Orientation) -> [Vector; 2] {
        let turn = self.sections[orientation.index()].turn;
        orientation.axes().map(|axis| turn * axis)
    }

    /// The direction across a section as it is turned that runs with the body's axis: to the left, the back or
    /// the head.
    pub fn normal(&self, orientation: Orientation) -> Vector {
        let mut axis = Vector::zeros();
        axis[orientation.normal_axis()] = 1.0;
        self.sections[orientation.index()].turn * axis
    }

    /// Turns a section by an angle about an axis; radians, right-handed. An axis of no length turns nothing.
    pub fn turn(&mut self, orientation: Orientation, axis: &Vector, angle_rad: f64) {
        if let Some(axis) = Unit::try_new(*axis, 1e-12)
            && angle_rad.is_finite()
        {
            let turn = &mut self.sections[orientation.index()].turn;
            *turn = Rotation3::from_axis_angle(&axis, angle_rad) * *turn;
            // Many small turns of a drag must not add up to something that is no rotation.
            turn.renormalize();
        }
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
        let normal = self.normal(orientation);
        let mut centre = state.centre.unwrap_or(ball.centre);
        centre += normal * normal.dot(&(self.crosshair.unwrap_or(ball.centre) - centre));
        let mm_per_point = state.mm_per_point.unwrap_or_else(|| fit(ball, size_points));
        let [right, down] = self.axes(orientation);
        let size = size_points.map(|s| (s * pixels_per_point).round().max(1.0) as usize);
        Section::new(centre, right, down, mm_per_point / pixels_per_point, size)?.with_slab(state.slab)
    }

    /// Everything fits again; turns and thicknesses stay.
    pub fn fit(&mut self) {
        for state in &mut self.sections {
            (state.centre, state.mm_per_point) = (None, None);
        }
    }
}

/// Millimetres per point at which a ball fits a picture.
fn fit(ball: Ball, size_points: [f64; 2]) -> f64 {
    // A box's section is smaller than its ball's: 0.8 of it is what a body fills.
    0.8 * 2.0 * ball.radius_mm / size_points[0].min(size_points[1]).max(1.0)
}

/// The ball about a volume where it was acquired and placed, its fragments unmoved.
pub fn ball_of(volume: &Volume, grid: &Grid) -> Ball {
    Ball::about(grid.corners_in_world().map(|p| volume.pose.point(&p)))
}

/// The ball about everything visible and loaded, fragments where they were moved to.
pub fn ball_of_case(case: &Case, assets: &Assets) -> Ball {
    let scene = scene::scene(case, assets);
    Ball::about(scene::bounds(&scene).into_iter().flatten())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::host::camera::Facing;

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
    fn a_turned_section_still_goes_through_the_crosshair_and_its_letters_turn_with_it() {
        let crosshair = Point::new(3.0, -40.0, 25.0);
        let mut views = Views { crosshair: Some(crosshair), ..Views::new() };
        let ball = Ball { centre: Point::new(100.0, 50.0, 0.0), radius_mm: 120.0 };
        for _ in 0..45 {
            views.turn(Orientation::Axial, &Vector::x(), 1.0_f64.to_radians());
        }
        let section = views.section(Orientation::Axial, ball, [40.0, 30.0], 1.0).expect("section");
        assert!(section.depth_mm(&crosshair).abs() < 1e-9, "through the crosshair");
        let half = std::f64::consts::FRAC_1_SQRT_2;
        assert!((section.down() - Vector::new(0.0, half, half)).norm() < 1e-12, "half a right angle");
        assert_eq!(Facing::letters(&section.right()), "L", "what it was turned about stays");
        assert_eq!(Facing::letters(&section.down()).len(), 2, "between two sides: both letters");
        assert!((views.normal(Orientation::Axial) - section.forward()).norm() < 1e-12, "its normal");
        views.sections[0].turn = Rotation3::identity();
        assert_eq!(views.axes(Orientation::Axial), [Vector::x(), Vector::y()], "reset");
    }
}
