//! How long to wait before what failed is tried again.

use std::time::Duration;

use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

const FIRST: Duration = Duration::from_millis(100);
const LONGEST: Duration = Duration::from_secs(5);

/// Waits that double from 100 ms to 5 s. Each is drawn from its upper half, so that cells that were cut off together
/// do not come back together.
pub struct Backoff {
    next: Duration,
    generator: ChaCha8Rng,
}

impl Backoff {
    /// `seed` tells bridges apart.
    pub fn new(seed: u64) -> Backoff {
        Backoff { next: FIRST, generator: ChaCha8Rng::seed_from_u64(seed) }
    }

    /// The wait after one more failure.
    pub fn after_failure(&mut self) -> Duration {
        let wait = self.next.mul_f64(self.generator.random_range(0.5..=1.0));
        self.next = (self.next * 2).min(LONGEST);
        wait
    }

    pub fn succeeded(&mut self) {
        self.next = FIRST;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn waits_double_up_to_a_limit_and_begin_again_after_a_success() {
        let mut backoff = Backoff::new(3);
        let waits: Vec<Duration> = (0..10).map(|_| backoff.after_failure()).collect();
        for (k, wait) in waits.iter().enumerate() {
            let longest = (FIRST * 2_u32.pow(k as u32)).min(LONGEST);
            assert!((longest / 2..=longest).contains(wait), "wait {k} is {wait:?}");
        }
        backoff.succeeded();
        assert!(backoff.after_failure() <= FIRST);
    }

    #[test]
    fn two_bridges_wait_differently_and_one_the_same_again() {
        let waits = |seed| {
            let mut backoff = Backoff::new(seed);
            [(); 4].map(|()| backoff.after_failure())
        };
        assert_eq!(waits(1), waits(1));
        assert_ne!(waits(1), waits(2));
    }
}
