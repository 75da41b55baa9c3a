//! Several places side by side, so that the processor adds for all of them at once. Each place has
//! its own sums, in the order of the trials, and gets the same bits as it would alone.

use nalgebra::DVector;

/// Enough independent sums to keep the processor adding; more were not faster.
pub const LANES: usize = 8;

/// One number for each place.
pub type Each = [f64; LANES];

/// Some places and their whitened kernels v, see [`super::surrogate::Surrogate`].
pub struct Lanes {
    /// D coordinates of each place.
    pub axes: Vec<Each>,
    /// vₙ of each place, one entry a trial.
    pub v: Vec<Each>,
    /// vᵀv of each place.
    pub explained: Each,
}

impl Lanes {
    /// One to [`LANES`] places; the lanes left over repeat the last one.
    pub fn new(places: &[DVector<f64>]) -> Lanes {
        let of = |axis| std::array::from_fn(|lane| places[lane.min(places.len() - 1)][axis]);
        let axes = (0..places[0].len()).map(of).collect();
        Lanes { axes, v: Vec::new(), explained: [0.0; LANES] }
    }

    /// Appends vₙ.
    pub fn push(&mut self, v: Each) {
        self.explained.iter_mut().zip(v).for_each(|(sum, v)| *sum += v * v);
        self.v.push(v);
    }

    /// Σₙ aₙvₙ of each place, over as many trials as `a` has entries.
    pub fn dot(&self, a: &[f64]) -> Each {
        let mut sums = [0.0; LANES];
        for (a, v) in a.iter().zip(&self.v) {
            sums.iter_mut().zip(v).for_each(|(sum, v)| *sum += a * v);
        }
        sums
    }

    /// ‖point − place‖ of each place.
    pub fn distances(&self, point: &DVector<f64>) -> Each {
        let mut squares = [0.0; LANES];
        for (a, axis) in point.iter().zip(&self.axes) {
            squares.iter_mut().zip(axis).for_each(|(sum, b)| *sum += (a - b) * (a - b));
        }
        squares.map(f64::sqrt)
    }

    /// v of one place.
    pub fn lane(&self, lane: usize) -> Vec<f64> {
        self.v.iter().map(|v| v[lane]).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Fewer places than lanes; sums in an order that rounding tells from others.
    #[test]
    fn a_place_among_others_has_the_numbers_it_has_alone() {
        let place = |i: u32| DVector::from_fn(3, |j, _| (f64::from(i) * 0.618 + j as f64).sqrt());
        let places: Vec<DVector<f64>> = (0..5).map(place).collect();
        let mut lanes = Lanes::new(&places);
        for n in 0..40 {
            lanes.push(std::array::from_fn(|lane| ((n * LANES + lane) as f64).sin()));
        }
        let a: Vec<f64> = (0..40).map(|n| (f64::from(n) + 0.3).ln()).collect();
        let dot = |v: &[f64]| a.iter().zip(v).fold(0.0, |sum, (a, v)| sum + a * v);
        for (lane, place) in places.iter().enumerate() {
            let v = lanes.lane(lane);
            assert_eq!(lanes.dot(&a)[lane], dot(&v));
            assert_eq!(lanes.explained[lane], v.iter().fold(0.0, |sum, v| sum + v * v));
            assert_eq!(lanes.distances(&places[0])[lane], places[0].metric_distance(place));
        }
    }
}
