//! The plan that the program opens with: an intertrochanteric osteotomy, exploded, with a trial stem.
//!
//! Two planes make three fragments: the head, which stays with the pelvis; the greater trochanter,
//! lifted off; and the shaft, turned about the neck's axis and drawn away, with the stem in it. No
//! plane meets the pelvis below the first one, so the picture is that of the operation.

use std::collections::BTreeMap;
use std::sync::Arc;

use render::scene::{Camera, Projection, Shading};
use render::volume::{Affine, Cutter, Side, Vector};

use super::table as t;
use crate::case::{Case, Fragment, Implant, NamedCutter, Source, Volume};
use crate::presets;

/// Where the first cut crosses the neck's axis, from the head's centre; mm.
const CUT_MM: f64 = 36.0;
/// How far the shaft is turned about the neck's axis, backwards at its lower end; degrees.
const TURN_DEG: f64 = 10.0;
/// How far the shaft is drawn away along the neck's axis; mm.
const APART_MM: f64 = 11.0;

fn source(name: &str) -> Source {
    Source::Builtin(name.to_owned())
}

/// What the shaft, and the stem in it, are moved by; world from unmoved.
pub(super) fn shaft_pose() -> Affine {
    let neck = t::neck_axis();
    let turn = Affine::rotation_about(t::head_centre(), neck, -TURN_DEG.to_radians());
    Affine::translation(-neck * APART_MM) * turn
}

/// What the trochanter is moved by; world from unmoved.
fn trochanter_pose() -> Affine {
    let hinge = t::neck_shaft_junction() + Vector::new(12.0, 5.0, 8.0);
    let turn = Affine::rotation_about(hinge, Vector::y(), 14.0_f64.to_radians());
    Affine::translation(Vector::new(15.0, -1.0, 4.0)) * turn
}

pub(super) fn case() -> Case {
    let head = t::head_centre();
    let cuts = [
        Cutter::plane(head - t::neck_axis() * CUT_MM, Vector::new(0.86, 0.18, -0.47).normalize()),
        Cutter::plane(head + Vector::new(46.0, 14.0, -33.0), Vector::new(0.80, 0.10, 0.59).normalize()),
    ];
    let ids = ["intertrochanteric", "trochanteric"];
    // The numbers above are those of planes, so none is left out.
    let cutters =
        ids.iter().zip(cuts).filter_map(|(id, cut)| Some(NamedCutter::new(*id, cut.ok()?))).collect();
    let piece = |id: &str, keep: &[(&str, Side)], pose: Affine| {
        let keep: BTreeMap<String, Side> = keep.iter().map(|(id, side)| ((*id).to_owned(), *side)).collect();
        Fragment { pose, ..Fragment::new(id, "ct", keep) }
    };
    let fragments = vec![
        piece("head", &[(ids[0], Side::Minus)], Affine::identity()),
        piece("trochanter", &[(ids[0], Side::Plus), (ids[1], Side::Plus)], trochanter_pose()),
        piece("shaft", &[(ids[0], Side::Plus), (ids[1], Side::Minus)], shaft_pose()),
    ];
    let range = [-1024.0, 3071.0];
    let ct = presets::by_name("CT-Bones").and_then(|p| p.transfer(range).ok());
    let ct = Arc::new(ct.unwrap_or_else(|| presets::default_for(Some("CT"), range)));
    let mri = Arc::new(presets::default_for(Some("MR"), [0.0, 1024.0]));
    let volumes = vec![
        Volume { shading: Shading::Lit, ..Volume::new("ct", source("hip/ct"), ct) },
        Volume {
            pose: t::registration(),
            visible: false,
            shading: Shading::Lit,
            ..Volume::new("mri", source("hip/mri"), mri)
        },
    ];
    let implants = vec![Implant {
        pose: shaft_pose() * t::stem_pose(),
        color: [0.36, 0.64, 0.95],
        opacity: 0.6,
        ..Implant::new("stem", source("hip/stem"))
    }];
    let target = head + Vector::new(2.0, 4.0, -22.0);
    let camera = Camera {
        eye: target + Vector::new(190.0, -385.0, 60.0),
        target,
        up: Vector::z(),
        projection: Projection::Perspective { fov_rad: 28.0_f64.to_radians() },
    };
    Case {
        name: "Sample: left hip".to_owned(),
        volumes,
        cutters,
        fragments,
        implants,
        camera: Some(camera),
        background: [0.035, 0.045, 0.065],
        ..Case::default()
    }
}
