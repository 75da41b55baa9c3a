//! Absolute deadlines on the monotonic clock.

use rustix::thread::clock_nanosleep_absolute;
use rustix::time::{ClockId, Timespec, clock_gettime};

const NS_PER_S: u64 = 1_000_000_000;

/// A periodic deadline that never drifts.
pub struct Clock {
    period_ns: u64,
    deadline_ns: u64,
    missed: u64,
}

/// How a tick began.
#[derive(Clone, Copy, Debug)]
pub struct Wake {
    /// Wake-up after the deadline, ns.
    pub late_ns: u64,
    /// Deadlines missed since the clock was made.
    pub missed: u64,
}

impl Clock {
    pub fn new(period_ns: u64) -> Clock {
        Clock { period_ns, deadline_ns: now_ns() + period_ns, missed: 0 }
    }

    /// Sleeps until the next deadline. A deadline that has passed by a whole period is counted as
    /// missed and skipped: the grid of deadlines stays where it was.
    pub fn wait(&mut self) -> Wake {
        let deadline = Timespec {
            tv_sec: (self.deadline_ns / NS_PER_S) as i64,
            tv_nsec: (self.deadline_ns % NS_PER_S) as _,
        };
        // A signal may end the sleep early; the rest is slept again.
        while now_ns() < self.deadline_ns {
            let _ = clock_nanosleep_absolute(ClockId::Monotonic, &deadline);
        }
        let late_ns = now_ns() - self.deadline_ns;
        let skipped = late_ns / self.period_ns;
        self.missed += skipped;
        self.deadline_ns += (skipped + 1) * self.period_ns;
        Wake { late_ns, missed: self.missed }
    }
}

/// Monotonic time, ns.
pub fn now_ns() -> u64 {
    let now = clock_gettime(ClockId::Monotonic);
    now.tv_sec as u64 * NS_PER_S + now.tv_nsec as u64
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn counts_missed_deadlines_and_keeps_the_grid() {
        let period = 2_000_000;
        let mut clock = Clock::new(period);
        let first = clock.deadline_ns;
        std::thread::sleep(std::time::Duration::from_millis(9));
        let wake = clock.wait();
        assert!(wake.missed >= 3, "slept through {} deadlines", wake.missed);
        assert_eq!((clock.deadline_ns - first) % period, 0);
        assert!(clock.deadline_ns > now_ns() - period);
    }
}
