//! The pointer in the 3D view, as tools see it: in the picture and as a ray in world mm.

use super::camera::{Lens, Ray};

/// What happened.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Phase {
    /// It moved with no button down.
    Hover,
    /// The main button went down, without modifier keys.
    Press,
    /// It moved with the main button down.
    Drag,
    /// The main button went up.
    Release,
    /// Escape was pressed during a drag, or the window lost the pointer: put back what was dragged.
    Cancel,
}

/// One thing the pointer did in the 3D view.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PointerEvent {
    /// What happened.
    pub phase: Phase,
    /// Where, in points from the picture's upper left corner.
    pub at: [f64; 2],
    /// The picture it happened in.
    pub lens: Lens,
}

impl PointerEvent {
    /// The ray under the pointer.
    pub fn ray(&self) -> Ray {
        self.lens.ray(self.at)
    }

    /// Distance in points from the pointer to where a place is seen; infinite behind the eye.
    pub fn distance_to(&self, p: &render::volume::Point) -> f64 {
        self.lens.project(p).map_or(f64::INFINITY, |[x, y]| (x - self.at[0]).hypot(y - self.at[1]))
    }
}

/// One thing the pointer did in a section.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SectionEvent {
    /// What happened.
    pub phase: Phase,
    /// The place in the section's plane; world mm.
    pub place: render::volume::Point,
}
