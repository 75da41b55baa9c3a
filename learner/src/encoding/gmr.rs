//! Gaussian mixture regression in time, Eq. (2) with ξʷ = ξᵀ = t and ξᵒ = ẋ, followed by the loop.
//!
//! The field is f(x, t) = ô(t) − κ x with ô(t) = Σᵢ hᵢ(t) [aᵢ (t − tᵢ) + oᵢ], and the loop follows it by
//! ẍ = λ(f − ẋ). With λ = 2√κᴾ and κ = κᴾ/λ it does what a critically damped spring does whose attractor is
//! ô/κ. So ô is the regression of o = κ x + ẋ + ẍ/λ, which makes the loop's law reproduce the movement exactly
//! where the regression is exact.
//!
//! The activations are those in time of a mixture of (t, x); a policy refitted to an altered demonstration keeps
//! them, so that it differs from the first one smoothly.

use imitation::gmm::{self, GmmError, GmmOptions};
use nalgebra::{DMatrix, DVector};
use search::Bounds;
use shm_types::policy::{OUTPUT_VELOCITY, PolicyMsg};

use super::time::{Bump, check_shape, driven_by_time, least_squares, moments, sealed, weights};
use crate::demonstration::Demonstration;
use crate::initial_policy::InitialPolicyConfig;
use crate::parameters::{
    ATTRACTOR_MAX, N_POSITIONS, ParameterError, PolicyIds, Scales, extent, no_end,
};

/// The mixture is part of the fit, not of the search: the same for every session.
const SEED: u64 = 0;
/// A component is at least as wide as this part of an equal share of the movement.
const NARROWEST: f64 = 0.2;
/// Ridge of the outputs, relative: it decides where two components cover one another only.
const RIDGE: f64 = 1e-6;
/// A component leads for about so many σᵢ.
const LEAD: f64 = 4.0;
/// A coordinate whose extent is below this never moves and is not fitted, m or rad.
const STILL: f64 = 1e-9;

/// The map between θ and regressions of one shape.
///
/// θ holds, in units of the scales, oᵢ/κ of all components and then 4aᵢσᵢ/κ: where the attractor is at the middle of a
/// component, and how far it moves while the component leads. 2·n·d numbers.
#[derive(Clone, Debug)]
pub struct Gmr {
    base: PolicyMsg,
    scales: Scales,
    bumps: Vec<Bump>,
    /// κ, s⁻¹.
    kappa: f64,
}

/// The regression of `demonstrations`, at least one, of equal duration; sealed, without session and rollout.
pub fn fit(
    demonstrations: &[Demonstration],
    config: &InitialPolicyConfig,
) -> Result<PolicyMsg, GmmError> {
    let bumps = bumps(demonstrations, config)?;
    let lambda = 2.0 * config.kappa_p.sqrt();
    let mut policy = PolicyMsg {
        output: OUTPUT_VELOCITY,
        following: lambda,
        orientation_stiffness: config.orientation_stiffness,
        orientation_damping: config.orientation_damping,
        ..driven_by_time(&bumps, config.task_dim, demonstrations)
    };
    for system in &mut policy.systems[..bumps.len()] {
        for c in 0..config.task_dim {
            system.of_position[7 * c] = -config.kappa_p / lambda;
        }
    }
    Ok(Gmr::of(policy, Scales::default()).refit(demonstrations))
}

/// The activations in time of a mixture of (t, x), in the order of their centres.
fn bumps(
    demonstrations: &[Demonstration],
    config: &InitialPolicyConfig,
) -> Result<Vec<Bump>, GmmError> {
    let moments = moments(demonstrations);
    let moving: Vec<usize> = (0..config.task_dim)
        .filter(|c| {
            let (low, high) = extent(moments.iter().map(|moment| moment.x[*c]));
            high - low > STILL
        })
        .collect();
    let data = DMatrix::from_fn(1 + moving.len(), moments.len(), |row, k| match row {
        0 => moments[k].t_s,
        row => moments[k].x[moving[row - 1]],
    });
    let options = GmmOptions::default();
    let mixture = gmm::fit(&data, config.n_components, &options, SEED)?.mixture;
    let share = demonstrations[0].duration_s() / config.n_components as f64;
    let mut bumps: Vec<Bump> = (0..mixture.n_components())
        .map(|i| Bump {
            log_prior: mixture.priors[i].max(f64::MIN_POSITIVE).ln(),
            center: mixture.means[i][0],
            width: mixture.covariances[i][(0, 0)].sqrt().max(NARROWEST * share),
        })
        .collect();
    bumps.sort_by(|a, b| a.center.total_cmp(&b.center));
    Ok(bumps)
}

impl Gmr {
    /// `base` carries everything θ does not: activations, gains and duration.
    pub fn new(base: &PolicyMsg, scales: Scales) -> Result<Gmr, ParameterError> {
        base.validate()?;
        Ok(Gmr::of(*base, scales))
    }

    fn of(base: PolicyMsg, scales: Scales) -> Gmr {
        let kappa = -base.systems[0].of_position_at(0, 0);
        Gmr { base, scales, bumps: Bump::of(&base), kappa }
    }

    fn task_dim(&self) -> usize {
        self.base.task_dim as usize
    }

    pub fn dim(&self) -> usize {
        2 * self.bumps.len() * self.task_dim()
    }

    /// Eq. (2), fitted: min over oᵢ, aᵢ of Σₖ ‖Σᵢ hᵢ(tₖ) [aᵢ (tₖ − tᵢ) + oᵢ] − o(tₖ)‖² with the activations of
    /// the base, o = κ x + ẋ + ẍ/λ.
    pub fn refit(&self, demonstrations: &[Demonstration]) -> PolicyMsg {
        let (d, n, moments) = (self.task_dim(), self.bumps.len(), moments(demonstrations));
        let (kappa, lambda) = (self.kappa, self.base.following);
        let h: Vec<Vec<f64>> = moments.iter().map(|m| weights(&self.bumps, m.t_s)).collect();
        let phi = DMatrix::from_fn(moments.len(), 2 * n, |k, j| match j < n {
            true => h[k][j],
            false => h[k][j - n] * self.bumps[j - n].within(moments[k].t_s) / LEAD,
        });
        // About the start, so that the ridge pulls towards it instead of the world's origin.
        let start = moments[0].x;
        let y = DMatrix::from_fn(moments.len(), d, |k, c| {
            let moment = &moments[k];
            moment.x[c] - start[c] + (moment.xd[c] + moment.xdd[c] / lambda) / kappa
        });
        let fitted = least_squares(&phi, &y, RIDGE);
        let theta = DVector::from_fn(self.dim(), |entry, _| {
            let (j, c) = (entry / d, entry % d);
            let from = if j < n { start[c] } else { 0.0 };
            (from + fitted[(j, c)]) / self.scales.attractor(c)
        });
        self.decode(&theta, PolicyIds::default())
    }

    pub fn encode(&self, policy: &PolicyMsg) -> Result<DVector<f64>, ParameterError> {
        check_shape(&self.base, policy)?;
        let (d, n, systems) = (self.task_dim(), self.bumps.len(), policy.systems());
        let gains = policy.systems().iter().zip(self.base.systems());
        for (component, (own, base)) in gains.enumerate() {
            if own.of_position != base.of_position || own.of_velocity != base.of_velocity {
                return Err(ParameterError::OtherStiffness { component });
            }
        }
        let lead = |i: usize| LEAD * self.bumps[i].width;
        let slope = |i: usize, c: usize| systems[i].of_drive[c] * lead(i) / self.kappa;
        Ok(DVector::from_fn(self.dim(), |entry, _| {
            let (j, c) = (entry / d, entry % d);
            let value = match self.bumps.get(j) {
                // offset = oᵢ − aᵢ tᵢ.
                Some(bump) => {
                    systems[j].offset[c] / self.kappa + slope(j, c) * bump.center / lead(j)
                }
                None => slope(j - n, c),
            };
            value / self.scales.attractor(c)
        }))
    }

    /// f = ô(t) − κ x. The message is sealed.
    ///
    /// Departure: attractors and how far they move are kept within the message's bounds, as those of springs are.
    ///
    /// # Panics
    /// If θ has another length than `dim()` or is not finite.
    pub fn decode(&self, theta: &DVector<f64>, ids: PolicyIds) -> PolicyMsg {
        assert_eq!(theta.len(), self.dim(), "θ does not belong to this policy shape");
        assert!(theta.iter().all(|value| value.is_finite()), "θ must be finite");
        let (d, n) = (self.task_dim(), self.bumps.len());
        let mut policy = self.base;
        for (i, bump) in self.bumps.iter().enumerate() {
            for c in 0..d {
                let entry = |j: usize| {
                    let value = theta[j * d + c] * self.scales.attractor(c);
                    value.clamp(-ATTRACTOR_MAX, ATTRACTOR_MAX)
                };
                let rate = entry(n + i) / (LEAD * bump.width);
                policy.systems[i].of_drive[c] = self.kappa * rate;
                policy.systems[i].offset[c] = self.kappa * (entry(i) - rate * bump.center);
            }
        }
        sealed(policy, ids)
    }

    /// The box whose attractors lie, at the middle of each component, within `reach_m` of those of `policy`, with
    /// no end in other parameters.
    pub fn near(&self, policy: &PolicyMsg, reach_m: f64) -> Bounds {
        let (mut bounds, d) = (no_end(self.dim()), self.task_dim());
        let Ok(theta) = self.encode(policy) else { return bounds };
        for axis in 0..N_POSITIONS.min(d) {
            let places = || (0..self.bumps.len()).map(|i| i * d + axis);
            let (low, high) = extent(places().map(|entry| theta[entry]));
            let reach = reach_m / self.scales.position_m;
            for entry in places() {
                (bounds.min[entry], bounds.max[entry]) = (low - reach, high + reach);
            }
        }
        bounds
    }
}
