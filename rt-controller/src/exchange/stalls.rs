//! Stalls of the loop, when its process is stopped, swapped out or starved: logged, counted and
//! remembered.
//!
//! In real time the loop's own wake-ups show a stall. Without deadlines nothing is late; there it shows in
//! the rounds of the exchange thread, which stalls with it.

use std::time::{Duration, Instant};

use crate::exchange::loop_report::LoopReport;

/// A real-time loop that wakes up this late has stalled for hundreds of ticks.
const LATE: Duration = Duration::from_millis(200);
/// Rounds take microseconds; on a busy host a thread may wait for its turn.
const ROUND: Duration = Duration::from_secs(1);

pub(crate) struct Stalls {
    is_realtime: bool,
    /// Since the start.
    pub count: u64,
    pub longest: Duration,
    last: Option<(Duration, Instant)>,
    round: Instant,
    ticked: Instant,
}

impl Stalls {
    pub fn new(is_realtime: bool) -> Stalls {
        let now = Instant::now();
        Stalls {
            is_realtime,
            count: 0,
            longest: Duration::ZERO,
            last: None,
            round: now,
            ticked: now,
        }
    }

    /// Called once per round of the exchange thread, with the loop's reports since the last one.
    /// While there is no plant nothing ticks.
    pub fn see(&mut self, report: &LoopReport, is_absent: bool) {
        let fresh = report.fresh + usize::from(is_absent);
        self.see_at(Instant::now(), fresh, Duration::from_nanos(report.latest_ns));
    }

    fn see_at(&mut self, now: Instant, fresh: usize, late: Duration) {
        let round = now - self.round;
        self.round = now;
        if fresh > 0 {
            self.ticked = now;
        }
        let stall = if self.is_realtime { late } else { round };
        if stall >= if self.is_realtime { LATE } else { ROUND } {
            self.count += 1;
            self.longest = self.longest.max(stall);
            self.last = Some((stall, now));
            tracing::warn!(
                stalls = self.count,
                "the loop stalled for {:.1} s",
                stall.as_secs_f64()
            );
        } else if round >= ROUND {
            let round = round.as_secs_f64();
            tracing::warn!("commands and the learner waited for {round:.1} s; the loop did not");
        }
    }

    /// Duration of the last stall, and time since its end.
    pub fn last(&self) -> Option<(Duration, Duration)> {
        self.last.map(|(stall, ended)| (stall, ended.elapsed()))
    }

    /// Without deadlines nothing ticks between rollouts.
    pub fn is_ticking(&self) -> bool {
        self.tick_age() <= ROUND
    }

    /// In real time: since the last tick was seen.
    pub fn tick_age(&self) -> Duration {
        if self.is_realtime { self.ticked.elapsed() } else { Duration::ZERO }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const MS: Duration = Duration::from_millis(1);

    #[test]
    fn a_loop_in_real_time_stands_still_by_its_own_word() {
        let mut stalls = Stalls::new(true);
        let start = stalls.round;
        stalls.see_at(start + MS, 1, 150 * MS);
        stalls.see_at(start + 3000 * MS, 0, Duration::ZERO);
        assert_eq!((stalls.count, stalls.last()), (0, None), "late, but no stall; a slow exchange");
        stalls.see_at(start + 7000 * MS, 3, 4000 * MS);
        stalls.see_at(start + 7001 * MS, 1, 300 * MS);
        assert_eq!((stalls.count, stalls.longest), (2, 4000 * MS));
        assert_eq!(stalls.last().unwrap().0, 300 * MS);
    }

    #[test]
    fn without_deadlines_the_exchange_stands_still_with_it() {
        let mut stalls = Stalls::new(false);
        let start = stalls.round;
        stalls.see_at(start + 900 * MS, 0, Duration::ZERO);
        assert_eq!(stalls.count, 0);
        stalls.see_at(start + 4900 * MS, 1, Duration::ZERO);
        assert_eq!((stalls.count, stalls.longest), (1, 4000 * MS));
        assert_eq!(stalls.tick_age(), Duration::ZERO, "nothing ticks between rollouts");
    }
}
