//! The camera as the shaders see it: view space, and forms that are linear along a pixel's ray.
//!
//! View space is millimetres from the eye, x right, y up, z into the picture. All of it is worked out in
//! `f64`; what a shader gets is relative to the near plane of the slab stack, so that neither a far eye
//! nor a far scene costs digits.

use crate::scene::{Camera, CameraError, Projection};
use crate::volume::{Affine, Point, Vector, convex::HalfSpace};

/// GPU mirrors of `shader/shared/frame.wgsl`.
pub(crate) mod gpu_data {
    /// `Frame`.
    #[repr(C)]
    #[derive(Debug, Clone, Copy, PartialEq, bytemuck::Pod, bytemuck::Zeroable)]
    pub(crate) struct Frame {
        pub(crate) size: [f32; 2],
        pub(crate) band_first: u32,
        pub(crate) layer_capacity: u32,
        pub(crate) lens: [f32; 2],
        pub(crate) perspective: f32,
        pub(crate) near_mm: f32,
        pub(crate) depth_mm: f32,
        pub(crate) step_mm: f32,
        pub(crate) steps: u32,
        pub(crate) layer_most: u32,
        pub(crate) background: [f32; 4],
        pub(crate) through: f32,
        pub(crate) pad_0: f32,
        pub(crate) pad_1: f32,
        pub(crate) pad_2: f32,
    }

    /// `Form`: a value affine in (1, ndc x, ndc y), and its growth per mm of zeta.
    #[repr(C)]
    #[derive(Debug, Clone, Copy, PartialEq, Default, bytemuck::Pod, bytemuck::Zeroable)]
    pub(crate) struct Form {
        pub(crate) at_near: [f32; 4],
        pub(crate) per_mm: [f32; 4],
    }
}

pub(crate) use gpu_data::Form;

/// A camera over a picture of a size.
#[expect(clippy::struct_field_names, reason = "a transform is named by its ends")]
#[derive(Debug, Clone, Copy)]
pub(crate) struct View {
    /// `view_from_world`.
    pub(crate) view_from_world: Affine,
    /// Tangents of half the field of view, or half the picture in mm, x and y.
    pub(crate) lens: [f64; 2],
    /// Whether rays spread.
    pub(crate) perspective: bool,
    /// Pixels.
    pub(crate) size: [u32; 2],
}

impl View {
    pub(crate) fn new(camera: &Camera, size: [u32; 2]) -> Result<Self, CameraError> {
        let frame = camera.frame()?;
        let world_from_view = Affine::from_columns(frame.right, frame.up, frame.forward, camera.eye)
            .map_err(|_singular| CameraError::NotFinite)?;
        let aspect = f64::from(size[0]) / f64::from(size[1]);
        let (half, perspective) = match camera.projection {
            Projection::Perspective { fov_rad } => ((fov_rad / 2.0).tan(), true),
            Projection::Parallel { height_mm } => (height_mm / 2.0, false),
        };
        let view_from_world = world_from_view.inverse();
        Ok(Self { view_from_world, lens: [half * aspect, half], perspective, size })
    }

    /// The form of n·p + d over view space, seen from the near plane at `near_mm`.
    pub(crate) fn form(&self, value: &HalfSpace, near_mm: f64) -> Form {
        let n = value.normal;
        let [x, y] = [n.x * self.lens[0], n.y * self.lens[1]];
        let row = |constant: f64, x: f64, y: f64| [constant as f32, x as f32, y as f32, 0.0];
        if self.perspective {
            Form {
                at_near: row(near_mm * n.z + value.offset, near_mm * x, near_mm * y),
                per_mm: row(n.z, x, y),
            }
        } else {
            Form { at_near: row(near_mm * n.z + value.offset, x, y), per_mm: row(n.z, 0.0, 0.0) }
        }
    }

    /// The form of one row of an affine transform from view space.
    pub(crate) fn row_form(&self, thing_from_view: &Affine, row: usize, near_mm: f64) -> Form {
        let m = thing_from_view.matrix();
        let normal = Vector::new(m[(row, 0)], m[(row, 1)], m[(row, 2)]);
        self.form(&HalfSpace { normal, offset: m[(row, 3)] }, near_mm)
    }

    /// Normalised coordinates of a place in view space; `None` at or behind a perspective eye's plane.
    pub(crate) fn ndc(&self, p: &Point) -> Option<[f64; 2]> {
        let depth = if self.perspective { p.z } else { 1.0 };
        (depth > 1e-6).then(|| [p.x / (self.lens[0] * depth), p.y / (self.lens[1] * depth)])
    }
}
