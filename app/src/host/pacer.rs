//! When to draw the 3D picture, and how large: never twice the same, roughly while things move, well when
//! they rest, and never so slowly that the window stops answering for long.
//!
//! On a graphics card every picture has its full size. Without one a picture may need seconds; then drafts have
//! fewer pixels, by what the last one took, and so has the good one where the window stands still for it. A picture
//! that is drawn beside the window is asked for first and comes later.

/// How long nothing must change before the picture is drawn well; seconds.
pub const REST_SECS: f64 = 0.15;
/// What a draft may take; milliseconds.
pub const DRAFT_MS: f64 = 80.0;
/// What a good picture may take, since the window stands still for it; milliseconds.
pub const GOOD_MS: f64 = 2500.0;
/// A good picture takes about this many times as long as a draft of its size: half the step.
const GOOD_PER_DRAFT: f64 = 2.0;
/// Smallest part of the full size, each way.
const LEAST: f64 = 0.2;

/// What to do in this frame. `scale` is the part of the full size, each way.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Need {
    /// The picture is as it should be, or being drawn.
    Nothing,
    /// Ask for a picture now, drawn roughly.
    Draft {
        /// Above 0, at most 1.
        scale: f64,
    },
    /// Ask for a picture now, drawn well.
    Good {
        /// Above 0, at most 1.
        scale: f64,
    },
    /// Look again after this many seconds.
    Later(f64),
}

/// How far the picture last asked for is.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Stage {
    /// Its draft is being drawn.
    Drafting,
    /// Its draft is there.
    Drafted,
    /// It is being drawn well.
    Refining,
    /// Nothing more is needed of it.
    AtRest,
}

/// What was asked for last. `K` is all that a picture depends on.
#[derive(Debug, Clone)]
pub struct Pacer<K> {
    asked: Option<K>,
    stage: Stage,
    changed_secs: f64,
    /// What a draft of the full size would take, by the last one; milliseconds.
    whole_ms: f64,
}

impl<K> Default for Pacer<K> {
    fn default() -> Self {
        Self { asked: None, stage: Stage::Drafting, changed_secs: 0.0, whole_ms: 0.0 }
    }
}

/// The part of the size, each way, at which a picture of `whole_ms` takes at most `allowed_ms`, in
/// steps of a tenth so that the size does not change with every frame.
fn scale(whole_ms: f64, allowed_ms: f64) -> f64 {
    if whole_ms <= allowed_ms {
        return 1.0;
    }
    let part = (allowed_ms / whole_ms).sqrt();
    ((part * 10.0).floor() / 10.0).clamp(LEAST, 1.0)
}

impl<K: PartialEq> Pacer<K> {
    /// What a picture of `key` needs at `now_secs`.
    pub fn need(&mut self, key: &K, now_secs: f64) -> Need {
        if self.asked.as_ref() != Some(key) {
            self.changed_secs = now_secs;
            return Need::Draft { scale: scale(self.whole_ms, DRAFT_MS) };
        }
        if self.stage != Stage::Drafted {
            return Need::Nothing;
        }
        let rested = now_secs - self.changed_secs;
        if rested < REST_SECS {
            return Need::Later(REST_SECS - rested);
        }
        Need::Good { scale: scale(self.whole_ms * GOOD_PER_DRAFT, GOOD_MS) }
    }

    /// A draft of `key` was asked for.
    pub fn drafts(&mut self, key: K) {
        self.asked = Some(key);
        self.stage = Stage::Drafting;
    }

    /// The picture of the last draft was asked for, drawn well.
    pub fn refines(&mut self) {
        self.stage = Stage::Refining;
    }

    /// A draft came at `scale` that took `took_ms`, making of textures not counted. `is_newest` where it is that of
    /// the picture last asked for.
    pub fn drafted(&mut self, is_newest: bool, scale: f64, took_ms: f64) {
        self.whole_ms = took_ms / (scale * scale);
        if is_newest {
            self.stage = Stage::Drafted;
        }
    }

    /// The picture last asked for came, drawn well, or cannot be drawn: nothing more is needed of it.
    pub fn rests(&mut self) {
        self.stage = Stage::AtRest;
    }

    /// Whether the draft of the last picture asked for is there, and nothing better was asked for.
    pub fn is_drafted(&self) -> bool {
        self.stage == Stage::Drafted
    }

    /// Whether the last picture asked for is there, drawn well.
    pub fn is_at_rest(&self) -> bool {
        self.stage == Stage::AtRest
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A draft that is asked for and there at once.
    fn draft(pacer: &mut Pacer<i32>, key: i32, scale: f64, took_ms: f64) {
        pacer.drafts(key);
        pacer.drafted(true, scale, took_ms);
    }

    #[test]
    fn a_picture_is_drafted_then_drawn_well_and_then_left_alone() {
        let mut pacer = Pacer::default();
        assert_eq!(pacer.need(&1, 10.0), Need::Draft { scale: 1.0 }, "new");
        pacer.drafts(1);
        assert_eq!(pacer.need(&1, 10.01), Need::Nothing, "it is being drawn");
        pacer.drafted(true, 1.0, 20.0);
        assert!(
            matches!(pacer.need(&1, 10.05), Need::Later(s) if (s - 0.1).abs() < 1e-9),
            "it may still move"
        );
        assert_eq!(pacer.need(&1, 10.2), Need::Good { scale: 1.0 }, "it rests");
        pacer.refines();
        assert!(pacer.need(&1, 10.3) == Need::Nothing && !pacer.is_at_rest(), "it is being drawn well");
        pacer.rests();
        assert!(pacer.need(&1, 500.0) == Need::Nothing && pacer.is_at_rest(), "nothing changed");
        assert_eq!(pacer.need(&2, 501.0), Need::Draft { scale: 1.0 }, "something changed");
        pacer.drafts(2);
        assert!(!pacer.is_at_rest(), "the new one is not there");
        pacer.drafted(false, 1.0, 20.0);
        assert_eq!(pacer.need(&2, 502.0), Need::Nothing, "a draft of an older one is not it");
    }

    #[test]
    fn pictures_shrink_to_what_the_device_can_do_and_grow_again() {
        let mut pacer = Pacer::default();
        draft(&mut pacer, 1, 1.0, 2000.0);
        assert_eq!(pacer.need(&2, 0.0), Need::Draft { scale: 0.2 }, "a fifth each way: 80 ms");
        draft(&mut pacer, 2, 0.2, 80.0);
        assert_eq!(pacer.need(&2, 9.0), Need::Good { scale: 0.7 }, "half the pixels: 2 s instead of 4");
        assert_eq!(pacer.need(&3, 9.0), Need::Draft { scale: 0.2 }, "as slow as before");
        draft(&mut pacer, 3, 0.2, 1.0);
        assert_eq!(pacer.need(&4, 9.1), Need::Draft { scale: 1.0 }, "fast");
    }
}
