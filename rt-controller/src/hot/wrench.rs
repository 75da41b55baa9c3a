//! Task force → joint torque: operational-space inertia, inverse dynamics, null-space posture.

use nalgebra::{Matrix6, Vector6};
use physics::arm::{ArmModel, BodyFrames, JointMatrix, JointVector, TipKinematics, dynamics};

/// Keeps Λ bounded near singularities: added to Λ⁻¹ = J M⁻¹ Jᵀ, whose entries are about 0.1 kg⁻¹
/// (translation) and 100 (kg·m²)⁻¹ (rotation of the wrist).
const LAMBDA_REGULARIZATION: f64 = 1e-4;

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

/// τ = Jᵀ F + bias + N τ₀, with F = Λ (ẍ − J̇q̇), Λ = (J M⁻¹ Jᵀ)⁻¹, τ₀ = M q̈_posture and
/// N = I − Jᵀ Λ J M⁻¹, which keeps the posture torque from moving the tip.
///
/// Eq. (5) yields an acceleration; Λ is the step to newtons. `xdd_world` and F are [linear;
/// angular] in world axes, `qdd_posture` in rad/s². An arm with fewer than six joints cannot follow
/// all six rows: it gets their least-squares compromise in the metric of M. Returns `None` when M or Λ⁻¹ is not positive
/// definite, which a physical arm in a finite state cannot produce.
pub fn operational_space_torque(
    state: &ArmState,
    xdd_world: &Vector6<f64>,
    qdd_posture: &JointVector,
) -> Option<JointVector> {
    let J = &state.tip.J;
    let M_inv_Jt = state.mass_matrix.cholesky()?.solve(&J.transpose());
    let lambda_inv: Matrix6<f64> = J * M_inv_Jt + Matrix6::identity() * LAMBDA_REGULARIZATION;
    let lambda = lambda_inv.cholesky()?;

    // One solve serves both: N M q̈₀ = M q̈₀ − Jᵀ Λ J q̈₀.
    let force = lambda.solve(&(xdd_world - state.tip.Jdot_qd - J * qdd_posture));
    Some(J.transpose() * force + state.bias + state.mass_matrix * qdd_posture)
}

/// Inverse dynamics: τ = M q̈ + C(q, q̇)q̇ + g(q), for q̈ in rad/s².
pub fn computed_torque(state: &ArmState, qdd: &JointVector) -> JointVector {
    state.mass_matrix * qdd + state.bias
}
