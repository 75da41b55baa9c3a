//! Names: of a requested rollout, and of a start of the controller.

use shm_types::policy::PolicyMsg;

/// Names a rollout and the policy it runs.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct Request {
    pub session: u64,
    pub rollout: u64,
    pub policy_id: u64,
    pub digest: u64,
}

impl Request {
    pub fn of(message: &PolicyMsg) -> Request {
        Request {
            session: message.session,
            rollout: message.rollout,
            policy_id: message.policy_id,
            digest: message.digest,
        }
    }
}

/// Tells one start of a controller from another. Names a process, decides nothing.
pub(crate) fn boot_id() -> u64 {
    let clock = rustix::time::clock_gettime(rustix::time::ClockId::Realtime);
    (clock.tv_sec as u64).wrapping_mul(1_000_000_000).wrapping_add(clock.tv_nsec as u64)
}
