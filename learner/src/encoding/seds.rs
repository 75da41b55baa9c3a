//! A stable field of the state: ẋ = Σᵢ hᵢ(x) Aᵢ (x − x*), Eq. (2) with ξʷ = ξᵀ = x and ξᵒ = ẋ, followed by the loop.
//!
//! With P = LLᵀ and Aᵢ = L⁻ᵀ(Wᵢ − Nᵢ)Lᵀ, Nᵢ = exp(Sᵢ) symmetric and Wᵢ skew, V = (x − x*)ᵀP(x − x*) falls along every
//! motion whatever Sᵢ and Wᵢ are: ½(PAᵢ + AᵢᵀP) = −L Nᵢ Lᵀ ≺ 0. So the certificate of the fit, P, holds for every θ, and
//! so does that of the motion which the loop makes of it, ẍ = λ(f − ẋ), as Wᵢ is shortened where
//! Nᵢ + WᵢᵀNᵢ⁻¹Wᵢ ≺ λI would fail (`imitation::stable::Certificate::damping`).
//!
//! A policy refitted to an altered demonstration starts from the base: its centres move, and its systems are
//! regressed towards those of the base.

#![allow(non_snake_case)] // A and P

use imitation::stable::{self, StableError, StableField, StableOptions};
use imitation::{Mixture, Recording};
use nalgebra::{DMatrix, DVector, SymmetricEigen};
use search::Bounds;
use shm_types::TASK_DIM;
use shm_types::policy::{ACTIVATION_STATE, LinearSystem, OUTPUT_VELOCITY, PolicyMsg, packed_index};

use super::time::{Moment, check_shape, hold_the_rest, least_squares, moments, sealed};
use crate::demonstration::Demonstration;
use crate::initial_policy::InitialPolicyConfig;
use crate::parameters::{
    ATTRACTOR_MAX, N_POSITIONS, ParameterError, PolicyIds, Scales, extent, no_end, packed_len,
    spectral,
};

/// The field is part of the fit, not of the search: the same for every session.
const SEED: u64 = 0;
/// A radian counts as so many metres, as in the scales of θ.
const RADIAN_M: f64 = 0.3;
/// A coordinate that never moves: its extent, m or rad, and the spread that its activations are given.
const STILL: f64 = 1e-9;
const STILL_STD: f64 = 0.1;
/// Slowest decay of a system, s⁻¹, and the fastest, relative to λ.
const RATE_MIN: f64 = 0.01;
const RATE_MAX: f64 = 0.95;
/// Nᵢ + WᵢᵀNᵢ⁻¹Wᵢ relative to λ, at most.
const FOLLOWED: f64 = 0.98;
/// Steps of the centres in a refit, and the points that the centre of the base counts for.
const N_STEPS: usize = 20;
const BASE_POINTS: f64 = 1.0;
/// Ridge towards the systems of the base, relative.
const RIDGE: f64 = 0.01;

/// The map between θ and fields of one shape and certificate.
///
/// θ holds, per component, its centre (d), the lower triangle of Sᵢ by rows and the strict one of Wᵢ, and at the end
/// x* (d), in units of the scales; one unit of Wᵢ is the scale of log K times the mean rate of the base. In all
/// n·(d + d²) + d numbers.
#[derive(Clone, Debug)]
pub struct Seds {
    base: PolicyMsg,
    scales: Scales,
    /// L (d×d).
    factor: DMatrix<f64>,
    /// Mean of tr Nᵢ/d over the base, s⁻¹.
    rate: f64,
}

/// One system in coordinates in which V is the squared distance.
struct Decay {
    /// Nᵢ and Wᵢ (d×d, s⁻¹).
    rates: DMatrix<f64>,
    turns: DMatrix<f64>,
}

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

/// Of a coordinate in a recording, m.
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

/// bᵢ = −Aᵢ x*.
fn rest_at(system: &mut LinearSystem, target: &[f64; TASK_DIM], d: usize) {
    for row in 0..d {
        let speed = |col: usize| system.of_position_at(row, col) * target[col];
        system.offset[row] = -(0..d).map(speed).sum::<f64>();
    }
}

impl Seds {
    /// `base` carries everything θ does not: P, λ, priors, covariances and duration.
    pub fn new(base: &PolicyMsg, scales: Scales) -> Result<Seds, ParameterError> {
        base.validate()?;
        let d = base.task_dim as usize;
        let P = DMatrix::from_fn(d, d, |row, col| base.certificate[packed_index(row, col)]);
        let factor = P.cholesky().ok_or(ParameterError::NoCertificate)?.unpack();
        let mut seds = Seds { base: *base, scales, factor, rate: 1.0 };
        let rates = base.systems().iter().map(|system| seds.decay(system).rates.trace());
        let n = (d * base.systems().len()) as f64;
        seds.rate = (rates.sum::<f64>() / n).max(RATE_MIN);
        Ok(seds)
    }

    fn task_dim(&self) -> usize {
        self.base.task_dim as usize
    }

    fn n_systems(&self) -> usize {
        self.base.systems().len()
    }

    /// Numbers of a component in θ.
    fn stride(&self) -> usize {
        self.task_dim() * (self.task_dim() + 1)
    }

    pub fn dim(&self) -> usize {
        self.n_systems() * self.stride() + self.task_dim()
    }

    /// W − N = LᵀA L⁻ᵀ.
    fn decay(&self, system: &LinearSystem) -> Decay {
        let d = self.task_dim();
        let A = DMatrix::from_fn(d, d, |row, col| system.of_position_at(row, col));
        // X Lᵀ = LᵀA, from L Xᵀ = (LᵀA)ᵀ.
        let transposed = self.factor.solve_lower_triangular(&(self.factor.tr_mul(&A).transpose()));
        let in_metric = transposed.expect("a Cholesky factor has an inverse").transpose();
        let symmetric = (&in_metric + in_metric.transpose()) * 0.5;
        Decay { turns: in_metric - &symmetric, rates: -symmetric }
    }

    /// The nearest decay that a policy may have.
    fn admissible(&self, Decay { rates, turns }: Decay) -> Decay {
        let lambda = self.base.following;
        let (slowest, fastest) = (RATE_MIN, RATE_MAX * lambda);
        let eigen = SymmetricEigen::new(rates);
        let rates = spectral(&eigen, |value| value.clamp(slowest, fastest));
        let inverse = spectral(&eigen, |value| 1.0 / value.clamp(slowest, fastest));
        // γ² WᵀN⁻¹W ≼ R² with R² = 0.98 λI − N, for γ ≤ 1.
        let room = spectral(&eigen, |value| {
            1.0 / (FOLLOWED * lambda - value.clamp(slowest, fastest)).sqrt()
        });
        let turned = turns.tr_mul(&(inverse * &turns));
        let most = (&room * turned * &room).symmetric_eigenvalues().max();
        let turns = if most > 1.0 { turns / most.sqrt() } else { turns };
        Decay { rates, turns }
    }

    /// A = L⁻ᵀ(W − N)Lᵀ, and b = −A x*.
    fn put(&self, system: &mut LinearSystem, decay: &Decay, target: &[f64; TASK_DIM]) {
        let in_metric = (&decay.turns - &decay.rates) * self.factor.transpose();
        let A = self.factor.tr_solve_lower_triangular(&in_metric);
        let A = A.expect("a Cholesky factor has an inverse");
        for row in 0..self.task_dim() {
            for col in 0..self.task_dim() {
                system.of_position[TASK_DIM * row + col] = A[(row, col)];
            }
        }
        rest_at(system, target, self.task_dim());
    }

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

    fn learnt(&self, pose: &[f64; TASK_DIM]) -> DVector<f64> {
        DVector::from_column_slice(&pose[..self.task_dim()])
    }

    pub fn encode(&self, policy: &PolicyMsg) -> Result<DVector<f64>, ParameterError> {
        check_shape(&self.base, policy)?;
        if (policy.certificate, policy.following) != (self.base.certificate, self.base.following) {
            return Err(ParameterError::NoCertificate);
        }
        let d = self.task_dim();
        let mut theta = Vec::with_capacity(self.dim());
        for (index, system) in policy.systems().iter().enumerate() {
            theta.extend((0..d).map(|c| system.center[c] / self.scales.attractor(c)));
            let Decay { rates, turns } = self.decay(system);
            let eigen = SymmetricEigen::new(rates);
            let slowest = eigen.eigenvalues.min();
            if slowest <= 0.0 {
                return Err(ParameterError::Rate { system: index, value: slowest });
            }
            let log_rates = spectral(&eigen, f64::ln);
            for row in 0..d {
                let entries = (0..=row).map(|col| log_rates[(row, col)]);
                theta.extend(entries.map(|entry| entry / self.scales.log_stiffness));
            }
            for row in 0..d {
                theta.extend((0..row).map(|col| turns[(row, col)] / self.turn_scale()));
            }
        }
        theta.extend((0..d).map(|c| policy.target[c] / self.scales.attractor(c)));
        Ok(DVector::from_vec(theta))
    }

    /// One unit of an entry of Wᵢ, s⁻¹.
    fn turn_scale(&self) -> f64 {
        self.rate * self.scales.log_stiffness
    }

    /// Aᵢ = L⁻ᵀ(Wᵢ − exp(Sᵢ))Lᵀ, bᵢ = −Aᵢ x*. The message is sealed.
    ///
    /// Departure: decays are kept within what the loop can follow, centres and x* within the message's bounds.
    ///
    /// # Panics
    /// If θ has another length than `dim()` or is not finite.
    pub fn decode(&self, theta: &DVector<f64>, ids: PolicyIds) -> PolicyMsg {
        assert_eq!(theta.len(), self.dim(), "θ does not belong to this policy shape");
        assert!(theta.iter().all(|value| value.is_finite()), "θ must be finite");
        let d = self.task_dim();
        let place = |value: f64, c: usize| {
            (value * self.scales.attractor(c)).clamp(-ATTRACTOR_MAX, ATTRACTOR_MAX)
        };
        let (components, target) = theta.as_slice().split_at(self.n_systems() * self.stride());
        let mut policy = self.base;
        (0..d).for_each(|c| policy.target[c] = place(target[c], c));
        for (i, entries) in components.chunks_exact(self.stride()).enumerate() {
            let (center, rest) = entries.split_at(d);
            let (log_rates, turns) = rest.split_at(packed_len(d));
            (0..d).for_each(|c| policy.systems[i].center[c] = place(center[c], c));
            let log_rates = DMatrix::from_fn(d, d, |row, col| {
                log_rates[packed_index(row, col)] * self.scales.log_stiffness
            });
            let (least, most) = (RATE_MIN.ln(), (RATE_MAX * self.base.following).ln());
            let eigen = SymmetricEigen::new(log_rates);
            let rates = spectral(&eigen, |value| value.clamp(least, most).exp());
            let turn = |row: usize, col: usize| turns[row * (row - 1) / 2 + col];
            let turns = DMatrix::from_fn(d, d, |row, col| match row.cmp(&col) {
                std::cmp::Ordering::Greater => turn(row, col) * self.turn_scale(),
                std::cmp::Ordering::Less => -turn(col, row) * self.turn_scale(),
                std::cmp::Ordering::Equal => 0.0,
            });
            let decay = self.admissible(Decay { rates, turns });
            self.put(&mut policy.systems[i], &decay, &policy.target);
        }
        sealed(policy, ids)
    }

    /// The box whose centres and target lie within `reach_m` of those of `policy`, with no end in other
    /// parameters.
    pub fn near(&self, policy: &PolicyMsg, reach_m: f64) -> Bounds {
        let mut bounds = no_end(self.dim());
        for axis in 0..N_POSITIONS.min(self.task_dim()) {
            let centers = policy.systems().iter().map(|system| system.center[axis]);
            let (low, high) = extent(centers.chain([policy.target[axis]]));
            for i in 0..=self.n_systems() {
                let entry = i * self.stride() + axis;
                bounds.min[entry] = (low - reach_m) / self.scales.position_m;
                bounds.max[entry] = (high + reach_m) / self.scales.position_m;
            }
        }
        bounds
    }
}
