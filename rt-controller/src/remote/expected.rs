//! What a plant must be for this controller: compared before anything moves.

use std::path::PathBuf;

use physics::arm::ArmModel;
use shm_types::cell::Cell;
use shm_types::plant::{PLANT_CAN_RESET, PLANT_HAS_OBJECT, PLANT_VERSION, PlantHello};
use shm_types::text;
use thiserror::Error;

/// By which share two torque limits may differ: what decimal text costs.
const SAME: f64 = 1e-6;
/// Farthest beyond its limit that a joint may rest, rad.
const POSITION_TOLERANCE: f64 = 0.2;

/// A plant in another process: where it comes to, and what it must be.
pub struct External {
    pub socket: PathBuf,
    /// Where a plant that polls gets shared memory; without one it stays at the socket.
    pub cell: Option<Cell>,
    pub expected: Expected,
}

/// What the configuration says.
#[derive(Clone, Debug)]
pub struct Expected {
    pub joint_names: Vec<String>,
    /// Largest torques, N·m, and ranges of the joints, rad.
    pub tau_max: Vec<f64>,
    pub q_range: Vec<(f64, f64)>,
    pub period_ns: u64,
    /// In lockstep; otherwise the plant is the clock.
    pub is_simulated: bool,
    pub urdf_sha256: [u8; 32],
    /// The task looks at an object.
    pub needs_object: bool,
}

/// Why a plant was not let in: both values, and what to do.
#[derive(Clone, Debug, Error, PartialEq)]
pub enum Refused {
    #[error(
        "it uses version {theirs} of the protocol, the controller {PLANT_VERSION}: update the older one"
    )]
    Version { theirs: u64 },
    #[error("it has {theirs} joints, the controller's arm {ours}: start both with the same arm")]
    Joints { theirs: u64, ours: usize },
    #[error(
        "its joint {place} is '{theirs}', the controller's '{ours}': send the joints in this order: {order}"
    )]
    JointName { place: usize, theirs: String, ours: String, order: String },
    #[error(
        "its period is {theirs} ns, the controller's {ours}: set controller.period_us, or its own"
    )]
    Period { theirs: u64, ours: u64 },
    #[error(
        "it declares itself real, so its samples are the clock: start the controller with --pace plant"
    )]
    Real,
    #[error(
        "it declares itself simulated and is stepped in lockstep: start the controller with --pace max or realtime"
    )]
    Simulated,
    #[error("it is simulated but cannot reset itself: every rollout needs a reset world")]
    Reset,
    #[error(
        "it was made from another URDF, of sha256 {theirs}…, the controller's is {ours}…: start both with the same file"
    )]
    Urdf { theirs: String, ours: String },
    #[error(
        "its joint {joint} takes {theirs} N·m, the controller's {ours}: set plant.torque_limits_nm, or its own"
    )]
    Torque { joint: String, theirs: f64, ours: f64 },
    #[error(
        "its joint {joint} is at {found} rad, outside the arm's range {min}..={max}: check units \
         and zero"
    )]
    Posture { joint: String, found: f64, min: f64, max: f64 },
    #[error("it tracks no object, but the task needs one")]
    Object,
}

impl Expected {
    /// Expects the arm of `model`, in lockstep unless the plant is the clock.
    pub fn of(model: &ArmModel, period_ns: u64, is_simulated: bool) -> Expected {
        let (limits, n) = (model.limits(), model.n_joints());
        Expected {
            joint_names: model.joint_names().to_vec(),
            tau_max: limits.tau_max.iter().copied().take(n).collect(),
            q_range: (0..n).map(|i| (limits.q_min[i], limits.q_max[i])).collect(),
            period_ns,
            is_simulated,
            urdf_sha256: [0; 32],
            needs_object: false,
        }
    }

    pub fn check(&self, hello: &PlantHello) -> Result<(), Refused> {
        let ours = self.joint_names.len();
        if hello.version != PLANT_VERSION {
            return Err(Refused::Version { theirs: hello.version });
        }
        if hello.n_joints != ours as u64 {
            return Err(Refused::Joints { theirs: hello.n_joints, ours });
        }
        self.check_names(hello)?;
        if hello.period_ns != self.period_ns {
            return Err(Refused::Period { theirs: hello.period_ns, ours: self.period_ns });
        }
        match (hello.is_simulated(), self.is_simulated) {
            (false, true) => return Err(Refused::Real),
            (true, false) => return Err(Refused::Simulated),
            _ => {}
        }
        if hello.is_simulated() && hello.flags & PLANT_CAN_RESET == 0 {
            return Err(Refused::Reset);
        }
        if self.needs_object && hello.flags & PLANT_HAS_OBJECT == 0 {
            return Err(Refused::Object);
        }
        let (theirs, ours) = (hello.urdf_sha256, self.urdf_sha256);
        if theirs != [0; 32] && theirs != ours {
            return Err(Refused::Urdf { theirs: hex(&theirs), ours: hex(&ours) });
        }
        self.check_joints(hello)
    }

    fn check_names(&self, hello: &PlantHello) -> Result<(), Refused> {
        for (i, ours) in self.joint_names.iter().enumerate() {
            let theirs = text::unpack(&hello.joint_names[i]);
            if !theirs.is_empty() && theirs != *ours {
                let (ours, order) = (ours.clone(), self.joint_names.join(", "));
                return Err(Refused::JointName { place: i + 1, theirs, ours, order });
            }
        }
        Ok(())
    }

    fn check_joints(&self, hello: &PlantHello) -> Result<(), Refused> {
        for (i, name) in self.joint_names.iter().enumerate() {
            let (theirs, ours) = (hello.tau_max[i], self.tau_max[i]);
            let is_same = (theirs - ours).abs() <= SAME * ours;
            if theirs != 0.0 && !is_same {
                return Err(Refused::Torque { joint: name.clone(), theirs, ours });
            }
            let (found, (min, max)) = (hello.q[i], self.q_range[i]);
            if !(min - POSITION_TOLERANCE..=max + POSITION_TOLERANCE).contains(&found) {
                return Err(Refused::Posture { joint: name.clone(), found, min, max });
            }
        }
        Ok(())
    }
}

/// As much of a digest as tells files apart.
fn hex(digest: &[u8; 32]) -> String {
    digest[..4].iter().map(|byte| format!("{byte:02x}")).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use shm_types::plant::PLANT_SIMULATED;

    fn expected() -> Expected {
        let urdf = include_str!("../../../robots/wam7/wam7_pan.urdf");
        let model = ArmModel::from_urdf(urdf, "pan").unwrap();
        Expected { urdf_sha256: [7; 32], ..Expected::of(&model, 1_000_000, true) }
    }

    fn hello() -> PlantHello {
        let flags = PLANT_SIMULATED | PLANT_CAN_RESET;
        PlantHello { n_joints: 7, period_ns: 1_000_000, flags, ..PlantHello::EMPTY }
    }

    #[test]
    fn what_is_not_said_is_not_compared() {
        assert_eq!(expected().check(&hello()), Ok(()));
        let mut said = hello();
        for (i, name) in expected().joint_names.iter().enumerate() {
            said.joint_names[i] = text::pack(name);
            said.tau_max[i] = expected().tau_max[i];
        }
        said.urdf_sha256 = [7; 32];
        assert_eq!(expected().check(&said), Ok(()));
    }

    /// Each of them tells the plant's value and the controller's.
    #[test]
    fn a_plant_that_is_another_is_refused_with_both_values() {
        let refused = |change: fn(&mut PlantHello)| {
            let mut spoilt = hello();
            change(&mut spoilt);
            expected().check(&spoilt).unwrap_err().to_string()
        };
        type Change = fn(&mut PlantHello);
        let changes: [(Change, [&str; 2]); 10] = [
            (|h| h.version = 2, ["version 2", "controller 1"]),
            (|h| h.n_joints = 6, ["6 joints", "arm 7"]),
            (|h| h.joint_names[1] = text::pack("j1"), ["'j1'", "this order: "]),
            (|h| h.period_ns = 2_000_000, ["2000000 ns", "1000000"]),
            (|h| h.flags &= !PLANT_SIMULATED, ["real", "--pace plant"]),
            (|h| h.flags &= !PLANT_CAN_RESET, ["cannot reset", "every rollout needs"]),
            (|h| h.urdf_sha256 = [1; 32], ["01010101", "07070707"]),
            (|h| h.tau_max[0] = 99.0, ["99 N·m", "150"]),
            (|h| h.q[3] = 90.0, ["90 rad", "units"]),
            (|h| h.q[3] = f64::NAN, ["NaN rad", "outside the arm's range"]),
        ];
        for (change, words) in changes {
            let said = refused(change);
            assert!(words.iter().all(|word| said.contains(word)), "{said}");
        }
        let clock = Expected { is_simulated: false, ..expected() };
        assert_eq!(clock.check(&hello()), Err(Refused::Simulated));
        let looks = Expected { needs_object: true, ..expected() };
        assert_eq!(looks.check(&hello()), Err(Refused::Object));
    }
}
