//! Directions in which a demonstrated skill may sensibly change: exploration that knows what a
//! movement is.
//!
//! White noise on 112 parameters is mostly tremor. A demonstration altered as a teacher would alter
//! it (farther, quicker, later) is again a movement: the difference between the policy fitted to it
//! and the policy fitted to the original is one direction d in θ, and noise on a few such numbers
//! explores whole movements. Any demonstration will do; an alteration that changes nothing there,
//! as a larger rotation of a skill without one, gives no direction.

mod stiffness;

use std::f64::consts::PI;

use nalgebra::DVector;
use serde::{Deserialize, Serialize};
use shm_types::policy::PolicyMsg;

use crate::demonstration::Demonstration;
use crate::encoding::{Encoding, FitError};
use crate::parameters::{ATTRACTOR_MAX, N_POSITIONS, ParameterError};
use crate::trajectory::{Pose, retime};
use search::Direction;
use search::range::{Range, range};
pub use stiffness::PhaseError;
use thiserror::Error;

/// Reach of the changes around the peak to both sides, as a part of the duration.
const PEAK_REACH: f64 = 0.25;
/// A change of θ smaller than this is none: rounding, not movement.
const NO_CHANGE: f64 = 1e-6;

/// Which directions the search explores.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(rename_all = "lowercase")]
pub enum ExplorationKind {
    /// Alterations of the demonstration, one number each.
    Demonstration,
    /// Every parameter separately, as in the paper.
    White,
}

/// Why there are no directions.
#[derive(Debug, Error, PartialEq)]
pub enum ExplorationError {
    #[error(transparent)]
    Parameters(#[from] ParameterError),
    #[error(transparent)]
    Phases(#[from] PhaseError),
    #[error("an altered demonstration cannot be fitted: {0}")]
    Refit(FitError),
}

/// No `#[from]`: the text holds the cause, and a chain would repeat it.
impl From<FitError> for ExplorationError {
    fn from(error: FitError) -> Self {
        ExplorationError::Refit(error)
    }
}

/// Which stiffnesses are explored, each with its own factor.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(rename_all = "lowercase")]
pub enum StiffnessKind {
    /// None: they stay those of the initial policy.
    Fixed,
    /// One factor for position and one for rotation over the whole movement, from the start.
    #[default]
    Uniform,
    /// One factor each for position and rotation, before and after the demonstration's peak, once trials
    /// succeed.
    Phases,
    /// One factor each for position and rotation of every component, once trials succeed.
    Components,
    /// As `phases`, and the coupling of each two coordinates that move: full matrices.
    Full,
}

/// How far one unit of noise alters the demonstration; 0 leaves a direction out.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(default, deny_unknown_fields)]
pub struct ExplorationConfig {
    /// Which directions the search explores.
    pub kind: ExplorationKind,
    /// Relative growth of the position's excursion from the start.
    pub position_amplitude: f64,
    /// Relative growth of the rotation's excursion from the start.
    pub rotation_amplitude: f64,
    /// Offset along x, y and z at the peak: three directions.
    pub peak_offset_m: [f64; 3],
    /// Advance of the peak.
    pub tempo_s: f64,
    /// Lag of the rotation behind the position.
    pub rotation_lag_s: f64,
    /// Whether the position's amplitude is increased first, as a slow demonstration needs.
    #[serde(default)]
    pub grows: bool,
    /// Which stiffnesses are explored.
    #[serde(default)]
    pub stiffness: StiffnessKind,
    /// Change of log K of the position, for `uniform` and `components`.
    pub position_log_stiffness: f64,
    /// Change of log K of the rotation, for `uniform` and `components`.
    pub rotation_log_stiffness: f64,
    /// Change of log K before the peak, for `phases` and `full`.
    pub before_log_stiffness: f64,
    /// Change of log K after the peak, for `phases` and `full`.
    pub after_log_stiffness: f64,
    /// Change of an off-diagonal entry of log K, for `full`.
    pub coupling_log_stiffness: f64,
    /// How far beyond the demonstration's attractors an attractor may lie; otherwise weak springs to far attractors
    /// replace stiff ones to near attractors.
    #[serde(default = "far")]
    pub attractor_reach_m: f64,
}

// What sessions did that were stored before there was a choice.
fn far() -> f64 {
    ATTRACTOR_MAX
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
            grows: true,
            stiffness: StiffnessKind::Full,
            position_log_stiffness: 0.4,
            rotation_log_stiffness: 0.4,
            before_log_stiffness: 0.4,
            after_log_stiffness: 0.8,
            coupling_log_stiffness: 0.15,
            attractor_reach_m: 0.5,
        }
    }
}

impl ExplorationConfig {
    /// Settings and their ranges.
    pub fn ranges(&self) -> Vec<Range> {
        vec![
            range("position_amplitude", self.position_amplitude, 0.0, 10.0, "1"),
            range("rotation_amplitude", self.rotation_amplitude, 0.0, 10.0, "1"),
            range("peak_offset_m[0]", self.peak_offset_m[0], 0.0, 1.0, "m"),
            range("peak_offset_m[1]", self.peak_offset_m[1], 0.0, 1.0, "m"),
            range("peak_offset_m[2]", self.peak_offset_m[2], 0.0, 1.0, "m"),
            range("tempo_s", self.tempo_s, 0.0, 10.0, "s"),
            range("rotation_lag_s", self.rotation_lag_s, 0.0, 10.0, "s"),
            range("position_log_stiffness", self.position_log_stiffness, 0.0, 3.0, "1"),
            range("rotation_log_stiffness", self.rotation_log_stiffness, 0.0, 3.0, "1"),
            range("before_log_stiffness", self.before_log_stiffness, 0.0, 3.0, "1"),
            range("after_log_stiffness", self.after_log_stiffness, 0.0, 3.0, "1"),
            range("coupling_log_stiffness", self.coupling_log_stiffness, 0.0, 3.0, "1"),
            range("attractor_reach_m", self.attractor_reach_m, 0.0, ATTRACTOR_MAX, "m"),
        ]
    }
}

/// A change of θ per unit of noise, `encoding.dim()` long, and what is known of it.
pub(crate) type Column = (DVector<f64>, Direction);

/// The directions, only those along which something changes. `initial` is the policy fitted to
/// `demonstrations`, at least one; what alters one of them alters all.
///
/// # Errors
/// If phases are needed and the demonstration has none.
pub(crate) fn directions(
    initial: &PolicyMsg,
    encoding: &Encoding,
    config: &ExplorationConfig,
    demonstrations: &[Demonstration],
) -> Result<Vec<Column>, ExplorationError> {
    let theta_0 = encoding.encode(&encoding.unaltered(initial, demonstrations)?)?;
    let altered: Vec<Vec<Demonstration>> =
        demonstrations.iter().map(|one| alterations(one, config)).collect();
    let mut columns = Vec::new();
    for index in 0..altered[0].len() {
        let set: Vec<Demonstration> = altered.iter().map(|all| all[index].clone()).collect();
        let grows = config.grows && index == POSITION_AMPLITUDE;
        let direction = Direction { grows, late: false };
        columns.push((encoding.encode(&encoding.refit(&set)?)? - &theta_0, direction));
    }
    if let Some((springs, map)) = encoding.springs(initial) {
        let of_springs = stiffness::columns(&springs, map, config, &demonstrations[0])?;
        let dim = encoding.dim();
        let whole = |(change, direction): Column| (change.resize_vertically(dim, 0.0), direction);
        columns.extend(of_springs.into_iter().map(whole));
    }
    columns.retain(|(change, _)| change.amax() > NO_CHANGE);
    Ok(columns)
}

/// Index of the alteration that enlarges the position's excursion.
const POSITION_AMPLITUDE: usize = 0;

/// The demonstration, altered in each way by one unit of noise.
fn alterations(demonstration: &Demonstration, amounts: &ExplorationConfig) -> Vec<Demonstration> {
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
    let altered = [
        grown([amounts.position_amplitude, 0.0]),
        grown([0.0, amounts.rotation_amplitude]),
        offset(0),
        offset(1),
        offset(2),
        sooner,
        lagging.collect(),
    ];
    altered.into_iter().map(|poses| demonstration.with_poses(poses)).collect()
}

/// The moment at which a movement is farthest from its start.
struct Peak {
    t_s: f64,
    /// 0 where the movement ends at its peak.
    reach_s: f64,
}

impl Peak {
    fn of(demonstration: &Demonstration) -> Peak {
        let excursion = Peak::excursion(demonstration).into_iter().enumerate();
        let at = excursion.fold((0, 0.0), |best, now| if now.1 > best.1 { now } else { best }).0;
        let (t_s, end_s) = (at as f64 * demonstration.period_s(), demonstration.duration_s());
        // Start and end of the movement stay what they are.
        let reach_s = (PEAK_REACH * end_s).min(t_s).min(end_s - t_s);
        Peak { t_s, reach_s }
    }

    /// Squared distance from the start at every sample, of the position, or of the rotation if the
    /// position never moves.
    fn excursion(demonstration: &Demonstration) -> Vec<f64> {
        let poses = demonstration.poses();
        let of = |coordinates: std::ops::Range<usize>| -> Vec<f64> {
            let squared = |pose: &Pose| -> f64 {
                coordinates.clone().map(|c| (pose[c] - poses[0][c]).powi(2)).sum()
            };
            poses.iter().map(squared).collect()
        };
        let position = of(0..N_POSITIONS);
        let moves = position.iter().any(|distance| *distance > 0.0);
        if moves { position } else { of(N_POSITIONS..poses[0].len()) }
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
