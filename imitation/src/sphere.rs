//! Orientations: unit quaternions, their tangent spaces, and turns of more than one revolution.

use std::f64::consts::{PI, TAU};

use nalgebra::{DMatrix, DVector, UnitQuaternion, Vector3};
use thiserror::Error;

use crate::gmm::{self, GmmError, GmmOptions};
use crate::mixture::Mixture;

/// A Karcher mean is found when its step is shorter than this, rad.
const MEAN_STEP: f64 = 1e-12;
const MEAN_STEPS: usize = 100;
/// A turn shorter than this has no axis, rad.
const NO_TURN: f64 = 1e-12;

/// Log map at `base`: the rotation vector, of at most π rad, that turns `base` into `rotation`, in the
/// frame of `base`.
pub fn log(base: &UnitQuaternion<f64>, rotation: &UnitQuaternion<f64>) -> Vector3<f64> {
    (base.inverse() * rotation).scaled_axis()
}

/// Exponential map at `base`: `base` turned by the rotation vector `v` (rad) in its own frame.
pub fn exp(base: &UnitQuaternion<f64>, v: &Vector3<f64>) -> UnitQuaternion<f64> {
    base * UnitQuaternion::from_scaled_axis(*v)
}

/// The weighted Karcher mean: the rotation m with Σ wᵢ log(m, qᵢ) = 0, found by repeated steps from the
/// rotation with the largest weight. Unique where all rotations are within π/2 of one.
///
/// Weights are 0 or more, one each; `None` when they sum to 0.
pub fn karcher_mean(
    rotations: &[UnitQuaternion<f64>],
    weights: &[f64],
) -> Option<UnitQuaternion<f64>> {
    let weighted = || rotations.iter().zip(weights);
    let (first, largest) = weighted().max_by(|a, b| a.1.total_cmp(b.1))?;
    if *largest <= 0.0 {
        return None;
    }
    let total: f64 = weights.iter().sum();
    let mut mean = *first;
    for _ in 0..MEAN_STEPS {
        let step = weighted().map(|(q, w)| log(&mean, q) * *w).sum::<Vector3<f64>>() / total;
        mean = exp(&mean, &step);
        mean.renormalize();
        if step.norm() < MEAN_STEP {
            break;
        }
    }
    Some(mean)
}

/// A Gaussian mixture over orientations, in the tangent space at `base`. Meant for orientations within
/// a right angle or so of it; densities are those of the tangent space, rad⁻³.
#[derive(Clone, Debug, PartialEq)]
pub struct RotationMixture {
    pub base: UnitQuaternion<f64>,
    /// Over log(base, q), rad.
    pub tangent: Mixture,
}

impl RotationMixture {
    /// K = `k` components about the Karcher mean of `rotations`. Their coordinates share one scale:
    /// turns about a fixed axis, whose other two coordinates never move, can be fitted.
    pub fn fit(
        rotations: &[UnitQuaternion<f64>],
        k: usize,
        options: &GmmOptions,
        seed: u64,
    ) -> Result<RotationMixture, GmmError> {
        let base = karcher_mean(rotations, &vec![1.0; rotations.len()])
            .unwrap_or_else(UnitQuaternion::identity);
        let columns: Vec<_> = rotations.iter().map(|q| log(&base, q)).collect();
        let data = DMatrix::from_fn(3, columns.len(), |c, j| columns[j][c]);
        let tangent = gmm::fit_one_scale(&data, k, options, seed)?.mixture;
        Ok(RotationMixture { base, tangent })
    }

    /// The centre of component `i` (from 0).
    pub fn center(&self, i: usize) -> UnitQuaternion<f64> {
        let mean = &self.tangent.means[i];
        exp(&self.base, &Vector3::new(mean[0], mean[1], mean[2]))
    }

    /// log Σᵢ πᵢ 𝒩(log(base, q) | μᵢ, Σᵢ).
    pub fn log_density(&self, rotation: &UnitQuaternion<f64>) -> f64 {
        self.tangent.log_density(&self.coordinates(rotation))
    }

    /// hᵢ of every component at `rotation`.
    pub fn responsibilities(&self, rotation: &UnitQuaternion<f64>) -> DVector<f64> {
        self.tangent.responsibilities(&self.coordinates(rotation))
    }

    fn coordinates(&self, rotation: &UnitQuaternion<f64>) -> DVector<f64> {
        DVector::from_column_slice(log(&self.base, rotation).as_slice())
    }
}

/// The quaternions with the sign, of q and −q, that is nearer to the one before: a path on the sphere.
pub fn continuous(rotations: &[UnitQuaternion<f64>]) -> Vec<UnitQuaternion<f64>> {
    let mut path: Vec<UnitQuaternion<f64>> = Vec::with_capacity(rotations.len());
    for rotation in rotations {
        let turned = path.last().is_some_and(|before| before.coords.dot(&rotation.coords) < 0.0);
        path.push(if turned {
            UnitQuaternion::new_unchecked(-rotation.into_inner())
        } else {
            *rotation
        });
    }
    path
}

/// The turn so far (rad, in the world's frame): sums of the rotation vectors from each orientation to the
/// next, which are less than half a turn. It is continuous for every sequence, over any number of
/// revolutions and about any axes; about a fixed axis it is the rotation vector from the first.
///
/// [`orientations`] is its inverse.
pub fn turns(rotations: &[UnitQuaternion<f64>]) -> Vec<Vector3<f64>> {
    let mut turn = Vector3::zeros();
    let mut turns: Vec<Vector3<f64>> = rotations.first().map(|_| turn).into_iter().collect();
    for pair in rotations.windows(2) {
        turn += (pair[1] * pair[0].inverse()).scaled_axis();
        turns.push(turn);
    }
    turns
}

/// The orientations from `start` on whose [`turns`] these are.
pub fn orientations(
    start: &UnitQuaternion<f64>,
    turns: &[Vector3<f64>],
) -> Vec<UnitQuaternion<f64>> {
    let mut orientation = *start;
    let mut path: Vec<UnitQuaternion<f64>> =
        turns.first().map(|_| orientation).into_iter().collect();
    for pair in turns.windows(2) {
        orientation = UnitQuaternion::from_scaled_axis(pair[1] - pair[0]) * orientation;
        orientation.renormalize();
        path.push(orientation);
    }
    path
}

/// Why rotation vectors cannot be made continuous.
#[derive(Clone, Debug, PartialEq, Error)]
#[error(
    "between points {point} and {next} the rotation vector jumps by {jump} rad while the orientation turns by \
     {turn}: after a full turn the axis changed, where no rotation vector is continuous; use `turns`"
)]
pub struct UnwrapError {
    /// From 1.
    pub point: usize,
    pub next: usize,
    pub jump: f64,
    pub turn: f64,
}

/// Rotation vectors (rad) of the same orientations, each the nearest to the one before: n(θ + 2πm) with
/// whole m. A full turn about an axis goes on from 2π instead of returning to 0.
pub fn unwrapped(vectors: &[Vector3<f64>]) -> Result<Vec<Vector3<f64>>, UnwrapError> {
    let mut path: Vec<Vector3<f64>> = Vec::with_capacity(vectors.len());
    for (k, vector) in vectors.iter().enumerate() {
        let Some(before) = path.last() else {
            path.push(*vector);
            continue;
        };
        let next = nearest_equivalent(vector, before);
        let rotation = |v: &Vector3<f64>| UnitQuaternion::from_scaled_axis(*v);
        let (jump, turn) = ((next - before).norm(), rotation(before).angle_to(&rotation(&next)));
        // Vectors differ by more than their turn when the axis changes, by half a turn at most.
        if jump > turn + PI / 2.0 {
            return Err(UnwrapError { point: k, next: k + 1, jump, turn });
        }
        path.push(next);
    }
    Ok(path)
}

/// The rotation vector (rad) of the same rotation as `vector` that is nearest to `before`: n(θ + 2πm), m whole.
pub fn nearest_equivalent(vector: &Vector3<f64>, before: &Vector3<f64>) -> Vector3<f64> {
    let angle = vector.norm();
    // Without a turn every axis will do, and the one before is nearest.
    let axis = if angle > NO_TURN {
        vector / angle
    } else {
        before.try_normalize(NO_TURN).unwrap_or_default()
    };
    axis * (angle + TAU * ((before.dot(&axis) - angle) / TAU).round())
}

#[cfg(test)]
mod tests;
