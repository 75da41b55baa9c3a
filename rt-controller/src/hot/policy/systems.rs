//! Eq. (2) whole, ξᵒ = Σ hᵢ(ξʷ) [Aᵢ ξᵀ + bᵢ], with full matrices and Gaussians in time, s or state.
//!
//! Where ξᵒ is a velocity f, the loop follows it by the damped law of Kronander & Billard ("Passive
//! interaction control with dynamical systems", RA-L 2016) with the isotropic damping D = λ I:
//!
//! ẍ = λ (f − ẋ).
//!
//! Under the operational-space law, which decouples the inertia to one, an external force acts as an
//! acceleration a: ẍ = λ (f(x) − ẋ) + a.
//!
//! - Where f = −∇V, the loop is passive from a to ẋ: S = ½|ẋ|² + λ V(x) has Ṡ = −λ|ẋ|² + ẋᵀa.
//! - Any other f may feed the motion: ½|ẋ|² grows by λ (ẋᵀf − |ẋ|²) + ẋᵀa ≤ λ|f|²/4 + ẋᵀa, so that the
//!   loop injects at most λ|f|²/4 per unit of mass, W/kg, wherever it is pushed, and nothing where
//!   f = 0 or |ẋ| ≥ |f|.
//!
//! Both are of the decoupled unit inertia, as is Eq. (5); the power of the force itself is ẋᵀΛa.

use nalgebra::{Matrix6, UnitQuaternion, Vector6};
use shm_types::MAX_COMPONENTS;
use shm_types::policy::{
    ACTIVATION_DECAY, ACTIVATION_STATE, LinearSystem, ORIENTATION_SPHERE, OUTPUT_VELOCITY,
    PolicyMsg,
};

use super::{Command, normalize};
use crate::hot::task_space::{TaskState, orientation};

#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Systems {
    n_systems: usize,
    /// Learnt coordinates d.
    task_dim: usize,
    drive: Drive,
    output: Output,
    /// The movement is over after it, s: what time drives stands still.
    duration_s: f64,
    has_of_velocity: bool,
    target: Vector6<f64>,
    /// On the sphere, the orientation that the rotational part of x is relative to: the target's.
    R_WT: Option<UnitQuaternion<f64>>,
    /// Gains of the coordinates that are not learnt, s⁻² and s⁻¹.
    orientation_stiffness: f64,
    orientation_damping: f64,
    systems: [System; MAX_COMPONENTS],
}

/// ξʷ.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Drive {
    Time,
    /// s = exp(−α t), with α in s⁻¹.
    Decay(f64),
    State,
}

/// ξᵒ.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Output {
    Acceleration,
    /// Followed with λ, s⁻¹.
    Velocity(f64),
}

/// Subsystem i; rows and columns that are not in use are zero.
#[derive(Clone, Copy, Debug, PartialEq)]
struct System {
    /// ln πᵢ − ½ ln|Σᵢ|.
    log_weight: f64,
    center: Vector6<f64>,
    /// W with Wᵀ W = Σᵢ⁻¹.
    whitening: Matrix6<f64>,
    of_position: Matrix6<f64>,
    of_velocity: Matrix6<f64>,
    of_drive: Vector6<f64>,
    offset: Vector6<f64>,
}

impl System {
    /// A system of `d` learnt coordinates and a ξʷ of `drive_dim`. A covariance that is not positive definite,
    /// which admission refuses, makes the system equally likely everywhere.
    fn new(message: &LinearSystem, d: usize, drive_dim: usize) -> System {
        // Unit variances fill Σᵢ up to 6×6: they add nothing to ln|Σᵢ|.
        let covariance = block(drive_dim, |row, column| message.covariance_at(row, column))
            + Matrix6::from_diagonal(&Vector6::from_fn(
                |i, _| if i < drive_dim { 0.0 } else { 1.0 },
            ));
        let L = covariance.cholesky().map(|factor| factor.l());
        let half_log_det = L.map_or(0.0, |L| L.diagonal().map(f64::ln).sum());
        let inverse = L.and_then(|L| L.try_inverse()).unwrap_or_else(Matrix6::zeros);
        System {
            log_weight: message.log_prior - half_log_det,
            center: leading(&message.center, drive_dim),
            whitening: block(drive_dim, |row, column| inverse[(row, column)]),
            of_position: block(d, |row, column| message.of_position_at(row, column)),
            of_velocity: block(d, |row, column| message.of_velocity_at(row, column)),
            of_drive: leading(&message.of_drive, d),
            offset: leading(&message.offset, d),
        }
    }
}

/// The leading n×n block of a matrix, zero around it.
fn block(n: usize, entry: impl Fn(usize, usize) -> f64) -> Matrix6<f64> {
    Matrix6::from_fn(|row, column| if row.max(column) < n { entry(row, column) } else { 0.0 })
}

/// The first n entries, zero after them.
fn leading(values: &[f64; 6], n: usize) -> Vector6<f64> {
    Vector6::from_fn(|i, _| if i < n { values[i] } else { 0.0 })
}

impl Systems {
    pub fn new(message: &PolicyMsg) -> Systems {
        let d = message.task_dim as usize;
        let new = |system| System::new(system, d, message.drive_dim());
        let mut systems = [new(&LinearSystem::ZERO); MAX_COMPONENTS];
        for (system, of_message) in systems.iter_mut().zip(message.systems()) {
            *system = new(of_message);
        }
        let target = Vector6::from_column_slice(&message.target);
        Systems {
            n_systems: message.systems().len(),
            task_dim: d,
            drive: match message.activation {
                ACTIVATION_STATE => Drive::State,
                ACTIVATION_DECAY => Drive::Decay(message.decay_rate),
                _ => Drive::Time,
            },
            output: match message.output {
                OUTPUT_VELOCITY => Output::Velocity(message.following),
                _ => Output::Acceleration,
            },
            duration_s: message.duration_s,
            has_of_velocity: systems.iter().any(|system| system.of_velocity != Matrix6::zeros()),
            target,
            R_WT: (message.orientation == ORIENTATION_SPHERE).then(|| orientation(&target)),
            orientation_stiffness: message.orientation_stiffness,
            orientation_damping: message.orientation_damping,
            systems,
        }
    }

    /// x and x* as the systems see them. On the sphere the rotational part of x is the rotation vector
    /// from the target's orientation, Log(R R*⁻¹) in the world frame, and that of x* is zero: a chart
    /// of all orientations less than half a turn from the target's.
    fn coordinates(&self, task: &TaskState) -> (Vector6<f64>, Vector6<f64>) {
        match &self.R_WT {
            None => (task.x, self.target),
            Some(R_WT) => {
                let target = Vector6::from_fn(|i, _| if i < 3 { self.target[i] } else { 0.0 });
                (task.relative_to(R_WT), target)
            }
        }
    }

    /// ξʷ where it is one number, else 0. What time drives stands still when the movement is over.
    fn drive(&self, t_s: f64) -> f64 {
        let t_s = t_s.min(self.duration_s);
        match self.drive {
            Drive::Time => t_s,
            Drive::Decay(rate) => (-rate * t_s).exp(),
            Drive::State => 0.0,
        }
    }

    pub fn activations(&self, t_s: f64, task: &TaskState) -> [f64; MAX_COMPONENTS] {
        self.weights(self.drive(t_s), &self.coordinates(task).0)
    }

    /// Eq. (2), weights: hᵢ ∝ πᵢ 𝒩(ξʷ | cᵢ, Σᵢ) at the drive `s`, or at `x`.
    fn weights(&self, s: f64, x: &Vector6<f64>) -> [f64; MAX_COMPONENTS] {
        let mut h = [0.0; MAX_COMPONENTS];
        let mut largest = f64::NEG_INFINITY;
        for (h, system) in h.iter_mut().zip(&self.systems).take(self.n_systems) {
            let squared = match self.drive {
                Drive::State => (system.whitening * (x - system.center)).norm_squared(),
                _ => (system.whitening[(0, 0)] * (s - system.center[0])).powi(2),
            };
            *h = system.log_weight - 0.5 * squared;
            largest = largest.max(*h);
        }
        normalize(&mut h, self.n_systems, largest);
        h
    }

    /// Eq. (2): ξᵒ = Σ hᵢ [Aᵢ ξᵀ + bᵢ]; then ẍ = ξᵒ, or ẍ = λ (ξᵒ − ẋ) where it is a velocity. What is not
    /// learnt follows the target with the gains of the orientation.
    ///
    /// Departure: a velocity that time drives is followed to the end of the movement and is zero after
    /// it: regression in time knows nothing beyond its data, and its last velocity would carry on.
    pub fn command(&self, t_s: f64, task: &TaskState) -> Command {
        let (x, target) = self.coordinates(task);
        let (s, xd) = (self.drive(t_s), &task.xd);
        let h = self.weights(s, &x);
        let mut xi = Vector6::zeros();
        for (h, system) in h.iter().zip(&self.systems).take(self.n_systems) {
            let mut part = system.of_position * x + system.of_drive * s + system.offset;
            if self.has_of_velocity {
                part += system.of_velocity * xd;
            }
            xi += part * *h;
        }
        if self.drive != Drive::State
            && t_s > self.duration_s
            && self.output != Output::Acceleration
        {
            xi = Vector6::zeros();
        }
        let (learnt, lead) = match self.output {
            Output::Acceleration => (xi, Vector6::zeros()),
            Output::Velocity(following) => ((xi - xd) * following, xi / following),
        };
        let held = (target - x) * self.orientation_stiffness - xd * self.orientation_damping;
        let is_learnt = |i| i < self.task_dim;
        Command {
            xdd: Vector6::from_fn(|i, _| if is_learnt(i) { learnt[i] } else { held[i] }),
            attractor: Vector6::from_fn(|i, _| match is_learnt(i) {
                true => task.x[i] + lead[i],
                false => self.target[i],
            }),
        }
    }
}

#[cfg(test)]
mod tests;
