//! Faults: why the arm is held instead of driven.

use shm_types::episode::{
    FAULT_APPROACH_TIMEOUT, FAULT_OVERRUN, FAULT_POLICY_REFUSED, FAULT_SWAPPED,
};

/// Why a tick fell back to damped gravity hold.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u32)]
pub enum Fault {
    None = 0,
    /// A measured position or speed, of a joint or of the object, is not a number.
    MeasurementNotFinite = 1,
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
}

impl Fault {
    /// The policy that was executed may be to blame, as far as anybody can tell.
    pub fn blames_policy(self) -> bool {
        !matches!(
            self,
            Fault::None
                | Fault::ApproachTimeout
                | Fault::PolicyRefused
                | Fault::Swapped
                | Fault::Overrun
        )
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
            _ => "unknown fault code",
        }
    }
}
