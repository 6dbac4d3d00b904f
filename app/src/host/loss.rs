//! A graphics device that is lost, and what becomes of the plan.
//!
//! The window on that device closes and opens again on another, with the same [`super::frame::Host`] and so the same
//! plan. Where none opens, the plan is written to a file.
//!
//! `OSTEOTOME_LOSE_GPU=N` gives the device up before the Nth frame, once: to try it.

use std::fmt;
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

use super::session::Session;

/// The environment variable that orders a loss.
pub const VARIABLE: &str = "OSTEOTOME_LOSE_GPU";
/// Devices that may be lost in a row: a driver that resets at each picture is not opened for ever.
const IN_A_ROW: u32 = 3;
/// A device that lived as long as this is none of a row.
const STEADY: Duration = Duration::from_mins(1);

/// The frame before which the environment wants the device lost.
pub fn ordered() -> Option<u64> {
    std::env::var(VARIABLE).ok()?.parse().ok()
}

/// How often devices were lost.
#[derive(Debug)]
pub struct Losses {
    in_a_row: u32,
    opened: Instant,
}

impl Losses {
    /// None yet; the first device is opened now.
    pub fn new() -> Self {
        Self { in_a_row: 0, opened: Instant::now() }
    }

    /// Whether the device in use is not the first.
    pub fn any(&self) -> bool {
        self.in_a_row > 0
    }

    /// One more was lost at `now`, when the next is opened; whether that is worth it.
    pub fn again(&mut self, now: Instant) -> bool {
        let steady = now.saturating_duration_since(self.opened) >= STEADY;
        self.in_a_row = if steady { 1 } else { self.in_a_row + 1 };
        self.opened = now;
        self.in_a_row <= IN_A_ROW
    }
}

impl Default for Losses {
    fn default() -> Self {
        Self::new()
    }
}

/// What became of the plan where its window is gone; a part of a sentence.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Rescued {
    /// It had no changes.
    Unchanged,
    /// It is in a file of its own.
    Written(PathBuf),
    /// No file took it.
    Failed(String),
}

impl fmt::Display for Rescued {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Unchanged => f.write_str("the plan had no changes to be saved"),
            Self::Written(path) => write!(f, "the plan with its changes was written to {}", path.display()),
            Self::Failed(fault) => write!(f, "the changes of the plan could not be written: {fault}"),
        }
    }
}

/// Writes a plan with changes into a new file: beside the case's own, or in the current or the home folder.
pub fn rescue(session: &mut Session) -> Rescued {
    if session.history().is_saved() {
        return Rescued::Unchanged;
    }
    let own = session.path().and_then(Path::parent).map(Path::to_owned);
    let folders = [own, std::env::current_dir().ok(), std::env::home_dir()];
    rescue_into(session, folders.into_iter().flatten())
}

fn rescue_into(session: &mut Session, folders: impl Iterator<Item = PathBuf>) -> Rescued {
    let stem = session.path().and_then(Path::file_stem).unwrap_or("osteotome".as_ref());
    let stem = stem.to_string_lossy().into_owned();
    for folder in folders {
        let names = (1..1000).map(|n| format!("{stem}-rescued-{n}.json"));
        let free = names.map(|name| folder.join(name)).find(|path| !path.exists());
        if let Some(path) = free
            && session.save(&path)
        {
            return Rescued::Written(path);
        }
    }
    let fault = session.problems().last().map_or("no folder takes it", |p| p.text.as_str());
    Rescued::Failed(fault.to_owned())
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use super::*;
    use crate::case::{Case, Edit, file};

    #[test]
    fn a_plan_with_changes_goes_into_a_new_file_and_writes_none_over() {
        let folder = tempfile::tempdir().expect("folder");
        let own = folder.path().join("hip.json");
        let mut session = Session::new(Case::default(), Arc::new(|| ()));
        assert_eq!(rescue(&mut session), Rescued::Unchanged, "nothing was planned");
        assert!(session.save(&own), "its own file");
        let named = |name: &str| Edit::SetName(name.to_owned());
        session.edit(named("first"), 0.0);
        let missing = folder.path().join("no/such");
        let folders = || [missing.clone(), folder.path().to_owned()].into_iter();
        let first = rescue_into(&mut session, folders());
        assert_eq!(
            first,
            Rescued::Written(folder.path().join("hip-rescued-1.json")),
            "the folder that is there"
        );
        assert_eq!(file::load(&own).expect("a case").name, "", "the own file is as it was");
        assert_eq!(
            file::load(&folder.path().join("hip-rescued-1.json")).expect("a case").name,
            "first",
            "kept"
        );
        let mut other = Session::new(Case::default(), Arc::new(|| ()));
        other.edit(named("second"), 0.0);
        let only = || [missing.clone()].into_iter();
        assert!(
            matches!(rescue_into(&mut other, only()), Rescued::Failed(fault) if fault.contains("such")),
            "why"
        );
    }

    #[test]
    fn devices_lost_in_a_row_end_it_and_others_do_not() {
        let mut losses = Losses::new();
        let mut now = Instant::now();
        for _ in 0..10 {
            now += STEADY;
            assert!(losses.again(now), "it worked for a while");
        }
        let after: Vec<bool> = (1..4).map(|secs| losses.again(now + Duration::from_secs(secs))).collect();
        assert_eq!(after, [true, true, false], "three in a row, and the fourth is too many");
    }
}
