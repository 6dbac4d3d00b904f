//! Volumes in space, a wgpu renderer of them, and an `f64` reference of what it should draw.
//!
//! [`volume`] is data in space, [`scene`] what to draw of it. [`renderer::Renderer`] draws a scene on a
//! [`gpu::Gpu`]; [`mod@reference`] draws the same scene on the CPU and shares no code with it; [`section`]
//! samples planes through the original data.
//!
//! # The way of a frame
//! A scene is gathered into convex solids, one a fragment, with its planes, cylinders, transfer table and
//! the texture of its bounding box. Opaque meshes are drawn by depth; translucent ones are captured in a
//! list for each pixel. Then one common stack of slabs, perpendicular to the view, is drawn
//! front to back: in each slab the polygons of its fragments, those that touch together, each pixel
//! integrating its ray through the slab and compositing the surfaces that lie in it.
//!
//! # Conventions
//! - Bind groups: 0 the frame; 1 volumes, or the pass's texture; 2 fragments and tables; 3 surfaces.
//! - Colours are display values, premultiplied in pictures, accumulated front to back in 32-bit float;
//!   the background comes last.
//! - Depth for the depth test is reversed: 1 near, 0 far. *Zeta* is the depth in mm behind the near plane
//!   of the stack. Shaders never see world coordinates.
//!
//! # References
//! - *Doi*: texture-based multi-volume rendering with 3D texture compression, the core of this system.
//! - *Engel 2001*: Engel, Kraus, Ertl, "High-quality pre-integrated volume rendering using
//!   hardware-accelerated pixel shading", Graphics Hardware 2001.
//! - *Yang 2010*: Yang, Hensley, Grün, Thibieroz, "Real-time concurrent linked list construction on the
//!   GPU", Computer Graphics Forum 29(4).
//! - *Shewchuk 1997*: "Adaptive precision floating-point arithmetic and fast robust geometric predicates",
//!   Discrete & Computational Geometry 18.

pub mod cells;
pub mod cpu;
mod gather;
pub mod gpu;
pub mod image;
mod passes;
pub mod recovery;
pub mod reference;
pub mod renderer;
pub mod scene;
pub mod section;
pub mod shader;
mod simd;
mod target;
mod texture;
mod transfer;
mod view;
pub mod volume;

pub use texture::{GridSource, SourceError, StepDecoder, Stored, TextureSummary, decode_on_device};
