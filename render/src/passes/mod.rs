//! The passes of a frame, in their order: opaque surfaces, capture and sorting of translucent ones,
//! slabs of volume with the surfaces between them, presentation.

pub(crate) mod present;
pub(crate) mod slabs;
pub(crate) mod surfaces;
