//! What to draw, as plain data. No GPU, no files: the renderer and the `f64` reference both read it.

use std::fmt;
use std::sync::Arc;

use thiserror::Error;

use crate::volume::cells::{CellGrid, Scalar};
use crate::volume::{Affine, Cutter, Grid, PackedStep, Point, Side, Transfer, TriangleMesh, Vector};

/// How a surface or a volume is lit.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Shading {
    /// The plain colour.
    None,
    /// Lit from the eye: a volume by the gradient of its scalar (Blinn-Phong), a surface by its face
    /// normal. See [`light`] for the numbers.
    Lit,
}

/// The one light: white, at the eye, so that half vector, light and view direction are one.
pub mod light {
    use crate::volume::Transfer;

    /// Part of the colour that needs no light.
    pub const AMBIENT: f64 = 0.3;
    /// Part that goes with |n·v|.
    pub const DIFFUSE: f64 = 0.7;
    /// White added with |n·v|^[`SHININESS`].
    pub const SPECULAR: f64 = 0.2;
    /// Exponent of the highlight.
    pub const SHININESS: f64 = 20.0;
    /// Gradients below this part of [`value_span`] per mm do not light: the colour stays plain there, so
    /// that noise in flat regions makes no pattern.
    pub const FLAT: f64 = 1e-3;

    /// What a volume's gradients are measured by, in the unit of its values.
    ///
    /// The span of the transfer function's control points; where all are at one value, that of the volume's
    /// values, `range` from least to greatest. Infinite where the volume has but one value too: what differs
    /// there is rounding, and nothing lights.
    pub fn value_span(transfer: &Transfer, range: [f64; 2]) -> f64 {
        let points = transfer.points();
        let spans = [points[points.len() - 1].value - points[0].value, range[1] - range[0]];
        spans.into_iter().find(|&span| span > 0.0).unwrap_or(f64::INFINITY)
    }
}

/// How a volume's samples are kept for drawing.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
#[non_exhaustive]
pub enum TextureFormat {
    /// The renderer's choice: [`TextureFormat::R16`] where it fits, else the most accurate that does.
    Auto,
    /// 16 bits a voxel over the grid's range; exact for whole numbers that span less than 65 536.
    R16,
    /// 32-bit float.
    R32f,
    /// BC4 blocks of the scalar, 4 bits a voxel; classified after interpolation.
    Bc4,
    /// Scalar in the two planes of BC5 blocks, coarse and residual, 8 bits a voxel; classified after interpolation.
    Bc5,
    /// Pre-classified colour, 32 bits a voxel.
    Rgba8,
    /// Pre-classified colour in BC3 (DXT5) blocks, 8 bits a voxel: Doi's format.
    Bc3,
    /// Pre-classified colour in BC7 blocks, 8 bits a voxel.
    Bc7,
}

impl TextureFormat {
    /// Its name in a case file: `"r16"`.
    pub fn name(self) -> &'static str {
        match self {
            Self::Auto => "auto",
            Self::R16 => "r16",
            Self::R32f => "r32f",
            Self::Bc4 => "bc4",
            Self::Bc5 => "bc5",
            Self::Rgba8 => "rgba8",
            Self::Bc3 => "bc3",
            Self::Bc7 => "bc7",
        }
    }
}

impl fmt::Display for TextureFormat {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.name())
    }
}

/// One piece of a volume: what all of `keep` keeps, moved by `pose`.
#[derive(Debug, Clone, PartialEq)]
pub struct Piece {
    /// Cutters in world space, about the volume in its unmoved place, with the side kept.
    pub keep: Vec<(Cutter, Side)>,
    /// `world_from_unmoved`, rigid.
    pub pose: Affine,
}

impl Piece {
    /// All of the volume, where it is.
    pub fn whole() -> Self {
        Self { keep: Vec::new(), pose: Affine::identity() }
    }
}

/// How a volume becomes a picture; what each means is said in [`mod@crate::reference`].
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub enum VolumeMode {
    /// Emission and absorption along the ray.
    #[default]
    Composite,
    /// The greatest value on the ray, classified once.
    Mip,
    /// The surface where the scalar has a value, lit from the eye, in the transfer function's colour there.
    Isosurface {
        /// Of the scalar.
        value: f64,
        /// Of each crossing; 0 to 1, 1 is opaque.
        opacity: f64,
    },
}

/// Regions painted on a volume: whole numbers on a grid of their own, that ride with its pieces.
///
/// Where the nearest label (see [`crate::volume::label_at`]) is n > 0 with colour (r, g, b, a), the colour c
/// that the transfer function gives there becomes (1 - a)·c + a·(r, g, b), before light; extinction stays.
#[derive(Debug, Clone, PartialEq)]
pub struct Labels {
    /// One label a sample; 0 is none.
    pub grid: Arc<Grid>,
    /// `world_from_patient` of the labels, about the volume in its unmoved place; most often the volume's own.
    pub pose: Affine,
    /// Red, green, blue and share of label n at `colors[n]`; 0 to 1. The first is not used; a label past the
    /// end is not painted.
    pub colors: Arc<[[f64; 4]]>,
}

impl Labels {
    /// The colour of a label that is painted.
    pub fn color(&self, label: u32) -> Option<[f64; 4]> {
        self.colors.get(label as usize).copied().filter(|c| label > 0 && c[3] > 0.0)
    }
}

/// A volume to draw.
#[derive(Debug, Clone)]
pub struct VolumeItem {
    /// Its samples.
    pub grid: Arc<Grid>,
    /// The same samples as the compressed step of a time series. Where given, the renderer makes its texture of
    /// this and `texture` is not asked; the reference and the sections read the grid.
    pub packed: Option<Arc<PackedStep>>,
    /// `world_from_patient`: where the whole volume is placed, after the grid's own `world_from_voxel`.
    pub pose: Affine,
    /// Colour and opacity.
    pub transfer: Arc<Transfer>,
    /// Lighting.
    pub shading: Shading,
    /// How it is kept on the GPU. The reference reads the grid itself and ignores this.
    pub texture: TextureFormat,
    /// The pieces to draw; none draws nothing.
    pub pieces: Vec<Piece>,
    /// What is painted on it.
    pub labels: Option<Labels>,
    /// What is drawn of it.
    pub mode: VolumeMode,
}

/// An unstructured grid to draw; unlit.
#[derive(Debug, Clone)]
pub struct CellItem {
    /// Points, cells and fields.
    pub grid: Arc<CellGrid>,
    /// Which of the grid's steps.
    pub step: usize,
    /// Which scalar.
    pub scalar: Scalar,
    /// `world_from_grid`.
    pub pose: Affine,
    /// Colour and opacity.
    pub transfer: Arc<Transfer>,
}

/// A surface to draw; every crossing of a ray with it composites, front and back faces alike.
#[derive(Debug, Clone)]
pub struct MeshItem {
    /// Its triangles.
    pub mesh: Arc<TriangleMesh>,
    /// `world_from_mesh`; may scale (a model in metres).
    pub pose: Affine,
    /// Display red, green, blue; 0 to 1.
    pub color: [f64; 3],
    /// 0 to 1; 1 is an opaque surface.
    pub opacity: f64,
    /// Lighting.
    pub shading: Shading,
}

/// How the picture plane is spanned.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Projection {
    /// Rays spread from the eye.
    Perspective {
        /// Vertical field of view; radians, in (0, π).
        fov_rad: f64,
    },
    /// Rays are parallel.
    Parallel {
        /// Height of the picture; mm, > 0.
        height_mm: f64,
    },
}

/// Where the picture is taken from; world mm.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Camera {
    /// Rays start in the plane through here, perpendicular to the view.
    pub eye: Point,
    /// The middle of the picture shows this.
    pub target: Point,
    /// Roughly upwards; where it is parallel to the view, another axis takes its place.
    pub up: Vector,
    /// Perspective or parallel.
    pub projection: Projection,
}

/// Why a camera shows nothing.
#[derive(Debug, Clone, PartialEq, Error)]
#[non_exhaustive]
pub enum CameraError {
    /// A number is NaN or infinite.
    #[error("the camera has a number that is not finite")]
    NotFinite,
    /// Eye and target are one point.
    #[error("the camera's eye and target are the same point")]
    NoDirection,
    /// The field of view is not between 0 and 180 degrees, or the height not positive.
    #[error("the camera's fov_deg must lie between 0 and 180, or its parallel_mm be positive")]
    Projection,
}

/// An orthonormal frame of a camera: right, up (picture's), forward; world directions.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct CameraFrame {
    /// Towards the picture's right.
    pub right: Vector,
    /// Towards the picture's top.
    pub up: Vector,
    /// Into the picture.
    pub forward: Vector,
}

impl Camera {
    /// The camera's axes. Where `up` has no part across the view, the world axis most across it is used.
    ///
    /// # Errors
    /// [`CameraError`].
    pub fn frame(&self) -> Result<CameraFrame, CameraError> {
        let numbers = self.eye.iter().chain(self.target.iter()).chain(self.up.iter());
        if numbers.copied().any(|v| !v.is_finite()) {
            return Err(CameraError::NotFinite);
        }
        let valid = match self.projection {
            Projection::Perspective { fov_rad } => fov_rad > 0.0 && fov_rad < std::f64::consts::PI,
            Projection::Parallel { height_mm } => height_mm > 0.0 && height_mm.is_finite(),
        };
        if !valid {
            return Err(CameraError::Projection);
        }
        let forward = (self.target - self.eye).try_normalize(0.0).ok_or(CameraError::NoDirection)?;
        let up = self.up.try_normalize(0.0).unwrap_or_else(Vector::zeros);
        let mut right = forward.cross(&up);
        if right.norm() < 1e-9 {
            let mut axis = Vector::zeros();
            axis[forward.iamin()] = 1.0;
            right = forward.cross(&axis);
        }
        let right = right.try_normalize(0.0).ok_or(CameraError::NoDirection)?;
        Ok(CameraFrame { right, up: right.cross(&forward), forward })
    }
}

/// Everything in one picture.
#[derive(Debug, Clone)]
pub struct Scene {
    /// Volumes, each as its pieces.
    pub volumes: Vec<VolumeItem>,
    /// Surfaces.
    pub meshes: Vec<MeshItem>,
    /// Unstructured grids.
    pub grids: Vec<CellItem>,
    /// The view.
    pub camera: Camera,
    /// Display colour behind everything.
    pub background: [f64; 3],
}

impl Scene {
    /// Whether there is nothing to draw.
    pub fn is_empty(&self) -> bool {
        self.volumes.is_empty() && self.meshes.is_empty() && self.grids.is_empty()
    }
}
