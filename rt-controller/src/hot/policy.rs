//! The policy: the springs of Eq. (5), or the linear systems of Eq. (2) whole.

mod springs;
mod systems;

use nalgebra::Vector6;
use shm_types::MAX_COMPONENTS;
use shm_types::policy::PolicyMsg;

use crate::hot::task_space::TaskState;
use springs::Springs;
use systems::Systems;

/// A policy ready for the hot path: fixed size, no heap, safe to copy between threads.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Policy {
    pub duration_s: f64,
    law: Law,
}

/// Both in one place: a box would be heap.
#[derive(Clone, Copy, Debug, PartialEq)]
#[allow(clippy::large_enum_variant)]
enum Law {
    Springs(Springs),
    Systems(Systems),
}

/// What the policy asks for.
#[derive(Clone, Copy, Debug)]
pub struct Command {
    /// ẍ in task coordinates, m/s² and rad/s².
    pub xdd: Vector6<f64>,
    /// What x is drawn to, for the record: Σ hᵢ μᵢ of springs, x + ξᵒ/λ of systems whose output is a
    /// velocity, and x itself where the output is an acceleration, which names no such place.
    pub attractor: Vector6<f64>,
}

impl Policy {
    /// Precondition: `message` passed [`PolicyMsg::validate`].
    pub fn new(message: &PolicyMsg) -> Policy {
        let law = match message.n_systems {
            0 => Law::Springs(Springs::new(message)),
            _ => Law::Systems(Systems::new(message)),
        };
        Policy { duration_s: message.duration_s, law }
    }

    /// hᵢ at `t_s`, of systems driven by the state at `task`; they sum to 1. Unused entries are 0.
    pub fn activations(&self, t_s: f64, task: &TaskState) -> [f64; MAX_COMPONENTS] {
        match &self.law {
            Law::Springs(springs) => springs.activations(t_s),
            Law::Systems(systems) => systems.activations(t_s, task),
        }
    }

    /// ẍ at `t_s` since the start of Execute.
    pub fn command(&self, t_s: f64, task: &TaskState) -> Command {
        match &self.law {
            Law::Springs(springs) => springs.command(t_s, task),
            Law::Systems(systems) => systems.command(t_s, task),
        }
    }
}

/// Turns the first `n` entries, ln of what is proportional to hᵢ, into hᵢ. The `largest` of them is taken
/// out first: far from every centre the nearest component acts alone, instead of 0/0.
fn normalize(h: &mut [f64; MAX_COMPONENTS], n: usize, largest: f64) {
    let mut sum = 0.0;
    for h in h.iter_mut().take(n) {
        *h = (*h - largest).exp();
        sum += *h;
    }
    for h in h.iter_mut().take(n) {
        *h /= sum;
    }
}
