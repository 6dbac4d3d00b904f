//! The tools: one folder each, none knowing another. [`register_all`] is the one list of them.
//!
//! To add one: a folder with `mod.rs` (state, `impl Tool`), `panel.rs` (egui only) and files named by
//! what they compute, free of egui; then a line here. The test below draws it from then on.

use crate::host::registry::{Registry, RegistryError};

pub mod cutting;
pub mod fragments;
pub mod implants;
pub mod labels;
pub mod player;
pub mod sections;
pub mod simulation;
pub mod transfer;
pub mod volumes;

#[cfg(test)]
mod tests;

/// Adds every tool, in the order shown.
///
/// # Errors
/// [`RegistryError::Duplicate`] where two have one id.
pub fn register_all(registry: &mut Registry) -> Result<(), RegistryError> {
    registry.add::<volumes::Volumes>()?;
    registry.add::<transfer::TransferTool>()?;
    registry.add::<cutting::Cutting>()?;
    registry.add::<fragments::Fragments>()?;
    registry.add::<implants::Implants>()?;
    registry.add::<simulation::Simulation>()?;
    registry.add::<labels::LabelsTool>()?;
    registry.add::<sections::Sections>()?;
    registry.add::<player::Player>()?;
    Ok(())
}
