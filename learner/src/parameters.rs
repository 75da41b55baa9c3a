//! θ ↔ policy: the learner's scaled search vector and the physical parameters {μᵢ, Kᵢ} of Eq. (5).
//!
//! Per component θ holds d attractor entries (x, y, z, pitch, roll, yaw as far as learnt), then
//! the d(d+1)/2 lower-triangle entries, by rows, of S = log K: 72, 112 or 216 numbers for d = 3,
//! 4 or 6 and eight components. θ is absolute, θ = physical / scale, not an offset from the
//! initial policy: a stored θ means the same in every session with these scales. On the sphere the angles
//! of an attractor are turns, see [`crate::orientation`].

use std::ops::Range;

use nalgebra::{DMatrix, DVector, SymmetricEigen};
use search::Bounds;
use search::range::range;
use serde::{Deserialize, Serialize};
use shm_types::policy::{Component, PolicyMsg, PolicyMsgError, packed_index};
use thiserror::Error;

use crate::orientation::{attractors, put_attractors};

/// Smallest and largest eigenvalue of a decoded Kᵢ, s⁻².
pub const STIFFNESS_MIN: f64 = 1.0;
pub const STIFFNESS_MAX: f64 = 2e4;
/// Largest attractor entry a message may carry, m or rad.
pub const ATTRACTOR_MAX: f64 = 100.0;

/// Beyond what any θ reaches.
const NO_END: f64 = 1e9;
/// x, y and z come first.
pub(crate) const N_POSITIONS: usize = 3;

/// One unit of θ in physical units (the rescaling of the paper's footnote 1).
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(default, deny_unknown_fields)]
pub struct Scales {
    /// Position of an attractor.
    pub position_m: f64,
    /// Angle of an attractor.
    pub angle_rad: f64,
    /// Entries of log K.
    pub log_stiffness: f64,
}

impl Default for Scales {
    fn default() -> Self {
        Scales { position_m: 0.03, angle_rad: 0.1, log_stiffness: 0.3 }
    }
}

impl Scales {
    /// Settings and their ranges.
    pub fn ranges(&self) -> [search::range::Range; 3] {
        [
            range("position_m", self.position_m, 1e-4, 1.0, "m"),
            range("angle_rad", self.angle_rad, 1e-4, 3.0, "rad"),
            range("log_stiffness", self.log_stiffness, 1e-4, 3.0, "1"),
        ]
    }

    /// The scale of entry `coordinate` of an attractor, m or rad.
    pub fn attractor(&self, coordinate: usize) -> f64 {
        if coordinate < N_POSITIONS { self.position_m } else { self.angle_rad }
    }
}

/// Identity of a policy: the fields of the message that are not physical.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct PolicyIds {
    pub session: u64,
    pub rollout: u64,
    pub policy_id: u64,
}

impl PolicyIds {
    /// `policy` under these names; not sealed.
    pub(crate) fn name(self, policy: &PolicyMsg) -> PolicyMsg {
        let PolicyIds { session, rollout, policy_id } = self;
        PolicyMsg { session, rollout, policy_id, ..*policy }
    }
}

/// Why a policy has no θ.
#[derive(Debug, Error, PartialEq)]
pub enum ParameterError {
    #[error("policy cannot be encoded: {0}")]
    Message(PolicyMsgError),
    #[error("this policy has systems, but θ encodes springs: use a policy with components")]
    Systems,
    #[error(
        "policy has task_dim {found_dim} and {found} components, the session {task_dim} and \
         {components}: use a policy of the same shape"
    )]
    Shape { found_dim: u32, found: u32, task_dim: u32, components: u32 },
    #[error(
        "component {component}: stiffness has the eigenvalue {value} s⁻²: it must be within \
         {STIFFNESS_MIN}..={STIFFNESS_MAX}"
    )]
    Stiffness { component: usize, value: f64 },
    #[error(
        "component {component}: its stiffness is not that of the session, whose encoding keeps it: use \
         learner.encoding = \"springs\" for policies that differ in stiffness"
    )]
    OtherStiffness { component: usize },
    #[error(
        "the policy has another certificate than the session, or none: its certificate and following are kept"
    )]
    NoCertificate,
    #[error("system {system} decays at {value} s⁻¹ under its certificate; this must be above 0")]
    Rate { system: usize, value: f64 },
}

/// No `#[from]`: the text holds the cause, and a chain would repeat it.
impl From<PolicyMsgError> for ParameterError {
    fn from(error: PolicyMsgError) -> Self {
        ParameterError::Message(error)
    }
}

/// The map between θ and policies of one shape.
#[derive(Clone, Debug)]
pub struct ParameterMap {
    base: PolicyMsg,
    scales: Scales,
}

impl ParameterMap {
    /// `base` carries everything θ does not: activations, duration, damping, orientation gains,
    /// and the attractor entries of the coordinates that are not learnt.
    ///
    /// # Errors
    /// A policy that is not valid or is one of systems.
    pub fn new(base: &PolicyMsg, scales: Scales) -> Result<Self, ParameterError> {
        base.validate()?;
        if base.n_systems > 0 {
            return Err(ParameterError::Systems);
        }
        Ok(ParameterMap { base: tidied(base), scales })
    }

    /// The policy that carries everything θ does not.
    pub(crate) fn base(&self) -> &PolicyMsg {
        &self.base
    }

    /// Learnt coordinates d.
    pub fn task_dim(&self) -> usize {
        self.base.task_dim as usize
    }

    /// Length of θ: n·(d + d(d+1)/2).
    pub fn dim(&self) -> usize {
        self.base.components().len() * self.stride()
    }

    fn stride(&self) -> usize {
        self.task_dim() + packed_len(self.task_dim())
    }

    /// Sec. 3.1, Θ = {Kᵢ, μᵢ}: θ = (μᵢ / scale, lower triangle of log Kᵢ / scale)ᵢ, `dim()` long.
    ///
    /// Inverse of [`ParameterMap::decode`] for every policy whose stiffness is within bounds.
    pub fn encode(&self, policy: &PolicyMsg) -> Result<DVector<f64>, ParameterError> {
        if policy.n_systems > 0 {
            return Err(ParameterError::Systems);
        }
        check_shape(&self.base, policy)?;
        let d = self.task_dim();
        let mut theta = Vec::with_capacity(self.dim());
        let attractors = attractors(policy);
        for (index, component) in policy.components().iter().enumerate() {
            theta.extend((0..d).map(|c| attractors[index][c] / self.scales.attractor(c)));
            let stiffness = DMatrix::from_fn(d, d, |row, col| component.stiffness_at(row, col));
            let log_k = symmetric_log(stiffness)
                .map_err(|value| ParameterError::Stiffness { component: index, value })?;
            for row in 0..d {
                theta.extend((0..=row).map(|col| log_k[(row, col)] / self.scales.log_stiffness));
            }
        }
        Ok(DVector::from_vec(theta))
    }

    /// The change of θ that adds `amount` to the entry (`row`, `col`) of log K of `components`.
    pub fn log_stiffness_change(
        &self,
        components: &Range<usize>,
        row: usize,
        col: usize,
        amount: f64,
    ) -> DVector<f64> {
        let mut change = DVector::zeros(self.dim());
        for component in components.clone() {
            change[self.log_stiffness_entry(component, row, col)] =
                amount / self.scales.log_stiffness;
        }
        change
    }

    /// g with g·θ = tr(log Kᵢ)/d = ln det(Kᵢ)/d, the mean log stiffness of `component`.
    pub fn mean_log_stiffness(&self, component: usize) -> DVector<f64> {
        let mut g = DVector::zeros(self.dim());
        for c in 0..self.task_dim() {
            let entry = self.log_stiffness_entry(component, c, c);
            g[entry] = self.scales.log_stiffness / self.task_dim() as f64;
        }
        g
    }

    fn log_stiffness_entry(&self, component: usize, row: usize, col: usize) -> usize {
        component * self.stride() + self.task_dim() + packed_index(row, col)
    }

    /// The box whose attractors lie within `reach_m` of those of `policy`, with no end in other
    /// parameters.
    pub fn near(&self, policy: &PolicyMsg, reach_m: f64) -> Bounds {
        let mut bounds = no_end(self.dim());
        for axis in 0..N_POSITIONS.min(self.task_dim()) {
            let places = policy.components().iter().map(|component| component.attractor[axis]);
            let (low, high) = extent(places);
            for component in 0..policy.components().len() {
                let at = component * self.stride() + axis;
                bounds.min[at] = (low - reach_m) / self.scales.position_m;
                bounds.max[at] = (high + reach_m) / self.scales.position_m;
            }
        }
        bounds
    }

    /// Sec. 3.1, footnote 1: Kᵢ = exp(Sᵢ), so that every θ gives a symmetric positive definite
    /// stiffness (log-Euclidean), and μᵢ = scale·θ. The message is sealed.
    ///
    /// Departure: the eigenvalues of exp(S) are kept within [`STIFFNESS_MIN`], [`STIFFNESS_MAX`]
    /// and the attractors within the message's bounds. The paper leaves both open, but a search
    /// that wanders off must not be able to produce a message the controller refuses.
    ///
    /// # Panics
    /// If θ has another length than `dim()` or is not finite.
    pub fn decode(&self, theta: &DVector<f64>, ids: PolicyIds) -> PolicyMsg {
        assert_eq!(theta.len(), self.dim(), "θ does not belong to this policy shape");
        assert!(theta.iter().all(|value| value.is_finite()), "θ must be finite");
        let d = self.task_dim();
        let mut policy = ids.name(&self.base);
        let chunks = theta.as_slice().chunks_exact(self.stride());
        let mut attractors = attractors(&self.base);
        for ((component, pose), entries) in
            policy.components.iter_mut().zip(&mut attractors).zip(chunks)
        {
            let (attractor, log_k) = entries.split_at(d);
            for (c, value) in attractor.iter().enumerate() {
                pose[c] = (value * self.scales.attractor(c)).clamp(-ATTRACTOR_MAX, ATTRACTOR_MAX);
            }
            let log_k = DMatrix::from_fn(d, d, |row, col| {
                log_k[packed_index(row, col)] * self.scales.log_stiffness
            });
            let stiffness = symmetric_exp(log_k);
            for row in 0..d {
                for col in 0..=row {
                    component.stiffness[packed_index(row, col)] = stiffness[(row, col)];
                }
            }
        }
        put_attractors(&mut policy, &attractors);
        policy.sealed()
    }
}

/// `base`, in which what is not in use is zero, so that equal policies have equal digests wherever the base
/// came from.
pub(crate) fn tidied(base: &PolicyMsg) -> PolicyMsg {
    let mut base = *base;
    base.components[base.n_components as usize..].fill(Component::ZERO);
    let packed = packed_len(base.task_dim as usize);
    base.components.iter_mut().for_each(|component| component.stiffness[packed..].fill(0.0));
    base
}

/// That `policy` is valid and has the shape of `base`.
pub(crate) fn check_shape(base: &PolicyMsg, policy: &PolicyMsg) -> Result<(), ParameterError> {
    policy.validate()?;
    if (policy.task_dim, policy.n_components) != (base.task_dim, base.n_components) {
        return Err(ParameterError::Shape {
            found_dim: policy.task_dim,
            found: policy.n_components,
            task_dim: base.task_dim,
            components: base.n_components,
        });
    }
    Ok(())
}

/// A box of `dim` parameters that ends beyond what any θ reaches.
pub(crate) fn no_end(dim: usize) -> Bounds {
    Bounds { min: DVector::from_element(dim, -NO_END), max: DVector::from_element(dim, NO_END) }
}

/// The smallest and the largest of `values`.
pub(crate) fn extent(values: impl Iterator<Item = f64>) -> (f64, f64) {
    values.fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), value| {
        (low.min(value), high.max(value))
    })
}

/// Entries of the lower triangle of a d×d matrix.
pub const fn packed_len(d: usize) -> usize {
    d * (d + 1) / 2
}

/// f(A) = V f(Λ) Vᵀ for a symmetric A = V Λ Vᵀ.
pub(crate) fn spectral(
    eigen: &SymmetricEigen<f64, nalgebra::Dyn>,
    f: impl Fn(f64) -> f64,
) -> DMatrix<f64> {
    let values = eigen.eigenvalues.map(f);
    &eigen.eigenvectors * DMatrix::from_diagonal(&values) * eigen.eigenvectors.transpose()
}

/// exp of a symmetric matrix, its eigenvalues kept within the stiffness bounds.
fn symmetric_exp(matrix: DMatrix<f64>) -> DMatrix<f64> {
    let eigen = SymmetricEigen::new(matrix);
    spectral(&eigen, |value| value.clamp(STIFFNESS_MIN.ln(), STIFFNESS_MAX.ln()).exp())
}

/// log of a symmetric matrix; the offending eigenvalue if one is out of the stiffness bounds.
fn symmetric_log(matrix: DMatrix<f64>) -> Result<DMatrix<f64>, f64> {
    let eigen = SymmetricEigen::new(matrix);
    // A decoded eigenvalue at a bound comes back with the rounding of the decomposition, which is
    // relative to the largest one.
    let slack = 1e-9 * STIFFNESS_MAX.min(eigen.eigenvalues.amax());
    let allowed = STIFFNESS_MIN - slack..=STIFFNESS_MAX + slack;
    match eigen.eigenvalues.iter().find(|value| !allowed.contains(value)) {
        Some(value) => Err(*value),
        None => Ok(spectral(&eigen, f64::ln)),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::Cholesky;
    use search::normals::{standard_normal, stream};

    const IDS: PolicyIds = PolicyIds { session: 9, rollout: 3, policy_id: 5 };

    fn map(task_dim: u32) -> ParameterMap {
        let mut base = PolicyMsg { task_dim, n_components: 8, damping: 28.0, ..PolicyMsg::EMPTY };
        for (i, component) in base.components[..8].iter_mut().enumerate() {
            component.center = 0.2 * i as f64;
            component.attractor = [0.0, 0.0, 0.0, 0.1, 0.2, 0.3];
        }
        ParameterMap::new(&base.sealed(), Scales::default()).expect("base is valid")
    }

    /// θ around K = 200 s⁻² with `std` in scaled units.
    fn random_theta(map: &ParameterMap, seed: u64, std: f64) -> DVector<f64> {
        let d = map.task_dim();
        let mut rng = stream(seed, 0);
        DVector::from_fn(map.dim(), |i, _| {
            let entry = i % map.stride();
            let diagonal = (0..d).any(|r| entry == d + packed_index(r, r));
            let center = if diagonal { 200_f64.ln() / 0.3 } else { 0.0 };
            center + std * standard_normal(&mut rng)
        })
    }

    #[test]
    fn theta_has_72_112_and_216_entries() {
        assert_eq!([3, 4, 6].map(|d| map(d).dim()), [72, 112, 216]);
    }

    #[test]
    fn encode_inverts_decode() {
        for task_dim in [3, 4, 6] {
            let map = map(task_dim);
            for seed in 0..20 {
                let theta = random_theta(&map, seed, 0.5);
                let policy = map.decode(&theta, IDS);
                assert_eq!(policy.validate(), Ok(()));
                let back = map.encode(&policy).expect("stiffness is within bounds");
                assert!((back - theta).amax() < 1e-9, "task_dim {task_dim}, seed {seed}");
            }
        }
    }

    #[test]
    fn every_theta_gives_admissible_positive_definite_stiffness() {
        for (task_dim, std) in [(3, 1.0), (4, 10.0), (6, 100.0), (4, 1e6)] {
            let map = map(task_dim);
            for seed in 0..20 {
                let policy = map.decode(&random_theta(&map, seed, std), IDS);
                assert_eq!(policy.validate(), Ok(()));
                let d = task_dim as usize;
                for component in policy.components() {
                    let k = DMatrix::from_fn(d, d, |r, c| component.stiffness_at(r, c));
                    assert!(Cholesky::new(k.clone()).is_some());
                    let eigenvalues = k.symmetric_eigenvalues();
                    assert!(eigenvalues.min() > 0.99 * STIFFNESS_MIN);
                    assert!(eigenvalues.max() < 1.01 * STIFFNESS_MAX);
                }
            }
        }
    }

    #[test]
    fn keeps_identity_and_unlearnt_coordinates() {
        let map = map(4);
        let policy = map.decode(&random_theta(&map, 1, 0.5), IDS);
        assert_eq!((policy.session, policy.rollout, policy.policy_id), (9, 3, 5));
        assert_eq!(policy.components[2].attractor[4..], [0.2, 0.3]);
        assert_eq!(policy.components[2].stiffness[packed_len(4)..], [0.0; 11]);
        assert_eq!(policy.components[8], Component::ZERO);
    }

    #[test]
    fn refuses_another_shape_and_an_indefinite_stiffness() {
        let theta = random_theta(&map(4), 1, 0.5);
        let mut policy = map(4).decode(&theta, IDS);
        let other = map(3).encode(&policy).expect_err("shape differs");
        assert!(matches!(other, ParameterError::Shape { found_dim: 4, task_dim: 3, .. }));
        let mut systems = PolicyMsg { n_components: 0, n_systems: 1, ..policy };
        systems.systems[0].covariance[0] = 0.01;
        assert_eq!(map(4).encode(&systems.sealed()), Err(ParameterError::Systems));
        let none = ParameterMap::new(&systems.sealed(), Scales::default());
        assert!(none.unwrap_err().to_string().contains("this policy has systems"));
        policy.components[6].stiffness[0] = -5.0;
        let error = map(4).encode(&policy.sealed()).expect_err("not positive definite");
        assert!(error.to_string().starts_with("component 6: stiffness"), "{error}");
    }
}
