//! Label sets: regions painted on a volume, from a file, and over it what was painted here.
//!
//! A file's labels are never changed. What the brush makes is kept as [`Bricks`] over them, whole cubes of
//! [`EDGE`] labels a side of which copies of a case share all that they have in common; so a step of undo costs the
//! bricks that were touched and no more.

use std::collections::BTreeMap;
use std::sync::Arc;

use render::volume::default_color;

use super::{EditError, Other, Source};

/// Labels along each side of a brick.
pub const EDGE: usize = 16;
/// The largest label that is painted and drawn.
pub const MAX_LABEL: u32 = u16::MAX as u32;

/// The labels of one brick, `[x, y, z]`, x fastest; those past the grid's end are 0.
pub type Brick = Arc<[u16]>;
/// Bricks by their place: brick `[i, j, k]` begins at label `[i, j, k]` times [`EDGE`].
pub type Bricks = BTreeMap<[usize; 3], Brick>;

/// Labels on a volume.
#[derive(Debug, Clone, PartialEq)]
pub struct LabelSet {
    /// Unique among the label sets, not empty.
    pub id: String,
    /// The id of the volume that they ride with.
    pub volume: String,
    /// Their data; none begins with no label, on the volume's own grid.
    pub source: Option<Source>,
    /// Which of the source's volumes, from 0.
    pub item: usize,
    /// Red, green, blue and share, 0 to 1, by label; what is not here has [`default_color`].
    pub colors: BTreeMap<u32, [f64; 4]>,
    /// Whether they are drawn.
    pub visible: bool,
    /// What was painted over the source and is in no file yet.
    pub painted: Arc<Bricks>,
    /// Unknown keys.
    pub other: Other,
}

impl LabelSet {
    /// Visible labels in default colours.
    pub fn new(id: impl Into<String>, volume: impl Into<String>, source: Option<Source>) -> Self {
        Self {
            id: id.into(),
            volume: volume.into(),
            source,
            item: 0,
            colors: BTreeMap::new(),
            visible: true,
            painted: Arc::default(),
            other: Other::new(),
        }
    }

    /// The colour of a label.
    pub fn color(&self, label: u32) -> [f64; 4] {
        self.colors.get(&label).copied().unwrap_or_else(|| default_color(label))
    }
}

/// A change to a label set.
#[derive(Debug, Clone, PartialEq)]
pub enum LabelChange {
    /// Takes the set away.
    Remove,
    /// Whether it is drawn.
    Visible(bool),
    /// The colour of a label.
    Color {
        /// The label, from 1.
        label: u32,
        /// Red, green, blue and share; 0 to 1.
        color: [f64; 4],
    },
    /// Bricks that take the place of those that were there.
    Paint(Bricks),
}

impl LabelChange {
    /// Whether this and an earlier change of the same set are steps of one drag.
    pub(super) fn continues(&self, earlier: &Self) -> bool {
        match (self, earlier) {
            (Self::Color { label: a, .. }, Self::Color { label: b, .. }) => a == b,
            (Self::Paint(_), Self::Paint(_)) => true,
            _ => false,
        }
    }
}

/// Changes the set at `index`, or leaves all as it was.
pub(super) fn apply(sets: &mut Vec<LabelSet>, index: usize, change: LabelChange) -> Result<(), EditError> {
    match change {
        LabelChange::Remove => {
            sets.remove(index);
        }
        LabelChange::Visible(visible) => sets[index].visible = visible,
        LabelChange::Color { label, color } => {
            check_color(color)?;
            sets[index].colors.insert(label, color);
        }
        LabelChange::Paint(bricks) => {
            let painted = Arc::make_mut(&mut sets[index].painted);
            painted.extend(bricks.into_iter().filter(|(_, brick)| brick.len() == EDGE * EDGE * EDGE));
        }
    }
    Ok(())
}

/// Refuses a colour with a component outside 0 to 1.
pub(super) fn check_color(color: [f64; 4]) -> Result<(), EditError> {
    match color.into_iter().find(|c| !(0.0..=1.0).contains(c)) {
        None => Ok(()),
        Some(value) => {
            let what = "a component of a label's colour";
            Err(EditError::Range { what, range: "between 0 and 1", value })
        }
    }
}
