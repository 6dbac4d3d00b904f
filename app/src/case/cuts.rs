//! What cutters leave of implants, kept while nothing that it depends on changes.
//!
//! A cutter acts on the surface in its place; the cut is made in the model's own frame, so that vertices it
//! does not touch stay as they are. Round cutters become facets within
//! [`DEFAULT_SAGITTA_MM`] of their wall.

use std::collections::BTreeMap;
use std::sync::{Arc, Mutex, PoisonError};

use render::volume::cut::{CutError, DEFAULT_SAGITTA_MM, Solid, SolidError, by_solid};
use render::volume::{Affine, Cutter, Side, TriangleMesh};
use thiserror::Error;

/// Why a surface cannot be cut.
#[derive(Debug, Clone, PartialEq, Error)]
enum Fault {
    #[error(transparent)]
    Solid(#[from] SolidError),
    #[error(transparent)]
    Cut(#[from] CutError),
}

/// What is left of a surface.
#[derive(Debug, Clone)]
pub struct Cut {
    /// In the model's own frame; none where nothing is left.
    pub mesh: Option<Arc<TriangleMesh>>,
    /// Lines of the cuts that do not close, since the surface is open there.
    pub open: usize,
}

/// A cut with all that it depends on.
#[derive(Debug, Clone)]
struct Known {
    whole: Arc<TriangleMesh>,
    world_from_model: Affine,
    keep: Vec<(Cutter, Side)>,
    cut: Cut,
}

/// The last cut of each implant.
#[derive(Debug, Clone, Default)]
pub struct Cuts {
    known: Arc<Mutex<BTreeMap<String, Known>>>,
}

impl Cuts {
    /// The part of a surface on the kept sides, for the implant `id`. A surface that cannot be cut shows nothing,
    /// with a line in the log, rather than something that is not planned.
    pub fn cut(
        &self,
        id: &str,
        whole: &Arc<TriangleMesh>,
        world_from_model: &Affine,
        keep: Vec<(Cutter, Side)>,
    ) -> Cut {
        let mut known = self.known.lock().unwrap_or_else(PoisonError::into_inner);
        if keep.is_empty() {
            known.remove(id);
            return Cut { mesh: Some(Arc::clone(whole)), open: 0 };
        }
        if let Some(known) = known.get(id)
            && Arc::ptr_eq(&known.whole, whole)
            && known.world_from_model == *world_from_model
            && known.keep == keep
        {
            return known.cut.clone();
        }
        let cut = made(whole, world_from_model, &keep).unwrap_or_else(|fault| {
            log::warn!("an implant is not shown, since it cannot be cut: {fault}");
            Cut { mesh: None, open: 0 }
        });
        let (whole, world_from_model) = (Arc::clone(whole), *world_from_model);
        known.insert(id.to_owned(), Known { whole, world_from_model, keep, cut: cut.clone() });
        cut
    }
}

fn made(whole: &Arc<TriangleMesh>, world_from_model: &Affine, keep: &[(Cutter, Side)]) -> Result<Cut, Fault> {
    let model_from_world = world_from_model.inverse();
    let mut cut = Cut { mesh: Some(Arc::clone(whole)), open: 0 };
    for (cutter, side) in keep {
        let Some(mesh) = &cut.mesh else { break };
        let (body, is_inside) = cutter.solid(*side);
        let solid = Solid::of(&body, DEFAULT_SAGITTA_MM)?.transformed(&model_from_world)?;
        let parts = by_solid(mesh, &solid)?;
        let part = if is_inside { parts.minus } else { parts.plus };
        cut = Cut { mesh: part.map(Arc::new), open: cut.open + parts.notes.open };
    }
    Ok(cut)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::sample;
    use render::volume::{Point, Vector};

    /// The divergence theorem about one vertex: right for a closed surface only.
    fn volume(cut: &Cut) -> f64 {
        cut.mesh.as_ref().map_or(0.0, |mesh| mesh.volume_mm3())
    }

    #[test]
    fn the_parts_of_the_sample_stem_add_up_to_it() {
        let stem = sample::stem().expect("stem");
        let turned = Affine::rotation_about(Point::new(3.0, -2.0, 1.0), Vector::new(0.2, 1.0, 0.4), 0.7);
        let place = Affine::translation(Vector::new(120.0, -40.0, 900.0)) * turned;
        let middle = place.point(&Point::new(0.0, 0.0, -40.0));
        let plane = Cutter::plane(middle, Vector::new(0.1, 0.3, 1.0)).expect("plane");
        let drill = Cutter::cylinder(middle, Vector::new(1.0, 0.2, 0.0), 5.0).expect("drill");
        let whole = stem.volume_mm3();
        let mut sum = 0.0;
        for first in [Side::Plus, Side::Minus] {
            for second in [Side::Plus, Side::Minus] {
                let keep = vec![(plane, first), (drill, second)];
                let cut = Cuts::default().cut("stem", &stem, &place, keep);
                assert_eq!(cut.open, 0, "closed");
                assert!(volume(&cut) > 0.01 * whole, "all four are there");
                sum += volume(&cut);
            }
        }
        assert!((sum - whole).abs() < 1e-10 * whole, "{sum} mm³ of {whole}");
    }
}
