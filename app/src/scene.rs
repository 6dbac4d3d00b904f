//! From a case and its loaded data to what the renderers draw. Pure: no files, no GPU, no window.
//!
//! What is hidden, or not loaded yet, is left out. Where the case has no camera, [`fit`] shows
//! everything that is drawn, seen from the front of the patient.

use std::sync::Arc;

use render::scene::{Camera, CellItem, Labels, MeshItem, Piece, Projection, Scene, VolumeItem};
use render::volume::cells::{Scalar, Step};
use render::volume::{Affine, CellGrid, Point, Transfer, Vector};

use crate::case::cuts::Cut;
use crate::case::labels::{LabelSet, MAX_LABEL};
use crate::case::{Assets, Case, Implant, UnstructuredGrid, Volume};
use crate::colormaps::{COLORMAPS, OPACITY};

/// Vertical field of view of a camera that the case does not give; degrees.
pub const DEFAULT_FOV_DEG: f64 = 30.0;

/// What a case shows.
pub fn scene(case: &Case, assets: &Assets) -> Scene {
    let volumes: Vec<VolumeItem> = case.volumes.iter().filter_map(|v| volume(case, v, assets)).collect();
    let meshes: Vec<MeshItem> = case.implants.iter().filter_map(|i| implant(case, i, assets)).collect();
    let grids: Vec<CellItem> = case.grids.iter().filter_map(|g| grid(case, g, assets)).collect();
    let around = |bounds| fit(bounds, Vector::y(), Vector::z());
    let camera = around([Point::from([-100.0; 3]), Point::from([100.0; 3])]);
    let mut scene = Scene { volumes, meshes, grids, camera, background: case.background };
    if let Some(camera) = case.camera.or_else(|| bounds(&scene).map(around)) {
        scene.camera = camera;
    }
    scene
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

fn implant(case: &Case, implant: &Implant, assets: &Assets) -> Option<MeshItem> {
    if !implant.visible || implant.opacity == 0.0 {
        return None;
    }
    Some(MeshItem {
        mesh: implant_cut(case, implant, assets)?.mesh?,
        pose: world_from_model(implant),
        color: implant.color,
        opacity: implant.opacity,
        shading: implant.shading,
    })
}

/// What the cutters leave of an implant in its place, where its surface is loaded; in the model's own frame.
pub fn implant_cut(case: &Case, implant: &Implant, assets: &Assets) -> Option<Cut> {
    let mesh = assets.mesh(implant)?;
    Some(assets.cuts().cut(&implant.id, mesh, &world_from_model(implant), case.sides(&implant.keep)))
}

/// An unstructured grid as it is drawn, where it is visible, loaded and has the scalar that it shows.
pub fn grid(case: &Case, grid: &UnstructuredGrid, assets: &Assets) -> Option<CellItem> {
    if !grid.visible {
        return None;
    }
    let cells = assets.cells(grid)?;
    let scalar = scalar_of(grid, cells)?;
    let transfer = transfer_of(grid, cells, &scalar);
    let pose = world_from_grid(case, grid);
    // A file may have fewer steps than it had.
    let step = grid.step.min(cells.steps().len() - 1);
    Some(CellItem { grid: Arc::clone(cells), step, scalar, pose, transfer })
}

/// The scalar that a grid shows; nothing where its data have none, or not the one that is chosen.
pub fn scalar_of(grid: &UnstructuredGrid, cells: &CellGrid) -> Option<Scalar> {
    grid.field.as_ref().map_or_else(|| cells.first_scalar(), |choice| choice.of(cells))
}

/// The colours and opacities of a grid: its own, or the default ones over the scalar's range.
pub fn transfer_of(grid: &UnstructuredGrid, cells: &CellGrid, scalar: &Scalar) -> Arc<Transfer> {
    let default = || {
        let [low, high] = cells.bounds();
        let unit_mm = (high - low).norm() * grid.scale / 100.0;
        let range = scalar.range(cells).unwrap_or([0.0, 1.0]);
        Arc::new(COLORMAPS[0].transfer(range, OPACITY, unit_mm))
    };
    grid.transfer.clone().unwrap_or_else(default)
}

/// Why a grid whose data are loaded cannot be shown; nothing where it can, or where they are not.
pub fn grid_fault(grid: &UnstructuredGrid, assets: &Assets) -> Option<String> {
    let cells = assets.cells(grid)?;
    if scalar_of(grid, cells).is_some() {
        return None;
    }
    let known = |step: &Step| {
        let all = step.point_fields.iter().chain(&step.cell_fields).map(|f| format!("\"{}\"", f.name()));
        all.collect::<Vec<_>>().join(", ")
    };
    let known = cells.steps().first().map(known).unwrap_or_default();
    let (id, source) = (&grid.id, &grid.source);
    Some(match &grid.field {
        _ if known.is_empty() => {
            format!("grid \"{id}\" has no field that could be shown; choose another file: {source}")
        }
        Some(choice) => {
            let name = &choice.name;
            format!(
                "grid \"{id}\" has no field \"{name}\" with that component there; choose one of {known}: {source}"
            )
        }
        None => format!("grid \"{id}\" has no scalar in its first step; choose one of {known}: {source}"),
    })
}

/// Where a grid's own coordinates lie: its pose after its scale, and where it rides on a fragment, moved with that.
pub fn world_from_grid(case: &Case, grid: &UnstructuredGrid) -> Affine {
    let placed = scaled(grid.pose, grid.scale);
    let fragment = grid.fragment.as_deref().and_then(|id| case.fragment(id));
    fragment.map_or(placed, |fragment| fragment.pose * placed)
}

/// Where the model's own coordinates lie: its pose after its scale.
pub fn world_from_model(implant: &Implant) -> Affine {
    scaled(implant.pose, implant.scale)
}

/// A rigid pose after a scale.
fn scaled(pose: Affine, s: f64) -> Affine {
    if s == 1.0 {
        return pose;
    }
    let axes = [Vector::x() * s, Vector::y() * s, Vector::z() * s];
    // A scale is checked to be positive and finite; one so small that it flattens space is as if unscaled.
    Affine::from_columns(axes[0], axes[1], axes[2], Point::origin())
        .map_or(pose, |mm_from_model| pose * mm_from_model)
}

/// The corners of a volume's box in its unmoved place, world mm: what [`crate::case::Edit::Split`] asks for.
pub fn unmoved_corners(volume: &Volume, assets: &Assets) -> Option<[Point; 8]> {
    let grid = assets.grid(volume)?;
    Some(grid.corners_in_world().map(|p| volume.pose.point(&p)))
}

/// Least and greatest coordinates of everything drawn; world mm. Fragments count with the part of
/// their volume's box that planes leave them, moved; none where nothing is drawn.
pub fn bounds(scene: &Scene) -> Option<[Point; 2]> {
    let mut low = Point::from([f64::INFINITY; 3]);
    let mut high = Point::from([f64::NEG_INFINITY; 3]);
    let mut take = |p: Point| {
        low = low.inf(&p);
        high = high.sup(&p);
    };
    for item in &scene.volumes {
        let corners = item.grid.corners_in_world().map(|p| item.pose.point(&p));
        for piece in &item.pieces {
            for p in crate::case::split::hull_of(&piece.keep, &corners) {
                take(piece.pose.point(&p));
            }
        }
    }
    for item in &scene.meshes {
        for p in item.mesh.positions() {
            take(item.pose.point(p));
        }
    }
    for item in &scene.grids {
        for p in item.grid.points() {
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
    fn an_implant_is_cut_in_its_place_and_only_once() {
        let (mut case, assets) = planned();
        // The model's triangle, 10 mm a side in the world, at z = 7; the cutter stands at x = 4.
        let cutter = Cutter::plane(Point::new(4.0, 0.0, 0.0), Vector::x()).expect("plane");
        case.cutters.push(crate::case::NamedCutter::new("c", cutter));
        let whole = scene(&case, &assets).meshes.remove(0).mesh;
        case.implants[0].keep.insert("c".to_owned(), render::volume::Side::Minus);
        let item = scene(&case, &assets).meshes.remove(0);
        let reach =
            item.mesh.positions().iter().map(|p| item.pose.point(p).x).fold(f64::NEG_INFINITY, f64::max);
        assert!((reach - 4.0).abs() < 1e-12, "it ends at the cutter: {reach}");
        let again = scene(&case, &assets).meshes.remove(0).mesh;
        assert!(Arc::ptr_eq(&item.mesh, &again), "nothing changed, nothing is cut again");
        case.implants[0].pose = Affine::translation(Vector::new(-5.0, 0.0, 0.0));
        let moved = scene(&case, &assets).meshes.remove(0).mesh;
        assert_ne!(moved, again, "moved past the cutter, less is cut off");
        case.implants[0].pose = Affine::translation(Vector::new(5.0, 0.0, 0.0));
        assert!(scene(&case, &assets).meshes.is_empty(), "all of it is cut off");
        case.implants[0].keep.clear();
        assert!(
            Arc::ptr_eq(&scene(&case, &assets).meshes[0].mesh, &whole),
            "whole, and the loaded mesh itself"
        );
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
