//! The policy in the loop, as an observer evaluates it again.

use nalgebra::Vector6;
use rt_controller::hot::policy::Policy;
use rt_controller::hot::task_space::TaskState;
use shm_types::episode::TickRecord;
use shm_types::policy::PolicyMsg;

/// A policy as the loop evaluates it.
pub struct LoopPolicy {
    pub digest: u64,
    policy: Policy,
    message: PolicyMsg,
}

impl LoopPolicy {
    /// `None` when the message is not one that a controller would admit.
    pub fn new(message: &PolicyMsg) -> Option<LoopPolicy> {
        message.validate().ok()?;
        Some(LoopPolicy { digest: message.digest, policy: Policy::new(message), message: *message })
    }

    pub fn task_dim(&self) -> usize {
        self.message.task_dim as usize
    }

    pub fn message(&self) -> &PolicyMsg {
        &self.message
    }

    /// hᵢ and Σ hᵢ Kᵢ, packed, in a tick of Execute or Settle; a policy of systems has no springs, and its
    /// stiffness is empty.
    pub fn at(&self, record: &TickRecord) -> (Vec<f64>, Vec<f64>) {
        let vector = |values: &[f64; 6]| Vector6::from_column_slice(values);
        let task = TaskState::at(vector(&record.x), vector(&record.xd));
        let components = self.message.components();
        let n = components.len() + self.message.systems().len();
        let h = self.policy.activations(record.t_s, &task)[..n].to_vec();
        if components.is_empty() {
            return (h, Vec::new());
        }
        let d = self.task_dim();
        let mut stiffness = vec![0.0; d * (d + 1) / 2];
        for (h, component) in h.iter().zip(components) {
            for (sum, k) in stiffness.iter_mut().zip(&component.stiffness) {
                *sum += h * k;
            }
        }
        (h, stiffness)
    }
}
