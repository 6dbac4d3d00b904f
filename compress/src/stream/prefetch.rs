//! Which chunk is wanted next.

/// The way through time.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Direction {
    /// From earlier to later steps.
    Forward,
    /// From later to earlier steps.
    Backward,
}

/// What comes after the end.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Repeat {
    /// Nothing.
    Once,
    /// The other end, again and again.
    Loop,
}

/// The chunks still wanted, in order.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) struct Wanted {
    next: Option<u32>,
    chunks: u32,
    direction: Direction,
    repeat: Repeat,
}

impl Wanted {
    /// Nothing.
    pub(super) const NONE: Self =
        Self { next: None, chunks: 0, direction: Direction::Forward, repeat: Repeat::Once };

    /// From `chunk`, one of `chunks`, on.
    pub(super) fn from(chunk: u32, chunks: u32, direction: Direction, repeat: Repeat) -> Self {
        Self { next: Some(chunk), chunks, direction, repeat }
    }

    /// The next chunk, without going on.
    pub(super) fn peek(&self) -> Option<u32> {
        self.next
    }
}

impl Iterator for Wanted {
    type Item = u32;

    fn next(&mut self) -> Option<u32> {
        let chunk = self.next?;
        let round = self.repeat == Repeat::Loop;
        self.next = match self.direction {
            Direction::Forward if chunk + 1 < self.chunks => Some(chunk + 1),
            Direction::Forward => round.then_some(0),
            Direction::Backward if chunk > 0 => Some(chunk - 1),
            Direction::Backward => round.then_some(self.chunks.saturating_sub(1)),
        };
        Some(chunk)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn chunks_follow_the_direction_and_go_round_if_they_repeat() {
        let first = |chunk, direction, repeat| -> Vec<u32> {
            Wanted::from(chunk, 4, direction, repeat).take(7).collect()
        };
        assert_eq!(first(1, Direction::Forward, Repeat::Once), [1, 2, 3], "to the end");
        assert_eq!(first(1, Direction::Backward, Repeat::Once), [1, 0], "to the beginning");
        assert_eq!(first(2, Direction::Forward, Repeat::Loop), [2, 3, 0, 1, 2, 3, 0], "round");
        assert_eq!(first(1, Direction::Backward, Repeat::Loop), [1, 0, 3, 2, 1, 0, 3], "round, backward");
        let single: Vec<u32> = Wanted::from(0, 1, Direction::Backward, Repeat::Loop).take(3).collect();
        assert_eq!(single, [0, 0, 0], "a single chunk");
        assert_eq!(Wanted::NONE.count(), 0, "nothing");
    }
}
