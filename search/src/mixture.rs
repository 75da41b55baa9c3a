//! The Gaussian mixture over policies and its EM step, Eq. (7).

use nalgebra::{DMatrix, DVector};
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, StandardUniform};

use super::gaussian::{Gaussian, log_sum_exp};
use super::normals::standard_normal;
use super::{Bounds, Mode};
use crate::trial::Trial;

/// Draws outside the box before the last one is moved to its border.
const MAX_REDRAWS: usize = 50;

/// πᵢ and 𝒩(μᵢ, Σᵢ).
#[derive(Clone, Debug, PartialEq)]
pub struct Component {
    pub prior: f64,
    pub gaussian: Gaussian,
}

/// {πᵢ, μᵢ, Σᵢ}, i = 1 … K, K ≥ 1; the priors sum to one.
#[derive(Clone, Debug, PartialEq)]
pub struct Mixture {
    pub components: Vec<Component>,
}

/// Which mean the scatter of Eq. (7) is taken about.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum About {
    /// μ⁽ⁿ⁻¹⁾, as printed.
    OldMean,
    /// μ⁽ⁿ⁾, as in plain EM. Departure: without the boost the printed form gives to each step.
    NewMean,
}

/// What Eq. (7) leaves to choose.
#[derive(Clone, Debug)]
pub struct EmStep {
    /// M, the elites of each component; 0 for all trials.
    pub n_elites: usize,
    /// Σ₀ (D×D).
    pub sigma_0: DMatrix<f64>,
    pub about: About,
}

impl Mixture {
    /// One component.
    pub fn single(gaussian: Gaussian) -> Mixture {
        Mixture { components: vec![Component { prior: 1.0, gaussian }] }
    }

    /// log πᵢ 𝒩(θ | μᵢ, Σᵢ) of every component.
    pub fn log_joint(&self, theta: &DVector<f64>) -> Vec<f64> {
        let joint = |c: &Component| c.prior.ln() + c.gaussian.log_density(theta);
        self.components.iter().map(joint).collect()
    }

    /// log Σᵢ πᵢ 𝒩(θ | μᵢ, Σᵢ).
    pub fn log_density(&self, theta: &DVector<f64>) -> f64 {
        log_sum_exp(&self.log_joint(theta))
    }

    /// hᵢ(θ) of every component: the E-step of Eq. (7).
    pub fn responsibilities(&self, theta: &DVector<f64>) -> Vec<f64> {
        let joint = self.log_joint(theta);
        let density = log_sum_exp(&joint);
        joint.into_iter().map(|log_joint| (log_joint - density).exp()).collect()
    }

    /// Σ r log p(θ) / Σ r over the `trials`; those without reward are skipped, and `None` when
    /// none has any (*evaluateLikelihood* of Algorithm 1).
    pub fn log_likelihood(&self, trials: &[Trial]) -> Option<f64> {
        let rewards = relative_rewards(trials)?;
        let rewarded = || trials.iter().zip(&rewards).filter(|(_, reward)| **reward > 0.0);
        let sum: f64 = rewarded().map(|(trial, r)| r * self.log_density(&trial.theta)).sum();
        Some(sum / rewarded().map(|(_, r)| r).sum::<f64>())
    }

    /// One step of Eq. (7). Without any reward the mixture stays, and so does a component without
    /// any share in the rewards, at prior 0.
    pub fn em_step(&self, trials: &[Trial], step: &EmStep) -> Mixture {
        let Some(rewards) = relative_rewards(trials) else { return self.clone() };
        let thetas = columns(trials);
        let shares = self.shares(&thetas, &rewards);
        let update = |(component, shares): (&Component, Vec<f64>)| {
            let mut elites: Vec<(usize, f64)> = shares.into_iter().enumerate().collect();
            if (1..elites.len()).contains(&step.n_elites) {
                // A stable sort: equal shares stay in the order of their trials.
                elites.sort_by(|a, b| b.1.total_cmp(&a.1));
                elites.truncate(step.n_elites);
            }
            m_step(component, &thetas, &elites, step)
        };
        let mut components: Vec<Component> =
            self.components.iter().zip(shares).map(update).collect();
        normalise(&mut components);
        Mixture { components }
    }

    /// r·hᵢ of every trial, a list a component. The same as
    /// [`responsibilities`](Self::responsibilities), for all trials at once.
    fn shares(&self, thetas: &DMatrix<f64>, rewards: &[f64]) -> Vec<Vec<f64>> {
        let log_joint = |Component { prior, gaussian }: &Component| -> Vec<f64> {
            let constant = prior.ln() + gaussian.log_normaliser();
            let distances = gaussian.squared_distances(thetas).into_iter();
            distances.map(|distance| constant - 0.5 * distance).collect()
        };
        let mut shares: Vec<Vec<f64>> = self.components.iter().map(log_joint).collect();
        let mut joint = vec![0.0; shares.len()];
        for (m, reward) in rewards.iter().enumerate() {
            joint.iter_mut().zip(&shares).for_each(|(joint, shares)| *joint = shares[m]);
            let density = log_sum_exp(&joint);
            shares.iter_mut().for_each(|shares| shares[m] = reward * (shares[m] - density).exp());
        }
        shares
    }

    /// *randomSampling* of Algorithm 1: the first component with u < π₁ + … + πᵢ, and μᵢ + Lᵢ z.
    pub fn draw(&self, u: f64, z: &DVector<f64>) -> (usize, DVector<f64>) {
        let mut cumulative = 0.0;
        let last = self.components.len() - 1;
        let chosen = self.components.iter().position(|component| {
            cumulative += component.prior;
            u < cumulative
        });
        let chosen = chosen.unwrap_or(last);
        (chosen, self.components[chosen].gaussian.sample(z))
    }

    /// A draw with the numbers of `rng`; within `bounds` where there are any.
    pub fn sample(&self, rng: &mut ChaCha8Rng, bounds: Option<&Bounds>) -> DVector<f64> {
        let dim = self.components[0].gaussian.dim();
        draw_within(bounds, || {
            let u = StandardUniform.sample(rng);
            let z = DVector::from_fn(dim, |_, _| standard_normal(rng));
            self.draw(u, &z).1
        })
    }

    /// The component with the highest prior, the first of equals.
    pub fn dominant(&self) -> &Component {
        self.components.iter().rev().max_by(|a, b| a.prior.total_cmp(&b.prior)).expect("K ≥ 1")
    }

    /// The components, highest prior first.
    pub fn modes(&self) -> Vec<Mode> {
        let mode = |Component { prior, gaussian }: &Component| Mode {
            prior: *prior,
            mean: gaussian.mean().clone(),
            covariance: gaussian.covariance().clone(),
        };
        let mut modes: Vec<Mode> = self.components.iter().map(mode).collect();
        modes.sort_by(|a, b| b.prior.total_cmp(&a.prior));
        modes
    }
}

/// Draws until one lies within `bounds`; after `MAX_REDRAWS` the nearest point of the box.
pub fn draw_within(
    bounds: Option<&Bounds>,
    mut draw: impl FnMut() -> DVector<f64>,
) -> DVector<f64> {
    let mut theta = draw();
    let Some(bounds) = bounds else { return theta };
    for _ in 0..MAX_REDRAWS {
        if bounds.contains(&theta) {
            return theta;
        }
        theta = draw();
    }
    bounds.clamp(&theta)
}

/// Priors from masses to a sum of one.
pub fn normalise(components: &mut [Component]) {
    let sum: f64 = components.iter().map(|component| component.prior).sum();
    components.iter_mut().for_each(|component| component.prior /= sum);
}

/// Rewards in units of the best one, so that none near the ends of the number range is lost;
/// `None` without any reward.
fn relative_rewards(trials: &[Trial]) -> Option<Vec<f64>> {
    let best = trials.iter().map(|trial| trial.reward).fold(0.0, f64::max);
    (best > 0.0).then(|| trials.iter().map(|trial| trial.reward / best).collect())
}

/// The θ of the trials as the columns of a D×n matrix.
fn columns(trials: &[Trial]) -> DMatrix<f64> {
    let thetas: Vec<DVector<f64>> = trials.iter().map(|trial| trial.theta.clone()).collect();
    DMatrix::from_columns(&thetas)
}

/// μᵢ, Σᵢ and the mass Σ r·hᵢ of Eq. (7) from the elites (column of `thetas`, r·hᵢ); the mass takes
/// the place of the prior.
fn m_step(
    old: &Component,
    thetas: &DMatrix<f64>,
    elites: &[(usize, f64)],
    step: &EmStep,
) -> Component {
    let mass: f64 = elites.iter().map(|(_, share)| share).sum();
    if mass < f64::MIN_POSITIVE {
        return Component { prior: 0.0, gaussian: old.gaussian.clone() };
    }
    let old_mean = old.gaussian.mean();
    let deviation = |row: usize, m: usize| thetas[(row, elites[m].0)] - old_mean[row];
    let mut deviations = DMatrix::from_fn(old_mean.len(), elites.len(), deviation);
    let weights = DVector::from_fn(elites.len(), |m, _| elites[m].1 / mass);
    let shift = &deviations * &weights;
    if step.about == About::NewMean {
        deviations.column_iter_mut().for_each(|mut column| column -= &shift);
    }
    let mean = old_mean + shift;
    // Σ wₘ[θₘ − μ][θₘ − μ]ᵀ as one product X·Xᵀ.
    let columns = deviations.column_iter_mut().zip(weights.iter());
    columns.for_each(|(mut column, weight)| column *= weight.sqrt());
    let mut covariance = step.sigma_0.clone();
    covariance.gemm(1.0, &deviations, &deviations.transpose(), 1.0);
    covariance.fill_upper_triangle_with_lower_triangle();
    Component { prior: mass, gaussian: Gaussian::new(mean, covariance) }
}

#[cfg(test)]
mod tests;
