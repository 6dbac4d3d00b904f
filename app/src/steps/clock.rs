//! Which step is due: from the clock on the wall, the times of the steps, speed and direction. No window.

use super::{Direction, Repeat};

/// Slowest and fastest playing, against the steps' own times.
pub const SPEEDS: [f64; 2] = [0.05, 20.0];

/// What is due.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Due {
    /// Nothing new yet.
    Same,
    /// This step.
    Step(usize),
    /// The end was reached, at this step; playing has stopped.
    End(usize),
}

/// Where playing began.
#[derive(Debug, Clone, Copy)]
struct Start {
    wall_secs: f64,
    series_secs: f64,
}

/// The player's clock. Times in seconds.
#[derive(Debug, Clone)]
pub struct Clock {
    /// Against the steps' own times; 1 is as it was acquired.
    speed: f64,
    direction: Direction,
    /// Whether the first step follows the last.
    pub repeat: Repeat,
    start: Option<Start>,
    shown: u64,
    dropped: u64,
    playing_since: f64,
}

impl Default for Clock {
    fn default() -> Self {
        let (direction, start) = (Direction::Forward, None);
        Self { speed: 1.0, direction, repeat: Repeat::Loop, start, shown: 0, dropped: 0, playing_since: 0.0 }
    }
}

/// How long the last step lasts: as long as the one before it, or a second where it is alone.
fn last_secs(times: &[f64]) -> f64 {
    match times {
        [.., before, last] => last - before,
        _ => 1.0,
    }
}

impl Clock {
    /// Whether it runs.
    pub fn is_playing(&self) -> bool {
        self.start.is_some()
    }

    /// Steps shown and steps passed over since playing began.
    pub fn counts(&self) -> (u64, u64) {
        (self.shown, self.dropped)
    }

    /// Steps shown in a second since playing began.
    pub fn rate(&self, now_secs: f64) -> f64 {
        let secs = now_secs - self.playing_since;
        if secs > 0.0 { self.shown as f64 / secs } else { 0.0 }
    }

    /// The speed, and which way.
    pub fn speed(&self) -> (f64, Direction) {
        (self.speed, self.direction)
    }

    /// Runs from `step` on. At the end it begins anew.
    pub fn play(&mut self, now_secs: f64, step: usize, times: &[f64]) {
        let last = times.len().saturating_sub(1);
        let at = match self.direction {
            Direction::Forward if step >= last => 0,
            Direction::Backward if step == 0 => last,
            _ => step,
        };
        (self.shown, self.dropped, self.playing_since) = (0, 0, now_secs);
        self.start_at(now_secs, at, times);
    }

    /// Stops where it is.
    pub fn stop(&mut self) {
        self.start = None;
    }

    /// Another speed or direction from `step` on, playing or not.
    pub fn set_speed(&mut self, speed: f64, direction: Direction, now_secs: f64, step: usize, times: &[f64]) {
        self.speed = speed.clamp(SPEEDS[0], SPEEDS[1]);
        self.direction = direction;
        if self.is_playing() {
            self.start_at(now_secs, step, times);
        }
    }

    fn start_at(&mut self, now_secs: f64, step: usize, times: &[f64]) {
        // Time runs back from the end of the step.
        let series_secs = match self.direction {
            Direction::Forward => times.get(step).copied().unwrap_or_default(),
            Direction::Backward => {
                let end = times.get(step + 1).copied();
                end.or_else(|| times.last().map(|t| t + last_secs(times))).unwrap_or_default()
            }
        };
        self.start = Some(Start { wall_secs: now_secs, series_secs });
    }

    /// What is due at `now_secs` where `step` is shown. `times` rise, one a step, at least one.
    pub fn due(&mut self, now_secs: f64, step: usize, times: &[f64]) -> Due {
        let (Some(start), [first, .., last]) = (self.start, times) else { return Due::Same };
        let length = last + last_secs(times) - first;
        let passed = (now_secs - start.wall_secs).max(0.0) * self.speed;
        let along = match self.direction {
            Direction::Forward => start.series_secs - first + passed,
            Direction::Backward => start.series_secs - first - passed,
        };
        let is_over = !(0.0..length).contains(&along) && passed > 0.0;
        if is_over && self.repeat == Repeat::Once {
            self.stop();
            let end = if self.direction == Direction::Forward { times.len() - 1 } else { 0 };
            return Due::End(end);
        }
        let at = first + along.rem_euclid(length);
        let due = times.partition_point(|&t| t <= at).saturating_sub(1);
        if due == step { Due::Same } else { Due::Step(due) }
    }

    /// Counts that `due` follows `step` on the screen, of `count` steps in all.
    pub fn show(&mut self, step: usize, due: usize, count: usize) {
        let on = match self.direction {
            Direction::Forward => (due + count).saturating_sub(step) % count.max(1),
            Direction::Backward => (step + count).saturating_sub(due) % count.max(1),
        };
        self.shown += 1;
        self.dropped += on.saturating_sub(1) as u64;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Ten steps a tenth of a second apart, beginning at 5 s.
    fn times() -> Vec<f64> {
        (0..10).map(|i| 5.0 + f64::from(i) * 0.1).collect()
    }

    #[test]
    fn steps_fall_due_by_their_own_times_and_the_speed() {
        let (times, mut clock) = (times(), Clock::default());
        assert_eq!(clock.due(0.0, 3, &times), Due::Same, "it does not run");
        clock.play(100.0, 3, &times);
        assert_eq!(clock.due(100.05, 3, &times), Due::Same, "the step lasts");
        assert_eq!(clock.due(100.11, 3, &times), Due::Step(4), "the next");
        clock.set_speed(4.0, Direction::Forward, 100.11, 4, &times);
        assert_eq!(clock.due(100.19, 4, &times), Due::Step(7), "four times as fast");
        clock.show(4, 7, 10);
        assert_eq!(clock.counts(), (1, 2), "two were passed over");
        assert!((clock.rate(100.5) - 2.0).abs() < 1e-9, "one in half a second");
    }

    #[test]
    fn the_last_step_is_followed_by_the_first_or_by_the_end() {
        let (times, mut clock) = (times(), Clock::default());
        clock.play(0.0, 9, &times);
        assert_eq!(clock.due(0.05, 9, &times), Due::Step(0), "from the end it begins anew");
        assert_eq!(clock.due(1.05, 0, &times), Due::Same, "round once");
        clock.repeat = Repeat::Once;
        assert_eq!(clock.due(0.97, 8, &times), Due::Step(9), "the last");
        assert_eq!(clock.due(1.01, 9, &times), Due::End(9), "and the end");
        assert!(!clock.is_playing(), "it has stopped");
    }

    #[test]
    fn time_runs_back_too() {
        let (times, mut clock) = (times(), Clock::default());
        clock.set_speed(1.0, Direction::Backward, 0.0, 5, &times);
        clock.play(0.0, 5, &times);
        assert_eq!(clock.due(0.05, 5, &times), Due::Same, "the step lasts");
        assert_eq!(clock.due(0.15, 5, &times), Due::Step(4), "the one before");
        clock.show(5, 4, 10);
        assert_eq!(clock.due(0.65, 4, &times), Due::Step(9), "round");
        clock.show(4, 9, 10);
        assert_eq!(clock.counts(), (2, 4), "3, 2, 1 and 0 were passed over");
    }

    #[test]
    fn a_series_of_one_step_is_never_due() {
        let mut clock = Clock::default();
        clock.play(0.0, 0, &[0.0]);
        assert_eq!(clock.due(9.0, 0, &[0.0]), Due::Same, "nothing follows it");
    }
}
