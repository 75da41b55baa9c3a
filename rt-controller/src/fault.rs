//! Faults: why the arm is held instead of driven.

use shm_types::episode::{
    FAULT_APPROACH_TIMEOUT, FAULT_HELD, FAULT_MEASUREMENT_INCONSISTENT,
    FAULT_MEASUREMENT_NOT_FINITE, FAULT_MEASUREMENT_STALE, FAULT_OVERRUN, FAULT_POLICY_REFUSED,
    FAULT_SWAPPED, FAULT_UNEXPECTED_FORCE,
};

/// Why a tick fell back to damped gravity hold.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u32)]
pub enum Fault {
    None = 0,
    /// A measured position or speed, of a joint or of the object, is not a number.
    MeasurementNotFinite = FAULT_MEASUREMENT_NOT_FINITE as u32,
    /// A joint is far beyond its position limit.
    JointOutOfRange = 2,
    /// A joint is far beyond its speed limit.
    Overspeed = 3,
    /// The mass matrix or Λ⁻¹ is not positive definite.
    Singular = 4,
    /// The computed torque is not a number.
    TorqueNotFinite = 5,
    /// The start posture was not reached in time.
    ApproachTimeout = FAULT_APPROACH_TIMEOUT as u32,
    /// The policy was not admitted; nothing was executed.
    PolicyRefused = FAULT_POLICY_REFUSED as u32,
    /// Another policy was swapped in during the rollout; no reason to hold.
    Swapped = FAULT_SWAPPED as u32,
    /// The host missed too many deadlines in a row.
    Overrun = FAULT_OVERRUN as u32,
    /// No new sample came for too many ticks.
    MeasurementStale = FAULT_MEASUREMENT_STALE as u32,
    /// Measured positions and speeds contradict each other.
    MeasurementInconsistent = FAULT_MEASUREMENT_INCONSISTENT as u32,
    /// The arm does not move as its torques say: it is stuck, pushed, or measured wrongly.
    UnexpectedForce = FAULT_UNEXPECTED_FORCE as u32,
    /// The pan left the workspace under a policy.
    OutOfWorkspace = 13,
    /// Somebody asked for the arm to be held.
    Held = FAULT_HELD as u32,
}

impl Fault {
    /// The policy that was executed may be to blame, as far as anybody can tell.
    pub fn blames_policy(self) -> bool {
        matches!(
            self,
            Fault::JointOutOfRange
                | Fault::Overspeed
                | Fault::Singular
                | Fault::TorqueNotFinite
                | Fault::OutOfWorkspace
        )
    }

    /// A hardware fault: it latches, and the arm is held until it is re-armed.
    pub fn latches(self) -> bool {
        Fault::latching(self as u32) == Some(self)
    }

    /// The latching fault with this code.
    pub fn latching(code: u32) -> Option<Fault> {
        let all = [
            Fault::MeasurementNotFinite,
            Fault::MeasurementStale,
            Fault::MeasurementInconsistent,
            Fault::UnexpectedForce,
            Fault::Held,
        ];
        all.into_iter().find(|fault| *fault as u32 == code)
    }

    /// What a person reads in place of a code.
    pub fn describe(code: u32) -> &'static str {
        match code {
            0 => "none",
            1 => "a measurement is not a number",
            2 => "a joint is far beyond its position limit",
            3 => "a joint is far beyond its speed limit",
            4 => "the mass matrix is singular",
            5 => "the torque is not a number",
            6 => "the start posture was not reached in time",
            7 => "the policy was refused",
            8 => "another policy was swapped in",
            9 => "too many deadlines in a row were missed",
            10 => "the measurement is stale",
            11 => "measured positions and speeds contradict each other",
            12 => "the arm does not move as its torques predict",
            13 => "the pan left the workspace",
            14 => "held by operator",
            _ => "unknown fault code",
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use shm_types::episode::MACHINE_FAULTS;

    #[test]
    fn controller_and_learner_agree_on_what_latches() {
        for code in 0..20 {
            let latching = Fault::latching(code);
            assert_eq!(latching.is_some(), MACHINE_FAULTS.contains(&code.into()), "{code}");
            assert!(latching.is_none_or(|fault| !fault.blames_policy()), "{code}");
        }
    }
}
