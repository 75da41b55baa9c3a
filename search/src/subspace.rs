//! Any search along given directions: outside θ = θ₀ + L e, inside white noise on e.

use nalgebra::{DMatrix, DVector};

use super::{Mode, Prediction, RewardError, Search, SearchSnapshot, Space};
use crate::trial::{Proposal, Trial};

/// The search over e (k numbers from 0) that is a search over θ (D numbers) from outside. [`crate::build`]
/// wraps the methods of this crate in it; a search of another crate has to be wrapped by hand.
pub struct Subspace {
    inner: Box<dyn Search>,
    space: Space,
    /// L⁺ (k×D): e = L⁺(θ − θ₀) by least squares.
    inverse: DMatrix<f64>,
    mean: DVector<f64>,
}

impl Subspace {
    /// `build` makes the inner search.
    ///
    /// # Panics
    /// If the columns of L are not independent; see [`Space::along`].
    pub fn new(space: Space, build: impl FnOnce(Space) -> Box<dyn Search>) -> Subspace {
        let k = space.exploration.ncols();
        let known = space.known.as_ref().map(|k| k.along(&space.theta_0, &space.exploration));
        let directions = space.directions.clone();
        let prediction = space.prediction.clone().map(|prediction| {
            let outer = space.clone();
            Prediction::new(move |e| prediction.of(&place(&outer, e)))
        });
        let white = Space::white(DVector::zeros(k));
        let inner = build(Space { directions, known, prediction, ..white });
        let (mean, inverse) = (space.theta_0.clone(), space.inverse());
        let mut subspace = Subspace { inner, mean, space, inverse };
        subspace.mean = subspace.theta(subspace.inner.mean());
        subspace
    }

    fn theta(&self, e: &DVector<f64>) -> DVector<f64> {
        place(&self.space, e)
    }

    /// The same proposal for the inner search.
    fn inner(&self, proposal: &Proposal) -> Proposal {
        let e = &self.inverse * (&proposal.theta - &self.space.theta_0);
        Proposal { rollout: proposal.rollout, theta: e }
    }

    fn all_inner(&self, proposals: &[Proposal]) -> Vec<Proposal> {
        proposals.iter().map(|proposal| self.inner(proposal)).collect()
    }

    /// L Σ Lᵀ.
    fn covariance(&self, inner: &DMatrix<f64>) -> DMatrix<f64> {
        let l = &self.space.exploration;
        l * inner * l.transpose()
    }
}

/// θ₀ + L e, within the box.
fn place(space: &Space, e: &DVector<f64>) -> DVector<f64> {
    space.inside(&space.theta_0 + &space.exploration * e)
}

impl Search for Subspace {
    fn ask(&self, rollout: u64, pending: &[Proposal]) -> Proposal {
        let Proposal { theta: e, .. } = self.inner.ask(rollout, &self.all_inner(pending));
        Proposal { rollout, theta: self.theta(&e) }
    }

    fn note(&mut self, proposal: &Proposal, pending: &[Proposal]) {
        let (proposal, pending) = (self.inner(proposal), self.all_inner(pending));
        self.inner.note(&proposal, &pending);
    }

    fn check_reward(&self, reward: f64) -> Result<(), RewardError> {
        self.inner.check_reward(reward)
    }

    fn tell(&mut self, trial: &Trial) {
        let e = &self.inverse * (&trial.theta - &self.space.theta_0);
        self.inner.tell(&Trial { theta: e, ..trial.clone() });
        self.mean = self.theta(self.inner.mean());
    }

    fn mean(&self) -> &DVector<f64> {
        &self.mean
    }

    /// The standard deviations count each inner one by itself: correlations between the inner
    /// parameters are not part of a snapshot.
    fn snapshot(&self, rollout: u64) -> SearchSnapshot {
        let SearchSnapshot { mean, std, floor } = self.inner.snapshot(rollout);
        let variance = self.space.exploration.map(|x| x * x) * std.map(|s| s * s);
        SearchSnapshot { mean: self.theta(&mean), std: variance.map(f64::sqrt), floor }
    }

    fn doubted(&self) -> Vec<usize> {
        self.inner.doubted()
    }

    fn modes(&self) -> Vec<Mode> {
        let outer = |mode: Mode| Mode {
            prior: mode.prior,
            mean: self.theta(&mode.mean),
            covariance: self.covariance(&mode.covariance),
        };
        self.inner.modes().into_iter().map(outer).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::random::{Random, RandomConfig};
    use crate::{DirectionsError, SearchConfig, build};

    /// Three directions in ten parameters.
    fn space() -> Space {
        let l = DMatrix::from_fn(10, 3, |i, j| ((i * 7 + j * 3) % 11) as f64 - 5.0);
        Space::along(DVector::from_element(10, 2.0), l).unwrap()
    }

    /// r = exp(−‖L⁺(θ − θ₀) − 1‖²), highest at e = (1, 1, 1).
    fn hill(search: &Subspace, theta: &DVector<f64>) -> f64 {
        let e = &search.inverse * (theta - &search.space.theta_0);
        (-e.add_scalar(-1.0).norm_squared()).exp()
    }

    #[test]
    fn proposals_stay_on_the_directions_and_white_draws_come_through() {
        let outer = space();
        let random = RandomConfig { std: 0.5 };
        let search = Subspace::new(outer.clone(), |inner| Box::new(Random::new(random, 4, inner)));
        assert_eq!(search.mean(), &outer.theta_0);
        let inner = Random::new(random, 4, Space::white(DVector::zeros(3)));
        for rollout in 1..20 {
            let theta = search.ask(rollout, &[]).theta;
            let e = inner.ask(rollout, &[]).theta;
            assert_eq!(theta, &outer.theta_0 + &outer.exploration * &e);
            let back = &search.inverse * (&theta - &outer.theta_0);
            assert!((back - e).amax() < 1e-12, "least squares inverts");
        }
        let modes = search.modes();
        let expected = &outer.exploration * outer.exploration.transpose() * 0.25;
        assert!((&modes[0].covariance - &expected).amax() < 1e-12);
        let std = search.snapshot(2).std;
        assert!((std.map(|s| s * s) - expected.diagonal()).amax() < 1e-12);
    }

    #[test]
    fn a_search_climbs_along_the_directions() {
        let config = SearchConfig::default();
        let mut search = Subspace::new(space(), |inner| build(&config, 3, inner));
        for rollout in 1..=150 {
            let theta = search.ask(rollout, &[]).theta;
            let reward = hill(&search, &theta);
            search.tell(&Trial { rollout, theta, reward, success: false, measured: Vec::new() });
        }
        let reached = hill(&search, search.mean());
        assert!(reached > 0.9, "r(mean) = {reached}");
    }

    #[test]
    fn dependent_directions_are_refused_with_what_to_do() {
        let l = DMatrix::from_columns(&[
            DVector::from_vec(vec![1.0, 2.0, 0.0]),
            DVector::from_vec(vec![2.0, 4.0, 0.0]),
        ]);
        let error = Space::along(DVector::zeros(3), l.clone()).unwrap_err();
        assert!(error.to_string().contains("the 2 exploration directions"), "{error}");
        let length = Space::along(DVector::zeros(4), l).unwrap_err();
        assert_eq!(length, DirectionsError::Length { dim: 4, found: 3 });
        let wide = Space::along(DVector::zeros(1), DMatrix::from_element(1, 2, 1.0));
        assert!(wide.is_err());
    }
}
