//! Task force → joint torque: operational-space inertia, inverse dynamics, null-space posture.

use nalgebra::{Cholesky, Matrix6, SMatrix, U6, Vector6};
use physics::arm::{
    ArmModel, BodyFrames, JointMatrix, JointVector, MAX_JOINTS, TipKinematics, dynamics,
};

/// Keeps Λ bounded near singularities: added to Λ⁻¹ = J M⁻¹ Jᵀ, whose entries are about 0.1 kg⁻¹
/// (translation) and 100 (kg·m²)⁻¹ (rotation of the wrist).
const LAMBDA_REGULARIZATION: f64 = 1e-4;
/// Rounds in which the posture's torque is kept from the tip.
const NULL_ROUNDS: usize = 4;

/// Rigid-body quantities of one tick.
pub struct ArmState {
    pub tip: TipKinematics,
    pub mass_matrix: JointMatrix,
    /// C(q, q̇)q̇ + g(q), N·m.
    pub bias: JointVector,
}

impl ArmState {
    pub fn new(model: &ArmModel, q: &JointVector, qd: &JointVector) -> ArmState {
        let frames = BodyFrames::new(model, q);
        ArmState {
            tip: TipKinematics::at(model, &frames, qd),
            mass_matrix: dynamics::mass_matrix_at(model, &frames),
            bias: dynamics::bias_at(model, &frames, qd),
        }
    }
}

/// What the arm weighs at its tip, for the torques of one tick.
pub struct TaskInertia {
    M_inv_Jt: SMatrix<f64, MAX_JOINTS, 6>,
    /// Cholesky factor of Λ⁻¹ = J M⁻¹ Jᵀ, regularised.
    lambda: Cholesky<f64, U6>,
}

impl TaskInertia {
    /// Returns `None` when M or Λ⁻¹ is not positive definite, which a physical arm in a finite state cannot
    /// produce.
    pub fn new(state: &ArmState) -> Option<TaskInertia> {
        let J = &state.tip.J;
        let M_inv_Jt = state.mass_matrix.cholesky()?.solve(&J.transpose());
        let lambda_inv: Matrix6<f64> = J * M_inv_Jt + Matrix6::identity() * LAMBDA_REGULARIZATION;
        Some(TaskInertia { M_inv_Jt, lambda: lambda_inv.cholesky()? })
    }

    /// τ = Jᵀ F + bias + N τ₀, with F = Λ (ẍ − J̇q̇), Λ = (J M⁻¹ Jᵀ)⁻¹, τ₀ = M q̈_posture and
    /// N = I − Jᵀ Λ J M⁻¹, which keeps the posture torque from moving the tip.
    ///
    /// Eq. (5) yields an acceleration; Λ is the step to newtons. `xdd_world` and F are [linear;
    /// angular] in world axes, `qdd_posture` in rad/s². An arm with fewer than six joints cannot follow
    /// all six rows: it gets their least-squares compromise in the metric of M.
    pub fn torque(
        &self,
        state: &ArmState,
        xdd_world: &Vector6<f64>,
        qdd_posture: &JointVector,
    ) -> JointVector {
        let J = &state.tip.J;
        // One solve serves both: N M q̈₀ = M q̈₀ − Jᵀ Λ J q̈₀.
        let force = self.lambda.solve(&(xdd_world - state.tip.Jdot_qd - J * qdd_posture));
        J.transpose() * force + state.bias + state.mass_matrix * qdd_posture
    }

    /// F = Λ J M⁻¹ (τ − bias): what `torque` (N·m) exerts at the tip beyond holding and moving the arm,
    /// [force N; moment N·m] in world axes. It inverts [`TaskInertia::torque`], whose posture torque does
    /// not reach the tip.
    pub fn force(&self, state: &ArmState, torque: &JointVector) -> Vector6<f64> {
        self.lambda.solve(&(self.M_inv_Jt.transpose() * (torque - state.bias)))
    }

    /// τ = N M q̈, with an N that does not move the tip at all: `qdd` in rad/s².
    ///
    /// τ = M q̈ − Jᵀ f with J M⁻¹ Jᵀ f = J q̈. The regularised Λ alone would leave about 10⁻³ of J q̈ at the
    /// tip; each round leaves as much of what the round before left, and all are bounded where J is singular.
    pub fn null_torque(&self, state: &ArmState, qdd: &JointVector) -> JointVector {
        let J = &state.tip.J;
        let moves = J * qdd;
        let mut force = Vector6::zeros();
        for _ in 0..NULL_ROUNDS {
            force += self.lambda.solve(&(moves - J * (self.M_inv_Jt * force)));
        }
        state.mass_matrix * qdd - J.transpose() * force
    }
}

/// Inverse dynamics: τ = M q̈ + C(q, q̇)q̇ + g(q), for q̈ in rad/s².
pub fn computed_torque(state: &ArmState, qdd: &JointVector) -> JointVector {
    state.mass_matrix * qdd + state.bias
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::{RngExt, SeedableRng};
    use rand_chacha::ChaCha8Rng;

    const ARMS: [&str; 4] = [
        include_str!("../../../robots/wam7/wam7_pan.urdf"),
        include_str!("../../../robots/panda/panda_pan.urdf"),
        include_str!("../../../robots/iiwa14/iiwa14_pan.urdf"),
        include_str!("../../../robots/xarm7/xarm7_pan.urdf"),
    ];

    #[test]
    fn the_force_at_the_tip_is_found_again_in_the_torque() {
        let arm = ArmModel::from_urdf(ARMS[0], "pan").unwrap();
        let q = JointVector::from_column_slice(&[0.1, 0.6, -0.2, 1.5, 0.1, -0.4, 0.2]);
        let qd = JointVector::from_element(0.3);
        let state = ArmState::new(&arm, &q, &qd);
        let inertia = TaskInertia::new(&state).unwrap();
        let given = Vector6::new(10.0, -4.0, 25.0, 1.0, 0.5, -0.8);
        let posture = inertia.null_torque(&state, &JointVector::from_element(5.0));
        let torque = state.tip.J.transpose() * given + state.bias + posture;
        let found = inertia.force(&state, &torque);
        assert!((found - given).norm() < 2e-2 * given.norm(), "{found}");
    }

    #[test]
    fn the_torque_of_a_posture_does_not_move_the_tip() {
        let mut rng = ChaCha8Rng::seed_from_u64(1);
        // What the tip gets, m/s² and rad/s², and what the elbow gets, as a part of what was asked.
        let (mut leaks, mut moves): (f64, f64) = (0.0, 0.0);
        for urdf in ARMS {
            let arm = ArmModel::from_urdf(urdf, "pan").unwrap();
            let limits = arm.limits();
            let mut n = 0;
            while n < 250 {
                let q = JointVector::from_fn(|i, _| {
                    rng.random_range(limits.q_min[i]..=limits.q_max[i])
                });
                let qd = JointVector::from_fn(|_, _| rng.random_range(-2.0..=2.0));
                let qdd = JointVector::from_fn(|_, _| rng.random_range(-25.0..=25.0));
                let state = ArmState::new(&arm, &q, &qd);
                let inertia = TaskInertia::new(&state).unwrap();
                // A tip of more than 100 kg is as good as singular.
                let weight = inertia.lambda.inverse().symmetric_eigenvalues().max();
                if weight > 100.0 {
                    continue;
                }
                n += 1;
                let elbow_qdd =
                    state.mass_matrix.cholesky().unwrap().solve(&inertia.null_torque(&state, &qdd));
                leaks = leaks.max((state.tip.J * elbow_qdd).amax());
                moves += elbow_qdd.amax() / qdd.amax() / 1000.0;
            }
        }
        assert!(leaks < 1e-6, "{leaks}");
        assert!(moves > 0.3, "an elbow that does not move shows nothing: {moves}");
    }
}
