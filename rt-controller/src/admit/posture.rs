//! What a posture must satisfy before the null space may be drawn to it.

use physics::arm::{ArmModel, JointVector};
use thiserror::Error;

use crate::config::ControllerConfig;
use crate::hot::posture::{PostureMove, SPEED_MAX, shortest_s};

/// Joints that the six coordinates of the tip leave no freedom to.
const TASK_JOINTS: usize = 6;
/// How long a move may take, s: a shorter one would be a jerk. And how long it takes at least where the command
/// does not say.
const DURATION_MIN_S: f64 = 0.25;
const DURATION_MAX_S: f64 = 60.0;
const DURATION_DEFAULT_S: f64 = 1.0;

/// Why a posture was not admitted.
#[derive(Debug, Error, PartialEq)]
pub enum PostureError {
    #[error("this task has no arm with a posture to move")]
    NoArm,
    #[error(
        "the arm has {0} joints, and the tip needs {TASK_JOINTS}: it has no null space; use an arm with 7"
    )]
    NoNullSpace(usize),
    #[error("joint {joint}: the offset {offset} is not a finite number of radians")]
    NotFinite { joint: usize, offset: f64 },
    #[error("the move would take {0} s: use {DURATION_MIN_S} to {DURATION_MAX_S} s (--in)")]
    Duration(f64),
    #[error(
        "joint {joint} ({name}) would be pulled to {position:.3} rad: keep it within {min:.3} and {max:.3}, that \
         is, its offset within {least:.3} and {most:.3}"
    )]
    Limit { joint: usize, name: String, position: f64, min: f64, max: f64, least: f64, most: f64 },
    #[error(
        "joint {joint} ({name}) would move at {speed:.2} rad/s: at most {SPEED_MAX} is allowed; give it \
         {needed_s:.2} s or more (--in)"
    )]
    Speed { joint: usize, name: String, speed: f64, needed_s: f64 },
}

/// Checks a posture `q0` + `offset`, rad, reached within `duration_s`, or within what it needs where that is 0:
/// from `q0` at the start of a rollout, and from `before`, the offset of now.
pub fn admit_posture(
    offset: &JointVector,
    duration_s: f64,
    before: &JointVector,
    model: &ArmModel,
    q0: &JointVector,
    config: &ControllerConfig,
) -> Result<PostureMove, PostureError> {
    let n_joints = model.n_joints();
    if n_joints <= TASK_JOINTS {
        return Err(PostureError::NoNullSpace(n_joints));
    }
    if duration_s != 0.0 && !(DURATION_MIN_S..=DURATION_MAX_S).contains(&duration_s) {
        return Err(PostureError::Duration(duration_s));
    }
    let limits = model.limits();
    let mut default_s = DURATION_DEFAULT_S;
    for (i, &offset) in offset.iter().enumerate() {
        let joint = i + 1;
        if !offset.is_finite() {
            return Err(PostureError::NotFinite { joint, offset });
        }
        let name = model.joint_names()[i].clone();
        let margin = config.joint_margin_rad;
        let (min, max) = (limits.q_min[i] + margin, limits.q_max[i] - margin);
        let position = q0[i] + offset;
        // Where nothing is moved the start posture is the arm's own matter.
        if offset != 0.0 && !(min..=max).contains(&position) {
            let (least, most) = (min - q0[i], max - q0[i]);
            return Err(PostureError::Limit { joint, name, position, min, max, least, most });
        }
        let needed_s = shortest_s(offset).max(shortest_s(offset - before[i]));
        default_s = default_s.max(needed_s);
        if duration_s > 0.0 && duration_s < needed_s {
            let speed = SPEED_MAX * needed_s / duration_s;
            return Err(PostureError::Speed { joint, name, speed, needed_s });
        }
    }
    let duration_s = if duration_s > 0.0 { duration_s } else { default_s };
    Ok(PostureMove { offset: *offset, duration_s })
}

#[cfg(test)]
mod tests {
    use super::*;
    use physics::pancake::WAM7_START_POSTURE;

    fn admitted(joint: usize, offset: f64, duration_s: f64) -> Result<PostureMove, String> {
        let urdf = include_str!("../../../robots/wam7/wam7_pan.urdf");
        let model = ArmModel::from_urdf(urdf, "pan").unwrap();
        let (mut moved, before) = (JointVector::zeros(), JointVector::zeros());
        moved[joint - 1] = offset;
        let config = ControllerConfig::default();
        admit_posture(&moved, duration_s, &before, &model, &WAM7_START_POSTURE, &config)
            .map_err(|error| error.to_string())
    }

    #[test]
    fn a_posture_within_limits_and_slow_enough_is_admitted() {
        let moved = admitted(3, 0.5, 1.0).unwrap();
        assert_eq!((moved.offset[2], moved.duration_s), (0.5, 1.0));
        assert_eq!(admitted(3, 0.5, 0.0).unwrap().duration_s, 1.0);
        assert_eq!(admitted(3, 1.0, 0.0).unwrap().duration_s, 1.875, "as long as it needs");
        assert_eq!(admitted(3, 0.0, 0.25).unwrap().offset, JointVector::zeros());
    }

    #[test]
    fn what_is_refused_is_named_with_what_to_do() {
        for (joint, offset, duration_s, words) in [
            (3, f64::NAN, 1.0, ["joint 3", "not a finite number"]),
            (3, f64::INFINITY, 1.0, ["joint 3", "not a finite number"]),
            (3, 0.5, -1.0, ["-1 s", "--in"]),
            (3, 0.5, 1e-300, ["s (--in)", "0.25 to 60"]),
            (3, 0.5, f64::NAN, ["NaN s", "--in"]),
            (3, 0.5, 61.0, ["61 s", "0.25 to 60 s"]),
            (3, 0.5, 0.5, ["1.88 rad/s", "give it 0.94 s"]),
            (4, 1.5, 10.0, ["joint 4", "its offset within"]),
        ] {
            let why = admitted(joint, offset, duration_s).unwrap_err();
            assert!(words.iter().all(|word| why.contains(word)), "{words:?}: {why}");
        }
    }
}
