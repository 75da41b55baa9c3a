//! Absolute deadlines on the monotonic clock.

use rustix::thread::clock_nanosleep_absolute;
use rustix::time::{ClockId, Timespec, clock_gettime};

const NS_PER_S: u64 = 1_000_000_000;

/// A periodic deadline that never drifts.
///
/// Deadlines are whole multiples of the period on the monotonic clock, plus `phase_ns`: two loops of
/// one host know where the other one is.
pub struct Clock {
    period_ns: u64,
    /// The sleep ends this much before the deadline; the rest is spun.
    spin_ns: u64,
    deadline_ns: u64,
    missed: u64,
    overruns: u32,
}

/// How a tick began.
#[derive(Clone, Copy, Debug)]
pub struct Wake {
    /// Wake-up after the deadline, ns.
    pub late_ns: u64,
    /// Deadlines missed since the clock was made.
    pub missed: u64,
    /// Waits in a row, this one included, that ended a period or more too late.
    pub overruns: u32,
}

impl Wake {
    /// The wake-up of a loop that is not paced by a clock.
    pub const UNPACED: Wake = Wake { late_ns: 0, missed: 0, overruns: 0 };
}

impl Clock {
    pub fn new(period_ns: u64, phase_ns: u64, spin_ns: u64) -> Clock {
        let deadline_ns = (now_ns() / period_ns + 1) * period_ns + phase_ns;
        Clock { period_ns, spin_ns, deadline_ns, missed: 0, overruns: 0 }
    }

    /// Waits for the next deadline. One that has passed by a whole period is counted as missed and
    /// skipped: the grid of deadlines stays where it was.
    pub fn wait(&mut self) -> Wake {
        let sleep_until = self.deadline_ns.saturating_sub(self.spin_ns);
        let wake_up = Timespec {
            tv_sec: (sleep_until / NS_PER_S) as i64,
            tv_nsec: (sleep_until % NS_PER_S) as _,
        };
        let mut now = now_ns();
        // A signal may end the sleep early; the rest is slept again.
        while now < sleep_until {
            let _ = clock_nanosleep_absolute(ClockId::Monotonic, &wake_up);
            now = now_ns();
        }
        while now < self.deadline_ns {
            std::hint::spin_loop();
            now = now_ns();
        }
        let late_ns = now - self.deadline_ns;
        let skipped = late_ns / self.period_ns;
        self.missed += skipped;
        self.overruns = if skipped > 0 { self.overruns.saturating_add(1) } else { 0 };
        self.deadline_ns += (skipped + 1) * self.period_ns;
        Wake { late_ns, missed: self.missed, overruns: self.overruns }
    }
}

/// Monotonic time, ns. No system call where the kernel maps its clock into the process.
pub fn now_ns() -> u64 {
    let now = clock_gettime(ClockId::Monotonic);
    now.tv_sec as u64 * NS_PER_S + now.tv_nsec as u64
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::time::Duration;

    #[test]
    fn counts_missed_deadlines_and_keeps_the_grid() {
        let (period, phase) = (2_000_000, 700_000);
        let mut clock = Clock::new(period, phase, 0);
        for overruns in 1..=3 {
            std::thread::sleep(Duration::from_millis(9));
            let wake = clock.wait();
            assert!(wake.missed >= 3, "slept through {} deadlines", wake.missed);
            assert_eq!(wake.overruns, overruns);
            assert_eq!((clock.deadline_ns - phase) % period, 0);
            assert!(clock.deadline_ns > now_ns() - period);
        }
    }

    #[test]
    fn never_wakes_before_the_deadline_with_or_without_spinning() {
        for spin_ns in [0, 300_000, 10_000_000] {
            let mut clock = Clock::new(1_000_000, 0, spin_ns);
            for _ in 0..5 {
                let deadline = clock.deadline_ns;
                clock.wait();
                assert!(now_ns() >= deadline);
            }
        }
    }
}
