//! Fields from demonstrations: the first one, and those refitted to altered demonstrations.

#![allow(non_snake_case)] // A and P

use imitation::stable::{self, StableError, StableField, StableOptions};
use imitation::{Mixture, Recording};
use nalgebra::{DMatrix, DVector};
use shm_types::TASK_DIM;
use shm_types::policy::{ACTIVATION_STATE, LinearSystem, OUTPUT_VELOCITY, PolicyMsg, packed_index};

use super::super::time::{Moment, hold_the_rest, least_squares, moments, sealed};
use super::{Decay, Seds, rest_at};
use crate::demonstration::Demonstration;
use crate::initial_policy::InitialPolicyConfig;
use crate::parameters::{N_POSITIONS, PolicyIds, extent};

/// The field is part of the fit, not of the search: the same for every session.
const SEED: u64 = 0;
/// A radian counts as so many metres, as in the scales of θ.
const RADIAN_M: f64 = 0.3;
/// A coordinate that never moves: its extent, m or rad, and the spread that its activations are given.
const STILL: f64 = 1e-9;
const STILL_STD: f64 = 0.1;
/// Steps of the centres in a refit, and the points that the centre of the base counts for.
const N_STEPS: usize = 20;
const BASE_POINTS: f64 = 1.0;
/// Ridge towards the systems of the base, relative.
const RIDGE: f64 = 0.01;

/// The field of `demonstrations`, at least one; sealed, without session and rollout.
///
/// # Errors
/// Where a demonstration moves away from its end, as one does that comes back to its start.
pub fn fit(
    demonstrations: &[Demonstration],
    config: &InitialPolicyConfig,
) -> Result<PolicyMsg, StableError> {
    let moments = moments(demonstrations);
    let moves = |c: &usize| {
        let (low, high) = extent(moments.iter().map(|moment| moment.x[*c]));
        high - low > STILL
    };
    let moving: Vec<usize> = (0..config.task_dim).filter(moves).collect();
    let recording = |demonstration: &Demonstration| {
        let poses = demonstration.poses();
        let points = DMatrix::from_fn(moving.len(), poses.len(), |row, k| {
            poses[k][moving[row]] * unit(moving[row])
        });
        Recording::new(demonstration.file(), demonstration.period_s(), points)
    };
    let recordings: Vec<Recording> =
        demonstrations.iter().map(recording).collect::<Result<_, _>>()?;
    let lambda = 2.0 * config.kappa_p.sqrt();
    let options = StableOptions {
        n_components: config.n_components,
        damping: lambda,
        ..StableOptions::default()
    };
    let field = stable::fit(&recordings, &options, SEED)?;
    let mut policy = PolicyMsg {
        task_dim: config.task_dim as u32,
        n_systems: config.n_components as u32,
        activation: ACTIVATION_STATE,
        output: OUTPUT_VELOCITY,
        duration_s: demonstrations[0].duration_s(),
        following: lambda,
        orientation_stiffness: config.orientation_stiffness,
        orientation_damping: config.orientation_damping,
        ..PolicyMsg::EMPTY
    };
    policy.target = moments[0].x;
    hold_the_rest(&mut policy, demonstrations);
    put(&mut policy, &field, &moving);
    Ok(sealed(policy, PolicyIds::default()))
}

/// The unit of a coordinate in a recording, m.
fn unit(coordinate: usize) -> f64 {
    if coordinate < N_POSITIONS { 1.0 } else { RADIAN_M }
}

/// Writes `field`, of the coordinates `moving`, into a policy. Others are pulled to where they always are, as by a
/// spring, and have no part in the activations.
fn put(policy: &mut PolicyMsg, field: &StableField, moving: &[usize]) {
    let (d, systems) = (policy.task_dim as usize, &field.systems);
    let place = |c: usize| moving.iter().position(|other| *other == c);
    let P = &field.certificate.P;
    // V has no unit: around 1, it keeps most digits.
    let eigenvalues = P.symmetric_eigenvalues();
    let middle = (eigenvalues.min() * eigenvalues.max()).sqrt();
    for row in 0..d {
        for col in 0..=row {
            policy.certificate[packed_index(row, col)] = match (place(row), place(col)) {
                (Some(r), Some(c)) => P[(r, c)] / middle * unit(row) * unit(col),
                _ if row == col => 1.0,
                _ => 0.0,
            };
        }
        if let Some(r) = place(row) {
            policy.target[row] = field.certificate.target[r] / unit(row);
        }
    }
    let rate = 0.25 * policy.following;
    for (i, system) in policy.systems[..systems.n_components()].iter_mut().enumerate() {
        system.log_prior = systems.priors[i].max(f64::MIN_POSITIVE).ln();
        let (center, covariance) = (&systems.centers[i], &systems.covariances[i]);
        for row in 0..d {
            system.center[row] = place(row).map_or(policy.target[row], |r| center[r] / unit(row));
            for col in 0..d {
                let (of_position, spread) = match (place(row), place(col)) {
                    (Some(r), Some(c)) => (
                        systems.A[i][(r, c)] * unit(col) / unit(row),
                        covariance[(r, c)] / (unit(row) * unit(col)),
                    ),
                    _ if row == col => (-rate, STILL_STD * STILL_STD),
                    _ => (0.0, 0.0),
                };
                system.of_position[TASK_DIM * row + col] = of_position;
                system.covariance[packed_index(row, col)] = spread;
            }
        }
        rest_at(system, &policy.target, d);
    }
}

impl Seds {
    /// Fits from the base on: first the centres, then all Nᵢ and Wᵢ with the activations of these.
    pub fn refit(&self, demonstrations: &[Demonstration]) -> PolicyMsg {
        let (d, moments) = (self.task_dim(), moments(demonstrations));
        let mut policy = self.base;
        for c in 0..d {
            let ends = demonstrations.iter().filter_map(|one| one.poses().last());
            policy.target[c] = ends.map(|pose| pose[c]).sum::<f64>() / demonstrations.len() as f64;
        }
        let mixture = self.moved(&moments);
        let h: Vec<DVector<f64>> =
            moments.iter().map(|m| mixture.responsibilities(&self.learnt(&m.x))).collect();
        let target = self.learnt(&policy.target);
        // In coordinates in which V is the squared distance, z = Lᵀ(x − x*): ż = Σᵢ hᵢ (Wᵢ − Nᵢ) z. What the base
        // does not explain is regressed.
        let base: Vec<DMatrix<f64>> = self
            .base
            .systems()
            .iter()
            .map(|system| {
                let Decay { rates, turns } = self.decay(system);
                turns - rates
            })
            .collect();
        let z: Vec<DVector<f64>> =
            moments.iter().map(|m| self.factor.tr_mul(&(self.learnt(&m.x) - &target))).collect();
        let phi = DMatrix::from_fn(z.len(), self.n_systems() * d, |k, j| h[k][j / d] * z[k][j % d]);
        let unexplained: Vec<_> = (0..z.len())
            .map(|k| {
                let explained = base.iter().zip(h[k].iter()).map(|(system, h)| system * &z[k] * *h);
                let velocity = self.factor.tr_mul(&self.learnt(&moments[k].xd));
                explained.fold(velocity, |rest, one| rest - one).transpose()
            })
            .collect();
        let change = least_squares(&phi, &DMatrix::from_rows(&unexplained), RIDGE);
        for (i, base) in base.iter().enumerate() {
            let in_metric = base + change.rows(i * d, d).transpose();
            let symmetric = (&in_metric + in_metric.transpose()) * 0.5;
            let decay = Decay { turns: &in_metric - &symmetric, rates: -symmetric };
            let system = &mut policy.systems[i];
            system.center[..d].copy_from_slice(mixture.means[i].as_slice());
            self.put(system, &self.admissible(decay), &policy.target);
        }
        sealed(policy, PolicyIds::default())
    }

    /// The mixture of the base, its centres moved to what was shown: expectation-maximisation of the centres
    /// alone, to which those of the base are data as well.
    fn moved(&self, moments: &[Moment]) -> Mixture {
        let d = self.task_dim();
        let systems = self.base.systems();
        let priors: Vec<f64> = systems.iter().map(|system| system.log_prior.exp()).collect();
        let sum: f64 = priors.iter().sum();
        let start: Vec<DVector<f64>> =
            systems.iter().map(|system| self.learnt(&system.center)).collect();
        let covariance = |system: &LinearSystem| {
            DMatrix::from_fn(d, d, |row, col| system.covariance_at(row, col))
        };
        let mut mixture = Mixture {
            priors: priors.into_iter().map(|prior| prior / sum).collect(),
            means: start.clone(),
            covariances: systems.iter().map(covariance).collect(),
        };
        for _ in 0..N_STEPS {
            let mut weights = vec![BASE_POINTS; start.len()];
            let mut sums: Vec<_> = start.iter().map(|center| center * BASE_POINTS).collect();
            for moment in moments {
                let x = self.learnt(&moment.x);
                for (i, h) in mixture.responsibilities(&x).iter().enumerate() {
                    weights[i] += h;
                    sums[i] += &x * *h;
                }
            }
            mixture.means = sums.into_iter().zip(weights).map(|(sum, n)| sum / n).collect();
        }
        mixture
    }
}
