//! What a demonstration asks of the joints: speeds and torques against their limits.

use anyhow::{Context, Result, anyhow};
use learner::Demonstration;
use learner::trajectory::derivatives;
use physics::arm::{ArmModel, JointVector, MAX_JOINTS, dynamics, inverse_kinematics};
use serde_json::json;

/// Samples at each end whose accelerations are not known: nothing was recorded beyond.
const ENDS: usize = 2;

/// The largest value of a joint relative to its limit, rad/s or N·m.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Peak {
    pub joint: String,
    pub t_s: f64,
    pub value: f64,
    pub limit: f64,
}

impl Peak {
    pub fn share(&self) -> f64 {
        if self.limit > 0.0 { self.value / self.limit } else { 0.0 }
    }

    fn grow(&mut self, joint: &str, t_s: f64, value: f64, limit: f64) {
        let candidate = Peak { joint: joint.into(), t_s, value: value.abs(), limit };
        if candidate.share() > self.share() || self.joint.is_empty() {
            *self = candidate;
        }
    }

    pub fn json(&self) -> serde_json::Value {
        let Peak { joint, t_s, value, limit } = self;
        json!({ "joint": joint, "t_s": t_s, "value": value, "limit": limit })
    }
}

#[derive(Clone, Debug, PartialEq)]
pub struct Effort {
    /// rad/s
    pub speed: Peak,
    /// N·m, by inverse dynamics
    pub torque: Peak,
    /// N·m, of gravity alone
    pub holding: Peak,
    /// How many times slower it would be within the limits, by these samples.
    pub slow: f64,
}

impl Effort {
    /// Follows the demonstration from `q0`, as the check of its reach does, and differentiates.
    ///
    /// # Errors
    /// The arm cannot reach a pose.
    pub fn of(model: &ArmModel, q0: &JointVector, demonstration: &Demonstration) -> Result<Effort> {
        let (n, limits, names) = (model.n_joints(), model.limits(), model.joint_names());
        let path = joint_path(model, q0, demonstration)?;
        let (speeds, accelerations) = derivatives(&path, demonstration.period_s());
        let mut effort = Effort {
            speed: Peak::default(),
            torque: Peak::default(),
            holding: Peak::default(),
            slow: 1.0,
        };
        for k in ENDS..path.len().saturating_sub(ENDS) {
            let t_s = k as f64 * demonstration.period_s();
            let [q, qd, qdd] = [path[k], speeds[k], accelerations[k]].map(JointVector::from);
            let tau = dynamics::rnea(model, &q, &qd, &qdd);
            let gravity = dynamics::gravity_torque(model, &q);
            for (i, name) in names.iter().enumerate().take(n) {
                effort.speed.grow(name, t_s, qd[i], limits.qd_max[i]);
                effort.torque.grow(name, t_s, tau[i], limits.tau_max[i]);
                effort.holding.grow(name, t_s, gravity[i], limits.tau_max[i]);
                // f times slower: q̇/f, and τ = g + (τ − g)/f².
                let by_speed = qd[i].abs() / limits.qd_max[i];
                let moving = tau[i] - gravity[i];
                let free = limits.tau_max[i] - gravity[i] * moving.signum();
                let by_torque = (moving.abs() / free).max(0.0).sqrt();
                for factor in [by_speed, by_torque].into_iter().filter(|f| f.is_finite()) {
                    effort.slow = effort.slow.max(factor);
                }
            }
        }
        Ok(effort)
    }

    /// Every joint stays within its limits.
    pub fn is_within_limits(&self) -> bool {
        [&self.speed, &self.torque, &self.holding].iter().all(|peak| peak.share() <= 1.0)
    }

    /// How many times slower is slow enough by these samples, with one decimal: enough to type.
    pub fn slower(&self) -> f64 {
        ((10.0 * self.slow).floor() + 1.0) / 10.0
    }

    /// Why the arm cannot follow at this speed, with the place and the `remedy`.
    pub fn excess(&self, file: &str, remedy: &str) -> anyhow::Error {
        let Peak { joint, t_s, value, limit } = &self.holding;
        if self.holding.share() > 1.0 {
            return anyhow!(
                "{file}: joint {joint} needs {value:.3} N·m to hold the arm still at t = {t_s:.2} s, and \
                 its limit is {limit} N·m: move the demonstration, or take a stronger arm"
            );
        }
        let place = |peak: &Peak, verb: &str, unit: &str| {
            let Peak { joint, t_s, value, limit } = peak;
            (peak.share() > 1.0).then(|| {
                format!(
                    "joint {joint} {verb} {value:.3} {unit} at t = {t_s:.2} s, and its limit is {limit} \
                     {unit}"
                )
            })
        };
        let places = [place(&self.speed, "turns at", "rad/s"), place(&self.torque, "needs", "N·m")];
        let places: Vec<String> = places.into_iter().flatten().collect();
        anyhow!("{file}: too fast for this arm: {}: {remedy}", places.join("; "))
    }
}

/// Joint positions along the demonstration, rad.
fn joint_path(
    model: &ArmModel,
    q0: &JointVector,
    demonstration: &Demonstration,
) -> Result<Vec<[f64; MAX_JOINTS]>> {
    let mut q = *q0;
    let mut path = Vec::with_capacity(demonstration.poses().len());
    for (k, target) in demonstration.path().iter().enumerate() {
        q = inverse_kinematics::solve(model, target, &q).with_context(|| {
            let (file, t) = (demonstration.file(), k as f64 * demonstration.period_s());
            format!("{file}: at t = {t:.2} s")
        })?;
        path.push(q.into());
    }
    Ok(path)
}
