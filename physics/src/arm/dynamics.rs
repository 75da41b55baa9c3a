//! Inverse dynamics: τ = M(q)q̈ + C(q,q̇)q̇ + g(q). No friction, no rotor inertia.
//!
//! The paper controls its arm by "inverse dynamics solved with a recursive Newton-Euler
//! formulation" (Sec. 3.1). Everything is expressed in world axes.

use nalgebra::{Matrix3, Vector3};

use super::frames::BodyFrames;
use super::model::ArmModel;
use super::{JointMatrix, JointVector, MAX_JOINTS};

/// Recursive Newton-Euler: the torques (N·m) that give `qdd` (rad/s²) at `q` (rad), `qd` (rad/s).
///
/// Outwards the motion of every body, gravity entering as an upward acceleration of the base;
/// inwards the force f and the moment n about the joint:
/// F = m·a_cm, N = I·α + ω × I·ω, τ_i = z_i · n_i.
pub fn rnea(model: &ArmModel, q: &JointVector, qd: &JointVector, qdd: &JointVector) -> JointVector {
    rnea_at(model, &BodyFrames::new(model, q), qd, qdd)
}

/// [`rnea`] where the bodies are at `frames`.
pub fn rnea_at(
    model: &ArmModel,
    frames: &BodyFrames,
    qd: &JointVector,
    qdd: &JointVector,
) -> JointVector {
    let mut force = [Vector3::zeros(); MAX_JOINTS];
    let mut moment = [Vector3::zeros(); MAX_JOINTS];

    let mut omega = Vector3::zeros();
    let mut alpha = Vector3::zeros();
    let mut a = -model.gravity();
    let mut p_previous = Vector3::zeros();
    for (i, body) in model.bodies().iter().enumerate() {
        let (R, p, z) = (&frames.R_WB[i], frames.p_WB[i], frames.axis(i));
        // The origin of this body still moves with the body before it.
        let r = p - p_previous;
        a += alpha.cross(&r) + omega.cross(&omega.cross(&r));
        alpha += z * qdd[i] + omega.cross(&z) * qd[i];
        omega += z * qd[i];
        p_previous = p;

        let c = R * body.p_BBcm;
        force[i] = (a + alpha.cross(&c) + omega.cross(&omega.cross(&c))) * body.mass;
        let inertia_times = |w: &Vector3<f64>| R * (body.I_BBcm * R.tr_mul(w));
        moment[i] =
            inertia_times(&alpha) + omega.cross(&inertia_times(&omega)) + c.cross(&force[i]);
    }

    let mut tau = JointVector::zeros();
    let mut f = Vector3::zeros();
    let mut n = Vector3::zeros();
    let mut p_next = Vector3::zeros();
    for i in (0..model.n_joints()).rev() {
        n += (p_next - frames.p_WB[i]).cross(&f) + moment[i];
        f += force[i];
        p_next = frames.p_WB[i];
        tau[i] = frames.axis(i).dot(&n);
    }
    tau
}

/// Bias torque C(q,q̇)q̇ + g(q), N·m: what the motors must give at q̈ = 0.
pub fn bias(model: &ArmModel, q: &JointVector, qd: &JointVector) -> JointVector {
    bias_at(model, &BodyFrames::new(model, q), qd)
}

/// [`bias`] where the bodies are at `frames`.
pub fn bias_at(model: &ArmModel, frames: &BodyFrames, qd: &JointVector) -> JointVector {
    rnea_at(model, frames, qd, &JointVector::zeros())
}

/// Gravity torque g(q), N·m: what holds the arm still.
///
/// τ_i = −z_i · ((h − m·p_i) × g), with m the mass outboard of joint i and h = Σ m·p_Wcm.
pub fn gravity_torque(model: &ArmModel, q: &JointVector) -> JointVector {
    let frames = BodyFrames::new(model, q);
    let gravity = model.gravity();
    let mut tau = JointVector::zeros();
    let mut mass = 0.0;
    let mut h = Vector3::zeros();
    for (i, body) in model.bodies().iter().enumerate().rev() {
        let p = frames.p_WB[i];
        mass += body.mass;
        h += (p + frames.R_WB[i] * body.p_BBcm) * body.mass;
        tau[i] = -frames.axis(i).dot(&(h - p * mass).cross(&gravity));
    }
    tau
}

/// Mass matrix M(q), kg·m², by composite rigid bodies; ones on the diagonal of unused joints.
///
/// Motions and forces are taken at the world origin: joint i moves with (ω, v) = (z_i, p_i × z_i),
/// and a composite body of mass m, first moment h and inertia I about that origin answers with
/// f = m·v + ω × h, n = I·ω + h × v. Then M_ij = z_j·n_i + v_j·f_i for j ≤ i.
pub fn mass_matrix(model: &ArmModel, q: &JointVector) -> JointMatrix {
    mass_matrix_at(model, &BodyFrames::new(model, q))
}

/// [`mass_matrix`] where the bodies are at `frames`.
pub fn mass_matrix_at(model: &ArmModel, frames: &BodyFrames) -> JointMatrix {
    let mut z = [Vector3::zeros(); MAX_JOINTS];
    let mut v = [Vector3::zeros(); MAX_JOINTS];
    for i in 0..model.n_joints() {
        z[i] = frames.axis(i);
        v[i] = frames.p_WB[i].cross(&z[i]);
    }

    let mut M = JointMatrix::identity();
    let mut mass = 0.0;
    let mut h = Vector3::zeros();
    let mut inertia = Matrix3::zeros();
    for (i, body) in model.bodies().iter().enumerate().rev() {
        let R = &frames.R_WB[i];
        let c = frames.p_WB[i] + R * body.p_BBcm;
        mass += body.mass;
        h += c * body.mass;
        inertia += (R * body.I_BBcm) * R.transpose()
            + (Matrix3::from_diagonal_element(c.norm_squared()) - c * c.transpose()) * body.mass;

        let f = v[i] * mass + z[i].cross(&h);
        let n = inertia * z[i] + h.cross(&v[i]);
        for j in 0..=i {
            M[(i, j)] = z[j].dot(&n) + v[j].dot(&f);
            M[(j, i)] = M[(i, j)];
        }
    }
    M
}
