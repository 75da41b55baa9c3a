//! Takagi–Sugeno: ẍ = Σᵢ hᵢ(t) [Aᵢ [x; ẋ] + bᵢ], Eq. (2) with ξʷ = t, ξᵀ = [x; ẋ] and ξᵒ = ẍ.
//!
//! Local models are fitted by ridge regression towards the critically damped spring, [−κᴾ I, −κᵛ I]. Of Aᵢ the
//! block of the position is searched, −(Kᵢ + Wᵢ) with Kᵢ = exp(Sᵢ) symmetric and Wᵢ skew; that of the velocity
//! stays −κᵛ I. With μᵢ = (Kᵢ + Wᵢ)⁻¹ bᵢ a local model is a spring whose pull is turned by Wᵢ, so that θ is that of
//! springs and the Wᵢ.
//!
//! A local model is stable whenever ‖Wᵢ‖² < κᵛ² λ_min(Kᵢ): an eigenvalue s with eigenvector v of
//! s² + κᵛ s + (K + W) has s² + κᵛ s + k + iω = 0 with k = v*Kv/v*v and iω = v*Wv/v*v, and Re s < 0 just where
//! ω² < κᵛ² k. Decoding keeps Wᵢ within half of that.

use nalgebra::{DMatrix, DVector, SymmetricEigen};
use search::Bounds;
use shm_types::policy::{
    ACTIVATION_TIME, LinearSystem, OUTPUT_ACCELERATION, PolicyMsg, packed_index,
};

use super::time::{
    Bump, Moment, check_shape, driven_by_time, least_squares, moments, sealed, weights,
};
use crate::demonstration::Demonstration;
use crate::initial_policy::{InitialPolicyConfig, initial_policy};
use crate::parameters::{ParameterError, ParameterMap, PolicyIds, STIFFNESS_MAX, Scales, spectral};

/// A spread of √ρ units of the scales within a component weighs as much as the ridge.
const RIDGE: f64 = 30.0;
/// Softest direction of a fitted model, relative to κᴾ: of a softer one the attractor would lie absurdly far.
const SOFTEST: f64 = 0.25;
/// ‖Wᵢ‖ relative to the bound of stability.
const MARGIN: f64 = 0.5;
/// Ridge of the offsets, relative, as that of the attractors of springs.
const OFFSET_RIDGE: f64 = 1e-9;

/// The map between θ and Takagi–Sugeno models of one shape.
///
/// θ holds what it holds of springs, see [`ParameterMap`], then the strict lower triangles of the Wᵢ by rows, in
/// units of κᴾ times the scale of log K: n·(d + d²) numbers.
#[derive(Clone, Debug)]
pub struct Tsm {
    base: PolicyMsg,
    springs: ParameterMap,
    scales: Scales,
    bumps: Vec<Bump>,
    /// κᵛ, s⁻¹.
    damping: f64,
}

/// The models of `demonstrations`, at least one, of equal duration; sealed, without session and rollout.
pub fn fit(demonstrations: &[Demonstration], config: &InitialPolicyConfig) -> PolicyMsg {
    let springs = initial_policy(&demonstrations[0], config);
    let bump = |i: usize| {
        let component = &springs.components[i];
        Bump { log_prior: 0.0, center: component.center, width: component.width }
    };
    let bumps: Vec<Bump> = (0..springs.components().len()).map(bump).collect();
    let mut policy = PolicyMsg {
        output: OUTPUT_ACCELERATION,
        orientation_stiffness: config.orientation_stiffness,
        orientation_damping: config.orientation_damping,
        ..driven_by_time(&bumps, config.task_dim, demonstrations)
    };
    let model = |system: &mut LinearSystem| {
        for c in 0..config.task_dim {
            system.of_position[7 * c] = -config.kappa_p;
            system.of_velocity[7 * c] = -springs.damping;
        }
    };
    policy.systems[..bumps.len()].iter_mut().for_each(model);
    let model = Tsm::of(policy.sealed(), Scales::default());
    model.expect("springs are within the bounds of a message").refit(demonstrations)
}

impl Tsm {
    /// `base` carries everything θ does not: activations, κᵛ and duration.
    pub fn new(base: &PolicyMsg, scales: Scales) -> Result<Tsm, ParameterError> {
        base.validate()?;
        Tsm::of(*base, scales)
    }

    fn of(base: PolicyMsg, scales: Scales) -> Result<Tsm, ParameterError> {
        let bumps = Bump::of(&base);
        let mut springs = PolicyMsg {
            task_dim: base.task_dim,
            n_components: base.n_systems,
            activation: ACTIVATION_TIME,
            duration_s: base.duration_s,
            damping: -base.systems[0].of_velocity_at(0, 0),
            orientation_stiffness: base.orientation_stiffness,
            orientation_damping: base.orientation_damping,
            ..PolicyMsg::EMPTY
        };
        for (component, bump) in springs.components.iter_mut().zip(&bumps) {
            (component.center, component.width) = (bump.center, bump.width);
            component.attractor = base.target;
        }
        let damping = springs.damping;
        let springs = ParameterMap::new(&springs.sealed(), scales)?;
        Ok(Tsm { base, springs, scales, bumps, damping })
    }

    fn task_dim(&self) -> usize {
        self.base.task_dim as usize
    }

    /// Entries of a Wᵢ.
    fn n_skew(&self) -> usize {
        self.task_dim() * (self.task_dim() - 1) / 2
    }

    pub fn dim(&self) -> usize {
        self.springs.dim() + self.bumps.len() * self.n_skew()
    }

    /// κᴾ, s⁻², to which κᵛ is critical.
    fn kappa_p(&self) -> f64 {
        (0.5 * self.damping).powi(2)
    }

    /// One unit of an entry of Wᵢ, s⁻².
    fn skew_scale(&self) -> f64 {
        self.kappa_p() * self.scales.log_stiffness
    }

    /// The map of the springs in the models; θ begins with theirs.
    pub fn map(&self) -> &ParameterMap {
        &self.springs
    }

    /// The springs Kᵢ, μᵢ in the models of `policy`: these without the Wᵢ. A sealed policy of springs.
    pub fn springs(&self, policy: &PolicyMsg) -> PolicyMsg {
        let zero = DVector::zeros(self.springs.dim());
        let mut springs = self.springs.decode(&zero, PolicyIds::default());
        for (component, system) in springs.components.iter_mut().zip(policy.systems()) {
            let block = self.block(system);
            let offset = DVector::from_column_slice(&system.offset[..self.task_dim()]);
            let attractor = block.clone().lu().solve(&offset).unwrap_or(offset);
            for row in 0..self.task_dim() {
                component.attractor[row] = attractor[row];
                for col in 0..=row {
                    component.stiffness[packed_index(row, col)] =
                        0.5 * (block[(row, col)] + block[(col, row)]);
                }
            }
        }
        springs.sealed()
    }

    /// Kᵢ + Wᵢ = −∂ẍ/∂x (d×d, s⁻²).
    fn block(&self, system: &LinearSystem) -> DMatrix<f64> {
        let d = self.task_dim();
        DMatrix::from_fn(d, d, |row, col| -system.of_position_at(row, col))
    }

    /// Fits Kᵢ + Wᵢ to every component for itself, then all bᵢ together, with the activations of the base.
    pub fn refit(&self, demonstrations: &[Demonstration]) -> PolicyMsg {
        let moments = moments(demonstrations);
        let h: Vec<Vec<f64>> = moments.iter().map(|m| weights(&self.bumps, m.t_s)).collect();
        let (d, n) = (self.task_dim(), self.bumps.len());
        let blocks: Vec<_> =
            (0..n).map(|i| self.admissible(&self.local(&moments, |k| h[k][i]))).collect();
        // Σᵢ hᵢ bᵢ = ẍ + κᵛẋ + Σᵢ hᵢ (Kᵢ + Wᵢ) x.
        let y = DMatrix::from_rows(
            &(0..moments.len())
                .map(|k| {
                    let (x, pull) = (self.learnt(&moments[k].x), self.pull(&moments[k]));
                    let mixed = blocks.iter().zip(&h[k]).map(|(block, h)| block * &x * *h);
                    mixed.fold(pull, |sum, one| sum + one).transpose()
                })
                .collect::<Vec<_>>(),
        );
        let phi = DMatrix::from_fn(moments.len(), n, |k, i| h[k][i]);
        // The hᵢ sum to 1: about its mean, the ridge does not pull towards the world's origin.
        let mean = y.row_mean();
        let about = DMatrix::from_fn(y.nrows(), d, |k, c| y[(k, c)] - mean[c]);
        let offsets = least_squares(&phi, &about, OFFSET_RIDGE);
        let mut policy = self.base;
        for (i, (system, block)) in policy.systems.iter_mut().zip(&blocks).enumerate() {
            self.put_block(system, block);
            (0..d).for_each(|c| system.offset[c] = offsets[(i, c)] + mean[c]);
        }
        sealed(policy, PolicyIds::default())
    }

    /// min over M of Σₖ wₖ‖M(x̄ − xₖ) − (gₖ − ḡ)‖² / Σₖ wₖ + ρ‖(M − κᴾI)D‖², g = ẍ + κᵛẋ and D the scales, with
    /// means by the same weights: M (d×d).
    fn local(&self, moments: &[Moment], weight: impl Fn(usize) -> f64) -> DMatrix<f64> {
        let d = self.task_dim();
        let sum: f64 = (0..moments.len()).map(&weight).sum();
        let mean = |of: &dyn Fn(&Moment) -> DVector<f64>| {
            let weighted = moments.iter().enumerate().map(|(k, moment)| of(moment) * weight(k));
            weighted.fold(DVector::zeros(d), |sum, one| sum + one) / sum
        };
        let x_mean = mean(&|moment| self.learnt(&moment.x));
        let g_mean = mean(&|moment| self.pull(moment));
        let ridge = DMatrix::from_fn(d, d, |row, col| match row == col {
            true => RIDGE * self.scales.attractor(row).powi(2),
            false => 0.0,
        });
        let (mut spread, mut pulls) = (ridge.clone(), ridge * self.kappa_p());
        for (k, moment) in moments.iter().enumerate() {
            let (x, g) = (self.learnt(&moment.x) - &x_mean, self.pull(moment) - &g_mean);
            spread += &x * x.transpose() * (weight(k) / sum);
            pulls -= g * x.transpose() * (weight(k) / sum);
        }
        let factor = spread.cholesky().expect("a ridge is positive definite");
        factor.solve(&pulls.transpose()).transpose()
    }

    /// The nearest block that a policy may have: its symmetric part stiff enough, its skew part stable.
    fn admissible(&self, block: &DMatrix<f64>) -> DMatrix<f64> {
        let symmetric = (block + block.transpose()) * 0.5;
        let skew = block - &symmetric;
        let softest = SOFTEST * self.kappa_p();
        let eigen = SymmetricEigen::new(symmetric);
        let stiffness = spectral(&eigen, |value| value.clamp(softest, STIFFNESS_MAX));
        let bounded = self.bounded(skew, &stiffness);
        stiffness + bounded
    }

    /// W, shortened where ‖W‖ exceeds its part of κᵛ √λ_min(K).
    fn bounded(&self, skew: DMatrix<f64>, stiffness: &DMatrix<f64>) -> DMatrix<f64> {
        let softest = stiffness.symmetric_eigenvalues().min().max(0.0);
        let most = MARGIN * self.damping * softest.sqrt();
        let norm = skew.singular_values().max();
        if norm > most { skew * (most / norm) } else { skew }
    }

    fn learnt(&self, pose: &[f64]) -> DVector<f64> {
        DVector::from_column_slice(&pose[..self.task_dim()])
    }

    /// g = ẍ + κᵛẋ, which the local models explain.
    fn pull(&self, moment: &Moment) -> DVector<f64> {
        self.learnt(&moment.xdd) + self.learnt(&moment.xd) * self.damping
    }

    fn put_block(&self, system: &mut LinearSystem, block: &DMatrix<f64>) {
        for row in 0..self.task_dim() {
            for col in 0..self.task_dim() {
                system.of_position[6 * row + col] = -block[(row, col)];
            }
        }
    }

    pub fn encode(&self, policy: &PolicyMsg) -> Result<DVector<f64>, ParameterError> {
        check_shape(&self.base, policy)?;
        let gains = policy.systems().iter().zip(self.base.systems());
        for (component, (own, base)) in gains.enumerate() {
            if own.of_velocity != base.of_velocity {
                return Err(ParameterError::OtherStiffness { component });
            }
        }
        let mut theta = self.springs.encode(&self.springs(policy))?.as_slice().to_vec();
        for system in policy.systems() {
            let block = self.block(system);
            for row in 0..self.task_dim() {
                let skew = |col: usize| 0.5 * (block[(row, col)] - block[(col, row)]);
                theta.extend((0..row).map(|col| skew(col) / self.skew_scale()));
            }
        }
        Ok(DVector::from_vec(theta))
    }

    /// bᵢ = (Kᵢ + Wᵢ) μᵢ, and Aᵢ = [−(Kᵢ + Wᵢ), −κᵛ I]. The message is sealed.
    ///
    /// # Panics
    /// If θ has another length than `dim()` or is not finite.
    pub fn decode(&self, theta: &DVector<f64>, ids: PolicyIds) -> PolicyMsg {
        assert_eq!(theta.len(), self.dim(), "θ does not belong to this policy shape");
        let (of_springs, of_skews) = theta.as_slice().split_at(self.springs.dim());
        let springs =
            self.springs.decode(&DVector::from_column_slice(of_springs), PolicyIds::default());
        assert!(of_skews.iter().all(|value| value.is_finite()), "θ must be finite");
        let (d, n_skew) = (self.task_dim(), self.n_skew());
        let mut policy = self.base;
        for (i, component) in springs.components().iter().enumerate() {
            let stiffness = DMatrix::from_fn(d, d, |row, col| component.stiffness_at(row, col));
            let mut skew = DMatrix::zeros(d, d);
            for row in 0..d {
                for col in 0..row {
                    let entry = of_skews[i * n_skew + row * (row - 1) / 2 + col];
                    skew[(row, col)] = entry * self.skew_scale();
                    skew[(col, row)] = -skew[(row, col)];
                }
            }
            let block = &stiffness + self.bounded(skew, &stiffness);
            let offset = &block * self.learnt(&component.attractor);
            self.put_block(&mut policy.systems[i], &block);
            policy.systems[i].offset[..d].copy_from_slice(offset.as_slice());
        }
        sealed(policy, ids)
    }

    /// The box of the springs, with no end in the Wᵢ.
    pub fn near(&self, policy: &PolicyMsg, reach_m: f64) -> Bounds {
        let Bounds { min, max } = self.springs.near(&self.springs(policy), reach_m);
        let no_end = crate::parameters::no_end(self.dim());
        let with = |of: DVector<f64>, rest: DVector<f64>| {
            let n = of.len();
            DVector::from_fn(rest.len(), |i, _| if i < n { of[i] } else { rest[i] })
        };
        Bounds { min: with(min, no_end.min), max: with(max, no_end.max) }
    }
}
