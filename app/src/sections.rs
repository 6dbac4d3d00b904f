//! From a case and its loaded data to what a section shows: layers, grids, and lines over them. Pure: no files, no window.

use std::collections::BTreeMap;

use render::scene::{CellItem, Piece};
use render::section::{self, Layer, Section, Window};
use render::volume::cells::{Part, Scalar};
use render::volume::{CellGrid, Grid, Point};

use crate::case::assets::Key;
use crate::case::{Assets, Case, UnstructuredGrid, Volume};
use crate::scene;

/// Values below this are air: only CT, in HU, stores such.
pub const AIR_BELOW: f64 = -500.0;

/// The visible volumes as sections show them: the first grey, later ones tinted. A volume whose id is not among
/// `windows` has the [`default_window`].
pub fn layers(case: &Case, assets: &Assets, windows: &BTreeMap<String, Window>) -> Vec<Layer> {
    const TINTS: [[f64; 3]; 4] = [[1.0, 1.0, 1.0], [1.0, 0.72, 0.35], [0.45, 0.8, 1.0], [0.7, 1.0, 0.5]];
    let shown = case.volumes.iter().filter(|v| v.visible);
    shown
        .filter_map(|volume| Some((volume, assets.grid(volume)?)))
        .enumerate()
        .map(|(index, (volume, grid))| Layer {
            pose: volume.pose,
            pieces: pieces_of(case, volume),
            window: windows.get(&volume.id).copied().unwrap_or_else(|| default_window(&grid)),
            grid,
            color: TINTS[index.min(TINTS.len() - 1)],
            weight: volume.blend,
            labels: scene::labels(case, volume, assets),
        })
        .collect()
}

/// An unstructured grid as sections and colour bars show it.
#[derive(Debug, Clone)]
pub struct ShownGrid {
    /// Its id.
    pub id: String,
    /// What is drawn.
    pub item: CellItem,
    /// The name of its scalar.
    pub title: String,
    /// What the scalar is measured in; may be empty.
    pub unit: String,
}

impl ShownGrid {
    /// The scalar at a world place; nothing where no cell is.
    pub fn value(&self, p: &Point) -> Option<f64> {
        section::cell_value(&self.item, p)
    }
}

/// A grid as it is shown; nothing where it is hidden, not loaded or without the scalar that it should show.
pub fn grid(case: &Case, grid: &UnstructuredGrid, assets: &Assets) -> Option<ShownGrid> {
    let item = scene::grid(case, grid, assets)?;
    let title = scalar_title(&item.scalar, &item.grid);
    Some(ShownGrid { id: grid.id.clone(), item, title, unit: grid.unit.clone() })
}

/// The visible grids, in the order of the case.
pub fn grids(case: &Case, assets: &Assets) -> Vec<ShownGrid> {
    case.grids.iter().filter_map(|shown| grid(case, shown, assets)).collect()
}

/// A scalar's name for people: the field's, and what is shown of one of several components.
pub fn scalar_title(scalar: &Scalar, cells: &CellGrid) -> String {
    let field = cells.steps().first().and_then(|step| scalar.field(step));
    match field.map_or(1, |f| f.components()) {
        1 => scalar.name.clone(),
        count => format!("{}, {}", scalar.name, part_title(scalar.part, count)),
    }
}

/// What is shown of a field of so many components: `"magnitude"`, `"x"`, `"component 4"`.
pub fn part_title(part: Part, components: usize) -> String {
    match part {
        Part::Magnitude => "magnitude".to_owned(),
        Part::Component(c @ 0..3) if components == 3 => ["x", "y", "z"][c].to_owned(),
        Part::Component(c) => format!("component {c}"),
    }
}

/// The pieces of a volume that are drawn.
pub fn pieces_of(case: &Case, volume: &Volume) -> Vec<Piece> {
    if case.fragments_of(&volume.id).next().is_none() {
        return vec![Piece::whole()];
    }
    case.fragments_of(&volume.id).filter(|f| f.visible).map(|f| case.piece(f)).collect()
}

/// The piece of a volume that is seen at a world place, by its layer's rule: the last one that lies there.
pub fn piece_at(case: &Case, assets: &Assets, volume: &Volume, p: &Point) -> Option<Piece> {
    let layer = Layer {
        grid: assets.grid(volume)?,
        pose: volume.pose,
        pieces: pieces_of(case, volume),
        window: Window { level: 0.0, width: 1.0 },
        color: [1.0; 3],
        weight: 1.0,
        labels: None,
    };
    let index = layer.piece_at(p)?;
    layer.pieces.into_iter().nth(index)
}

/// The cutters' lines in a section; world mm.
///
/// Of a cutter that fragments keep a side of: its line at each shown one's place, as far as it bounds that fragment.
/// Of one that cuts nothing yet: its whole line within `reach_mm`.
pub fn cutter_lines(case: &Case, layers: &[Layer], section: &Section, reach_mm: f64) -> Vec<Vec<Point>> {
    let used = |id: &str| case.fragments.iter().any(|f| f.keep.contains_key(id));
    let idle = case.cutters.iter().filter(|c| !used(&c.id));
    let whole = idle.flat_map(|c| section::cutter_outline(section, &c.cutter, reach_mm));
    let bounds = layers.iter().flat_map(|layer| {
        let of_piece = move |piece: &Piece| section::piece_outlines(section, &layer.grid, &layer.pose, piece);
        layer.pieces.iter().flat_map(of_piece).map(|line| line.places)
    });
    whole.chain(bounds).collect()
}

/// The unit of a volume's values, to stand after a number: `" HU"` of CT, else nothing.
pub fn unit(assets: &Assets, volume: &Volume, grid: &Grid) -> &'static str {
    let modality = assets.asset(&Key::of_volume(volume)).and_then(|a| a.modality.as_deref());
    let is_ct = modality.map_or(grid.range()[0] < AIR_BELOW, |m| m == "CT");
    if is_ct { " HU" } else { "" }
}

/// The window a volume gets before anybody has chosen.
///
/// Bone for CT (values below −500 are air), and otherwise from the 1st to the 99th percentile of about 30 000
/// samples.
pub fn default_window(grid: &Grid) -> Window {
    let [low, high] = grid.range();
    if low < AIR_BELOW {
        return Window { level: 350.0, width: 1800.0 };
    }
    let count = grid.samples().len();
    let stride = (count / 30_000).max(1);
    let mut seen: Vec<f64> = (0..count).step_by(stride).map(|i| grid.value_at(i)).collect();
    seen.sort_by(f64::total_cmp);
    let at = |part: f64| seen.get((part * (seen.len().max(1) - 1) as f64) as usize).copied();
    let (low, high) = (at(0.01).unwrap_or(low), at(0.99).unwrap_or(high));
    let width = if high > low { high - low } else { 1.0 };
    Window { level: low + width / 2.0, width }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::case::{Fragment, NamedCutter};
    use render::volume::{Affine, Cutter, Rescale, Samples, Side, Vector};
    use std::sync::Arc;

    #[test]
    fn the_first_window_is_bone_for_ct_and_the_bulk_of_the_values_otherwise() {
        let grid = |v: Vec<f32>| {
            Grid::new([v.len(), 1, 1], Samples::F32(v), Rescale::default(), Affine::identity()).expect("grid")
        };
        let ct = default_window(&grid(vec![-1000.0, 0.0, 900.0]));
        assert_eq!((ct.level, ct.width), (350.0, 1800.0), "bone");
        let mut values: Vec<f32> = (0..1000).map(|i| i as f32).collect();
        values.push(1e6);
        let mr = default_window(&grid(values));
        assert!((mr.level - 500.0).abs() < 15.0 && (mr.width - 980.0).abs() < 15.0, "one hot voxel: {mr:?}");
        assert_eq!(default_window(&grid(vec![5.0, 5.0])).width, 1.0, "a flat volume has a width");
    }

    #[test]
    fn a_cutter_in_use_is_drawn_at_each_fragment_and_an_idle_one_in_full() {
        let grid = Grid::new([11; 3], Samples::U8(vec![0; 1331]), Rescale::default(), Affine::identity());
        let plane = |x| Cutter::plane(Point::new(x, 0.0, 0.0), Vector::x()).expect("plane");
        let mut case = Case { cutters: vec![NamedCutter::new("a", plane(5.0))], ..Case::default() };
        let piece = |id: &str, side| Fragment::new(id, "ct", [("a".to_owned(), side)].into());
        let layer = |pieces| Layer {
            grid: Arc::new(grid.clone().expect("grid")),
            pose: Affine::identity(),
            pieces,
            window: Window { level: 0.0, width: 1.0 },
            color: [1.0; 3],
            weight: 1.0,
            labels: None,
        };
        let section = Section::new(Point::new(5.0, 5.0, 5.0), Vector::x(), Vector::y(), 0.1, [100, 100]);
        let section = section.expect("section");
        let length = |lines: &[Vec<Point>]| -> f64 {
            lines.iter().flat_map(|l| l.windows(2)).map(|pair| (pair[1] - pair[0]).norm()).sum()
        };
        let idle = cutter_lines(&case, &[layer(vec![Piece::whole()])], &section, 100.0);
        assert!((length(&idle) - 200.0).abs() < 1e-6, "in full");
        case.fragments = vec![piece("left", Side::Plus), piece("right", Side::Minus)];
        case.fragments[0].pose = Affine::translation(Vector::new(20.0, 0.0, 0.0));
        let pieces = case.fragments.iter().map(|f| case.piece(f)).collect();
        let lines = cutter_lines(&case, &[layer(pieces)], &section, 100.0);
        assert!((length(&lines) - 22.0).abs() < 0.01, "the face of each, 11 mm: {}", length(&lines));
        let moved = lines.iter().flatten().filter(|p| (p.x - 25.0).abs() < 1e-9).count();
        let stayed = lines.iter().flatten().filter(|p| (p.x - 5.0).abs() < 1e-9).count();
        assert!(moved > 1 && stayed > 1, "one where it went, one where it is");
    }
}
