//! Chooses what is executed: a draw, the best of some draws, or the mean.

use nalgebra::DVector;

use super::{Power, PowerConfig};
use crate::normals::{standard_normal, stream};
use crate::trial::Proposal;

/// Streams of the further candidates of a rollout lie this far apart.
const CANDIDATES: u64 = 1 << 48;

/// A correlation below this, of so many trials, says that going forwards pays less.
const PAYS_LESS: f64 = -0.5;
const ENOUGH: usize = 4;

/// Elites that are left at least.
const FEWEST: usize = 2;

/// An update with the same elites moves the mean by rounding only, in units of the floor.
const SAME: f64 = 1e-9;

/// Growth of the noise with each success, until it is as wide as in Eq. (6).
const GROWTH: f64 = 1.02;
/// If the world's own randomness makes draws fail, less noise does not help.
const NARROWEST: f64 = 0.2;

impl Power {
    /// Every so many rollouts of the phase of successes, those that are pending included; but not while the same
    /// mean is pending, whose trial would tell the same.
    pub(super) fn is_turn_of_mean(&self, pending: &[Proposal]) -> bool {
        let PowerConfig { mean_every: every, .. } = self.config;
        let n = self.n_succeeding.map(|n| n + pending.len() as u64);
        let noted = pending.iter().filter_map(|p| self.noted.get(&p.rollout));
        let is_same = |mean: &DVector<f64>| mean.metric_distance(&self.mean) <= SAME * self.floor();
        every > 0
            && n.is_some_and(|n| (n + 1).is_multiple_of(every))
            && !noted.flatten().any(is_same)
    }

    /// The draw of `rollout` whose known reward is highest; after a failure a plain draw, since more of
    /// what is known to pay may be what failed.
    pub(super) fn best_draw(&self, rollout: u64, pending: &[Proposal]) -> DVector<f64> {
        let first = self.draw(rollout, pending);
        let Some(known) = &self.space.known else { return first };
        if self.n_succeeding.is_none() || !self.last_succeeded {
            return first;
        }
        let further = (1..self.config.candidates as u64)
            .map(|n| self.draw(rollout + n * CANDIDATES, pending));
        let worth = |theta: DVector<f64>| (known.of(&theta), theta);
        let best = further.map(worth).fold(worth(first), |a, b| if b.0 > a.0 { b } else { a });
        best.1
    }

    /// What a trial of the phase of successes says of mean and noise, whatever it was rewarded with.
    ///
    /// A draw that was made before the noise narrowed counts like any other: leaving such failures out, or
    /// counting them less, cost rollouts with 8 arms and doubled them with 64 (docs/adr/0034).
    pub(super) fn adapt(&mut self, is_mean: bool, success: bool) {
        self.last_succeeded = success;
        if self.n_succeeding.is_none() {
            return;
        }
        let PowerConfig { n_elites, success_rate, fewer_elites, .. } = self.config;
        if !is_mean {
            // Rechenberg's rule: a success lets the noise grow a little again, a failure narrows it so much
            // more that both cancel at the rate that is asked for.
            let exponent = if success { 1.0 } else { -success_rate / (1.0 - success_rate) };
            self.spread = (self.spread * GROWTH.powf(exponent)).clamp(NARROWEST, 1.0);
        } else if fewer_elites {
            let n = if success { self.n_chosen + 1 } else { self.n_chosen / 2 };
            self.n_chosen = n.clamp(FEWEST.min(n_elites), n_elites);
        }
    }

    /// Eq. (6), sampling: θ = Θ⁽ⁿ⁾ + Σₘ fₘ zₘ + σ₀ z with zₘ, z ~ 𝒩(0, 1), moved into the box where
    /// one is known.
    ///
    /// Its covariance is Σₘ fₘfₘᵀ + σ₀²I = Σ⁽ⁿ⁾ exactly; a Cholesky factor of the D×D matrix would
    /// give the same distribution for more work and another rounding on every linear algebra
    /// library.
    pub(super) fn draw(&self, number: u64, pending: &[Proposal]) -> DVector<f64> {
        let mut theta = self.mean.clone();
        let mut rng = stream(self.seed, number);
        for factor in self.factors.iter().flatten() {
            theta += factor * (self.spread * standard_normal(&mut rng));
        }
        for i in 0..theta.len() {
            let z = standard_normal(&mut rng);
            let z = if self.goes_forwards_only(i, pending) { z.abs() } else { z };
            theta[i] += self.spread * self.floor_along(i) * z;
        }
        theta
    }

    /// Standard deviation of the isotropic part along parameter `i`; that of late ones is 0 until the
    /// elites are successes.
    pub(super) fn floor_along(&self, i: usize) -> f64 {
        if !self.space.direction(i).late {
            return self.floor();
        }
        if self.n_succeeding.is_none() {
            return 0.0;
        }
        let floor = self.config.late_std * self.config.late_decay.powf(self.n_falls as f64);
        floor.max(self.config.late_min)
    }

    /// In the initial batch a direction that grows is tried forwards only, unless the start succeeds or
    /// what was tried so far says clearly that forwards pays less.
    fn goes_forwards_only(&self, i: usize, pending: &[Proposal]) -> bool {
        if self.factors.is_some() || !self.space.direction(i).grows {
            return false;
        }
        let pairs: Vec<(f64, f64)> = self.initial.iter().map(|t| (t.theta[i], t.reward)).collect();
        // A start that is still pending has not succeeded.
        let is_pending = pending.first().is_some_and(|first| first.rollout == 1);
        let start = self.initial.iter().min_by_key(|trial| trial.rollout);
        (is_pending || start.is_some_and(|start| !start.success))
            && (pairs.len() < ENOUGH || correlation(&pairs) > PAYS_LESS)
    }
}

/// Pearson's; 0 where one of the two does not vary.
fn correlation(pairs: &[(f64, f64)]) -> f64 {
    let n = pairs.len() as f64;
    let mean = |of: &dyn Fn(&(f64, f64)) -> f64| pairs.iter().map(of).sum::<f64>() / n;
    let (a, b) = (mean(&|pair| pair.0), mean(&|pair| pair.1));
    let covariance = mean(&|pair| (pair.0 - a) * (pair.1 - b));
    let spread = (mean(&|pair| (pair.0 - a).powi(2)) * mean(&|pair| (pair.1 - b).powi(2))).sqrt();
    if spread > 0.0 { covariance / spread } else { 0.0 }
}

#[cfg(test)]
mod tests;
