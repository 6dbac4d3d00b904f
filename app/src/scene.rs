//! From a case and its loaded data to what the renderers draw. Pure: no files, no GPU, no window.
//!
//! What is hidden, or not loaded yet, is left out. Where the case has no camera, [`fit`] shows
//! everything that is drawn, seen from the front of the patient.

use std::sync::Arc;

use render::scene::{Camera, Labels, MeshItem, Piece, Projection, Scene, VolumeItem};
use render::volume::{Affine, Point, Vector};

use crate::case::labels::{LabelSet, MAX_LABEL};
use crate::case::{Assets, Case, Implant, Volume};

/// Vertical field of view of a camera that the case does not give; degrees.
pub const DEFAULT_FOV_DEG: f64 = 30.0;

/// What a case shows.
pub fn scene(case: &Case, assets: &Assets) -> Scene {
    let volumes: Vec<VolumeItem> = case.volumes.iter().filter_map(|v| volume(case, v, assets)).collect();
    let meshes: Vec<MeshItem> = case.implants.iter().filter_map(|i| implant(i, assets)).collect();
    let camera = case.camera.unwrap_or_else(|| {
        let bounds = bounds(&volumes, &meshes).unwrap_or([Point::from([-100.0; 3]), Point::from([100.0; 3])]);
        fit(bounds, Vector::y(), Vector::z())
    });
    Scene { volumes, meshes, camera, background: case.background }
}

fn volume(case: &Case, volume: &Volume, assets: &Assets) -> Option<VolumeItem> {
    if !volume.visible {
        return None;
    }
    let grid = assets.grid(volume)?;
    let packed = assets.steps(volume).and_then(|steps| steps.packed(volume.step));
    let mut fragments = case.fragments_of(&volume.id).peekable();
    let pieces: Vec<Piece> = if fragments.peek().is_none() {
        vec![Piece::whole()]
    } else {
        fragments.filter(|f| f.visible).map(|f| case.piece(f)).collect()
    };
    if pieces.is_empty() {
        return None;
    }
    Some(VolumeItem {
        packed,
        grid,
        pose: volume.pose,
        transfer: Arc::clone(&volume.transfer),
        shading: volume.shading,
        texture: volume.texture,
        pieces,
        labels: labels(case, volume, assets),
        mode: volume.mode,
    })
}

/// What is painted on a volume: its first visible label set, where loaded.
pub fn labels(case: &Case, volume: &Volume, assets: &Assets) -> Option<Labels> {
    let set = case.labels_of(&volume.id)?;
    let found = assets.labels(case, set)?;
    let most = found.counts.keys().next_back().copied()?.min(MAX_LABEL);
    // A set without a source lies on the volume's own grid, one with a source where its file says: both in the
    // patient's space, that the volume's pose places.
    Some(Labels { grid: found.grid, pose: volume.pose, colors: colors(set, most) })
}

fn colors(set: &LabelSet, most: u32) -> Arc<[[f64; 4]]> {
    std::iter::once([0.0; 4]).chain((1..=most).map(|label| set.color(label))).collect()
}

fn implant(implant: &Implant, assets: &Assets) -> Option<MeshItem> {
    if !implant.visible || implant.opacity == 0.0 {
        return None;
    }
    Some(MeshItem {
        mesh: Arc::clone(assets.mesh(implant)?),
        pose: world_from_model(implant),
        color: implant.color,
        opacity: implant.opacity,
        shading: implant.shading,
    })
}

/// Where the model's own coordinates lie: its pose after its scale.
pub fn world_from_model(implant: &Implant) -> Affine {
    if implant.scale == 1.0 {
        return implant.pose;
    }
    let s = implant.scale;
    let axes = [Vector::x() * s, Vector::y() * s, Vector::z() * s];
    // A scale is checked to be positive and finite; one so small that it flattens space is as if unscaled.
    Affine::from_columns(axes[0], axes[1], axes[2], Point::origin())
        .map_or(implant.pose, |mm_from_model| implant.pose * mm_from_model)
}

/// The corners of a volume's box in its unmoved place, world mm: what [`crate::case::Edit::Split`] asks for.
pub fn unmoved_corners(volume: &Volume, assets: &Assets) -> Option<[Point; 8]> {
    let grid = assets.grid(volume)?;
    Some(grid.corners_in_world().map(|p| volume.pose.point(&p)))
}

/// Least and greatest coordinates of everything drawn; world mm. Fragments count with the part of
/// their volume's box that planes leave them, moved; none where nothing is drawn.
pub fn bounds(volumes: &[VolumeItem], meshes: &[MeshItem]) -> Option<[Point; 2]> {
    let mut low = Point::from([f64::INFINITY; 3]);
    let mut high = Point::from([f64::NEG_INFINITY; 3]);
    let mut take = |p: Point| {
        low = low.inf(&p);
        high = high.sup(&p);
    };
    for item in volumes {
        let corners = item.grid.corners_in_world().map(|p| item.pose.point(&p));
        for piece in &item.pieces {
            for p in crate::case::split::hull_of(&piece.keep, &corners) {
                take(piece.pose.point(&p));
            }
        }
    }
    for item in meshes {
        for p in item.mesh.positions() {
            take(item.pose.point(p));
        }
    }
    (low.x <= high.x).then_some([low, high])
}

/// A camera that shows all of a box: along `forward`, with `up` upwards, [`DEFAULT_FOV_DEG`] wide.
/// World +y is to the back (LPS), so `forward = +y` looks at the patient from the front.
pub fn fit(bounds: [Point; 2], forward: Vector, up: Vector) -> Camera {
    let target = nalgebra::center(&bounds[0], &bounds[1]);
    let fov_rad = DEFAULT_FOV_DEG.to_radians();
    // The sphere about the box fits in the cone of view; a point still needs some distance.
    let radius = ((bounds[1] - bounds[0]).norm() / 2.0).max(1.0);
    let distance = radius / (fov_rad / 2.0).sin();
    let forward = forward.try_normalize(0.0).unwrap_or_else(Vector::y);
    Camera { eye: target - forward * distance, target, up, projection: Projection::Perspective { fov_rad } }
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeMap;

    use super::*;
    use crate::case::assets::{Asset, Data, Key};
    use crate::case::{Edit, Source, edit};
    use crate::presets;
    use render::volume::{Cutter, Grid, Rescale, Samples, TriangleMesh};

    fn planned() -> (Case, Assets) {
        let mut case = Case::default();
        let transfer = Arc::new(presets::default_for(Some("CT"), [0.0, 1.0]));
        let volume = Volume::new("ct", Source::Builtin("a".to_owned()), transfer);
        let mut implant = Implant::new("stem", Source::Builtin("b".to_owned()));
        implant.scale = 1000.0;
        implant.pose = Affine::translation(Vector::new(0.0, 0.0, 7.0));
        let grid = Grid::new([4, 4, 4], Samples::U8(vec![0; 64]), Rescale::default(), Affine::identity());
        let corners = vec![Point::origin(), Point::new(0.01, 0.0, 0.0), Point::new(0.0, 0.01, 0.0)];
        let mesh = TriangleMesh::new(corners, vec![[0, 1, 2]]).expect("mesh");
        let mut assets = Assets::default();
        for (key, data) in [
            (Key::of_volume(&volume), Data::Grid(Arc::new(grid.expect("grid")))),
            (Key::of_implant(&implant), Data::Mesh(Arc::new(mesh))),
        ] {
            let name = String::new();
            assets.insert(Arc::new(Asset { key, name, format: "test", modality: None, data, notes: vec![] }));
        }
        case.volumes.push(volume);
        case.implants.push(implant);
        (case, assets)
    }

    #[test]
    fn what_is_hidden_or_not_loaded_is_left_out() {
        let (mut case, assets) = planned();
        let all = scene(&case, &assets);
        assert_eq!((all.volumes.len(), all.meshes.len()), (1, 1), "both");
        let nothing = scene(&case, &Assets::default());
        assert_eq!((nothing.volumes.len(), nothing.meshes.len()), (0, 0), "not loaded");
        case.volumes[0].visible = false;
        case.implants[0].opacity = 0.0;
        let hidden = scene(&case, &assets);
        assert_eq!((hidden.volumes.len(), hidden.meshes.len()), (0, 0), "hidden");
    }

    #[test]
    fn a_volume_with_fragments_is_its_visible_fragments_only() {
        let (mut case, assets) = planned();
        let cutter = Cutter::plane(Point::new(1.0, 0.0, 0.0), Vector::x()).expect("plane");
        let corners = unmoved_corners(&case.volumes[0], &assets).expect("loaded");
        let named = crate::case::NamedCutter::new("c", cutter);
        edit::apply(&mut case, Edit::AddCutter(named)).expect("cutter");
        let split = Edit::Split { volume: "ct".to_owned(), cutters: vec!["c".to_owned()], corners };
        edit::apply(&mut case, split).expect("split");
        assert_eq!(scene(&case, &assets).volumes[0].pieces.len(), 2, "two pieces, no whole");
        case.fragments[0].visible = false;
        assert_eq!(scene(&case, &assets).volumes[0].pieces.len(), 1, "the other");
        case.fragments[1].visible = false;
        assert!(scene(&case, &assets).volumes.is_empty(), "all hidden");
    }

    #[test]
    fn a_model_in_metres_is_scaled_before_it_is_placed() {
        let (case, _) = planned();
        let at = world_from_model(&case.implants[0]).point(&Point::new(0.01, 0.0, 0.0));
        assert!((at - Point::new(10.0, 0.0, 7.0)).norm() < 1e-9, "{at}");
    }

    #[test]
    fn the_default_camera_sees_everything_from_the_front() {
        let (mut case, assets) = planned();
        case.fragments.push(crate::case::Fragment::new("f", "ct", BTreeMap::new()));
        case.fragments[0].pose = Affine::translation(Vector::new(300.0, 0.0, 0.0));
        let camera = scene(&case, &assets).camera;
        assert!(camera.eye.y < camera.target.y, "the eye is in front (LPS: -y)");
        let frame = camera.frame().expect("frame");
        assert!((frame.up - Vector::z()).norm() < 1e-12, "head up");
        assert!((frame.right - Vector::x()).norm() < 1e-12, "the patient's left is on the right");
        let half = (DEFAULT_FOV_DEG / 2.0).to_radians().tan();
        for corner in [Point::new(299.5, -0.5, -0.5), Point::new(303.5, 3.5, 3.5), Point::new(0.0, 10.0, 7.0)]
        {
            let to = corner - camera.eye;
            let depth = to.dot(&frame.forward);
            assert!(to.dot(&frame.right).abs() <= half * depth, "{corner} is within the width");
            assert!(to.dot(&frame.up).abs() <= half * depth, "{corner} is within the height");
        }
    }

    #[test]
    fn an_empty_case_still_has_a_camera() {
        let camera = scene(&Case::default(), &Assets::default()).camera;
        assert!(camera.frame().is_ok(), "it can be drawn");
    }
}
