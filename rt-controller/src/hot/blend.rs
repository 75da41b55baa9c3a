//! From one policy to another while a rollout goes on: the accelerations of both are mixed.

use crate::hot::policy::{Command, Policy};
use crate::hot::task_space::TaskState;

/// The old policy, fading out.
///
/// ẍ = (1 − w) ẍ_old + w ẍ_new with w = 3s² − 2s³, s growing from 0 to 1 over the window: a convex
/// mixture of two spring-dampers is one itself, at every instant. What the mixture still asks for
/// too suddenly, the torque-rate limit stretches.
#[derive(Clone, Copy)]
pub struct Blend {
    from: Policy,
    /// The old policy's clock minus the new one's, s.
    lead_s: f64,
    tick: u32,
    n_ticks: u32,
}

impl Blend {
    /// Over `n_ticks` > 0 ticks, from `from` at its own time `t_from_s`; the new policy is at
    /// `t_to_s`.
    pub fn new(from: &Policy, t_from_s: f64, t_to_s: f64, n_ticks: u32) -> Blend {
        Blend { from: *from, lead_s: t_from_s - t_to_s, tick: 0, n_ticks }
    }

    /// Mixes into what the new policy asks for at its time `t_s`.
    pub fn mix(&self, to: Command, t_s: f64, task: &TaskState) -> Command {
        let s = f64::from(self.tick + 1) / f64::from(self.n_ticks + 1);
        let w = s * s * (3.0 - 2.0 * s);
        let from = self.from.command(t_s + self.lead_s, task);
        Command {
            xdd: from.xdd * (1.0 - w) + to.xdd * w,
            attractor: from.attractor * (1.0 - w) + to.attractor * w,
        }
    }

    /// Ends the tick; false when the window has ended with it.
    pub fn advance(&mut self) -> bool {
        self.tick += 1;
        self.tick < self.n_ticks
    }
}
