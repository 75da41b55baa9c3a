//! Reproducible normal numbers: one independent stream per rollout.

use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, StandardNormal};

/// The generator of rollout `rollout`: ChaCha8 keyed by the session's seed, stream `rollout`.
///
/// A stream per rollout makes `ask` a pure function: no draw depends on how often others were
/// made, before or after a resume. The key is written out instead of `seed_from_u64`, whose
/// expansion is a choice of the library.
pub fn stream(seed: u64, rollout: u64) -> ChaCha8Rng {
    let mut key = [0; 32];
    key[..8].copy_from_slice(&seed.to_le_bytes());
    let mut rng = ChaCha8Rng::from_seed(key);
    rng.set_stream(rollout);
    rng
}

/// One number z ~ 𝒩(0, 1).
pub fn standard_normal(rng: &mut ChaCha8Rng) -> f64 {
    StandardNormal.sample(rng)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn draw(seed: u64, rollout: u64) -> [u64; 3] {
        let mut rng = stream(seed, rollout);
        [0; 3].map(|_| standard_normal(&mut rng).to_bits())
    }

    /// A session must come out the same after an upgrade of the libraries.
    #[test]
    fn draws_the_numbers_it_always_drew() {
        let mut rng = stream(3, 7);
        let drawn: Vec<f64> = (0..4).map(|_| standard_normal(&mut rng)).collect();
        assert_eq!(
            drawn,
            [-1.3754968313521325, 0.6049151486947318, -1.5508324370120203, 1.2174355068808627]
        );
    }

    #[test]
    fn streams_repeat_and_differ() {
        assert_eq!(draw(3, 7), draw(3, 7));
        assert_ne!(draw(3, 7), draw(3, 8));
        assert_ne!(draw(3, 7), draw(4, 7));
    }
}
