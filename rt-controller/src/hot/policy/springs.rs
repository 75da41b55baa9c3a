//! Eq. (5), ẍ = Σ hᵢ [Kᵢ (μᵢ − x) − κᵛ ẋ], with full stiffness matrices Kᵢ.

use nalgebra::{Matrix6, UnitQuaternion, Vector6};
use shm_types::MAX_COMPONENTS;
use shm_types::policy::{ACTIVATION_DECAY, ORIENTATION_SPHERE, PolicyMsg};

use super::{Command, normalize};
use crate::hot::task_space::{TaskState, orientation};

#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Springs {
    n_components: usize,
    /// Decay rate α of s = exp(−α t); 0 when driven by time.
    decay_rate: f64,
    /// Errors of orientation are rotations, not differences of rotation vectors.
    is_sphere: bool,
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
    /// exp of its rotational part.
    R_WA: UnitQuaternion<f64>,
    stiffness: Matrix6<f64>,
    /// 2ζ Kᵢ^½ on the learnt coordinates, s⁻¹.
    damper: Matrix6<f64>,
}

impl Spring {
    /// μᵢ − x on the sphere: the rotation Log(exp(μᵢ) R⁻¹) stands for the difference of the rotation
    /// vectors. It is the shortest way, in the world frame, and changes sides half a turn away.
    fn error_on_sphere(&self, task: &TaskState) -> Vector6<f64> {
        let (error, turn) = (self.attractor - task.x, task.relative_to(&self.R_WA));
        Vector6::from_fn(|i, _| if i < 3 { error[i] } else { -turn[i] })
    }
}

impl Springs {
    pub fn new(message: &PolicyMsg) -> Springs {
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
            R_WA: UnitQuaternion::identity(),
            stiffness: Matrix6::zeros(),
            damper: Matrix6::zeros(),
        }; MAX_COMPONENTS];
        for (spring, component) in springs.iter_mut().zip(message.components()) {
            let learnt = Matrix6::from_fn(|r, c| match r < d && c < d {
                true => component.stiffness_at(r, c),
                false => 0.0,
            });
            let attractor = Vector6::from_column_slice(&component.attractor);
            *spring = Spring {
                center: component.center,
                width: component.width,
                attractor,
                R_WA: orientation(&attractor),
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
        Springs {
            n_components: message.components().len(),
            decay_rate: if decays { message.decay_rate } else { 0.0 },
            is_sphere: message.orientation == ORIENTATION_SPHERE,
            damping: Vector6::from_fn(|i, _| damping(i)),
            has_dampers,
            springs,
        }
    }

    /// Activations hᵢ(t) = N(s; cᵢ, wᵢ²) / Σₖ N(s; cₖ, wₖ²), with s = t, or s = exp(−α t).
    pub fn activations(&self, t_s: f64) -> [f64; MAX_COMPONENTS] {
        let s = if self.decay_rate > 0.0 { (-self.decay_rate * t_s).exp() } else { t_s };
        let mut h = [0.0; MAX_COMPONENTS];
        let mut largest = f64::NEG_INFINITY;
        for (h, spring) in h.iter_mut().zip(&self.springs).take(self.n_components) {
            let z = (s - spring.center) / spring.width;
            *h = -0.5 * z * z - spring.width.ln();
            largest = largest.max(*h);
        }
        normalize(&mut h, self.n_components, largest);
        h
    }

    /// Eq. (5): ẍ = Σ hᵢ [Kᵢ (μᵢ − x) − κᵛ ẋ], where Σ hᵢ = 1; with dampers of their own,
    /// 2ζ Kᵢ^½ in κᵛ's place.
    pub fn command(&self, t_s: f64, task: &TaskState) -> Command {
        if self.is_sphere {
            return self.pull(t_s, task, |spring| spring.error_on_sphere(task));
        }
        self.pull(t_s, task, |spring| spring.attractor - task.x)
    }

    /// Eq. (5), where `error` is μᵢ − x.
    #[inline(always)]
    fn pull(&self, t_s: f64, task: &TaskState, error: impl Fn(&Spring) -> Vector6<f64>) -> Command {
        let h = self.activations(t_s);
        let mut xdd = -self.damping.component_mul(&task.xd);
        let mut attractor = Vector6::zeros();
        for (h, spring) in h.iter().zip(&self.springs).take(self.n_components) {
            xdd += spring.stiffness * error(spring) * *h;
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
mod tests;
