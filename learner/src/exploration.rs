//! Directions in which a demonstrated skill may sensibly change: exploration that knows what a
//! movement is.
//!
//! White noise on 112 parameters is mostly tremor. A demonstration altered as a teacher would alter
//! it (farther, quicker, later) is again a movement: the difference between the policy fitted to it
//! and the policy fitted to the original is one direction d in θ, and noise on a few such numbers
//! explores whole movements. Any demonstration will do; an alteration that changes nothing there,
//! as a larger rotation of a skill without one, gives no direction.

use std::f64::consts::PI;

use nalgebra::DVector;
use serde::{Deserialize, Serialize};
use shm_types::policy::{PolicyMsg, packed_index};

use crate::demonstration::Demonstration;
use crate::initial_policy::{InitialPolicyConfig, initial_policy};
use crate::parameters::{ParameterError, ParameterMap};
use crate::trajectory::{Pose, retime};
use search::range::{Range, range};

/// x, y and z come first in a pose and in θ, rotations after them.
const N_POSITIONS: usize = 3;
/// Reach of the changes around the peak to both sides, as a part of the duration.
const PEAK_REACH: f64 = 0.25;
/// A change of θ smaller than this is none: rounding, not movement.
const NO_CHANGE: f64 = 1e-6;

/// Which directions the search explores.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum ExplorationKind {
    /// Alterations of the demonstration, one number each.
    Demonstration,
    /// Every parameter by itself, as in the paper.
    White,
}

/// How far one unit of noise alters the demonstration; 0 leaves a direction out.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct ExplorationConfig {
    pub kind: ExplorationKind,
    /// Growth of the position's excursion from the start, relative.
    pub position_amplitude: f64,
    /// Growth of the rotation's excursion from the start, relative.
    pub rotation_amplitude: f64,
    /// Offset along x, y and z at the peak, m: three directions.
    pub peak_offset_m: [f64; 3],
    /// How much sooner the peak comes, s.
    pub tempo_s: f64,
    /// How much later the rotation comes than the position, s.
    pub rotation_lag_s: f64,
    /// Change of log K of the position and of the rotation.
    pub position_log_stiffness: f64,
    pub rotation_log_stiffness: f64,
}

impl Default for ExplorationConfig {
    fn default() -> Self {
        ExplorationConfig {
            kind: ExplorationKind::Demonstration,
            position_amplitude: 0.8,
            rotation_amplitude: 0.5,
            peak_offset_m: [0.05, 0.0, 0.0],
            tempo_s: 0.1,
            rotation_lag_s: 0.05,
            position_log_stiffness: 0.4,
            rotation_log_stiffness: 0.4,
        }
    }
}

impl ExplorationConfig {
    /// Settings and their ranges.
    pub fn ranges(&self) -> Vec<Range> {
        vec![
            range("position_amplitude", self.position_amplitude, 0.0, 10.0),
            range("rotation_amplitude", self.rotation_amplitude, 0.0, 10.0),
            range("peak_offset_m[0]", self.peak_offset_m[0], 0.0, 1.0),
            range("peak_offset_m[1]", self.peak_offset_m[1], 0.0, 1.0),
            range("peak_offset_m[2]", self.peak_offset_m[2], 0.0, 1.0),
            range("tempo_s", self.tempo_s, 0.0, 10.0),
            range("rotation_lag_s", self.rotation_lag_s, 0.0, 10.0),
            range("position_log_stiffness", self.position_log_stiffness, 0.0, 3.0),
            range("rotation_log_stiffness", self.rotation_log_stiffness, 0.0, 3.0),
        ]
    }
}

/// The directions as changes of θ per unit of noise, `map.dim()` long each; only those along which
/// something changes. `initial` is the policy fitted to `demonstration`.
pub(crate) fn directions(
    initial: &PolicyMsg,
    map: &ParameterMap,
    config: &ExplorationConfig,
    initial_config: &InitialPolicyConfig,
    demonstration: &Demonstration,
) -> Result<Vec<DVector<f64>>, ParameterError> {
    let theta_0 = map.encode(initial)?;
    let refitted = alterations(demonstration, config)
        .into_iter()
        .map(|poses| demonstration.with_poses(poses))
        .map(|altered| initial_policy(&altered, initial_config));
    let (position, rotation) = (0..N_POSITIONS, N_POSITIONS..initial_config.task_dim);
    let stiffened = [
        stiffened(initial, position, config.position_log_stiffness),
        stiffened(initial, rotation, config.rotation_log_stiffness),
    ];
    let mut directions = Vec::new();
    for policy in refitted.chain(stiffened) {
        let change = map.encode(&policy)? - &theta_0;
        if change.amax() > NO_CHANGE {
            directions.push(change);
        }
    }
    Ok(directions)
}

/// The demonstration's poses, altered in each way by one unit of noise.
fn alterations(demonstration: &Demonstration, amounts: &ExplorationConfig) -> Vec<Vec<Pose>> {
    let (poses, period_s) = (demonstration.poses(), demonstration.period_s());
    let start = poses[0];
    let grown = |by: [f64; 2]| -> Vec<Pose> {
        let grow = |pose: &Pose| -> Pose {
            std::array::from_fn(|c| {
                let growth = by[usize::from(c >= N_POSITIONS)];
                pose[c] + growth * (pose[c] - start[c])
            })
        };
        poses.iter().map(grow).collect()
    };
    let peak = Peak::of(demonstration);
    let offset = |axis: usize| -> Vec<Pose> {
        let mut altered = poses.to_vec();
        for (k, pose) in altered.iter_mut().enumerate() {
            pose[axis] += amounts.peak_offset_m[axis] * peak.nearness(k as f64 * period_s);
        }
        altered
    };
    let sooner = retime(poses, period_s, |t_s| t_s + amounts.tempo_s * peak.nearness(t_s));
    let late = retime(poses, period_s, |t_s| t_s - amounts.rotation_lag_s);
    let lagging = poses.iter().zip(&late).map(|(pose, late)| -> Pose {
        std::array::from_fn(|c| if c < N_POSITIONS { pose[c] } else { late[c] })
    });
    vec![
        grown([amounts.position_amplitude, 0.0]),
        grown([0.0, amounts.rotation_amplitude]),
        offset(0),
        offset(1),
        offset(2),
        sooner,
        lagging.collect(),
    ]
}

/// `policy` with exp(`amount`) times the stiffness of `coordinates`, Kᵢ → D Kᵢ D.
fn stiffened(policy: &PolicyMsg, coordinates: std::ops::Range<usize>, amount: f64) -> PolicyMsg {
    let mut stiffened = *policy;
    let factor = |c: usize| if coordinates.contains(&c) { (0.5 * amount).exp() } else { 1.0 };
    for component in &mut stiffened.components[..policy.n_components as usize] {
        for row in 0..policy.task_dim as usize {
            for col in 0..=row {
                component.stiffness[packed_index(row, col)] *= factor(row) * factor(col);
            }
        }
    }
    stiffened.sealed()
}

/// The moment at which a movement is farthest from its start.
struct Peak {
    t_s: f64,
    reach_s: f64,
}

impl Peak {
    /// By its position, or by its rotation if the position never moves.
    fn of(demonstration: &Demonstration) -> Peak {
        let poses = demonstration.poses();
        let farthest = |coordinates: std::ops::Range<usize>| {
            let distance = |pose: &Pose| -> f64 {
                coordinates.clone().map(|c| (pose[c] - poses[0][c]).powi(2)).sum()
            };
            let squared = poses.iter().map(distance).enumerate();
            squared.fold((0, 0.0), |best, now| if now.1 > best.1 { now } else { best })
        };
        let (at, distance) = farthest(0..N_POSITIONS);
        let at = if distance > 0.0 { at } else { farthest(N_POSITIONS..poses[0].len()).0 };
        let (t_s, end_s) = (at as f64 * demonstration.period_s(), demonstration.duration_s());
        // Start and end of the movement stay what they are.
        let reach_s = (PEAK_REACH * end_s).min(t_s).min(end_s - t_s);
        Peak { t_s, reach_s }
    }

    /// 1 at the peak, falling smoothly to 0 within reach.
    fn nearness(&self, t_s: f64) -> f64 {
        let distance = (t_s - self.t_s).abs();
        if distance >= self.reach_s {
            return 0.0;
        }
        0.5 * (1.0 + (PI * distance / self.reach_s).cos())
    }
}

#[cfg(test)]
mod tests;
