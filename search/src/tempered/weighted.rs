//! EM on weighted trials, and the number of components by the Bayesian information criterion.

use nalgebra::{DMatrix, DVector};

use super::super::gaussian::{Gaussian, log_add, log_sum_exp};
use super::super::mixture::{Component, Mixture};
use super::super::split_merge::{Split, merge, split};

/// EM steps on what a split or merge changes, before it is judged.
const REFINEMENT: usize = 3;
/// A component with less of the weights explains nothing.
const MIN_MASS: f64 = 1e-12;

/// Trials with weights.
pub struct Weighted {
    /// D×n.
    pub thetas: DMatrix<f64>,
    /// Sum to one.
    pub weights: Vec<f64>,
    /// (Σw)² / Σw²: as many trials of equal weight would tell as much.
    pub n_effective: f64,
}

/// What keeps the covariances of few trials from collapsing: with the scatter S of n effective
/// trials, Σ = (n·S + ν·V) / (n + ν) + Σ₀, the most likely one a posteriori.
#[derive(Clone, Copy, Debug)]
pub struct Regulariser {
    /// V = variance·I.
    pub variance: f64,
    /// ν.
    pub pseudo_count: f64,
    /// Σ₀ = floor·I.
    pub floor: f64,
}

/// A mixture on its way to fit trials.
pub struct Fit<'a> {
    trials: &'a Weighted,
    regulariser: Regulariser,
    mixture: Mixture,
    /// log πᵢ 𝒩(θₘ | μᵢ, Σᵢ): one column a component.
    joint: Vec<Vec<f64>>,
    /// log p(θₘ).
    densities: Vec<f64>,
}

impl<'a> Fit<'a> {
    pub fn new(mixture: Mixture, trials: &'a Weighted, regulariser: Regulariser) -> Self {
        let joint = mixture.components.iter().map(|c| log_joint(c, trials)).collect();
        let mut fit = Fit { trials, regulariser, mixture, joint, densities: Vec::new() };
        fit.densities = fit.log_densities(&fit.all());
        fit
    }

    pub fn into_mixture(self) -> Mixture {
        self.mixture
    }

    /// log p(θₘ) of some of the components.
    fn log_densities(&self, components: &[usize]) -> Vec<f64> {
        let mut row = vec![0.0; components.len()];
        let density = |m: usize| {
            row.iter_mut().zip(components).for_each(|(x, &i)| *x = self.joint[i][m]);
            log_sum_exp(&row)
        };
        (0..self.trials.weights.len()).map(density).collect()
    }

    fn all(&self) -> Vec<usize> {
        (0..self.joint.len()).collect()
    }

    /// Σ w log p(θ).
    fn log_likelihood(&self) -> f64 {
        self.densities.iter().zip(&self.trials.weights).map(|(density, w)| density * w).sum()
    }

    /// One step of Eq. (7) on all components.
    pub fn em_step(&mut self) {
        self.refine(&self.all(), 1);
    }

    /// EM steps on the components `active`; the others stay, and so does their part of the prior.
    fn refine(&mut self, active: &[usize], steps: usize) {
        let others: Vec<usize> = self.all().into_iter().filter(|i| !active.contains(i)).collect();
        let fixed = self.log_densities(&others);
        for _ in 0..steps {
            let share: f64 = active.iter().map(|&i| self.mixture.components[i].prior).sum();
            let updated: Vec<Component> = active.iter().map(|&i| self.m_step(i)).collect();
            let mass: f64 = updated.iter().map(|component| component.prior).sum();
            if mass == 0.0 {
                return;
            }
            for (&i, mut component) in active.iter().zip(updated) {
                component.prior *= share / mass;
                self.joint[i] = log_joint(&component, self.trials);
                self.mixture.components[i] = component;
            }
            let moved = self.log_densities(active);
            self.densities = moved.iter().zip(&fixed).map(|(a, b)| log_add(*a, *b)).collect();
        }
    }

    /// Eq. (7) for component `i`: all trials, about the new mean, regularised. Its mass Σ w·hᵢ
    /// takes the place of the prior.
    fn m_step(&self, i: usize) -> Component {
        let terms = self.trials.weights.iter().zip(&self.joint[i]).zip(&self.densities);
        let shares = terms.map(|((w, joint), density)| w * (joint - density).exp());
        let mut shares = DVector::from_iterator(self.densities.len(), shares);
        let mass = shares.sum();
        if mass < MIN_MASS {
            let gaussian = self.mixture.components[i].gaussian.clone();
            return Component { prior: 0.0, gaussian };
        }
        shares /= mass;
        let mean = &self.trials.thetas * &shares;
        let mut scatter = self.trials.thetas.clone();
        for (mut column, share) in scatter.column_iter_mut().zip(shares.iter()) {
            column -= &mean;
            column *= share.sqrt();
        }
        let Regulariser { variance, pseudo_count, floor } = self.regulariser;
        let n = mass * self.trials.n_effective;
        let mut covariance = &scatter * scatter.transpose() * (n / (n + pseudo_count));
        let added = variance * pseudo_count / (n + pseudo_count) + floor;
        (0..covariance.nrows()).for_each(|d| covariance[(d, d)] += added);
        Component { prior: mass, gaussian: Gaussian::new(mean, covariance) }
    }

    /// Splits component `turn` (modulo K) or merges the two components most alike, where n·ΔL
    /// exceeds, or stays below, what the criterion charges for a component: ½·p·log n, with n
    /// effective trials and p parameters.
    ///
    /// Departure: the thresholds Tˢ and Tᴹ, which Sec. 4.2 names as the weak point, are gone.
    pub fn select(&mut self, turn: u64, max_components: usize) {
        let dim = self.trials.thetas.nrows() as f64;
        let n_parameters = 1.0 + dim + 0.5 * dim * (dim + 1.0);
        // The criterion is for many trials: below e of them log(n)/n would fall again.
        let n = self.trials.n_effective.max(1_f64.exp());
        let price = 0.5 * n_parameters * n.ln() / n;
        let now = self.log_likelihood();
        let k = self.joint.len();
        let i = (turn % k as u64) as usize;
        // A half with fewer trials than span its covariance is no finding (nor worth the time).
        let enough = self.mixture.components[i].prior * n >= 2.0 * (dim + 1.0);
        if k < max_components && enough {
            let halves = self.split(i);
            if halves.log_likelihood() - now > price {
                *self = halves;
                return;
            }
        }
        if let Some((j, k)) = self.most_alike() {
            let merged = self.merge(j, k);
            if now - merged.log_likelihood() < price {
                *self = merged;
            }
        }
    }

    fn split(&self, i: usize) -> Fit<'a> {
        let last = self.joint.len();
        self.changed(split(&self.mixture, i, Split::default()), &[i, last], |joint| {
            joint.push(Vec::new());
        })
    }

    fn merge(&self, j: usize, k: usize) -> Fit<'a> {
        self.changed(merge(&self.mixture, j, k), &[j], |joint| drop(joint.remove(k)))
    }

    /// The fit of a `mixture` that differs in the components `active`, after their refinement.
    fn changed(
        &self,
        mixture: Mixture,
        active: &[usize],
        arrange: impl FnOnce(&mut Vec<Vec<f64>>),
    ) -> Fit<'a> {
        let mut joint = self.joint.clone();
        arrange(&mut joint);
        for &i in active {
            joint[i] = log_joint(&mixture.components[i], self.trials);
        }
        let mut fit = Fit { mixture, joint, densities: Vec::new(), ..*self };
        fit.densities = fit.log_densities(&fit.all());
        fit.refine(active, REFINEMENT);
        fit
    }

    /// The two components whose responsibilities for the trials are nearest to parallel; one that
    /// is responsible for none is like any other.
    fn most_alike(&self) -> Option<(usize, usize)> {
        let direction = |column: &Vec<f64>| {
            let terms = column.iter().zip(&self.densities).zip(&self.trials.weights);
            let shares = terms.map(|((joint, density), w)| w.sqrt() * (joint - density).exp());
            let shares = DVector::from_iterator(column.len(), shares);
            let norm = shares.norm();
            (norm > MIN_MASS).then(|| shares / norm)
        };
        let directions: Vec<Option<DVector<f64>>> = self.joint.iter().map(direction).collect();
        let likeness = |j: usize, k: usize| match (&directions[j], &directions[k]) {
            (Some(a), Some(b)) => a.dot(b),
            _ => 1.0,
        };
        let n = self.joint.len();
        let pairs = (0..n).flat_map(|j| (j + 1..n).map(move |k| (j, k)));
        pairs.max_by(|a, b| likeness(a.0, a.1).total_cmp(&likeness(b.0, b.1)))
    }
}

fn log_joint(component: &Component, trials: &Weighted) -> Vec<f64> {
    let constant = component.prior.ln() + component.gaussian.log_normaliser();
    let distances = component.gaussian.squared_distances(&trials.thetas);
    distances.into_iter().map(|distance| constant - 0.5 * distance).collect()
}
