//! The expected value of one measure: from its prediction and the prediction's errors, or from measured values
//! alone.
//!
//! Both processes see every measured value. The residual's is used as long as it foretells the values about
//! as well as the data's does: a prediction that is far off loses its influence (the Bayes factor of the two,
//! Rasmussen and Williams 2006, Sec. 5.4.1, over all values but the first, which is the data's prior mean).

use nalgebra::DVector;

use super::config::Target;
use super::process::{Kernel, Process, Projection};
use super::window::log_within;

/// Standard deviation of what does not repeat from rollout to rollout, in widths of the window.
const NOISE: f64 = 1.0 / 15.0;
/// Prior error of the prediction, relative to the predicted change.
const ERROR: f64 = 0.5;
/// Standard deviation of the constant part of a residual: half of its variance.
const EVERYWHERE: f64 = std::f64::consts::FRAC_1_SQRT_2;
/// What is local changes less than what is a slope.
const LOCAL: f64 = 0.8;
/// Standard deviation of what a window's edges leave out, in its widths: a measure near an edge is
/// neither a success for sure nor a failure.
const EDGE: f64 = 1.0 / 6.0;
/// A Bayes factor of 20 is strong evidence.
const STRONG: f64 = 3.0;

/// Expected value and its variance.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Expected {
    pub mean: f64,
    pub variance: f64,
}

impl Expected {
    /// Logarithm of the probability of a window, with soft edges.
    pub fn log_within(&self, [min, max]: [f64; 2]) -> f64 {
        let deviation = (self.variance + (EDGE * (max - min)).powi(2)).sqrt();
        let z = |edge: f64| (edge - self.mean) / deviation;
        log_within(z(min), z(max))
    }
}

/// What of a place is kept from step to step.
#[derive(Clone, Debug, Default)]
pub struct Place {
    data: Projection,
    residual: Projection,
}

#[derive(Clone, Debug)]
pub struct Estimate {
    /// Prior mean of the data.
    first: Option<f64>,
    data: Process,
    residual: Process,
    /// Logarithm of the Bayes factor of the data against the prediction.
    against: f64,
    was_doubted: bool,
}

impl Estimate {
    pub fn new(target: &Target, length: f64) -> Estimate {
        let (scale, error, noise) = (target.scale, ERROR * target.scale, NOISE * target.width());
        let data = Kernel { constant: scale, linear: scale, local: LOCAL * scale, length };
        let residual =
            Kernel { constant: EVERYWHERE * error, linear: 0.0, local: EVERYWHERE * error, length };
        Estimate {
            first: None,
            data: Process::new(data, noise),
            residual: Process::new(residual, noise),
            against: 0.0,
            was_doubted: false,
        }
    }

    /// Takes the value measured at `e`, where `predicted` was foretold.
    pub fn observe(&mut self, e: &DVector<f64>, predicted: Option<f64>, measured: f64) {
        let is_first = self.first.is_none();
        let first = *self.first.get_or_insert(measured);
        let of_data = self.data.observe(e, measured - first);
        if let Some(predicted) = predicted {
            let of_residual = self.residual.observe(e, measured - predicted);
            if !is_first {
                self.against += of_data - of_residual;
            }
        }
        self.was_doubted |= self.is_doubted();
    }

    fn is_doubted(&self) -> bool {
        self.against > STRONG
    }

    /// The prediction has been worse than none.
    pub fn was_doubted(&self) -> bool {
        self.was_doubted
    }

    /// What is expected at `e`, where `predicted` is foretold; `place` is that of `e`.
    pub fn at(&self, e: &DVector<f64>, predicted: Option<f64>, place: &mut Place) -> Expected {
        match predicted.filter(|_| !self.is_doubted()) {
            Some(predicted) => {
                let (mean, variance) = self.residual.at(e, &mut place.residual);
                Expected { mean: predicted + mean, variance }
            }
            None => {
                let (mean, variance) = self.data.at(e, &mut place.data);
                Expected { mean: self.first.unwrap_or(0.0) + mean, variance }
            }
        }
    }
}
