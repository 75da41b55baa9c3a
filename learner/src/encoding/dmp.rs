//! Dynamic movement primitives: Eq. (3), read as the springs of Eq. (4).
//!
//! ẍ = κᴾ[x_T − x] − κᵛẋ + Σᵢ hᵢ(s) fᵢ is Σᵢ hᵢ(s) [κᴾ(μᵢ − x) − κᵛẋ] with μᵢ = x_T + fᵢ/κᴾ, as Σᵢ hᵢ = 1. So a
//! primitive is a policy of springs that all have the stiffness κᴾ I, and θ holds the forces and the goal. The last
//! component has no force: it has the weight when s has decayed, and the movement ends at the goal.

use nalgebra::DVector;
use search::Bounds;
use shm_types::policy::PolicyMsg;

use crate::orientation::{attractors, put_attractors};
use crate::parameters::{
    ATTRACTOR_MAX, N_POSITIONS, ParameterError, PolicyIds, Scales, check_shape, extent, no_end,
    tidied,
};

/// The map between θ and primitives of one shape.
///
/// θ holds, for every component but the last, fᵢ/κᴾ in units of the scales, then x_T in the same units: as many
/// numbers as there are attractor entries, n·d.
#[derive(Clone, Debug)]
pub struct Dmp {
    base: PolicyMsg,
    scales: Scales,
}

impl Dmp {
    /// `base` carries everything θ does not: κᴾ and κᵛ, activations, duration, and the attractor entries of the
    /// coordinates that are not learnt.
    pub fn new(base: &PolicyMsg, scales: Scales) -> Result<Dmp, ParameterError> {
        base.validate()?;
        Ok(Dmp { base: tidied(base), scales })
    }

    pub(super) fn base(&self) -> &PolicyMsg {
        &self.base
    }

    fn task_dim(&self) -> usize {
        self.base.task_dim as usize
    }

    /// Index of the last component, the goal's.
    fn last(&self) -> usize {
        self.base.components().len() - 1
    }

    pub fn dim(&self) -> usize {
        self.base.components().len() * self.task_dim()
    }

    /// Eq. (3): fᵢ/κᴾ = μᵢ − x_T, and x_T is the attractor of the last component.
    pub fn encode(&self, policy: &PolicyMsg) -> Result<DVector<f64>, ParameterError> {
        check_shape(&self.base, policy)?;
        let (d, last) = (self.task_dim(), self.last());
        let attractors = attractors(policy);
        let goal = attractors[last];
        for (component, (own, base)) in
            policy.components().iter().zip(self.base.components()).enumerate()
        {
            if own.stiffness != base.stiffness {
                return Err(ParameterError::OtherStiffness { component });
            }
        }
        Ok(DVector::from_fn(self.dim(), |entry, _| {
            let (i, c) = (entry / d, entry % d);
            let from = if i == last { 0.0 } else { goal[c] };
            (attractors[i][c] - from) / self.scales.attractor(c)
        }))
    }

    /// Eq. (4): μᵢ = x_T + fᵢ/κᴾ. The message is sealed.
    ///
    /// Departure: attractors are kept within the message's bounds, as those of springs are.
    ///
    /// # Panics
    /// If θ has another length than `dim()` or is not finite.
    pub fn decode(&self, theta: &DVector<f64>, ids: PolicyIds) -> PolicyMsg {
        assert_eq!(theta.len(), self.dim(), "θ does not belong to this policy shape");
        assert!(theta.iter().all(|value| value.is_finite()), "θ must be finite");
        let (d, last) = (self.task_dim(), self.last());
        let mut policy = ids.name(&self.base);
        let mut attractors = attractors(&self.base);
        for i in 0..=last {
            for c in 0..d {
                let from = if i == last { 0.0 } else { theta[last * d + c] };
                attractors[i][c] = ((from + theta[i * d + c]) * self.scales.attractor(c))
                    .clamp(-ATTRACTOR_MAX, ATTRACTOR_MAX);
            }
        }
        put_attractors(&mut policy, &attractors);
        policy.sealed()
    }

    /// The box whose goal lies within `reach_m` of the attractors of `policy`, and whose forces pull no farther
    /// than `reach_m` beyond the distance of these.
    pub fn near(&self, policy: &PolicyMsg, reach_m: f64) -> Bounds {
        let mut bounds = no_end(self.dim());
        let (d, last) = (self.task_dim(), self.last());
        for axis in 0..N_POSITIONS.min(d) {
            let scale = self.scales.position_m;
            let places = policy.components().iter().map(|component| component.attractor[axis]);
            let (low, high) = extent(places);
            let force = (high - low + reach_m) / scale;
            for i in 0..=last {
                let [min, max] = match i == last {
                    true => [(low - reach_m) / scale, (high + reach_m) / scale],
                    false => [-force, force],
                };
                (bounds.min[i * d + axis], bounds.max[i * d + axis]) = (min, max);
            }
        }
        bounds
    }
}
