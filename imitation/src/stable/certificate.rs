//! Proof that a field comes to rest at its target from everywhere: one quadratic Lyapunov function for all of
//! its systems.

use nalgebra::{Cholesky, DMatrix, DVector};
use serde::{Deserialize, Serialize};
use thiserror::Error;

use crate::lists::{self, Rows};
use crate::systems::Systems;

/// What rounding may leave of a zero, relative to the terms that cancel.
const ROUNDING: f64 = 1e-9;

/// V(x) = (x−x*)ᵀP(x−x*), which falls along every motion of a field that passes [`Certificate::check`].
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(try_from = "Lists", into = "Lists")]
pub struct Certificate {
    /// P (d×d), symmetric positive definite.
    pub P: DMatrix<f64>,
    /// x* (d): the end of every motion.
    pub target: DVector<f64>,
}

/// Why a certificate says nothing about a field. Components are counted from 1.
#[derive(Clone, Debug, PartialEq, Error)]
pub enum CertificateError {
    #[error("P is {rows}×{columns} for a target of {d} coordinates: give a d×d matrix")]
    Shape { rows: usize, columns: usize, d: usize },
    #[error("P is not symmetric and positive definite")]
    NotPositive,
    #[error("the target is not finite")]
    Target,
    #[error("component {component} maps {found} coordinates and the target has {d}")]
    Coordinates { component: usize, found: usize, d: usize },
    #[error("component {component} moves at the target, by {speed:e}: b must be −A x*")]
    Moves { component: usize, speed: f64 },
    #[error(
        "component {component} can move away from the target: V falls at {rate:e} of its value a second, \
         and must fall at more than 0; AᵀP + PA must be negative definite"
    )]
    NotStable { component: usize, rate: f64 },
    #[error("a matrix has rows of unequal length")]
    Ragged,
}

impl Certificate {
    /// The margin α > 0 (1/s) by which `systems` is certified: V̇ ≤ −αV for ẋ = Σᵢ hᵢ(x)[Aᵢx + bᵢ] whatever
    /// the weights hᵢ ≥ 0, Σᵢ hᵢ = 1 are, so that x* is globally exponentially stable. The conditions, with
    /// P = LLᵀ:
    ///
    /// bᵢ = −Aᵢx*,  α = minᵢ λmin(−L⁻¹(AᵢᵀP + PAᵢ)L⁻ᵀ) > 0.
    ///
    /// They are those of SEDS (Khansari-Zadeh and Billard 2011) for P = I. A margin that could be rounding
    /// is none.
    pub fn check(&self, systems: &Systems) -> Result<f64, CertificateError> {
        let mut margin = f64::INFINITY;
        for (i, A) in self.in_metric(systems)?.into_iter().enumerate() {
            let rate = -(&A + A.transpose()).symmetric_eigenvalues().max();
            // False if it is no number.
            let falls = rate > ROUNDING * A.norm();
            if !falls {
                return Err(CertificateError::NotStable { component: i + 1, rate });
            }
            margin = margin.min(rate);
        }
        Ok(margin)
    }

    /// The least damping (1/s) that certifies the driven motion, ẍ = λ(f(x) − ẋ) with the field f of
    /// `systems`, in the same way: for every larger λ it ends at rest at x*, from every x and ẋ.
    ///
    /// With e = ẋ/λ and y = x − x* + e, both in coordinates in which P = I, and A = −N + W there (N
    /// symmetric, W skew), the motion is ẏ = A(y − e), ė = A(y − e) − λe. Along it V₂ = yᵀy + eᵀe changes by
    ///
    /// V̇₂ = −2 [y; e]ᵀ [N, W; Wᵀ, λI − N] [y; e],
    ///
    /// whose matrix is linear in A: it is positive definite for Σᵢ hᵢAᵢ if it is for every Aᵢ, that is if
    /// λ > λmax(Nᵢ + WᵢᵀNᵢ⁻¹Wᵢ). A spiral that closes slowly needs much: driven with less, it opens. Fails
    /// as `check` does.
    pub fn damping(&self, systems: &Systems) -> Result<f64, CertificateError> {
        self.check(systems)?;
        let needed = self.in_metric(systems)?.into_iter().map(|A| {
            let N = (&A + A.transpose()) / -2.0;
            let W = (&A - A.transpose()) / 2.0;
            let turned = Cholesky::new(N.clone()).map(|N| W.transpose() * N.solve(&W));
            turned.map_or(f64::INFINITY, |turned| (N + turned).symmetric_eigenvalues().max())
        });
        Ok(needed.fold(0.0, f64::max))
    }

    /// LᵀAᵢL⁻ᵀ: every system in coordinates in which V is the squared distance.
    fn in_metric(&self, systems: &Systems) -> Result<Vec<DMatrix<f64>>, CertificateError> {
        let L = self.factor()?;
        let d = self.target.len();
        let mut found = Vec::new();
        for (i, (A, b)) in systems.A.iter().zip(&systems.b).enumerate() {
            let component = i + 1;
            for size in [A.nrows(), A.ncols(), systems.centers[i].len()] {
                if size != d {
                    return Err(CertificateError::Coordinates { component, found: size, d });
                }
            }
            let speed = (A * &self.target + b).norm();
            let rests = speed <= ROUNDING * (A.norm() * self.target.norm() + b.norm());
            if !rests {
                return Err(CertificateError::Moves { component, speed });
            }
            // X Lᵀ = LᵀA, from L Xᵀ = (LᵀA)ᵀ.
            let transposed = L.solve_lower_triangular(&(L.transpose() * A).transpose());
            found.push(transposed.ok_or(CertificateError::NotPositive)?.transpose());
        }
        Ok(found)
    }

    /// L, lower triangular with P = LLᵀ.
    fn factor(&self) -> Result<DMatrix<f64>, CertificateError> {
        let d = self.target.len();
        if self.P.shape() != (d, d) || d == 0 {
            let (rows, columns) = self.P.shape();
            return Err(CertificateError::Shape { rows, columns, d });
        }
        if !self.target.iter().all(|x| x.is_finite()) {
            return Err(CertificateError::Target);
        }
        let is_symmetric = (&self.P - self.P.transpose()).amax() <= ROUNDING * self.P.amax();
        let factor = Cholesky::new(self.P.clone()).filter(|_| is_symmetric);
        factor.map(Cholesky::unpack).ok_or(CertificateError::NotPositive)
    }
}

/// A certificate as it is written.
#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct Lists {
    P: Rows,
    target: Vec<f64>,
}

impl From<Certificate> for Lists {
    fn from(certificate: Certificate) -> Lists {
        Lists { P: lists::rows(&certificate.P), target: certificate.target.as_slice().to_vec() }
    }
}

impl TryFrom<Lists> for Certificate {
    type Error = CertificateError;

    fn try_from(written: Lists) -> Result<Certificate, CertificateError> {
        let P = lists::matrix(&written.P).ok_or(CertificateError::Ragged)?;
        let certificate = Certificate { P, target: DVector::from_vec(written.target) };
        certificate.factor().map(|_| certificate)
    }
}

#[cfg(test)]
mod tests;
