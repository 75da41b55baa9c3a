//! The policy: Eq. (5), ẍ = Σ hᵢ [Kᵢ (μᵢ − x) − κᵛ ẋ], with full stiffness matrices Kᵢ.

use nalgebra::{Matrix6, Vector6};
use shm_types::MAX_COMPONENTS;
use shm_types::policy::{ACTIVATION_DECAY, PolicyMsg};

use crate::hot::task_space::TaskState;

/// A policy ready for the hot path: fixed size, no heap, safe to copy between threads.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Policy {
    n_components: usize,
    /// Decay rate α of s = exp(−α t); 0 when driven by time.
    decay_rate: f64,
    pub duration_s: f64,
    /// κᵛ on the learnt coordinates, or 0 where every spring has its own damper; the orientation
    /// damping on the others, s⁻¹.
    damping: Vector6<f64>,
    has_dampers: bool,
    springs: [Spring; MAX_COMPONENTS],
}

/// One virtual spring-damper. On coordinates that are not learnt, `stiffness` holds the gain of
/// the resolved-acceleration orientation control and `attractor` its reference.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Spring {
    center: f64,
    width: f64,
    attractor: Vector6<f64>,
    stiffness: Matrix6<f64>,
    /// 2ζ Kᵢ^½ on the learnt coordinates, s⁻¹.
    damper: Matrix6<f64>,
}

/// What the policy asks for.
#[derive(Clone, Copy, Debug)]
pub struct Command {
    /// ẍ in task coordinates, m/s² and rad/s².
    pub xdd: Vector6<f64>,
    /// Σ hᵢ μᵢ, for the record.
    pub attractor: Vector6<f64>,
}

impl Policy {
    /// Precondition: `message` passed [`PolicyMsg::validate`].
    pub fn new(message: &PolicyMsg) -> Policy {
        let d = message.task_dim as usize;
        let has_dampers = message.damping_ratio > 0.0;
        let damping = |i| match (i < d, has_dampers) {
            (true, true) => 0.0,
            (true, false) => message.damping,
            (false, _) => message.orientation_damping,
        };
        let mut springs = [Spring {
            center: 0.0,
            width: 1.0,
            attractor: Vector6::zeros(),
            stiffness: Matrix6::zeros(),
            damper: Matrix6::zeros(),
        }; MAX_COMPONENTS];
        for (spring, component) in springs.iter_mut().zip(message.components()) {
            let learnt = Matrix6::from_fn(|r, c| match r < d && c < d {
                true => component.stiffness_at(r, c),
                false => 0.0,
            });
            *spring = Spring {
                center: component.center,
                width: component.width,
                attractor: Vector6::from_column_slice(&component.attractor),
                stiffness: Matrix6::from_fn(|r, c| match (r < d && c < d, r == c) {
                    (false, true) => message.orientation_stiffness,
                    _ => learnt[(r, c)],
                }),
                damper: match has_dampers {
                    true => root(&learnt) * (2.0 * message.damping_ratio),
                    false => Matrix6::zeros(),
                },
            };
        }
        let decays = message.activation == ACTIVATION_DECAY;
        Policy {
            n_components: message.components().len(),
            decay_rate: if decays { message.decay_rate } else { 0.0 },
            duration_s: message.duration_s,
            damping: Vector6::from_fn(|i, _| damping(i)),
            has_dampers,
            springs,
        }
    }

    /// Activations hᵢ(t) = N(s; cᵢ, wᵢ²) / Σₖ N(s; cₖ, wₖ²), with s = t, or s = exp(−α t).
    /// The largest exponent is taken out first: far from every centre the nearest spring pulls
    /// alone, instead of 0/0. Unused entries are 0.
    pub fn activations(&self, t_s: f64) -> [f64; MAX_COMPONENTS] {
        let s = if self.decay_rate > 0.0 { (-self.decay_rate * t_s).exp() } else { t_s };
        let mut h = [0.0; MAX_COMPONENTS];
        let mut largest = f64::NEG_INFINITY;
        for (h, spring) in h.iter_mut().zip(&self.springs).take(self.n_components) {
            let z = (s - spring.center) / spring.width;
            *h = -0.5 * z * z - spring.width.ln();
            largest = largest.max(*h);
        }
        let mut sum = 0.0;
        for h in h.iter_mut().take(self.n_components) {
            *h = (*h - largest).exp();
            sum += *h;
        }
        for h in h.iter_mut().take(self.n_components) {
            *h /= sum;
        }
        h
    }

    /// Eq. (5): ẍ = Σ hᵢ [Kᵢ (μᵢ − x) − κᵛ ẋ], where Σ hᵢ = 1; with dampers of their own,
    /// 2ζ Kᵢ^½ in κᵛ's place.
    pub fn command(&self, t_s: f64, task: &TaskState) -> Command {
        let h = self.activations(t_s);
        let mut xdd = -self.damping.component_mul(&task.xd);
        let mut attractor = Vector6::zeros();
        for (h, spring) in h.iter().zip(&self.springs).take(self.n_components) {
            xdd += spring.stiffness * (spring.attractor - task.x) * *h;
            attractor += spring.attractor * *h;
            if self.has_dampers {
                xdd -= spring.damper * task.xd * *h;
            }
        }
        Command { xdd, attractor }
    }
}

/// K^½ of a positive semidefinite K: V Λ^½ Vᵀ.
fn root(K: &Matrix6<f64>) -> Matrix6<f64> {
    let eigen = K.symmetric_eigen();
    let roots = eigen.eigenvalues.map(|value| value.max(0.0).sqrt());
    eigen.eigenvectors * Matrix6::from_diagonal(&roots) * eigen.eigenvectors.transpose()
}

#[cfg(test)]
mod tests {
    use super::*;
    use shm_types::policy::packed_index;

    fn two_springs() -> PolicyMsg {
        let mut message = PolicyMsg { task_dim: 3, n_components: 2, ..PolicyMsg::EMPTY };
        message.damping = 10.0;
        message.orientation_stiffness = 400.0;
        message.orientation_damping = 40.0;
        for (i, component) in message.components.iter_mut().take(2).enumerate() {
            component.center = i as f64;
            component.width = 0.1;
            for row in 0..3 {
                component.stiffness[packed_index(row, row)] = 200.0;
            }
        }
        message.components[1].stiffness[packed_index(1, 0)] = 50.0;
        message.components[1].attractor = [1.0, 0.0, 0.0, 0.5, 0.0, 0.0];
        message.sealed()
    }

    #[test]
    fn activations_sum_to_one_and_never_underflow() {
        let policy = Policy::new(&two_springs());
        for t in [-1e3, 0.0, 0.5, 1.0, 1e3] {
            let sum: f64 = policy.activations(t).iter().sum();
            assert!((sum - 1.0).abs() < 1e-15, "t = {t}: {sum}");
        }
        assert_eq!(policy.activations(1e3)[1], 1.0);
    }

    #[test]
    fn full_stiffness_couples_coordinates_and_orientation_keeps_its_own_gains() {
        let policy = Policy::new(&two_springs());
        let task = TaskState { x: Vector6::zeros(), xd: Vector6::repeat(1.0) };
        let command = policy.command(1.0, &task);
        // hᵢ of the far spring is exp(−50): below the tolerance.
        let expected = [200.0 - 10.0, 50.0 - 10.0, -10.0, 400.0 * 0.5 - 40.0, -40.0, -40.0];
        for (found, expected) in command.xdd.iter().zip(expected) {
            assert!((found - expected).abs() < 1e-9, "{found} instead of {expected}");
        }
    }

    #[test]
    fn a_spring_with_a_damper_of_its_own_is_critical_along_every_axis() {
        let mut message = two_springs();
        message.damping_ratio = 1.0;
        let policy = Policy::new(&message.sealed());
        let damper = policy.springs[1].damper.fixed_view::<3, 3>(0, 0) * 0.5;
        let stiffness = policy.springs[1].stiffness.fixed_view::<3, 3>(0, 0).clone_owned();
        assert!((damper * damper - stiffness).amax() < 1e-10, "half of it squared is K");

        let task = TaskState { x: Vector6::zeros(), xd: Vector6::z() };
        let command = policy.command(1.0, &task);
        // z is coupled with nothing: 2√200, where κᵛ is 10; what is not learnt keeps its own.
        assert!((command.xdd[2] + 2.0 * 200_f64.sqrt()).abs() < 1e-9, "{}", command.xdd[2]);
        let turning = TaskState { x: Vector6::zeros(), xd: Vector6::ith(4, 1.0) };
        assert!((policy.command(1.0, &turning).xdd[4] + 40.0).abs() < 1e-9);
    }

    #[test]
    fn decay_runs_through_the_same_springs() {
        let mut message = two_springs();
        message.activation = ACTIVATION_DECAY;
        message.decay_rate = 2.0;
        message.components[0].center = 1.0;
        message.components[1].center = (-2.0f64).exp();
        let policy = Policy::new(&message);
        assert!(policy.activations(0.0)[0] > 0.999);
        assert!(policy.activations(1.0)[1] > 0.999);
    }
}
