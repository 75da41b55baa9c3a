//! Attractors of springs of any stiffness, from one or several demonstrations, on the sphere as well.

#![allow(non_snake_case)] // K, R

use imitation::sphere;
use nalgebra::{DMatrix, DVector, Matrix6, UnitQuaternion, Vector6};
use shm_types::policy::{ACTIVATION_DECAY, ORIENTATION_SPHERE, PolicyMsg};

use crate::activation::policy_activations;
use crate::damping::dampers;
use crate::demonstration::Demonstration;
use crate::orientation::{counted, exp, put_attractors, rotation, with_rotation};
use crate::trajectory::Pose;

/// Ridge of a step, relative: it keeps the normal equations solvable where no sample shows a component.
const RIDGE: f64 = 1e-9;
/// Steps at most, and the longest one that changes nothing any more, m or rad. Without rotations one is enough.
const N_STEPS: usize = 50;
const NO_STEP: f64 = 1e-10;
/// A component acts on a sample where its weight is more than this.
const ACTS: f64 = 0.01;
/// Farthest that an attractor may be turned from where it acts, rad: the shortest way changes sides at π.
const MAX_TURN_RAD: f64 = 2.8;

/// What was shown at one moment, and what the springs have to do about it.
struct Moment {
    /// hᵢ.
    weights: Vec<f64>,
    /// m; its rotational coordinates count where there is no sphere.
    pose: Pose,
    R: UnitQuaternion<f64>,
    /// ẍ + Σᵢ hᵢ Dᵢ ẋ, m/s² and rad/s².
    pull: Vector6<f64>,
}

/// Where a spring pulls to.
#[derive(Clone)]
struct Attractor {
    pose: Pose,
    R: UnitQuaternion<f64>,
}

impl Attractor {
    /// μᵢ − x, on the sphere with Log(Rᵢ R⁻¹) as its rotational part, as the loop takes it.
    fn error(&self, moment: &Moment, is_sphere: bool) -> Vector6<f64> {
        let difference: Pose = std::array::from_fn(|c| self.pose[c] - moment.pose[c]);
        let error = match is_sphere {
            true => with_rotation(&difference, &(self.R * moment.R.inverse()).scaled_axis()),
            false => difference,
        };
        Vector6::from(error)
    }

    fn moved(&self, step: &Vector6<f64>) -> Attractor {
        let step: Pose = (*step).into();
        Attractor {
            pose: std::array::from_fn(|c| self.pose[c] + step[c]),
            R: UnitQuaternion::from_scaled_axis(rotation(&step)) * self.R,
        }
    }
}

/// Eq. (5) solved for its attractors along the demonstrations, at least one, of equal duration:
///
/// Σᵢ hᵢ(t) Kᵢ (μᵢ − x) ≈ ẍ + Σᵢ hᵢ(t) Dᵢ ẋ
///
/// by least squares over all samples, with the Kᵢ, Dᵢ and hᵢ of `frame`. On the sphere Log(exp(μᵢ) R⁻¹) stands for
/// the rotational part of μᵢ − x, and ω and ω̇ for its derivatives; there it is solved by repeated linear steps, which
/// take the derivative of Log for I.
/// Sealed, without session and rollout.
pub(crate) fn placed(frame: &PolicyMsg, demonstrations: &[Demonstration]) -> PolicyMsg {
    let is_sphere = frame.orientation == ORIENTATION_SPHERE;
    let shown: Vec<Demonstration> = demonstrations
        .iter()
        .map(|one| if is_sphere { one.on_sphere() } else { one.clone() })
        .collect();
    let (K, moments) = (stiffnesses(frame), moments(frame, &shown));
    let inverses: Vec<_> =
        K.iter().map(|K| K.pseudo_inverse(0.0).expect("0 is no negative tolerance")).collect();
    let h = DMatrix::from_fn(moments.len(), K.len(), |k, i| moments[k].weights[i]);
    let mut normal = h.tr_mul(&h);
    let ridge = RIDGE * normal.trace() / K.len() as f64;
    (0..K.len()).for_each(|i| normal[(i, i)] += ridge);
    let factor = normal.cholesky().expect("HᵀH plus a ridge is positive definite");

    let mut attractors = starts(frame, &shown[0]);
    let mut best = (f64::INFINITY, attractors.clone());
    for _ in 0..N_STEPS {
        let missing = missing(&moments, &attractors, &K, is_sphere);
        let error = missing.norm();
        if error >= best.0 {
            break;
        }
        best = (error, attractors.clone());
        let forces = factor.solve(&h.tr_mul(&missing));
        let mut longest: f64 = 0.0;
        for ((attractor, inverse), force) in
            attractors.iter_mut().zip(&inverses).zip(forces.row_iter())
        {
            let step = inverse * Vector6::from_iterator(force.iter().copied());
            longest = longest.max(step.amax());
            *attractor = attractor.moved(&step);
        }
        if longest < NO_STEP {
            break;
        }
    }
    with_attractors(frame, &best.1, &shown[0])
}

/// What the springs with these attractors leave of the pulls, a row each (T×6).
fn missing(
    moments: &[Moment],
    attractors: &[Attractor],
    K: &[Matrix6<f64>],
    is_sphere: bool,
) -> DMatrix<f64> {
    let rows: Vec<_> = moments
        .iter()
        .map(|moment| {
            let mut rest = moment.pull;
            for ((h, attractor), K) in moment.weights.iter().zip(attractors).zip(K) {
                rest -= K * attractor.error(moment, is_sphere) * *h;
            }
            DVector::from_column_slice(rest.as_slice()).transpose()
        })
        .collect();
    DMatrix::from_rows(&rows)
}

fn with_attractors(frame: &PolicyMsg, found: &[Attractor], shown: &Demonstration) -> PolicyMsg {
    let mut policy = *frame;
    let mut poses: Vec<Pose> = found.iter().map(|one| one.pose).collect();
    if frame.orientation == ORIENTATION_SPHERE {
        let rotations: Vec<_> = found.iter().map(|one| one.R).collect();
        // Of all that say the same, the rotation vector that continues what was shown.
        let start = rotation(&shown.poses()[0]);
        let first = sphere::nearest_equivalent(&rotations[0].scaled_axis(), &start);
        poses[0] = with_rotation(&poses[0], &first);
        poses = counted(&poses, &rotations);
    }
    put_attractors(&mut policy, &poses);
    policy.sealed()
}

/// Kᵢ of all coordinates: on those that are not learnt the gain of the orientation controller, s⁻².
fn stiffnesses(frame: &PolicyMsg) -> Vec<Matrix6<f64>> {
    let d = frame.task_dim as usize;
    let entry = |component: &shm_types::policy::Component, row: usize, col: usize| match row < d
        && col < d
    {
        true => component.stiffness_at(row, col),
        false if row == col => frame.orientation_stiffness,
        false => 0.0,
    };
    let matrix = |component| Matrix6::from_fn(|row, col| entry(component, row, col));
    frame.components().iter().map(matrix).collect()
}

fn moments(frame: &PolicyMsg, shown: &[Demonstration]) -> Vec<Moment> {
    let (d, learnt) = (frame.task_dim as usize, dampers(frame));
    let D = |i: usize| {
        Matrix6::from_fn(|row, col| match row < d && col < d {
            true => learnt[i][(row, col)],
            false if row == col => frame.orientation_damping,
            false => 0.0,
        })
    };
    let D: Vec<_> = (0..learnt.len()).map(D).collect();
    let of = |one: &Demonstration| {
        let ((velocity, acceleration), rotations) = (one.derivatives(), one.rotations());
        let moment = |k: usize| {
            let weights = policy_activations(frame, k as f64 * one.period_s());
            let xd = Vector6::from(velocity[k]);
            let damped = weights.iter().zip(&D).map(|(h, D)| D * xd * *h);
            let pull = damped.fold(Vector6::from(acceleration[k]), |sum, one| sum + one);
            Moment { weights, pose: one.poses()[k], R: rotations[k], pull }
        };
        (0..rotations.len()).map(moment).collect::<Vec<_>>()
    };
    shown.iter().flat_map(of).collect()
}

/// Where the demonstration is at the middle of each component.
fn starts(frame: &PolicyMsg, shown: &Demonstration) -> Vec<Attractor> {
    let rotations = shown.rotations();
    let at = |center: f64| {
        let t_s = match frame.activation {
            ACTIVATION_DECAY => -center.ln() / frame.decay_rate,
            _ => center,
        };
        let k = ((t_s / shown.period_s()).round() as usize).min(rotations.len() - 1);
        Attractor { pose: shown.poses()[k], R: rotations[k] }
    };
    frame.components().iter().map(|component| at(component.center)).collect()
}

/// An attractor that is nearly half a turn from where it acts.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct TooFar {
    pub file: String,
    /// From 0.
    pub component: usize,
    pub t_s: f64,
    pub turn: f64,
}

/// The first attractor of a policy on the sphere, fitted to `demonstrations`, that is too far to be pulled to the
/// way that was shown.
pub(crate) fn too_far(policy: &PolicyMsg, demonstrations: &[Demonstration]) -> Option<TooFar> {
    let attractors: Vec<_> = policy.components().iter().map(|one| exp(&one.attractor)).collect();
    for one in demonstrations {
        for (k, R) in one.rotations().iter().enumerate() {
            let t_s = k as f64 * one.period_s();
            let weights = policy_activations(policy, t_s);
            for (component, (h, attractor)) in weights.iter().zip(&attractors).enumerate() {
                let turn = R.angle_to(attractor);
                if *h > ACTS && turn > MAX_TURN_RAD {
                    return Some(TooFar { file: one.file().into(), component, t_s, turn });
                }
            }
        }
    }
    None
}

#[cfg(test)]
mod tests;
