//! What a search is told about its space before the first trial.

use std::fmt;
use std::sync::Arc;

use nalgebra::{DMatrix, DVector};
use thiserror::Error;

/// A box that is known to hold the solutions: D numbers each.
#[derive(Clone, Debug, PartialEq)]
pub struct Bounds {
    pub min: DVector<f64>,
    pub max: DVector<f64>,
}

/// Why numbers make no box.
#[derive(Debug, Error, PartialEq)]
pub enum BoundsError {
    #[error(
        "the box has {min} minima and {max} maxima for {dim} parameters: give one of each a parameter"
    )]
    Length { dim: usize, min: usize, max: usize },
    #[error(
        "the box is empty in parameter {index}: [{min}, {max}]; give finite numbers, min < max"
    )]
    Empty { index: usize, min: f64, max: f64 },
}

impl Bounds {
    /// A box of `dim` parameters.
    pub fn new(dim: usize, min: &[f64], max: &[f64]) -> Result<Bounds, BoundsError> {
        if min.len() != dim || max.len() != dim {
            return Err(BoundsError::Length { dim, min: min.len(), max: max.len() });
        }
        for (index, (&min, &max)) in min.iter().zip(max).enumerate() {
            if !(min.is_finite() && max.is_finite() && min < max) {
                return Err(BoundsError::Empty { index, min, max });
            }
        }
        Ok(Bounds { min: DVector::from_column_slice(min), max: DVector::from_column_slice(max) })
    }

    /// `centre` ± `half_width` in every parameter.
    pub fn around(centre: &DVector<f64>, half_width: f64) -> Bounds {
        Bounds { min: centre.add_scalar(-half_width), max: centre.add_scalar(half_width) }
    }

    pub fn dim(&self) -> usize {
        self.min.len()
    }

    pub fn contains(&self, theta: &DVector<f64>) -> bool {
        (0..self.dim()).all(|i| (self.min[i]..=self.max[i]).contains(&theta[i]))
    }

    /// The point of the box nearest to `theta`.
    pub fn clamp(&self, theta: &DVector<f64>) -> DVector<f64> {
        DVector::from_fn(self.dim(), |i, _| theta[i].clamp(self.min[i], self.max[i]))
    }

    /// A point given in fractions of the box, 0 to 1 each.
    pub fn at(&self, fractions: &[f64]) -> DVector<f64> {
        DVector::from_fn(self.dim(), |i, _| {
            self.min[i] + fractions[i] * (self.max[i] - self.min[i])
        })
    }

    /// Inverse of [`Bounds::at`].
    pub fn fractions(&self, theta: &DVector<f64>) -> DVector<f64> {
        DVector::from_fn(self.dim(), |i, _| (theta[i] - self.min[i]) / (self.max[i] - self.min[i]))
    }
}

/// The smallest singular value of a usable L, relative to the largest: far above rounding, far
/// below directions that differ.
const RANK_TOLERANCE: f64 = 1e-6;

/// Why a matrix of directions cannot be searched.
#[derive(Debug, Error, PartialEq)]
pub enum DirectionsError {
    #[error("the directions have {found} parameters, the start {dim}: they must agree")]
    Length { dim: usize, found: usize },
    #[error(
        "the {directions} exploration directions are not independent (smallest singular value \
         {smallest:.1e}, largest {largest:.1e}): leave out one that others combine to, by setting \
         its amount in learner.exploration to 0"
    )]
    Rank { directions: usize, smallest: f64, largest: f64 },
}

/// Where and how a search begins.
#[derive(Clone, Debug, PartialEq)]
pub struct Space {
    /// The start, D numbers.
    pub theta_0: DVector<f64>,
    /// L (D×k): noise of standard deviation s is s·L·z with z ~ 𝒩(0, I_k), and Σ = s²·L·Lᵀ.
    /// The identity is white noise on every parameter; the columns of a structured L are
    /// directions that mean something, and k may be far below D.
    pub exploration: DMatrix<f64>,
    pub bounds: Option<Bounds>,
    /// What is known of the columns of L, one each; nothing where it is empty.
    pub directions: Vec<Direction>,
    pub known: Option<Known>,
    pub prediction: Option<Prediction>,
}

/// What is known of one direction before the first trial.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Direction {
    /// Only forwards leads on, as far as one can tell: a slow demonstration has no use for a smaller
    /// amplitude.
    pub grows: bool,
    /// Closed until trials succeed: it matters how one succeeds, not whether.
    pub late: bool,
}

/// The part of the reward that follows from θ and needs no trial, up to a constant:
/// −Σᵢ wᵢ max(gᵢ·θ + bᵢ, least).
#[derive(Clone, Debug, PartialEq)]
pub struct Known {
    /// w (n) and b (n).
    pub weights: DVector<f64>,
    pub offsets: DVector<f64>,
    /// The gᵢ as rows (n×D).
    pub gradients: DMatrix<f64>,
    pub least: f64,
}

impl Known {
    pub fn of(&self, theta: &DVector<f64>) -> f64 {
        let terms = &self.gradients * theta + &self.offsets;
        -terms.iter().zip(&self.weights).map(|(term, w)| w * term.max(self.least)).sum::<f64>()
    }

    /// The same of e, where θ = θ₀ + L e.
    pub fn along(&self, theta_0: &DVector<f64>, directions: &DMatrix<f64>) -> Known {
        Known {
            offsets: &self.offsets + &self.gradients * theta_0,
            gradients: &self.gradients * directions,
            ..self.clone()
        }
    }
}

/// What will be measured of θ, as far as it can be computed without a trial: one value a target, `None`
/// for a target of which nothing can be said. Deterministic, and cheap next to a trial.
#[derive(Clone)]
pub struct Prediction(Arc<Predict>);

type Predict = dyn Fn(&DVector<f64>) -> Vec<Option<f64>> + Send + Sync;

impl Prediction {
    pub fn new(
        of: impl Fn(&DVector<f64>) -> Vec<Option<f64>> + Send + Sync + 'static,
    ) -> Prediction {
        Prediction(Arc::new(of))
    }

    pub fn of(&self, theta: &DVector<f64>) -> Vec<Option<f64>> {
        (self.0)(theta)
    }
}

impl fmt::Debug for Prediction {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("Prediction")
    }
}

/// A function equals itself.
impl PartialEq for Prediction {
    fn eq(&self, other: &Prediction) -> bool {
        Arc::ptr_eq(&self.0, &other.0)
    }
}

impl Space {
    /// White noise around `theta_0`, no box.
    pub fn white(theta_0: DVector<f64>) -> Space {
        let dim = theta_0.len();
        Space::new(theta_0, DMatrix::identity(dim, dim))
    }

    /// Noise along the columns of `directions` (D×k) around `theta_0`, no box.
    pub fn along(
        theta_0: DVector<f64>,
        directions: DMatrix<f64>,
    ) -> Result<Space, DirectionsError> {
        let (found, columns) = directions.shape();
        if found != theta_0.len() {
            return Err(DirectionsError::Length { dim: theta_0.len(), found });
        }
        let singular = directions.singular_values();
        let (smallest, largest) = (singular.min(), singular.max());
        if columns > found || smallest <= RANK_TOLERANCE * largest || !largest.is_finite() {
            return Err(DirectionsError::Rank { directions: columns, smallest, largest });
        }
        Ok(Space::new(theta_0, directions))
    }

    fn new(theta_0: DVector<f64>, exploration: DMatrix<f64>) -> Space {
        let (bounds, directions, known, prediction) = (None, Vec::new(), None, None);
        Space { theta_0, exploration, bounds, directions, known, prediction }
    }

    /// L⁺ (k×D): e = L⁺(θ − θ₀) by least squares.
    ///
    /// # Panics
    /// If the columns of L are not independent; see [`Space::along`].
    pub fn inverse(&self) -> DMatrix<f64> {
        let normal = self.exploration.tr_mul(&self.exploration);
        let factor = normal.cholesky().expect("independent directions");
        factor.solve(&self.exploration.transpose())
    }

    /// What is known of the direction `index`.
    pub fn direction(&self, index: usize) -> Direction {
        self.directions.get(index).copied().unwrap_or_default()
    }

    pub fn dim(&self) -> usize {
        self.theta_0.len()
    }

    /// The point of the box nearest to `theta`; `theta` itself where no box is known.
    pub fn inside(&self, theta: DVector<f64>) -> DVector<f64> {
        match &self.bounds {
            Some(bounds) => bounds.clamp(&theta),
            None => theta,
        }
    }

    /// White noise on every parameter.
    pub fn is_white(&self) -> bool {
        let (rows, columns) = self.exploration.shape();
        rows == columns && self.exploration == DMatrix::identity(rows, columns)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_box_is_checked_and_maps_both_ways() {
        let bounds = Bounds::new(2, &[-1.0, 0.0], &[1.0, 10.0]).unwrap();
        let theta = bounds.at(&[0.25, 0.5]);
        assert_eq!(theta.as_slice(), [-0.5, 5.0]);
        assert_eq!(bounds.fractions(&theta).as_slice(), [0.25, 0.5]);
        assert!(bounds.contains(&theta));
        let outside = DVector::from_vec(vec![3.0, -1.0]);
        assert!(!bounds.contains(&outside));
        assert_eq!(bounds.clamp(&outside).as_slice(), [1.0, 0.0]);

        let error = Bounds::new(2, &[0.0, 2.0], &[1.0, 2.0]).unwrap_err().to_string();
        assert!(error.contains("parameter 1: [2, 2]"), "{error}");
        assert!(Bounds::new(2, &[0.0], &[1.0, 2.0]).unwrap_err().to_string().contains("1 minima"));
        assert!(Bounds::new(1, &[f64::NAN], &[1.0]).is_err());
    }
}
