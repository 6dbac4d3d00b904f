//! What the sources of a case name, loaded: volumes, surfaces and unstructured grids, shared by `Arc`, keyed by source.

use std::collections::BTreeMap;
use std::path::PathBuf;
use std::sync::Arc;

use render::volume::{CellGrid, Grid, TriangleMesh};
use thiserror::Error;

use super::cuts::Cuts;
use super::label_grid::{LabelGrid, LabelGrids};
use super::{Case, Implant, LabelSet, Source, UnstructuredGrid, Volume};
use crate::load::{self, Content, Item, Limits, LoadError, Note, Progress};
use crate::sample;
use crate::steps::{self, SeriesFileError, Steps};

/// What kind of data is wanted of a source.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum Kind {
    /// A [`Grid`], or [`Steps`] of them.
    Volume,
    /// A [`TriangleMesh`].
    Surface,
    /// A [`CellGrid`].
    Cells,
}

/// Which data.
#[derive(Debug, Clone, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct Key {
    /// Where they come from.
    pub source: Source,
    /// Of which kind.
    pub kind: Kind,
    /// Which of that kind, from 0.
    pub item: usize,
}

impl Key {
    /// What a volume needs.
    pub fn of_volume(volume: &Volume) -> Self {
        Self { source: volume.source.clone(), kind: Kind::Volume, item: volume.item }
    }

    /// What a label set needs; none where it begins empty.
    pub fn of_labels(set: &LabelSet) -> Option<Self> {
        Some(Self { source: set.source.clone()?, kind: Kind::Volume, item: set.item })
    }

    /// What an unstructured grid needs.
    pub fn of_grid(grid: &UnstructuredGrid) -> Self {
        Self { source: grid.source.clone(), kind: Kind::Cells, item: grid.item }
    }

    /// What an implant needs.
    pub fn of_implant(implant: &Implant) -> Self {
        Self { source: implant.source.clone(), kind: Kind::Surface, item: implant.item }
    }
}

/// Samples, triangles or cells.
#[derive(Debug, Clone)]
#[non_exhaustive]
pub enum Data {
    /// A volume.
    Grid(Arc<Grid>),
    /// A volume over time.
    Steps(Arc<Steps>),
    /// A surface.
    Mesh(Arc<TriangleMesh>),
    /// An unstructured grid.
    Cells(Arc<CellGrid>),
}

impl Data {
    /// Least and greatest value of a volume, over all its steps; none of anything else.
    pub fn range(&self) -> Option<[f64; 2]> {
        match self {
            Self::Grid(grid) => Some(grid.range()),
            Self::Steps(steps) => Some(steps.range()),
            Self::Mesh(_) | Self::Cells(_) => None,
        }
    }
}

/// Data with what is known about them.
#[derive(Debug, Clone)]
pub struct Asset {
    /// Which these are.
    pub key: Key,
    /// What they call themselves.
    pub name: String,
    /// The format they were read as.
    pub format: &'static str,
    /// `"CT"`, `"MR"`, ... where known.
    pub modality: Option<String>,
    /// The data.
    pub data: Data,
    /// What departs from the plain reading.
    pub notes: Vec<Note>,
}

/// Why a source gave no data.
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum AssetError {
    /// The loader's complaint.
    #[error(transparent)]
    Load(#[from] LoadError),
    /// The series file's complaint.
    #[error(transparent)]
    Series(#[from] SeriesFileError),
    /// The source has no such item.
    #[error("holds {found} {kind}, so item {item} is not there; choose another file or item: {}", path.display())]
    NoItem {
        /// `volumes`, `surfaces` or `unstructured grids`.
        kind: &'static str,
        /// How many there are.
        found: usize,
        /// What was asked for.
        item: usize,
        /// The source.
        path: PathBuf,
    },
    /// No built-in data of that name.
    #[error(
        "there are no built-in data \"{name}\"; use builtin:hip/ct, builtin:hip/mri, builtin:hip/stem or builtin:beat"
    )]
    NoBuiltin {
        /// As asked for.
        name: String,
    },
    /// The built-in sample could not be made.
    #[error("the built-in sample could not be made: {0}")]
    Sample(#[from] sample::SampleError),
}

/// Loaded data of a case.
#[derive(Debug, Clone, Default)]
pub struct Assets {
    loaded: BTreeMap<Key, Arc<Asset>>,
    label_grids: LabelGrids,
    cuts: Cuts,
}

impl Assets {
    /// The samples of a volume, where loaded; of one over time, those of the step that it shows.
    pub fn grid(&self, volume: &Volume) -> Option<Arc<Grid>> {
        match &self.loaded.get(&Key::of_volume(volume))?.data {
            Data::Grid(grid) => Some(Arc::clone(grid)),
            Data::Steps(steps) => steps.grid(volume.step),
            Data::Mesh(_) | Data::Cells(_) => None,
        }
    }

    /// The steps of a volume over time, where loaded; none of a volume that does not change.
    pub fn steps(&self, volume: &Volume) -> Option<&Arc<Steps>> {
        match &self.loaded.get(&Key::of_volume(volume))?.data {
            Data::Steps(steps) => Some(steps),
            Data::Grid(_) | Data::Mesh(_) | Data::Cells(_) => None,
        }
    }

    /// The triangles of an implant, where loaded.
    pub fn mesh(&self, implant: &Implant) -> Option<&Arc<TriangleMesh>> {
        match &self.loaded.get(&Key::of_implant(implant))?.data {
            Data::Mesh(mesh) => Some(mesh),
            Data::Grid(_) | Data::Steps(_) | Data::Cells(_) => None,
        }
    }

    /// The cells of an unstructured grid, where loaded.
    pub fn cells(&self, grid: &UnstructuredGrid) -> Option<&Arc<CellGrid>> {
        match &self.loaded.get(&Key::of_grid(grid))?.data {
            Data::Cells(cells) => Some(cells),
            Data::Grid(_) | Data::Steps(_) | Data::Mesh(_) => None,
        }
    }

    /// The labels of a set with what was painted over them, where its source is loaded; where it has none, where its
    /// volume is.
    pub fn labels(&self, case: &Case, set: &LabelSet) -> Option<LabelGrid> {
        let base = match Key::of_labels(set) {
            None => self.grid(case.volume(&set.volume)?)?,
            Some(key) => match &self.loaded.get(&key)?.data {
                Data::Grid(grid) => Arc::clone(grid),
                Data::Steps(steps) => steps.grid(0)?,
                Data::Mesh(_) | Data::Cells(_) => return None,
            },
        };
        Some(self.label_grids.grid(set, &base))
    }

    /// What cutters leave of the surfaces.
    pub fn cuts(&self) -> &Cuts {
        &self.cuts
    }

    /// Everything known about some data, where loaded.
    pub fn asset(&self, key: &Key) -> Option<&Arc<Asset>> {
        self.loaded.get(key)
    }

    /// Keeps loaded data.
    pub fn insert(&mut self, asset: Arc<Asset>) {
        self.loaded.insert(asset.key.clone(), asset);
    }

    /// Takes in all that others have loaded.
    pub fn extend(&mut self, assets: impl IntoIterator<Item = Arc<Asset>>) {
        for asset in assets {
            self.insert(asset);
        }
    }

    /// What a case needs to be drawn and is not loaded: visible things only, each once.
    pub fn missing(&self, case: &Case) -> Vec<Key> {
        let volumes = case.volumes.iter().filter(|v| v.visible).map(Key::of_volume);
        let implants = case.implants.iter().filter(|i| i.visible).map(Key::of_implant);
        let grids = case.grids.iter().filter(|g| g.visible).map(Key::of_grid);
        let on_shown = |l: &&LabelSet| l.visible && case.volume(&l.volume).is_some_and(|v| v.visible);
        let labels = case.labels.iter().filter(on_shown).filter_map(Key::of_labels);
        let mut keys: Vec<Key> = volumes
            .chain(implants)
            .chain(labels)
            .chain(grids)
            .filter(|k| !self.loaded.contains_key(k))
            .collect();
        keys.sort();
        keys.dedup();
        keys
    }

    /// Loads what [`Assets::missing`] names.
    ///
    /// # Errors
    /// [`AssetError`] of the first source that gives nothing; what was loaded before it stays.
    pub fn load_missing(
        &mut self,
        case: &Case,
        limits: &Limits,
        progress: &dyn Progress,
    ) -> Result<(), AssetError> {
        // A source with several wanted items is opened once.
        for key in self.missing(case) {
            if !self.loaded.contains_key(&key) {
                let wanted: Vec<Key> =
                    self.missing(case).into_iter().filter(|k| k.source == key.source).collect();
                let assets = load_keys(&wanted, limits, progress)?;
                self.extend(assets);
            }
        }
        Ok(())
    }
}

/// The data of keys that share one source, which is opened once.
///
/// # Errors
/// [`AssetError`] of the first key that gives nothing.
pub fn load_keys(
    keys: &[Key],
    limits: &Limits,
    progress: &dyn Progress,
) -> Result<Vec<Arc<Asset>>, AssetError> {
    let Some(first) = keys.first() else { return Ok(Vec::new()) };
    let all = open(&first.source, limits, progress)?;
    let find = |key: &Key| {
        let found = || all.iter().filter(|a| a.key.kind == key.kind).count();
        all.iter().find(|a| a.key == *key).cloned().ok_or_else(|| match &key.source {
            Source::Builtin(name) => AssetError::NoBuiltin { name: name.clone() },
            Source::Path(path) => AssetError::NoItem {
                kind: match key.kind {
                    Kind::Volume => "volumes",
                    Kind::Surface => "surfaces",
                    Kind::Cells => "unstructured grids",
                },
                found: found(),
                item: key.item,
                path: path.clone(),
            },
        })
    };
    keys.iter().map(find).collect()
}

/// All volumes, surfaces and unstructured grids of a source, numbered by kind.
///
/// # Errors
/// [`AssetError`].
pub fn open(
    source: &Source,
    limits: &Limits,
    progress: &dyn Progress,
) -> Result<Vec<Arc<Asset>>, AssetError> {
    match source {
        Source::Path(path) if steps::is_series(path) => {
            let steps = Steps::open(path, limits.decoded_bytes)?;
            let (name, kind) = steps.title().unwrap_or_default();
            let name = if name.is_empty() { source.short_name() } else { name.to_owned() };
            let modality = Some(kind.to_owned()).filter(|kind| !kind.is_empty());
            let key = Key { source: source.clone(), kind: Kind::Volume, item: 0 };
            let mut notes = Vec::new();
            if steps.is_lossy() {
                let text = format!("Values differ from the original's: {}.", steps.description());
                notes.push(Note { severity: load::Severity::Caution, code: "series.lossy", text });
            }
            let data = Data::Steps(Arc::new(steps));
            Ok(vec![Arc::new(Asset { key, name, format: "series", modality, data, notes })])
        }
        Source::Path(path) => Ok(number(source, load::open(path, limits, progress)?)),
        Source::Builtin(name) => {
            let (data, modality) = match name.as_str() {
                "hip/ct" => (Data::Grid(sample::ct()?), Some("CT")),
                "hip/mri" => (Data::Grid(sample::mri()?), Some("MR")),
                "hip/stem" => (Data::Mesh(sample::stem()?), None),
                sample::BEAT => (Data::Steps(Arc::new(Steps::in_memory(sample::beat()?))), None),
                _ => return Err(AssetError::NoBuiltin { name: name.clone() }),
            };
            let kind = if matches!(data, Data::Mesh(_)) { Kind::Surface } else { Kind::Volume };
            let key = Key { source: source.clone(), kind, item: 0 };
            let modality = modality.map(str::to_owned);
            let name = source.short_name();
            Ok(vec![Arc::new(Asset { key, name, format: "built-in", modality, data, notes: Vec::new() })])
        }
    }
}

fn number(source: &Source, items: Vec<Item>) -> Vec<Arc<Asset>> {
    let (mut volumes, mut surfaces, mut cells) = (0, 0, 0);
    let mut assets = Vec::new();
    for item in items {
        let (data, kind, count) = match item.content {
            Content::Volume(grid) => (Data::Grid(Arc::new(grid)), Kind::Volume, &mut volumes),
            Content::Series(series) => {
                (Data::Steps(Arc::new(Steps::in_memory(series))), Kind::Volume, &mut volumes)
            }
            Content::Mesh(mesh) => (Data::Mesh(Arc::new(mesh)), Kind::Surface, &mut surfaces),
            Content::Cells(grid) => (Data::Cells(Arc::new(grid)), Kind::Cells, &mut cells),
        };
        let key = Key { source: source.clone(), kind, item: *count };
        *count += 1;
        let Item { name, format, modality, notes, .. } = item;
        assets.push(Arc::new(Asset { key, name, format, modality, data, notes }));
    }
    assets
}
