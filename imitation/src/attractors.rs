//! Eq. (5) as a value: attractors with full stiffness.

use nalgebra::{DMatrix, DVector};
use thiserror::Error;

use crate::activations::Activations;
use crate::integrate::from_rest;
use crate::least_squares::about_mean;
use crate::recording::{Recording, RecordingError, check_set};

/// Eq. (5): ẍ = Σᵢ hᵢ(t)[Kᵢ(μᵢ − x) − κᵛ ẋ], i = 1 … K.
#[derive(Clone, Debug, PartialEq)]
pub struct Attractors {
    pub activations: Activations,
    /// μᵢ (d), in the unit of x.
    pub mu: Vec<DVector<f64>>,
    /// Kᵢ (d×d), symmetric positive definite, s⁻².
    pub K: Vec<DMatrix<f64>>,
    /// κᵛ, s⁻¹.
    pub kappa_v: f64,
}

/// Why attractors cannot be fitted.
#[derive(Clone, Debug, PartialEq, Error)]
pub enum AttractorsError {
    #[error(transparent)]
    Recordings(#[from] RecordingError),
    #[error("{stiffnesses} stiffness matrices for {k} activations: give one each")]
    Counts { k: usize, stiffnesses: usize },
    /// Components are counted from 1.
    #[error(
        "component {0}: its stiffness is not positive definite or has another size than the movement"
    )]
    Stiffness(usize),
    #[error("no activation reaches the movement: spread them over its duration")]
    Activations,
}

impl Attractors {
    /// The attractors that follow `recordings` best for given `activations`, stiffnesses `K` (d×d,
    /// s⁻²) and damping `kappa_v` (s⁻¹): Eq. (5) is linear in gᵢ = Kᵢ μᵢ,
    ///
    /// Σᵢ hᵢ(t) gᵢ ≈ ẍ + κᵛ ẋ + Σᵢ hᵢ(t) Kᵢ x,
    ///
    /// solved by least squares over all points of all recordings.
    pub fn fit(
        recordings: &[Recording],
        activations: Activations,
        K: Vec<DMatrix<f64>>,
        kappa_v: f64,
    ) -> Result<Attractors, AttractorsError> {
        let d = check_set(recordings)?;
        if K.len() != activations.len() {
            let (k, stiffnesses) = (activations.len(), K.len());
            return Err(AttractorsError::Counts { k, stiffnesses });
        }
        let mut inverses = Vec::with_capacity(K.len());
        for (i, K) in K.iter().enumerate() {
            let fits = K.shape() == (d, d);
            let factor = fits.then(|| K.clone().cholesky()).flatten();
            inverses.push(factor.ok_or(AttractorsError::Stiffness(i + 1))?);
        }
        let n: usize = recordings.iter().map(Recording::n_points).sum();
        let mut h = DMatrix::zeros(n, K.len());
        let mut forces = DMatrix::zeros(n, d);
        let mut row = 0;
        for recording in recordings {
            let (velocities, accelerations) = (recording.velocities(), recording.accelerations());
            for t in 0..recording.n_points() {
                let weights = activations.at(recording.time_s(t));
                let x = recording.points.column(t);
                let force = accelerations.column(t)
                    + velocities.column(t) * kappa_v
                    + weighted(&weights, &K) * x;
                h.set_row(row, &weights.transpose());
                forces.set_row(row, &force.transpose());
                row += 1;
            }
        }
        let g = about_mean(&h, &forces).ok_or(AttractorsError::Activations)?;
        let mu = inverses.iter().zip(g.row_iter()).map(|(K, g)| K.solve(&g.transpose())).collect();
        Ok(Attractors { activations, mu, K, kappa_v })
    }

    /// d.
    pub fn dim(&self) -> usize {
        self.mu[0].len()
    }

    /// Σᵢ hᵢ(t) Kᵢ (d×d, s⁻²) at `t_s` (s).
    pub fn stiffness(&self, t_s: f64) -> DMatrix<f64> {
        weighted(&self.activations.at(t_s), &self.K)
    }

    /// Eq. (5): ẍ (d) at `t_s` (s), position `x` and velocity `xd` (d each).
    pub fn acceleration(&self, t_s: f64, x: &DVector<f64>, xd: &DVector<f64>) -> DVector<f64> {
        let h = self.activations.at(t_s);
        let springs = h.iter().zip(self.K.iter().zip(&self.mu));
        springs.fold(-xd * self.kappa_v, |sum, (h, (K, mu))| sum + K * (mu - x) * *h)
    }

    /// The path (d×T) from rest at `start`, a point each `period_s` (s) over `duration_s` (s).
    /// `disturbance` adds an acceleration (d) at every time (s).
    pub fn rollout(
        &self,
        start: &DVector<f64>,
        duration_s: f64,
        period_s: f64,
        disturbance: impl Fn(f64) -> DVector<f64>,
    ) -> DMatrix<f64> {
        from_rest(start, duration_s, period_s, |t, x, xd| {
            self.acceleration(t, x, xd) + disturbance(t)
        })
    }
}

fn weighted(h: &DVector<f64>, K: &[DMatrix<f64>]) -> DMatrix<f64> {
    let (rows, columns) = K[0].shape();
    h.iter().zip(K).fold(DMatrix::zeros(rows, columns), |sum, (h, K)| sum + K * *h)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::activations::Drive;

    /// Attractors with coupled stiffness, moved by themselves, are found again.
    #[test]
    fn a_fit_recovers_the_attractors_that_made_the_movement() {
        // The first two and the last three coincide: it begins and ends at rest.
        let places =
            [[0.1, 0.0], [0.1, 0.0], [0.3, 0.5], [0.0, 0.4], [0.2, 0.1], [0.2, 0.1], [0.2, 0.1]];
        let stiffness = |i: usize| [100.0 + 20.0 * i as f64, 30.0, 30.0, 120.0];
        let made = Attractors {
            activations: Activations::spread(Drive::Time, 7, 3.0, 0.5),
            mu: places.iter().map(|place| DVector::from_row_slice(place)).collect(),
            K: (0..7).map(|i| DMatrix::from_row_slice(2, 2, &stiffness(i))).collect(),
            kappa_v: 20.0,
        };
        let path = made.rollout(&made.mu[0], 3.0, 0.002, |_| DVector::zeros(2));
        let recording = Recording::new("made", 0.002, path.clone()).unwrap();
        let found =
            Attractors::fit(&[recording], made.activations.clone(), made.K.clone(), 20.0).unwrap();
        let again = found.rollout(&made.mu[0], 3.0, 0.002, |_| DVector::zeros(2));
        assert!((again - path).amax() < 2e-3);
        for (found, made) in found.mu.iter().zip(&made.mu) {
            assert!((found - made).amax() < 0.03, "{found} is not {made}");
        }
    }

    #[test]
    fn a_constant_force_displaces_by_its_stiffness() {
        let held = Attractors {
            activations: Activations::spread(Drive::Time, 1, 1.0, 0.5),
            mu: vec![DVector::zeros(2)],
            K: vec![DMatrix::from_row_slice(2, 2, &[200.0, 100.0, 100.0, 100.0])],
            kappa_v: 28.0,
        };
        let push = DVector::from_vec(vec![1.0, 0.0]);
        let path = held.rollout(&DVector::zeros(2), 10.0, 0.01, |_| push.clone());
        let last = path.column(path.ncols() - 1);
        assert!((&held.K[0] * last - push).amax() < 1e-3);
    }

    #[test]
    fn stiffness_that_is_none_is_refused_with_its_component() {
        let recording =
            Recording::new("r", 0.1, DMatrix::from_fn(2, 12, |c, k| (c + k) as f64)).unwrap();
        let activations = Activations::spread(Drive::Time, 2, 1.1, 0.5);
        let fit =
            |K| Attractors::fit(std::slice::from_ref(&recording), activations.clone(), K, 1.0);
        let flat = vec![DMatrix::identity(2, 2), DMatrix::zeros(2, 2)];
        assert_eq!(fit(flat).unwrap_err(), AttractorsError::Stiffness(2));
        let wide = vec![DMatrix::identity(3, 3), DMatrix::identity(2, 2)];
        assert_eq!(fit(wide).unwrap_err(), AttractorsError::Stiffness(1));
        assert!(matches!(fit(Vec::new()), Err(AttractorsError::Counts { k: 2, stiffnesses: 0 })));
    }
}
