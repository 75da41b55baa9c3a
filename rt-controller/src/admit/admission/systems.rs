//! What the linear systems of Eq. (2) must satisfy: Gaussians that are ones, gains that 1 kHz samples
//! and, of a field of the state, a certificate that it comes to rest at its target.
//!
//! With V = (x − x*)ᵀ P (x − x*), P Aᵢ + Aᵢᵀ P ≺ 0 and Aᵢ x* + bᵢ = 0 for every i, V falls along
//! ẋ = Σ hᵢ(x) [Aᵢ x + bᵢ] whatever the hᵢ ≥ 0 are (Khansari-Zadeh & Billard, T-RO 2011, for P = I). It is
//! a property of the field. The loop follows it with a lag of 1/λ, which makes of an eigenvalue −α ± βi
//! of Aᵢ the characteristic equation s² + λs + λ(α ∓ βi) = 0: stable where λ > β²/α.

use nalgebra::{Cholesky, DMatrix, DVector, Schur};
use shm_types::policy::{
    ACTIVATION_STATE, LinearSystem, ORIENTATION_SPHERE, OUTPUT_VELOCITY, PolicyMsg,
};

use super::{
    AdmissionError, CERTIFICATE_MAX, CERTIFICATE_MIN, CONTRACTION_MIN, COVARIANCE_MAX,
    COVARIANCE_MIN, DAMPER_MAX, REST_MAX, Room, STIFFNESS_MAX,
};

/// Sweeps of the eigenvalue iteration, which needs a few a row; no message may keep it busy for ever.
const SWEEPS: usize = 1000;

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
        let eigenvalue = rate(&A, &L);
        if eigenvalue > -CONTRACTION_MIN {
            return Err(AdmissionError::Contraction { system: i, eigenvalue });
        }
        let speed = (&A * &target + DVector::from_fn(d, |r, _| system.offset[r])).amax();
        if speed > REST_MAX {
            return Err(AdmissionError::Rest { system: i, speed });
        }
        following(i, A, message.following)?;
    }
    Ok(())
}

/// The least c with ½ (P A + Aᵀ P) ≼ c P, s⁻¹: with P = L Lᵀ the largest eigenvalue of the symmetric part
/// of Lᵀ A L⁻ᵀ.
fn rate(A: &DMatrix<f64>, L: &DMatrix<f64>) -> f64 {
    let transposed = L.solve_lower_triangular(&(A.transpose() * L));
    transposed.map_or(f64::INFINITY, |B| ((&B + B.transpose()) * 0.5).symmetric_eigenvalues().max())
}

/// λ > β²/α for every eigenvalue −α ± βi of A, where α > 0 is known.
fn following(i: usize, A: DMatrix<f64>, following: f64) -> Result<(), AdmissionError> {
    let unknown = AdmissionError::Following {
        system: i,
        re: f64::NAN,
        im: f64::NAN,
        following,
        needed: f64::INFINITY,
    };
    let schur = Schur::try_new(A, f64::EPSILON, SWEEPS).ok_or(unknown)?;
    for eigenvalue in schur.complex_eigenvalues().iter() {
        let (re, im) = (eigenvalue.re, eigenvalue.im.abs());
        let needed = im * im / -re;
        let is_followed = re < 0.0 && following > needed;
        if !is_followed {
            return Err(AdmissionError::Following { system: i, re, im, following, needed });
        }
    }
    Ok(())
}
