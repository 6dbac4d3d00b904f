//! Undo and redo by whole copies of the case, with the changes of one drag joined into one step.
//!
//! Time is passed in, in seconds, so that tests need no clock. The rule is egui's `Undoer`'s: a drag
//! becomes a step when it has rested [`REST_SECS`], or after [`LONGEST_SECS`] at the latest. Changes
//! that are not of one drag (see [`Edit::continues`]) never join.
//!
//! The view and the time shown are no steps: looking around and playing do not fill the list, and undo does not
//! turn the picture or the clock.

use std::collections::VecDeque;

use super::edit::apply;
use super::grids::GridChange;
use super::{Case, Edit, EditError};

/// A pause of this length ends a drag; seconds.
pub const REST_SECS: f64 = 1.0;
/// A drag that goes on longer than this starts a new step; seconds.
pub const LONGEST_SECS: f64 = 30.0;
/// Steps kept; the oldest is forgotten first.
pub const MAX_STEPS: usize = 100;

/// The drag going on.
#[derive(Debug, Clone)]
struct Drag {
    first_secs: f64,
    last_secs: f64,
    edit: Edit,
}

/// A case with its past.
#[derive(Debug, Clone, Default)]
pub struct History {
    case: Case,
    saved: Case,
    undo: VecDeque<Case>,
    redo: Vec<Case>,
    drag: Option<Drag>,
}

impl History {
    /// A case without a past, that counts as saved.
    pub fn new(case: Case) -> Self {
        Self { saved: case.clone(), case, ..Self::default() }
    }

    /// The case as it is.
    pub fn case(&self) -> &Case {
        &self.case
    }

    /// Makes a change at `now_secs`.
    ///
    /// # Errors
    /// [`EditError`]; the case and its past are as they were.
    pub fn edit(&mut self, edit: Edit, now_secs: f64) -> Result<(), EditError> {
        let shows_time = matches!(&edit, Edit::ChangeGrid { change: GridChange::Step(_), .. });
        if shows_time || matches!(edit, Edit::SetCamera(_) | Edit::SetStep { .. }) {
            return apply(&mut self.case, edit);
        }
        let mut changed = self.case.clone();
        apply(&mut changed, edit.clone())?;
        if changed == self.case {
            return Ok(());
        }
        let before = std::mem::replace(&mut self.case, changed);
        let joins = self.drag.as_ref().is_some_and(|drag| {
            edit.continues(&drag.edit)
                && now_secs - drag.last_secs < REST_SECS
                && now_secs - drag.first_secs < LONGEST_SECS
        });
        let first_secs = match &self.drag {
            Some(drag) if joins => drag.first_secs,
            _ => {
                self.push(before);
                now_secs
            }
        };
        self.redo.clear();
        self.drag = Some(Drag { first_secs, last_secs: now_secs, edit });
        Ok(())
    }

    fn push(&mut self, before: Case) {
        self.undo.push_back(before);
        if self.undo.len() > MAX_STEPS {
            self.undo.pop_front();
        }
    }

    /// Ends the drag going on: the next change is a step of its own. For a released pointer.
    pub fn end_drag(&mut self) {
        self.drag = None;
    }

    /// Takes the last step back; whether there was one.
    pub fn undo(&mut self) -> bool {
        let Some(before) = self.undo.pop_back() else { return false };
        let after = self.go_to(before);
        self.redo.push(after);
        true
    }

    /// Does the step that was last taken back again; whether there was one.
    pub fn redo(&mut self) -> bool {
        let Some(after) = self.redo.pop() else { return false };
        let before = self.go_to(after);
        self.push(before);
        true
    }

    /// Replaces the case but keeps the view; the case as it was.
    fn go_to(&mut self, mut case: Case) -> Case {
        self.drag = None;
        keep_view(&mut case, &self.case);
        std::mem::replace(&mut self.case, case)
    }

    /// Whether [`History::undo`] would do something.
    pub fn can_undo(&self) -> bool {
        !self.undo.is_empty()
    }

    /// Whether [`History::redo`] would do something.
    pub fn can_redo(&self) -> bool {
        !self.redo.is_empty()
    }

    /// Remembers the case as it is as the saved one.
    pub fn mark_saved(&mut self) {
        self.saved = self.case.clone();
    }

    /// Whether the case is as it was saved, the view aside.
    pub fn is_saved(&self) -> bool {
        let mut saved = self.saved.clone();
        keep_view(&mut saved, &self.case);
        saved == self.case
    }
}

/// Gives a case the camera and the steps shown of another.
fn keep_view(case: &mut Case, shown: &Case) {
    case.camera = shown.camera;
    for volume in &mut case.volumes {
        if let Some(now) = shown.volume(&volume.id) {
            volume.step = now.step;
        }
    }
    for grid in &mut case.grids {
        if let Some(now) = shown.grid(&grid.id) {
            grid.step = now.step;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn named(history: &mut History, name: &str, now_secs: f64) {
        history.edit(Edit::SetName(name.to_owned()), now_secs).expect("a name");
    }

    fn background(history: &mut History, grey: f64, now_secs: f64) {
        history.edit(Edit::SetBackground([grey; 3]), now_secs).expect("a colour");
    }

    #[test]
    fn undo_and_redo_walk_the_steps_both_ways() {
        let mut history = History::new(Case::default());
        named(&mut history, "a", 0.0);
        background(&mut history, 0.5, 0.1);
        assert!(history.undo(), "the colour");
        assert_eq!((history.case().name.as_str(), history.case().background[0]), ("a", 0.0), "one step");
        assert!(history.undo() && !history.undo(), "the name, and then no more");
        assert!(history.is_saved(), "as at the start");
        assert!(history.redo() && history.redo() && !history.redo(), "forth again");
        assert_eq!((history.case().name.as_str(), history.case().background[0]), ("a", 0.5), "as before");
    }

    #[test]
    fn a_new_change_forgets_what_was_taken_back() {
        let mut history = History::new(Case::default());
        named(&mut history, "a", 0.0);
        history.undo();
        background(&mut history, 0.5, 1.0);
        assert!(!history.can_redo(), "the other future is gone");
    }

    #[test]
    fn a_drag_is_one_step_until_it_rests_a_second() {
        let mut history = History::new(Case::default());
        for i in 0..10 {
            background(&mut history, 0.01 * f64::from(i + 1), 0.5 * f64::from(i));
        }
        background(&mut history, 0.9, 5.6);
        history.undo();
        assert!((history.case().background[0] - 0.1).abs() < 1e-12, "the second drag only");
        history.undo();
        assert_eq!(history.case().background, [0.0; 3], "the first drag as a whole");
    }

    #[test]
    fn a_drag_without_rest_is_a_step_every_thirty_seconds() {
        let mut history = History::new(Case::default());
        for i in 0..=70 {
            background(&mut history, 0.01 * f64::from(i + 1), 0.5 * f64::from(i));
        }
        history.undo();
        assert!((history.case().background[0] - 0.6).abs() < 1e-12, "back to second 29.5");
    }

    #[test]
    fn releasing_the_pointer_ends_a_drag() {
        let mut history = History::new(Case::default());
        background(&mut history, 0.1, 0.0);
        history.end_drag();
        background(&mut history, 0.2, 0.1);
        history.undo();
        assert_eq!(history.case().background[0], 0.1, "two steps");
    }

    #[test]
    fn only_the_last_hundred_steps_are_kept() {
        let mut history = History::new(Case::default());
        for i in 0..150 {
            named(&mut history, &i.to_string(), 10.0 * f64::from(i));
        }
        let mut count = 0;
        while history.undo() {
            count += 1;
        }
        assert_eq!((count, history.case().name.as_str()), (MAX_STEPS, "49"), "the newest hundred");
    }

    #[test]
    fn a_refused_change_leaves_no_step() {
        let mut history = History::new(Case::default());
        let refused = history.edit(Edit::RemoveCutter { id: "c".to_owned() }, 0.0);
        assert!(refused.is_err() && !history.can_undo(), "nothing happened");
    }

    #[test]
    fn the_step_shown_is_no_change_of_the_plan_and_undo_does_not_turn_it_back() {
        let transfer = crate::presets::default_for(None, [0.0, 1.0]);
        let source = crate::case::Source::Builtin("hip/ct".to_owned());
        let volume = crate::case::Volume::new("beat", source, std::sync::Arc::new(transfer));
        let mut history = History::new(Case { volumes: vec![volume], ..Case::default() });
        named(&mut history, "a", 0.0);
        history.edit(Edit::SetStep { id: "beat".to_owned(), step: 7 }, 1.0).expect("a step");
        assert!(history.undo() && !history.can_undo(), "only the name was a change");
        assert!(history.is_saved(), "playing is nothing to save");
        assert_eq!(history.case().volumes[0].step, 7, "the clock stays");
    }
}
