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

mod fit;

use nalgebra::{DMatrix, DVector, SymmetricEigen};
use search::Bounds;
use shm_types::TASK_DIM;
use shm_types::policy::{LinearSystem, PolicyMsg, packed_index};

pub use self::fit::fit;
use super::time::{check_shape, sealed};
use crate::parameters::{
    ATTRACTOR_MAX, N_POSITIONS, ParameterError, PolicyIds, Scales, extent, no_end, packed_len,
    spectral,
};

/// Slowest decay of a system, s⁻¹, and the fastest, relative to λ.
const RATE_MIN: f64 = 0.01;
const RATE_MAX: f64 = 0.95;
/// Nᵢ + WᵢᵀNᵢ⁻¹Wᵢ relative to λ, at most.
const FOLLOWED: f64 = 0.98;

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
