//! Rewards that do not repeat: what a trial is worth when its neighbours count as well.
//!
//! A person who presses the wrong key may give a failure the highest reward, and as an elite it would stay for ever.
//! Here a reward is r = f(θ) + e with a Gaussian process f around the mean reward r̄, and independent noise e of
//! σ times the standard deviation of f. Elites are ranked by the expected f at their places (Rasmussen and
//! Williams 2006, Eq. (2.25)):
//!
//! r̂ = r̄ + K(K + σ²I)⁻¹(r − r̄) = r − σ²(K + σ²I)⁻¹(r − r̄), K(θ, θ') = exp(−‖θ − θ'‖²/2ℓ²).
//!
//! A high reward among high ones stays high. One among low ones falls towards them, and one without neighbours falls
//! towards the mean. Replacing r by c·r + d, c > 0, changes no rank.

use std::cmp::Ordering;

use nalgebra::{Cholesky, DMatrix, DVector};

use super::{Power, by_reward};
use crate::trial::Trial;

/// ℓ² = D (0.3 `initial_std`)². Two draws of standard deviation s are about √(2D)·s apart, so K is e⁻¹ between them
/// once s is 0.3 of what it was in the initial batch.
const REACH: f64 = 0.3;
/// Trials that count; older ones are forgotten, because the time of an update grows with the third power.
const MOST: usize = 400;

impl Power {
    /// Keeps a trial whose reward is noisy, and ranks all of them by r̂, which is never taken for worse than the
    /// worst reward.
    pub(super) fn keep_noisy(&mut self, trial: &Trial) {
        let memory = self.config.memory;
        self.told.push(trial.clone());
        self.told.retain(|other| memory == 0 || other.rollout + memory > self.newest);
        if self.told.len() > MOST {
            self.told.remove(0);
        }
        let length = REACH * self.config.initial_std * (trial.theta.len() as f64).sqrt();
        let expected = expected(&self.told, self.config.noise, length);
        let ranked = self.told.iter().zip(&expected);
        let ranked = ranked.map(|(t, r)| Trial { reward: r.max(self.worst), ..t.clone() });
        self.kept = ranked.collect();
        self.kept.sort_by(by_reward);
    }
}

/// r̂ of `trials`, in their order. Where σ² is lost in rounding it is r.
fn expected(trials: &[Trial], noise: f64, length: f64) -> DVector<f64> {
    let (n, variance) = (trials.len(), noise * noise);
    let r = DVector::from_iterator(n, trials.iter().map(|trial| trial.reward));
    // Cholesky reads the lower half.
    let noisy = DMatrix::from_fn(n, n, |i, j| match i.cmp(&j) {
        Ordering::Less => 0.0,
        Ordering::Equal => 1.0 + variance,
        Ordering::Greater => kernel(&trials[i].theta, &trials[j].theta, length),
    });
    match Cholesky::new(noisy) {
        // Rewards are scaled by the largest one first: sums of huge ones would overflow.
        Some(factor) if r.amax() > 0.0 => {
            let scale = r.amax();
            let scaled = &r / scale;
            let centred = scaled.add_scalar(-scaled.mean());
            r - factor.solve(&centred) * (variance * scale)
        }
        _ => r,
    }
}

/// exp(−‖a − b‖²/2ℓ²).
fn kernel(a: &DVector<f64>, b: &DVector<f64>, length: f64) -> f64 {
    let squared = a.iter().zip(b).map(|(a, b)| (a - b).powi(2)).sum::<f64>();
    // Where there is no length only equal places are alike.
    (-0.5 * squared / length.powi(2).max(f64::MIN_POSITIVE)).exp()
}

#[cfg(test)]
mod tests;
