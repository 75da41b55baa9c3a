//! Places that fill a box evenly, however many there are.

use nalgebra::DVector;
use rand::RngExt;

use super::normals::stream;

/// The stream that shifts the places; no rollout has this number.
const SHIFT_STREAM: u64 = 0;

/// The additive recurrence whose steps are the powers 1/φ, …, 1/φᴰ of the generalised golden ratio
/// φ (φ^{D+1} = φ + 1), shifted by the seed.
pub struct Filling {
    steps: Vec<f64>,
    shift: Vec<f64>,
}

impl Filling {
    pub fn new(dim: usize, seed: u64) -> Filling {
        let ratio = golden_ratio(dim);
        let steps = (1..=dim).map(|power| ratio.powi(-(power as i32))).collect();
        let mut rng = stream(seed, SHIFT_STREAM);
        Filling { steps, shift: (0..dim).map(|_| rng.random()).collect() }
    }

    /// Place `index` in fractions of the box, D numbers.
    pub fn place(&self, index: u64) -> DVector<f64> {
        let coordinate = |i: usize, _| (self.shift[i] + index as f64 * self.steps[i]).fract();
        DVector::from_fn(self.steps.len(), coordinate)
    }
}

/// The positive solution of φ^{D+1} = φ + 1, by iteration.
fn golden_ratio(dim: usize) -> f64 {
    (0..30).fold(2.0, |ratio: f64, _| (1.0 + ratio).powf(1.0 / (dim as f64 + 1.0)))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_ratios_are_the_known_ones() {
        assert!((golden_ratio(1) - 1.618_033_988_749_895).abs() < 1e-14);
        assert!((golden_ratio(2) - 1.324_717_957_244_746).abs() < 1e-14);
    }

    /// In each of 16 equal cells lie 4 to 9 of 100 places; independent ones would spread more.
    #[test]
    fn fills_the_square_evenly_for_every_seed() {
        for seed in 0..20 {
            let filling = Filling::new(2, seed);
            let mut counts = [0; 16];
            for index in 0..100 {
                let place = filling.place(index);
                counts[(place[0] * 4.0) as usize * 4 + (place[1] * 4.0) as usize] += 1;
            }
            assert!(counts.iter().all(|n| (4..=9).contains(n)), "seed {seed}: {counts:?}");
        }
        assert_ne!(Filling::new(2, 1).place(0), Filling::new(2, 2).place(0));
    }
}
