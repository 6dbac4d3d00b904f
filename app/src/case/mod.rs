//! The case: what is planned, as plain data. Volumes, cutters, fragments, implants, grids and the view.
//!
//! A [`Case`] holds no samples and no triangles, so a clone is cheap and undo keeps whole copies. What
//! the sources name is loaded into [`Assets`], shared by `Arc`. [`mod@file`] reads and writes it (see
//! `FORMAT.md`), [`edit`] changes it, [`history`] takes changes back, [`split`] finds the pieces that
//! cutters make. Everything is in world space: LPS, mm. Unknown keys of a file are kept in `other`, at
//! every level, and written back.
#![doc = include_str!("FORMAT.md")]

use std::collections::BTreeMap;
use std::fmt;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use render::scene::{Camera, Piece, Shading, TextureFormat, VolumeMode};
use render::volume::{Affine, Cutter, Side, Transfer};
use serde_json::{Map, Value};

pub mod assets;
pub mod cuts;
pub mod edit;
pub mod file;
pub mod grids;
pub mod history;
pub mod label_grid;
pub mod labels;
mod read;
pub mod split;
mod write;

pub use assets::Assets;
pub use edit::{Edit, EditError};
pub use file::FileError;
pub use grids::UnstructuredGrid;
pub use history::History;
pub use labels::LabelSet;

/// Keys of a file that this version does not know, kept as they were.
pub type Other = Map<String, Value>;

/// Where data come from.
#[derive(Debug, Clone, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum Source {
    /// A file, folder or archive. Absolute once a case was loaded; relative to the case file in it.
    Path(PathBuf),
    /// Made by the program: the part after `builtin:`, such as `hip/ct`.
    Builtin(String),
}

impl Source {
    /// What stands before the name of built-in data.
    pub const BUILTIN: &'static str = "builtin:";

    /// A file or folder, made absolute by the current directory so that it means the same later.
    pub fn path(path: &Path) -> Self {
        Self::Path(std::path::absolute(path).unwrap_or_else(|_| path.to_owned()))
    }

    /// A short name for people: the last part of the path, without its format's endings.
    pub fn short_name(&self) -> String {
        let whole = match self {
            Self::Path(path) => path.file_name().map(|n| n.to_string_lossy().into_owned()),
            Self::Builtin(name) => name.rsplit('/').next().map(str::to_owned),
        };
        let whole = whole.unwrap_or_else(|| "data".to_owned());
        let stem = whole.split('.').find(|part| !part.is_empty()).unwrap_or("data");
        stem.to_owned()
    }
}

impl fmt::Display for Source {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Path(path) => write!(f, "{}", path.display()),
            Self::Builtin(name) => write!(f, "{}{name}", Self::BUILTIN),
        }
    }
}

/// A volume of the case.
#[derive(Debug, Clone, PartialEq)]
pub struct Volume {
    /// Unique among the volumes, not empty.
    pub id: String,
    /// Its data.
    pub source: Source,
    /// Which of the source's volumes, from 0.
    pub item: usize,
    /// Of a volume over time: the step shown, from 0. One past the end shows the last.
    pub step: usize,
    /// `world_from_patient`, rigid: where the volume is placed after its own `world_from_voxel`.
    pub pose: Affine,
    /// Whether it is drawn.
    pub visible: bool,
    /// How the GPU keeps it.
    pub texture: TextureFormat,
    /// Colour and opacity.
    pub transfer: Arc<Transfer>,
    /// Unknown keys beside the transfer function's.
    pub transfer_other: Other,
    /// Lighting.
    pub shading: Shading,
    /// What is drawn of it in 3D.
    pub mode: VolumeMode,
    /// How much it counts where other volumes are in a section; 0 to 1.
    pub blend: f64,
    /// Unknown keys.
    pub other: Other,
}

impl Volume {
    /// A volume where it was acquired, visible, unlit, with the renderer's choice of texture.
    pub fn new(id: impl Into<String>, source: Source, transfer: Arc<Transfer>) -> Self {
        Self {
            id: id.into(),
            source,
            item: 0,
            step: 0,
            pose: Affine::identity(),
            visible: true,
            texture: TextureFormat::Auto,
            transfer,
            transfer_other: Other::new(),
            shading: Shading::None,
            mode: VolumeMode::Composite,
            blend: 1.0,
            other: Other::new(),
        }
    }
}

/// A cutter of the case, about the volumes in their unmoved place.
#[derive(Debug, Clone, PartialEq)]
pub struct NamedCutter {
    /// Unique among the cutters, not empty.
    pub id: String,
    /// The surface; world mm.
    pub cutter: Cutter,
    /// Unknown keys beside the surface's own.
    pub cutter_other: Other,
    /// Unknown keys.
    pub other: Other,
}

impl NamedCutter {
    /// A cutter with a name.
    pub fn new(id: impl Into<String>, cutter: Cutter) -> Self {
        Self { id: id.into(), cutter, cutter_other: Other::new(), other: Other::new() }
    }
}

/// A piece of a volume: what lies on the kept side of each named cutter, moved by `pose`.
#[derive(Debug, Clone, PartialEq)]
pub struct Fragment {
    /// Unique among the fragments, not empty.
    pub id: String,
    /// The volume's id.
    pub volume: String,
    /// Side kept, by cutter id; none keeps all.
    pub keep: BTreeMap<String, Side>,
    /// `world_from_unmoved`, rigid.
    pub pose: Affine,
    /// Whether it is drawn.
    pub visible: bool,
    /// Unknown keys.
    pub other: Other,
}

impl Fragment {
    /// A visible piece in its unmoved place.
    pub fn new(id: impl Into<String>, volume: impl Into<String>, keep: BTreeMap<String, Side>) -> Self {
        Self {
            id: id.into(),
            volume: volume.into(),
            keep,
            pose: Affine::identity(),
            visible: true,
            other: Other::new(),
        }
    }
}

/// A surface placed in the case.
#[derive(Debug, Clone, PartialEq)]
pub struct Implant {
    /// Unique among the implants, not empty.
    pub id: String,
    /// Its data.
    pub source: Source,
    /// Which of the source's surfaces, from 0.
    pub item: usize,
    /// `world_from_model`, rigid, after `scale`.
    pub pose: Affine,
    /// Millimetres per unit of the model, > 0: 1000 for a model in metres.
    pub scale: f64,
    /// Side kept, by cutter id, of the surface in its place; none keeps all.
    pub keep: BTreeMap<String, Side>,
    /// Display red, green, blue; 0 to 1.
    pub color: [f64; 3],
    /// 0 to 1; 1 is an opaque surface.
    pub opacity: f64,
    /// Whether it is drawn.
    pub visible: bool,
    /// Lighting.
    pub shading: Shading,
    /// Unknown keys.
    pub other: Other,
}

impl Implant {
    /// The colour of an implant that says none: metal grey.
    pub const COLOR: [f64; 3] = [0.75, 0.78, 0.82];

    /// An opaque, visible, lit surface of metal grey at the model's own place, in millimetres.
    pub fn new(id: impl Into<String>, source: Source) -> Self {
        Self {
            id: id.into(),
            source,
            item: 0,
            pose: Affine::identity(),
            scale: 1.0,
            keep: BTreeMap::new(),
            color: Self::COLOR,
            opacity: 1.0,
            visible: true,
            shading: Shading::Lit,
            other: Other::new(),
        }
    }
}

/// A plan. See the module's page for what is where.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Case {
    /// For people; may be empty.
    pub name: String,
    /// Data sets.
    pub volumes: Vec<Volume>,
    /// Osteotomy planes and cylinders.
    pub cutters: Vec<NamedCutter>,
    /// Pieces. A volume with fragments is drawn as its fragments only.
    pub fragments: Vec<Fragment>,
    /// Surfaces.
    pub implants: Vec<Implant>,
    /// What is painted on volumes.
    pub labels: Vec<LabelSet>,
    /// Results of simulations.
    pub grids: Vec<UnstructuredGrid>,
    /// The view; none fits everything visible, seen from the front.
    pub camera: Option<Camera>,
    /// Unknown keys of the camera.
    pub camera_other: Other,
    /// Display colour behind everything; 0 to 1.
    pub background: [f64; 3],
    /// Unknown keys.
    pub other: Other,
}

impl Case {
    /// The volume of that id.
    pub fn volume(&self, id: &str) -> Option<&Volume> {
        self.volumes.iter().find(|v| v.id == id)
    }

    /// The cutter of that id.
    pub fn cutter(&self, id: &str) -> Option<&NamedCutter> {
        self.cutters.iter().find(|c| c.id == id)
    }

    /// The fragment of that id.
    pub fn fragment(&self, id: &str) -> Option<&Fragment> {
        self.fragments.iter().find(|f| f.id == id)
    }

    /// The implant of that id.
    pub fn implant(&self, id: &str) -> Option<&Implant> {
        self.implants.iter().find(|i| i.id == id)
    }

    /// The label set of that id.
    pub fn label_set(&self, id: &str) -> Option<&LabelSet> {
        self.labels.iter().find(|l| l.id == id)
    }

    /// The unstructured grid of that id.
    pub fn grid(&self, id: &str) -> Option<&UnstructuredGrid> {
        self.grids.iter().find(|g| g.id == id)
    }

    /// The label set that is drawn on a volume: the first visible one.
    pub fn labels_of(&self, volume: &str) -> Option<&LabelSet> {
        self.labels.iter().find(|l| l.volume == volume && l.visible)
    }

    /// The fragments of a volume.
    pub fn fragments_of<'a>(&'a self, volume: &'a str) -> impl Iterator<Item = &'a Fragment> {
        self.fragments.iter().filter(move |f| f.volume == volume)
    }

    /// A fragment as the renderer takes it. A cutter that is not there keeps everything: [`Edit`] and
    /// [`mod@file`] let none such in.
    pub fn piece(&self, fragment: &Fragment) -> Piece {
        Piece { keep: self.sides(&fragment.keep), pose: fragment.pose }
    }

    /// Cutters with the side kept, as [`Case::piece`] finds them.
    pub fn sides(&self, keep: &BTreeMap<String, Side>) -> Vec<(Cutter, Side)> {
        keep.iter().filter_map(|(id, side)| Some((self.cutter(id)?.cutter, *side))).collect()
    }

    /// An id that starts with `wish` and is not among `taken`: `ct`, `ct-2`, `ct-3`, ...
    pub fn free_id<'a>(wish: &str, taken: impl Iterator<Item = &'a str>) -> String {
        let taken: std::collections::BTreeSet<&str> = taken.collect();
        let wish = if wish.is_empty() { "item" } else { wish };
        if !taken.contains(wish) {
            return wish.to_owned();
        }
        let mut number = 2_u64;
        loop {
            let id = format!("{wish}-{number}");
            if !taken.contains(id.as_str()) {
                return id;
            }
            number += 1;
        }
    }

    /// A free volume id like `wish`.
    pub fn free_volume_id(&self, wish: &str) -> String {
        Self::free_id(wish, self.volumes.iter().map(|v| v.id.as_str()))
    }

    /// A free cutter id like `wish`.
    pub fn free_cutter_id(&self, wish: &str) -> String {
        Self::free_id(wish, self.cutters.iter().map(|c| c.id.as_str()))
    }

    /// A free fragment id like `wish`.
    pub fn free_fragment_id(&self, wish: &str) -> String {
        Self::free_id(wish, self.fragments.iter().map(|f| f.id.as_str()))
    }

    /// A free id of a label set like `wish`.
    pub fn free_labels_id(&self, wish: &str) -> String {
        Self::free_id(wish, self.labels.iter().map(|l| l.id.as_str()))
    }

    /// A free grid id like `wish`.
    pub fn free_grid_id(&self, wish: &str) -> String {
        Self::free_id(wish, self.grids.iter().map(|g| g.id.as_str()))
    }

    /// A free implant id like `wish`.
    pub fn free_implant_id(&self, wish: &str) -> String {
        Self::free_id(wish, self.implants.iter().map(|i| i.id.as_str()))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_free_id_is_free() {
        let taken = ["ct", "ct-2"];
        assert_eq!(Case::free_id("ct", taken.into_iter()), "ct-3", "the next number");
        assert_eq!(Case::free_id("mri", taken.into_iter()), "mri", "as wished");
        assert_eq!(Case::free_id("", std::iter::empty()), "item", "never empty");
    }

    #[test]
    fn a_short_name_has_no_ending() {
        let source = Source::Path(PathBuf::from("/a/torso.nii.gz"));
        assert_eq!(source.short_name(), "torso", "file");
        assert_eq!(Source::Builtin("hip/ct".into()).short_name(), "ct", "built-in");
    }
}
