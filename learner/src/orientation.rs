//! Orientation in the task coordinates pitch, roll, yaw: rotation vectors, or turns on the sphere.
//!
//! A rotation vector jumps at π and has no derivatives along some axes at 2π. A turn is what has been turned so
//! far, ∫ω dt in the world frame: it has no jump, its derivative is ω, and about a fixed axis it is the rotation
//! vector. Demonstrations and θ count turns on the sphere; messages carry rotation vectors of any length, whose
//! exponential the loop takes.

use imitation::sphere;
use nalgebra::{UnitQuaternion, Vector3};
use serde::{Deserialize, Serialize};
use shm_types::policy::{ORIENTATION_SPHERE, ORIENTATION_VECTOR, PolicyMsg};

use crate::trajectory::Pose;

/// Longest rotation vector that is counted on; a message may carry 100 rad in an entry.
const LONGEST_RAD: f64 = 90.0;

/// How a session sees orientations.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(rename_all = "snake_case")]
pub enum Orientation {
    /// Three more coordinates, which stay well within half a turn.
    #[default]
    #[serde(rename = "rotation_vector")]
    Vector,
    /// Rotations: any number of turns about any axes.
    Sphere,
}

impl Orientation {
    /// Whether it is that of every session stored before there was a choice.
    pub fn is_vector(&self) -> bool {
        *self == Orientation::Vector
    }

    /// The code in a policy message.
    pub fn code(self) -> u32 {
        match self {
            Orientation::Vector => ORIENTATION_VECTOR,
            Orientation::Sphere => ORIENTATION_SPHERE,
        }
    }
}

/// The rotational coordinates of `pose` in the world's axes, rad.
pub fn rotation(pose: &Pose) -> Vector3<f64> {
    Vector3::new(pose[4], pose[3], pose[5])
}

/// `pose` with other rotational coordinates, given in the world's axes, rad.
pub fn with_rotation(pose: &Pose, rotation: &Vector3<f64>) -> Pose {
    [pose[0], pose[1], pose[2], rotation.y, rotation.x, rotation.z]
}

/// exp of the rotational coordinates.
pub(crate) fn exp(pose: &Pose) -> UnitQuaternion<f64> {
    UnitQuaternion::from_scaled_axis(rotation(pose))
}

/// `poses` with turns as their rotational coordinates, for these orientations. The first turn is the rotational
/// part of the first pose, a rotation vector of the first orientation.
pub(crate) fn counted(poses: &[Pose], orientations: &[UnitQuaternion<f64>]) -> Vec<Pose> {
    let first = poses.first().map(rotation).unwrap_or_default();
    let turns = sphere::turns(orientations);
    poses.iter().zip(turns).map(|(pose, turn)| with_rotation(pose, &(first + turn))).collect()
}

/// The orientations of `poses` whose rotational coordinates are turns.
pub(crate) fn reached(poses: &[Pose]) -> Vec<UnitQuaternion<f64>> {
    let Some(first) = poses.first() else { return Vec::new() };
    sphere::orientations(&exp(first), &poses.iter().map(rotation).collect::<Vec<_>>())
}

/// The attractors of `policy` as θ counts them: on the sphere with turns from each to the next, of less than half
/// a turn, where the message has rotation vectors.
pub(crate) fn attractors(policy: &PolicyMsg) -> Vec<Pose> {
    let poses: Vec<Pose> = policy.components().iter().map(|one| one.attractor).collect();
    match policy.orientation {
        ORIENTATION_SPHERE => counted(&poses, &poses.iter().map(exp).collect::<Vec<_>>()),
        _ => poses,
    }
}

/// Inverse of [`attractors`]. On the sphere a rotation vector is the one nearest to that before, so that a full
/// turn goes on from 2π.
pub(crate) fn put_attractors(policy: &mut PolicyMsg, poses: &[Pose]) {
    let mut poses = poses.to_vec();
    if policy.orientation == ORIENTATION_SPHERE {
        let orientations = reached(&poses);
        for i in 1..poses.len() {
            let vector = orientations[i].scaled_axis();
            let nearest = sphere::nearest_equivalent(&vector, &rotation(&poses[i - 1]));
            // A message carries no longer ones; the shortest is the same orientation.
            let fits = nearest.norm() <= LONGEST_RAD;
            poses[i] = with_rotation(&poses[i], if fits { &nearest } else { &vector });
        }
    }
    for (component, pose) in policy.components.iter_mut().zip(poses) {
        component.attractor = pose;
    }
}

#[cfg(test)]
mod tests {
    use std::f64::consts::TAU;

    use super::*;

    fn policy(turns: &[[f64; 3]]) -> (PolicyMsg, Vec<Pose>) {
        let n_components = turns.len() as u32;
        let orientation = ORIENTATION_SPHERE;
        let policy = PolicyMsg { task_dim: 6, n_components, orientation, ..PolicyMsg::EMPTY };
        let pose = |turn: &[f64; 3]| with_rotation(&[0.1; 6], &Vector3::from(*turn));
        (policy, turns.iter().map(pose).collect())
    }

    #[test]
    fn turns_come_back_from_the_rotation_vectors_of_a_message() {
        // Most of a turn about z, half a one about x, and back about an axis in between.
        let turns = [
            [0.0, 0.0, 1.0],
            [0.0, 0.0, 3.5],
            [0.0, 0.1, 6.0],
            [1.5, 0.1, 6.5],
            [3.0, 0.0, 1.0 + TAU],
            [2.0, 1.0, 6.0],
        ];
        let (mut policy, poses) = policy(&turns);
        put_attractors(&mut policy, &poses);
        for (found, pose) in attractors(&policy).iter().zip(&poses) {
            let error = (0..6).map(|c| (found[c] - pose[c]).abs()).fold(0.0, f64::max);
            assert!(error < 1e-12, "{found:?} {pose:?}");
        }
    }

    #[test]
    fn about_a_fixed_axis_turns_are_rotation_vectors_of_any_length() {
        let turns: Vec<[f64; 3]> = (0..8).map(|i| [0.0, 0.0, 2.0 * f64::from(i)]).collect();
        let (mut policy, poses) = policy(&turns);
        put_attractors(&mut policy, &poses);
        for (component, pose) in policy.components().iter().zip(&poses) {
            let error = (rotation(&component.attractor) - rotation(pose)).amax();
            assert!(error < 1e-12, "{:?}", component.attractor);
        }
    }

    /// What a message cannot carry is another rotation vector of the same orientation.
    #[test]
    fn no_turn_is_too_long_for_a_message() {
        let turns: Vec<[f64; 3]> = (0..16).map(|i| [0.0, 0.0, 99.0 + 0.5 * f64::from(i)]).collect();
        let (mut policy, poses) = policy(&turns);
        put_attractors(&mut policy, &poses);
        for (component, orientation) in policy.components().iter().zip(reached(&poses)) {
            assert!(component.attractor.iter().all(|value| value.abs() <= 100.0));
            assert!(exp(&component.attractor).angle_to(&orientation) < 1e-9);
        }
    }
}
