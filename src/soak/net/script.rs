//! What happens, and when: drawn from a seed.

use std::time::Duration;

use rand::RngExt;
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::SeedableRng;

use super::fleet::Part;
use super::wan::Cut;

/// One of so many events is a cut, the others are kills; and one of so many cuts is a long one.
const CUTS: u32 = 6;
const LONG: u32 = 3;
/// How long links are cut, ms: for less than anybody waits, and beyond the lease of a rollout (30 s).
const SHORT_MS: std::ops::Range<u64> = 300..8_000;
const LONG_MS: std::ops::Range<u64> = 36_000..50_000;
/// How long what was killed stays away, ms.
const AWAY_MS: std::ops::Range<u64> = 0..4_000;
/// How long a process lives that is killed while it starts, ms.
const START_UP_MS: std::ops::Range<u64> = 0..300;

/// What is killed at once; cells and hosts by number.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Kill {
    Learner,
    Hub,
    LearnerAndHub,
    Controller(usize),
    Join(usize),
    ControllerAndJoin(usize),
    /// Everything on a host with cells.
    Host(usize),
}

#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Event {
    Kill(Kill),
    Cut { host: usize, cut: Cut, lasts: Duration },
}

pub struct Script {
    rng: ChaCha8Rng,
    /// Host of each cell.
    cells: Vec<usize>,
    hosts: usize,
    /// Between two events, on average.
    pause: Duration,
}

impl Kill {
    pub fn name(self) -> &'static str {
        match self {
            Kill::Learner => "learner",
            Kill::Hub => "hub",
            Kill::LearnerAndHub => "learner+hub",
            Kill::Controller(_) => "controller",
            Kill::Join(_) => "join",
            Kill::ControllerAndJoin(_) => "controller+join",
            Kill::Host(_) => "all of a host",
        }
    }
}

impl Script {
    /// For cells on these of so many hosts.
    pub fn new(seed: u64, cells: Vec<usize>, hosts: usize, pause: Duration) -> Script {
        Script { rng: ChaCha8Rng::seed_from_u64(seed), cells, hosts, pause }
    }

    /// The next event, and the pause before it.
    pub fn next(&mut self) -> (Duration, Event) {
        let pause = self.pause.mul_f64(self.rng.random_range(0.3..1.7));
        let event = match self.rng.random_range(0..CUTS) {
            0 => self.cut(),
            _ => Event::Kill(self.kill()),
        };
        (pause, event)
    }

    fn cut(&mut self) -> Event {
        let host = self.rng.random_range(0..self.hosts);
        let cut = match self.rng.random_range(0..5) {
            0 => Cut::In,
            1 => Cut::Out,
            _ => Cut::Both,
        };
        let lasts = if self.rng.random_range(0..LONG) == 0 { LONG_MS } else { SHORT_MS };
        Event::Cut { host, cut, lasts: self.ms(lasts) }
    }

    fn kill(&mut self) -> Kill {
        let cell = self.rng.random_range(0..self.cells.len());
        match self.rng.random_range(0..7) {
            0 => Kill::Learner,
            1 => Kill::Hub,
            2 => Kill::LearnerAndHub,
            3 => Kill::Controller(cell),
            4 => Kill::Join(cell),
            5 => Kill::ControllerAndJoin(cell),
            _ => Kill::Host(self.cells[cell]),
        }
    }

    /// The processes of a kill, in the order in which they die.
    pub fn victims(&mut self, kill: Kill) -> Vec<Part> {
        let mut victims = match kill {
            Kill::Learner => vec![Part::Learner],
            Kill::Hub => vec![Part::Hub],
            Kill::LearnerAndHub => vec![Part::Learner, Part::Hub],
            Kill::Controller(cell) => vec![Part::Controller(cell)],
            Kill::Join(cell) => vec![Part::Join(cell)],
            Kill::ControllerAndJoin(cell) => vec![Part::Controller(cell), Part::Join(cell)],
            Kill::Host(host) => {
                let of_host = (0..self.cells.len()).filter(|cell| self.cells[*cell] == host);
                of_host.flat_map(|cell| [Part::Controller(cell), Part::Join(cell)]).collect()
            }
        };
        if self.rng.random() {
            victims.reverse();
        }
        victims
    }

    /// How long a process stays away that was killed.
    pub fn away(&mut self) -> Duration {
        self.ms(AWAY_MS)
    }

    /// A process may be killed once more before it is up, after so long.
    pub fn killed_at_start(&mut self) -> Option<Duration> {
        (self.rng.random_range(0..4) == 0).then(|| self.ms(START_UP_MS))
    }

    fn ms(&mut self, range: std::ops::Range<u64>) -> Duration {
        // Finer than a millisecond: kills must meet every instruction.
        Duration::from_micros(self.rng.random_range(1000 * range.start..1000 * range.end))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_seed_is_a_script_in_which_everything_happens() {
        let script = |seed| Script::new(seed, vec![1, 1, 2, 2], 3, Duration::from_secs(10));
        let events = |seed| {
            let mut script = script(seed);
            (0..400).map(|_| script.next()).collect::<Vec<_>>()
        };
        assert_eq!(events(1), events(1));
        assert_ne!(events(1), events(2));
        let events: Vec<Event> = events(1).into_iter().map(|(_, event)| event).collect();
        let kills = events.iter().filter_map(|event| match event {
            Event::Kill(kill) => Some(*kill),
            Event::Cut { .. } => None,
        });
        let names: std::collections::BTreeSet<_> = kills.map(Kill::name).collect();
        assert_eq!(names.len(), 7);
        for host in 0..3 {
            for is_long in [false, true] {
                let is_it = |event: &&Event| match event {
                    Event::Cut { host: its, lasts, .. } => {
                        *its == host && (*lasts > Duration::from_secs(30)) == is_long
                    }
                    Event::Kill(_) => false,
                };
                assert!(events.iter().any(|event| is_it(&event)), "host {host}, {is_long}");
            }
        }
    }

    #[test]
    fn with_a_host_everything_on_it_dies() {
        let mut script = Script::new(1, vec![1, 1, 2], 3, Duration::from_secs(10));
        let mut victims = script.victims(Kill::Host(1));
        victims.sort_unstable();
        let expected = [Part::Controller(0), Part::Controller(1), Part::Join(0), Part::Join(1)];
        assert_eq!(victims, expected);
    }
}
