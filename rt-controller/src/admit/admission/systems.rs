//! What the linear systems of Eq. (2) must satisfy: Gaussians that are ones, gains that 1 kHz samples
//! and, of a field of the state, a certificate that it comes to rest at its target.
//!
//! With V = (x − x*)ᵀ P (x − x*), P Aᵢ + Aᵢᵀ P ≺ 0 and Aᵢ x* + bᵢ = 0 for every i, V falls along
//! ẋ = Σ hᵢ(x) [Aᵢ x + bᵢ] whatever the hᵢ ≥ 0 are (Khansari-Zadeh & Billard, T-RO 2011, for P = I). It is
//! a property of the field. The loop follows it with a lag of 1/λ, and that motion has a certificate of the
//! same kind where λ is large enough, see [`following`].

use nalgebra::{Cholesky, DMatrix, DVector};
use shm_types::policy::{
    ACTIVATION_STATE, LinearSystem, ORIENTATION_SPHERE, OUTPUT_VELOCITY, PolicyMsg,
};

use super::{
    AdmissionError, CERTIFICATE_MAX, CERTIFICATE_MIN, CONTRACTION_MIN, COVARIANCE_MAX,
    COVARIANCE_MIN, DAMPER_MAX, REST_MAX, Room, STIFFNESS_MAX,
};

pub(super) fn check(message: &PolicyMsg, room: &Room) -> Result<(), AdmissionError> {
    if let Some(distance) = room.excess(&message.target) {
        let ([x, y, z, ..], limit) = (message.target, room.limit);
        return Err(AdmissionError::Target { x, y, z, distance, limit });
    }
    let is_velocity = message.output == OUTPUT_VELOCITY;
    for (i, system) in message.systems().iter().enumerate() {
        covariance(i, system, message.drive_dim())?;
        gains(i, system, message)?;
    }
    match (message.activation == ACTIVATION_STATE, is_velocity) {
        (true, true) => field(message),
        (true, false) => Err(AdmissionError::StateOfAcceleration),
        (false, _) => Ok(()),
    }
}

fn covariance(i: usize, system: &LinearSystem, drive_dim: usize) -> Result<(), AdmissionError> {
    let sigma = DMatrix::from_fn(drive_dim, drive_dim, |r, c| system.covariance_at(r, c));
    let eigenvalues = sigma.symmetric_eigenvalues();
    let is_outside = |value: &&f64| !(COVARIANCE_MIN..=COVARIANCE_MAX).contains(*value);
    match eigenvalues.iter().find(is_outside) {
        Some(&eigenvalue) => Err(AdmissionError::Covariance { system: i, eigenvalue }),
        None => Ok(()),
    }
}

/// ∂ẍ/∂x as a spring's and ∂ẍ/∂ẋ as a damper's; a velocity is followed with λ times itself.
fn gains(i: usize, system: &LinearSystem, message: &PolicyMsg) -> Result<(), AdmissionError> {
    let d = message.task_dim as usize;
    let bounded = |field, matrix: &DMatrix<f64>, max: f64| match norm(matrix) {
        norm if norm > max => Err(AdmissionError::Gain { system: i, field, norm, max }),
        _ => Ok(()),
    };
    let of_position = DMatrix::from_fn(d, d, |r, c| system.of_position_at(r, c));
    let of_velocity = DMatrix::from_fn(d, d, |r, c| system.of_velocity_at(r, c));
    if message.output != OUTPUT_VELOCITY {
        bounded("of_position", &of_position, STIFFNESS_MAX)?;
        return bounded("of_velocity", &of_velocity, DAMPER_MAX);
    }
    if of_velocity.amax() != 0.0 {
        let why = "the output is a velocity";
        return Err(AdmissionError::Unused { system: i, field: "of_velocity", why });
    }
    bounded("of_position", &of_position, STIFFNESS_MAX / message.following)
}

/// The largest singular value.
fn norm(matrix: &DMatrix<f64>) -> f64 {
    (matrix.transpose() * matrix).symmetric_eigenvalues().max().max(0.0).sqrt()
}

/// A field of the state.
fn field(message: &PolicyMsg) -> Result<(), AdmissionError> {
    let d = message.task_dim as usize;
    let P = DMatrix::from_fn(d, d, |r, c| message.certificate_at(r, c));
    let is_outside = |value: &&f64| !(CERTIFICATE_MIN..=CERTIFICATE_MAX).contains(*value);
    if let Some(&eigenvalue) = P.symmetric_eigenvalues().iter().find(is_outside) {
        return Err(AdmissionError::Certificate { eigenvalue });
    }
    // All eigenvalues are positive.
    let L = Cholesky::new(P).map_or_else(|| DMatrix::identity(d, d), |factor| factor.l());
    let is_sphere = message.orientation == ORIENTATION_SPHERE;
    let target =
        DVector::from_fn(d, |r, _| if is_sphere && r >= 3 { 0.0 } else { message.target[r] });
    for (i, system) in message.systems().iter().enumerate() {
        if system.of_drive[..d].iter().any(|entry| *entry != 0.0) {
            let why = "the state drives the activations";
            return Err(AdmissionError::Unused { system: i, field: "of_drive", why });
        }
        let A = DMatrix::from_fn(d, d, |r, c| system.of_position_at(r, c));
        let Some(A_P) = in_metric(&A, &L) else {
            return Err(AdmissionError::Contraction { system: i, eigenvalue: f64::INFINITY });
        };
        let eigenvalue = (&A_P + A_P.transpose()).symmetric_eigenvalues().max() * 0.5;
        if eigenvalue > -CONTRACTION_MIN {
            return Err(AdmissionError::Contraction { system: i, eigenvalue });
        }
        let speed = (&A * &target + DVector::from_fn(d, |r, _| system.offset[r])).amax();
        if speed > REST_MAX {
            return Err(AdmissionError::Rest { system: i, speed });
        }
        following(i, &A_P, message.following)?;
    }
    Ok(())
}

/// Lᵀ A L⁻ᵀ: A in coordinates in which V is the squared distance, as P = L Lᵀ. The largest eigenvalue of its
/// symmetric part is the least c with ½ (P A + Aᵀ P) ≼ c P, s⁻¹.
fn in_metric(A: &DMatrix<f64>, L: &DMatrix<f64>) -> Option<DMatrix<f64>> {
    // X Lᵀ = Lᵀ A, from L Xᵀ = Aᵀ L.
    Some(L.solve_lower_triangular(&(A.transpose() * L))?.transpose())
}

/// λ > λmax(N + Wᵀ N⁻¹ W), where A = W − N in the metric of P with N symmetric, N ≻ 0, and W skew.
///
/// With y = x − x* + ẋ/λ and e = ẋ/λ, both in that metric, V₂ = yᵀy + eᵀe then falls along ẍ = λ (f − ẋ) whatever
/// the activations do: V̇₂ = −2 [y; e]ᵀ [N, W; Wᵀ, λI − N] [y; e] is linear in A.
fn following(i: usize, A_P: &DMatrix<f64>, following: f64) -> Result<(), AdmissionError> {
    let N = (A_P + A_P.transpose()) * -0.5;
    let W = (A_P - A_P.transpose()) * 0.5;
    let turned = Cholesky::new(N.clone()).map(|factor| W.transpose() * factor.solve(&W));
    let needed = turned.map_or(f64::INFINITY, |turned| (N + turned).symmetric_eigenvalues().max());
    let is_followed = following > needed;
    if !is_followed {
        return Err(AdmissionError::Following { system: i, following, needed });
    }
    Ok(())
}
