//! The newest line of each kind, for any number of readers.
//!
//! A writer replaces lines and never waits; a reader takes what is newer than what it has sent. A slow reader
//! skips lines that way, and none is queued.

use std::sync::{Arc, Condvar, Mutex, MutexGuard, PoisonError};
use std::time::Duration;

/// Every line is complete in itself.
#[derive(Clone, Copy)]
pub enum Kind {
    /// Where everything is, many times a second.
    Pose,
    /// Health, learner, policies.
    State,
    /// Reward and timing.
    Curves,
}

const KINDS: usize = 3;

#[derive(Default)]
struct Lines {
    newest: [Option<Arc<str>>; KINDS],
    versions: [u64; KINDS],
}

#[derive(Default)]
pub struct Board {
    lines: Mutex<Lines>,
    changed: Condvar,
}

/// What a reader has taken so far.
#[derive(Default)]
pub struct Taken([u64; KINDS]);

impl Board {
    pub fn post(&self, kind: Kind, line: String) {
        let mut lines = self.lock();
        lines.newest[kind as usize] = Some(line.into());
        lines.versions[kind as usize] += 1;
        self.changed.notify_all();
    }

    /// Waits up to `timeout` for lines newer than `taken`.
    pub fn newer(&self, taken: &mut Taken, timeout: Duration) -> Vec<Arc<str>> {
        let is_known = |lines: &mut Lines| lines.versions == taken.0;
        let waited = self.changed.wait_timeout_while(self.lock(), timeout, is_known);
        let (lines, _) = waited.unwrap_or_else(PoisonError::into_inner);
        let new = (0..KINDS).filter(|kind| lines.versions[*kind] != taken.0[*kind]);
        let newer = new.filter_map(|kind| lines.newest[kind].clone()).collect();
        taken.0 = lines.versions;
        newer
    }

    fn lock(&self) -> MutexGuard<'_, Lines> {
        self.lines.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_slow_reader_skips_lines_and_misses_no_kind() {
        let (board, mut taken) = (Board::default(), Taken::default());
        assert!(board.newer(&mut taken, Duration::ZERO).is_empty());
        board.post(Kind::State, "well".into());
        for tick in 0..100 {
            board.post(Kind::Pose, format!("pose {tick}"));
        }
        let lines = board.newer(&mut taken, Duration::ZERO);
        assert_eq!(lines.iter().map(|line| &**line).collect::<Vec<_>>(), ["pose 99", "well"]);
        assert!(board.newer(&mut taken, Duration::ZERO).is_empty());
    }
}
