//! What a bad network does to one packet.

use std::time::Duration;

use rand::{Rng, RngExt};

/// A packet that is overtaken by others comes up to this much later.
const LATE: Duration = Duration::from_millis(100);

/// Shares are of packets, each drawn for itself.
#[derive(Clone, Copy, Debug)]
pub struct Weather {
    /// One way.
    pub delay: Duration,
    pub loss: f64,
    pub duplicate: f64,
    /// Packets that come later than those sent after them.
    pub reorder: f64,
}

/// What becomes of a packet.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Fate {
    Lost,
    /// It arrives after so long.
    Arrives(Duration),
    /// Late: others overtake it.
    Overtaken(Duration),
    /// It arrives twice.
    Twice([Duration; 2]),
}

impl Weather {
    pub fn fate(&self, rng: &mut impl Rng) -> Fate {
        // Always the same number of draws: the fates of later packets do not depend on the shares.
        let [lost, doubled, late] = [(); 3].map(|()| rng.random::<f64>());
        let later = self.delay + LATE.mul_f64(rng.random());
        if lost < self.loss {
            Fate::Lost
        } else if doubled < self.duplicate {
            Fate::Twice([self.delay, later])
        } else if late < self.reorder {
            Fate::Overtaken(later)
        } else {
            Fate::Arrives(self.delay)
        }
    }
}

#[cfg(test)]
mod tests {
    use rand_chacha::ChaCha8Rng;
    use rand_chacha::rand_core::SeedableRng;

    use super::*;

    #[test]
    fn packets_are_lost_doubled_and_overtaken_as_often_as_is_asked_for() {
        let weather = Weather {
            delay: Duration::from_millis(200),
            loss: 0.01,
            duplicate: 0.02,
            reorder: 0.05,
        };
        let mut rng = ChaCha8Rng::seed_from_u64(1);
        let (mut lost, mut doubled, mut late) = (0, 0, 0);
        for _ in 0..100_000 {
            match weather.fate(&mut rng) {
                Fate::Lost => lost += 1,
                Fate::Twice([first, second]) => {
                    doubled += 1;
                    assert!(first == weather.delay && second >= first);
                }
                Fate::Overtaken(after) => {
                    late += 1;
                    assert!((weather.delay..=weather.delay + LATE).contains(&after));
                }
                Fate::Arrives(after) => assert_eq!(after, weather.delay),
            }
        }
        assert!((900..1100).contains(&lost), "{lost}");
        assert!((1850..2150).contains(&doubled), "{doubled}");
        assert!((4600..5100).contains(&late), "{late}");
    }
}
