//! The case that is open: its history, its data, what is being loaded, what went wrong. No window.
//!
//! Work goes one at a time, in the order asked for: first what the user opened, then what the case
//! needs and has not got. Time is passed in, in seconds, as to [`History`].

use std::collections::{BTreeSet, VecDeque};
use std::path::{Path, PathBuf};
use std::sync::Arc;

use crate::added;
use crate::case::assets::{self, Asset, Key};
use crate::case::grids::GridChange;
use crate::case::{Assets, Case, Edit, History, Source, file};
use crate::jobs::{Job, Poll, Reporter, Step};
use crate::load::{Limits, LoadError, Severity};
use crate::save::labels::{self, Saved};
use crate::scene;

/// Something the user should read.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Problem {
    /// One sentence that names what is wrong and what to do.
    pub text: String,
    /// Whether nothing was done because of it; otherwise part of the data is missing.
    pub is_fault: bool,
}

/// What to do in the background.
#[derive(Debug, Clone)]
enum Work {
    /// Find out what is there and load it.
    Open(Source),
    /// Load what the case needs of one source.
    Fill(Vec<Key>),
}

/// What came of it.
#[derive(Debug)]
enum Outcome {
    Case(PathBuf, Box<Case>),
    Opened(Vec<Arc<Asset>>),
    Filled(Vec<Arc<Asset>>),
    Failed { keys: Vec<Key>, text: String },
    Cancelled { keys: Vec<Key> },
}

/// Called from other threads when there is something to look at.
pub type Wake = Arc<dyn Fn() + Send + Sync>;

/// An open case.
pub struct Session {
    history: History,
    assets: Assets,
    /// Grows whenever data arrive.
    revision: u64,
    path: Option<PathBuf>,
    queue: VecDeque<Work>,
    running: Option<Job<Outcome>>,
    /// Sources that gave nothing: not asked again until the user shows the thing anew.
    failed: BTreeSet<Key>,
    problems: Vec<Problem>,
    /// Faults of grids that are problems already, read or not.
    told: BTreeSet<String>,
    /// A case that was opened while this one has changes.
    waiting: Option<(PathBuf, Box<Case>)>,
    /// Grows whenever another case takes this one's place.
    replaced: u64,
    /// Painted labels that are in files already.
    saved_labels: Saved,
    wake: Wake,
}

impl std::fmt::Debug for Session {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Session")
            .field("path", &self.path)
            .field("queue", &self.queue)
            .finish_non_exhaustive()
    }
}

impl Session {
    /// A session on `case`, which counts as saved. `wake` is called when a load ends.
    pub fn new(case: Case, wake: Wake) -> Self {
        Self {
            history: History::new(case),
            assets: Assets::default(),
            revision: 0,
            path: None,
            queue: VecDeque::new(),
            running: None,
            failed: BTreeSet::new(),
            problems: Vec::new(),
            told: BTreeSet::new(),
            waiting: None,
            replaced: 0,
            saved_labels: Saved::new(),
            wake,
        }
    }

    /// The case with its past.
    pub fn history(&self) -> &History {
        &self.history
    }

    /// The case.
    pub fn case(&self) -> &Case {
        self.history.case()
    }

    /// Its data, as far as loaded.
    pub fn assets(&self) -> &Assets {
        &self.assets
    }

    /// A number that differs whenever data arrived.
    pub fn revision(&self) -> u64 {
        self.revision
    }

    /// A number that differs whenever another case took the place of the one before.
    pub fn replaced(&self) -> u64 {
        self.replaced
    }

    /// The case file, once there is one.
    pub fn path(&self) -> Option<&Path> {
        self.path.as_deref()
    }

    /// What the user should read, oldest first.
    pub fn problems(&self) -> &[Problem] {
        &self.problems
    }

    /// The user has read one.
    pub fn dismiss(&mut self, index: usize) {
        if index < self.problems.len() {
            self.problems.remove(index);
        }
    }

    /// Something outside the session failed.
    pub fn complain(&mut self, text: impl Into<String>) {
        let problem = Problem { text: text.into(), is_fault: true };
        if !self.problems.contains(&problem) {
            self.problems.push(problem);
        }
    }

    /// Says what went wrong with volumes over time that are read as they play.
    pub fn complain_of_steps(&mut self) {
        let moving = self.history.case().volumes.iter().filter_map(|v| self.assets.steps(v));
        let faults: Vec<String> = moving.filter_map(|steps| steps.take_fault()).collect();
        for fault in faults {
            self.complain(fault);
        }
    }

    /// Says, once, which visible grids cannot be shown and why.
    pub fn complain_of_grids(&mut self) {
        let visible = self.history.case().grids.iter().filter(|grid| grid.visible);
        let faults: BTreeSet<String> = visible.filter_map(|g| scene::grid_fault(g, &self.assets)).collect();
        for fault in &faults {
            if !self.told.contains(fault) {
                self.complain(fault.as_str());
            }
        }
        self.told = faults;
    }

    /// Changes the case; a refusal becomes a [`Problem`].
    pub fn edit(&mut self, edit: Edit, now_secs: f64) {
        if let Edit::SetVolumeVisible { visible: true, .. }
        | Edit::SetImplantVisible { visible: true, .. }
        | Edit::ChangeGrid { change: GridChange::Visible(true), .. } = edit
        {
            self.failed.clear();
        }
        if let Err(error) = self.history.edit(edit, now_secs) {
            self.complain(error.to_string());
        }
    }

    /// One step back.
    pub fn undo(&mut self) {
        self.history.undo();
    }

    /// One step forth.
    pub fn redo(&mut self) {
        self.history.redo();
    }

    /// The pointer let go: what follows is another step.
    pub fn end_drag(&mut self) {
        self.history.end_drag();
    }

    /// Opens files and folders, in order, in the background.
    pub fn open(&mut self, paths: impl IntoIterator<Item = PathBuf>) {
        self.queue.extend(paths.into_iter().map(|p| Work::Open(Source::path(&p))));
    }

    /// Writes the case to `path`, which is its file from then on, and painted labels into new files beside it.
    pub fn save(&mut self, path: &Path) -> bool {
        let written = labels::beside(self.history.case(), &self.assets, path, &mut self.saved_labels);
        let saved = match written {
            Ok(case) => file::save(&case, path).map_err(|error| error.to_string()),
            Err(error) => Err(error.to_string()),
        };
        match saved {
            Ok(()) => {
                self.path = Some(path.to_owned());
                self.history.mark_saved();
                true
            }
            Err(fault) => {
                self.complain(fault);
                false
            }
        }
    }

    /// A case that waits for the user to say what becomes of the changes in this one.
    pub fn waiting(&self) -> Option<&Path> {
        self.waiting.as_ref().map(|(path, _)| path.as_path())
    }

    /// Takes the waiting case (`true`) or forgets it.
    pub fn settle(&mut self, take: bool) {
        if let Some((path, case)) = self.waiting.take()
            && take
        {
            self.replace(path, *case);
        }
    }

    fn replace(&mut self, path: PathBuf, case: Case) {
        self.history = History::new(case);
        self.path = Some(path);
        self.saved_labels.clear();
        self.failed.clear();
        self.told.clear();
        self.replaced += 1;
    }

    /// What is being loaded and how far it is; `None` where nothing is.
    pub fn progress(&mut self) -> Option<(String, Step)> {
        self.running.as_mut().map(|job| (job.name().to_owned(), job.step().clone()))
    }

    /// Whether nothing is being loaded or waits to be.
    pub fn is_idle(&self) -> bool {
        self.running.is_none() && self.queue.is_empty() && self.lacking().is_empty()
    }

    /// Stops what is being loaded and forgets what waits.
    pub fn cancel(&mut self) {
        self.queue.clear();
        if let Some(job) = &self.running {
            job.cancel();
        }
    }

    /// What the case needs and may still be asked for.
    fn lacking(&self) -> Vec<Key> {
        let mut keys = self.assets.missing(self.case());
        keys.retain(|k| !self.failed.contains(k));
        keys
    }

    /// Takes in what was loaded and starts what comes next. To be called every frame.
    pub fn tick(&mut self, now_secs: f64) {
        if let Some(job) = &self.running {
            match job.poll() {
                Poll::Running => return,
                Poll::Done(outcome) => {
                    self.running = None;
                    self.take(outcome, now_secs);
                }
                Poll::Lost => {
                    self.running = None;
                    // Not asked for again: the same fault would come back for ever.
                    let lost = self.lacking();
                    self.failed.extend(lost);
                    self.complain("loading stopped because of a fault in the program; try another file");
                }
            }
        }
        let next = self.queue.pop_front().or_else(|| {
            let mut keys = self.lacking();
            let source = keys.first()?.source.clone();
            keys.retain(|k| k.source == source);
            Some(Work::Fill(keys))
        });
        if let Some(work) = next {
            self.start(work);
        }
    }

    fn start(&mut self, work: Work) {
        let source = match &work {
            Work::Open(source) => Some(source),
            Work::Fill(keys) => keys.first().map(|k| &k.source),
        };
        let name = source.map_or_else(|| "data".to_owned(), Source::short_name);
        let wake = Arc::clone(&self.wake);
        let keys = if let Work::Fill(keys) = &work { keys.clone() } else { Vec::new() };
        match Job::start(&name, move |reporter| perform(work, reporter), move || wake()) {
            Ok(job) => self.running = Some(job),
            Err(error) => {
                self.failed.extend(keys);
                self.complain(format!(
                    "\"{name}\" cannot be loaded ({error}); close other programs and try again"
                ));
            }
        }
    }

    fn take(&mut self, outcome: Outcome, now_secs: f64) {
        match outcome {
            Outcome::Case(path, case) => {
                if self.history.is_saved() {
                    self.replace(path, *case);
                } else {
                    self.waiting = Some((path, case));
                }
            }
            Outcome::Opened(found) => {
                self.keep(&found);
                self.add(&found, now_secs);
            }
            Outcome::Filled(found) => self.keep(&found),
            Outcome::Failed { keys, text } => {
                self.failed.extend(keys);
                self.complain(text);
            }
            Outcome::Cancelled { keys } => self.failed.extend(keys),
        }
    }

    fn keep(&mut self, found: &[Arc<Asset>]) {
        self.revision += 1;
        for asset in found {
            for note in asset.notes.iter().filter(|n| n.severity == Severity::Loss) {
                self.problems
                    .push(Problem { text: format!("{}: {}", asset.name, note.text), is_fault: false });
            }
        }
        self.assets.extend(found.iter().cloned());
    }

    /// What was opened joins the case. Where nothing was planned yet there is nothing to take back, and
    /// nothing to save.
    fn add(&mut self, found: &[Arc<Asset>], now_secs: f64) {
        if found.is_empty() {
            self.complain("the file holds no volume, no surface and no unstructured grid; choose another");
            return;
        }
        let untouched = self.history.is_saved() && !self.history.can_undo() && self.path.is_none();
        for asset in found {
            let edit = added::edit(self.case(), asset);
            self.edit(edit, now_secs);
        }
        if untouched {
            self.history = History::new(self.case().clone());
        }
    }
}

/// Runs on the job's thread.
fn perform(work: Work, reporter: &Reporter) -> Outcome {
    let limits = Limits::default();
    let failed = |keys: Vec<Key>, error: &assets::AssetError| match error {
        assets::AssetError::Load(LoadError::Cancelled) => Outcome::Cancelled { keys },
        _ => Outcome::Failed { keys, text: sentence(&error.to_string()) },
    };
    match work {
        Work::Open(Source::Path(path)) if file::looks_like_case(&path) => match file::load(&path) {
            Ok(case) => Outcome::Case(path, Box::new(case)),
            Err(error) => Outcome::Failed { keys: Vec::new(), text: sentence(&error.to_string()) },
        },
        Work::Open(source) => match assets::open(&source, &limits, reporter) {
            Ok(found) => Outcome::Opened(found),
            Err(error) => failed(Vec::new(), &error),
        },
        Work::Fill(keys) => match assets::load_keys(&keys, &limits, reporter) {
            Ok(found) => Outcome::Filled(found),
            Err(error) => failed(keys, &error),
        },
    }
}

/// A loader's message as a sentence of its own: "cannot be read …" needs a subject.
fn sentence(message: &str) -> String {
    let verb = message.split(' ').next().unwrap_or_default();
    if matches!(verb, "cannot" | "is" | "holds" | "has") {
        format!("This {message}")
    } else {
        message.to_owned()
    }
}

#[cfg(test)]
mod tests {
    use std::time::{Duration, Instant};

    use super::*;
    use crate::case::Implant;

    fn session() -> Session {
        Session::new(Case::default(), Arc::new(|| ()))
    }

    /// Ticks until nothing is being loaded; at most ten seconds.
    fn settle(session: &mut Session) {
        let began = Instant::now();
        session.tick(0.0);
        while !session.is_idle() {
            assert!(began.elapsed() < Duration::from_secs(10), "loading does not end");
            std::thread::sleep(Duration::from_millis(2));
            session.tick(began.elapsed().as_secs_f64());
        }
    }

    /// A one-triangle surface on disk.
    fn surface(folder: &Path) -> PathBuf {
        let path = folder.join("plate.stl");
        let facet =
            "facet normal 0 0 1\nouter loop\nvertex 0 0 0\nvertex 9 0 0\nvertex 0 9 0\nendloop\nendfacet";
        std::fs::write(&path, format!("solid plate\n{facet}\nendsolid plate\n")).expect("written");
        path
    }

    #[test]
    fn an_opened_surface_becomes_an_implant_and_nothing_to_save() {
        let folder = tempfile::tempdir().expect("folder");
        let mut session = session();
        session.open([surface(folder.path())]);
        settle(&mut session);
        assert_eq!(session.problems(), [], "no complaint");
        let implant = session.case().implants.first().expect("an implant");
        assert_eq!(implant.id, "plate", "named after its file");
        assert!(session.assets().mesh(implant).is_some(), "with its triangles");
        assert!(session.history().is_saved(), "looking at a file is no change");
        session.open([surface(folder.path())]);
        session.edit(Edit::SetName("a plan".to_owned()), 0.0);
        settle(&mut session);
        assert_eq!(session.case().implants.len(), 2, "the second joins the first");
        assert!(!session.history().is_saved(), "and is a change of what was planned");
    }

    #[test]
    fn what_cannot_be_opened_is_one_sentence_with_the_path() {
        let mut session = session();
        session.open([PathBuf::from("/there/is/no/such.nrrd")]);
        settle(&mut session);
        let [problem] = session.problems() else { panic!("one complaint, not {:?}", session.problems()) };
        assert!(problem.is_fault && problem.text.contains("such.nrrd"), "{}", problem.text);
        session.dismiss(0);
        assert!(session.problems().is_empty(), "read and gone");
    }

    #[test]
    fn a_case_is_saved_opened_again_and_waits_where_there_are_changes() {
        let folder = tempfile::tempdir().expect("folder");
        let file = folder.path().join("hip.json");
        let mut first = session();
        first.open([surface(folder.path())]);
        settle(&mut first);
        first.edit(Edit::SetName("left hip".to_owned()), 0.0);
        assert!(first.save(&file) && first.history().is_saved(), "saved");
        let mut second = session();
        second.edit(Edit::SetName("something else".to_owned()), 0.0);
        second.open([file.clone()]);
        settle(&mut second);
        assert_eq!(second.case().name, "something else", "changes are not thrown away unasked");
        assert_eq!(second.waiting(), Some(file.as_path()), "it waits");
        second.settle(true);
        settle(&mut second);
        assert_eq!(second.case().name, "left hip", "taken");
        let implant = &second.case().implants[0];
        assert!(second.assets().mesh(implant).is_some(), "its data were loaded by themselves");
    }

    #[test]
    fn missing_data_are_complained_of_once_and_not_asked_for_again() {
        let mut case = Case::default();
        case.implants.push(Implant::new("stem", Source::path(Path::new("/nowhere/stem.stl"))));
        let mut session = Session::new(case, Arc::new(|| ()));
        settle(&mut session);
        settle(&mut session);
        assert_eq!(session.problems().len(), 1, "once");
        session.edit(Edit::SetImplantVisible { id: "stem".to_owned(), visible: false }, 0.0);
        session.edit(Edit::SetImplantVisible { id: "stem".to_owned(), visible: true }, 0.0);
        assert!(!session.is_idle(), "shown anew, it is tried anew");
    }
}
