//! Which ticks are published, and the time they get.

const SECOND_NS: u64 = 1_000_000_000;

/// At most so many ticks a second, by the clock of the wall.
pub struct Pace {
    period_ns: u64,
    due_ns: u64,
    /// Time of the last tick.
    last_ns: u64,
    /// How far the ticks of this loop have been ahead of the clock at most: by the delay of the first one, by which an
    /// observer sets them, and at full speed by ever more.
    ahead_ns: u64,
}

impl Pace {
    pub fn new(rate_hz: u32) -> Pace {
        let period_ns = SECOND_NS / u64::from(rate_hz.max(1));
        Pace { period_ns, due_ns: 0, last_ns: 0, ahead_ns: 0 }
    }

    /// The stamp of a tick of the time `at_ns` that is seen at `now_ns`, never later than that; `None` where it comes too
    /// early after the last one.
    pub fn stamp(&mut self, at_ns: u64, now_ns: u64) -> Option<u64> {
        if at_ns < self.last_ns {
            self.ahead_ns = 0; // another loop
        }
        self.last_ns = at_ns;
        self.ahead_ns = self.ahead_ns.max(at_ns.saturating_sub(now_ns));
        let (stamp, period) = (at_ns - self.ahead_ns, self.period_ns);
        let was_set_back = stamp + period < self.due_ns;
        if stamp < self.due_ns && !was_set_back {
            return None;
        }
        // On the grid of the last ones, so that the rate is kept on average.
        let is_next = stamp < self.due_ns + period && !was_set_back;
        self.due_ns = if is_next { self.due_ns + period } else { stamp + period };
        Some(stamp)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const MS: u64 = 1_000_000;
    const START: u64 = 1_700_000_000 * SECOND_NS;

    /// Stamps in ms since the start, of ticks seen `late` ms after their time.
    fn stamps(pace: &mut Pace, ticks: impl Iterator<Item = u64>, late: u64) -> Vec<u64> {
        let stamp = |tick| pace.stamp(START + tick * MS, START + (tick + late) * MS);
        ticks.filter_map(stamp).map(|stamp| (stamp - START) / MS).collect()
    }

    #[test]
    fn every_tenth_tick_of_1_khz_makes_100_hz() {
        let tens: Vec<u64> = (0..10).map(|n| 10 * n).collect();
        assert_eq!(stamps(&mut Pace::new(100), 0..100, 8), tens);
    }

    #[test]
    fn a_rate_that_does_not_divide_that_of_the_loop_is_kept_on_average() {
        assert_eq!(stamps(&mut Pace::new(300), 0..1000, 0).len(), 300);
        assert_eq!(stamps(&mut Pace::new(4000), 0..50, 0).len(), 50);
    }

    /// 1000 ticks within 50 ms of the clock.
    #[test]
    fn at_full_speed_the_clock_sets_the_pace() {
        let mut pace = Pace::new(100);
        let seen = (0..1000).map(|tick| (START + tick * MS, START + tick * MS / 20));
        let stamps: Vec<u64> = seen.filter_map(|(at, now)| pace.stamp(at, now)).collect();
        assert_eq!(stamps.len(), 5);
        assert!(stamps.iter().all(|stamp| *stamp < START + 50 * MS));
    }

    /// An observer takes the first tick for one of now.
    #[test]
    fn ticks_that_are_set_a_little_ahead_keep_their_distances() {
        let mut pace = Pace::new(100);
        let delay = |tick: u64| if tick < 10 { 0 } else { 3 + tick % 5 };
        let seen =
            (0..200).map(|tick| (START + (tick + 9) * MS, START + (tick + delay(tick)) * MS));
        let stamps: Vec<u64> = seen.filter_map(|(at, now)| pace.stamp(at, now)).collect();
        let steps: Vec<u64> = stamps.windows(2).map(|pair| (pair[1] - pair[0]) / MS).collect();
        assert!(steps.len() > 15 && steps.iter().all(|step| *step == 10), "{steps:?}");
        assert!(stamps[0] <= START);
    }

    #[test]
    fn a_clock_that_is_set_back_stops_nothing() {
        let mut pace = Pace::new(100);
        stamps(&mut pace, 3_600_000..3_600_100, 0);
        assert_eq!(stamps(&mut pace, 0..100, 0).len(), 10);
    }

    #[test]
    fn a_gap_is_not_made_up_for() {
        let mut pace = Pace::new(100);
        stamps(&mut pace, 0..10, 0);
        assert_eq!(stamps(&mut pace, 5000..5030, 0), [5000, 5010, 5020]);
    }
}
