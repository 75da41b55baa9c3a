//! The policy in the loop, as an observer evaluates it again.

use rt_controller::hot::policy::Policy;
use shm_types::policy::PolicyMsg;

/// A policy as the loop evaluates it.
pub struct LoopPolicy {
    pub digest: u64,
    springs: Policy,
    message: PolicyMsg,
}

impl LoopPolicy {
    /// `None` when the message is not one that a controller would admit.
    pub fn new(message: &PolicyMsg) -> Option<LoopPolicy> {
        message.validate().ok()?;
        Some(LoopPolicy {
            digest: message.digest,
            springs: Policy::new(message),
            message: *message,
        })
    }

    pub fn task_dim(&self) -> usize {
        self.message.task_dim as usize
    }

    pub fn message(&self) -> &PolicyMsg {
        &self.message
    }

    /// hᵢ and Σ hᵢ Kᵢ, packed, at `t_s` since the start of Execute.
    pub fn at(&self, t_s: f64) -> (Vec<f64>, Vec<f64>) {
        let components = self.message.components();
        let h = self.springs.activations(t_s)[..components.len()].to_vec();
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
