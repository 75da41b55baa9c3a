//! Initial stiffness from repetitions of a movement: stiff where they agree.

#![allow(non_snake_case)] // K, R

use imitation::activations::{Activations, Drive};
use imitation::align::{AlignError, Alignment, align};
use imitation::recording::RecordingError;
use imitation::variability::{VariabilityError, covariances, stiffnesses};
use imitation::{Recording, sphere};
use nalgebra::DMatrix;
use serde::{Deserialize, Serialize};
use shm_types::policy::{PolicyMsg, packed_index};
use thiserror::Error;

use super::InitialPolicyConfig;
use crate::activation::Activation;
use crate::demonstration::Demonstration;
use crate::orientation::{Orientation, reached, with_rotation};
use crate::parameters::{N_POSITIONS, STIFFNESS_MAX, STIFFNESS_MIN, Scales};
use crate::trajectory::Pose;

/// Deviations below this are none, m or rad.
const SAME: f64 = 1e-9;

/// Where the stiffness of the initial policy is from.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(rename_all = "snake_case")]
pub enum InitialStiffness {
    /// κᴾ I everywhere.
    #[default]
    KappaP,
    /// How much repetitions of the movement differ.
    Variability,
}

impl InitialStiffness {
    /// Whether it is that of every session stored before there was a choice.
    pub fn is_kappa_p(&self) -> bool {
        *self == InitialStiffness::KappaP
    }
}

/// Why repetitions give no stiffness.
#[derive(Clone, Debug, PartialEq, Error)]
pub enum StiffnessError {
    #[error("{0}")]
    Recording(RecordingError),
    #[error("{0}")]
    Align(AlignError),
    #[error("{0}")]
    Variability(VariabilityError),
}

/// Least and largest stiffness that variability gives, s⁻²: `range` times less and more than κᴾ, within what θ
/// and the controller hold.
pub(crate) fn bounds(kappa_p: f64, range: f64) -> [f64; 2] {
    [(kappa_p / range).max(STIFFNESS_MIN), (kappa_p * range).min(STIFFNESS_MAX)]
}

/// Puts stiffnesses from the variability of `demonstrations`, repetitions of one movement, into the springs of
/// `frame`, and κᵛ = 2√k_max, which no spring overshoots under.
///
/// Repetitions are compared at the same place of their ways, brought there by dynamic time warping, not at the same
/// moment. Position and rotation have a block each, full within the block: their units are not comparable, and a
/// direction that mixes m and rad has no stiffness in s⁻². In each block √(k_min k_max) = κᴾ belongs to the
/// geometric mean of the standard deviations (`imitation::variability::stiffnesses`). Coordinates in which nothing
/// differs say nothing and get κᴾ. On the sphere deviations are rotations from the Karcher mean, in the world frame,
/// in which the loop takes errors.
pub(crate) fn stiffen(
    frame: &mut PolicyMsg,
    demonstrations: &[Demonstration],
    config: &InitialPolicyConfig,
    scales: &Scales,
) -> Result<(), StiffnessError> {
    let deviations = deviations(demonstrations, config, scales)?;
    let activations = Activations {
        drive: match config.activation {
            Activation::Time => Drive::Time,
            Activation::Decay => Drive::Decay { rate: config.decay_rate },
        },
        centers: frame.components().iter().map(|component| component.center).collect(),
        widths: frame.components().iter().map(|component| component.width).collect(),
    };
    let [k_min, k_max] = bounds(config.kappa_p, config.stiffness_range);
    let differs = |c: &usize| {
        deviations.iter().any(|one| one.points.row(*c).iter().any(|value| value.abs() > SAME))
    };
    let mut any = false;
    for block in [0..N_POSITIONS, N_POSITIONS..config.task_dim] {
        let coordinates: Vec<usize> = block.filter(differs).collect();
        if coordinates.is_empty() {
            continue;
        }
        any = true;
        let part = |one: &Recording| Recording {
            points: one.points.select_rows(&coordinates),
            ..one.clone()
        };
        let parts: Vec<Recording> = deviations.iter().map(part).collect();
        let K = covariances(&parts, &activations)
            .and_then(|covariances| stiffnesses(&covariances, k_min, k_max))
            .map_err(StiffnessError::Variability)?;
        for (component, K) in frame.components.iter_mut().zip(K) {
            for (i, row) in coordinates.iter().enumerate() {
                for (j, col) in coordinates[..=i].iter().enumerate() {
                    component.stiffness[packed_index(*row, *col)] = K[(i, j)];
                }
            }
        }
    }
    if !any {
        return Err(StiffnessError::Variability(VariabilityError::NoVariability));
    }
    frame.damping = 2.0 * k_max.sqrt();
    Ok(())
}

/// Deviations of each repetition from the mean, m and rad, as recordings of the learnt coordinates on one clock.
fn deviations(
    demonstrations: &[Demonstration],
    config: &InitialPolicyConfig,
    scales: &Scales,
) -> Result<Vec<Recording>, StiffnessError> {
    let is_sphere = config.orientation == Orientation::Sphere;
    // All six: on the sphere an orientation is not known from some of them.
    let unit = |c: usize| scales.attractor(c);
    let recording = |one: &Demonstration| {
        let one = if is_sphere { one.on_sphere() } else { one.clone() };
        let poses = one.poses();
        let points = DMatrix::from_fn(6, poses.len(), |c, k| poses[k][c] / unit(c));
        Recording::new(one.file(), one.period_s(), points).map_err(StiffnessError::Recording)
    };
    let recordings: Vec<Recording> =
        demonstrations.iter().map(recording).collect::<Result<_, _>>()?;
    if recordings.len() < imitation::variability::MIN_RECORDINGS {
        let error = VariabilityError::TooFew { found: recordings.len() };
        return Err(StiffnessError::Variability(error));
    }
    let aligned = align(&recordings, Alignment::Warped).map_err(StiffnessError::Align)?;
    let mut poses: Vec<Vec<Pose>> = aligned
        .iter()
        .map(|one| {
            let pose = |k: usize| std::array::from_fn(|c| one.points[(c, k)] * unit(c));
            (0..one.n_points()).map(pose).collect()
        })
        .collect();
    about_mean(&mut poses, is_sphere);
    let deviation = |(one, poses): (&Recording, &Vec<Pose>)| Recording {
        points: DMatrix::from_fn(config.task_dim, poses.len(), |c, k| poses[k][c]),
        ..one.clone()
    };
    Ok(aligned.iter().zip(&poses).map(deviation).collect())
}

/// Takes the mean of all paths from each of them, point by point.
fn about_mean(paths: &mut [Vec<Pose>], is_sphere: bool) {
    let rotations: Vec<_> = paths.iter().map(|path| reached(path)).collect();
    let n = paths.len() as f64;
    for k in 0..paths[0].len() {
        let mean: Pose =
            std::array::from_fn(|c| paths.iter().map(|path| path[k][c]).sum::<f64>() / n);
        paths.iter_mut().for_each(|path| path[k] = std::array::from_fn(|c| path[k][c] - mean[c]));
        if !is_sphere {
            continue;
        }
        let there: Vec<_> = rotations.iter().map(|path| path[k]).collect();
        if let Some(middle) = sphere::karcher_mean(&there, &vec![1.0; there.len()]) {
            for (path, R) in paths.iter_mut().zip(&there) {
                path[k] = with_rotation(&path[k], &(R * middle.inverse()).scaled_axis());
            }
        }
    }
}

#[cfg(test)]
mod tests;
