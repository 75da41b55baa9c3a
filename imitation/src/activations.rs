//! Weights hᵢ of Eqs. (3) and (5), driven by time or by a decay.

use nalgebra::{DMatrix, DVector};

use crate::gaussian::normalised;

/// What drives the weights.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Drive {
    /// Time since the start, s.
    Time,
    /// s = exp(−rate·t), which solves τ ṡ = −α s with s(0) = 1 for rate = α/τ, s⁻¹.
    Decay { rate: f64 },
}

impl Drive {
    /// The driving variable at `t_s` (s).
    pub fn at(self, t_s: f64) -> f64 {
        match self {
            Drive::Time => t_s,
            Drive::Decay { rate } => (-rate * t_s).exp(),
        }
    }
}

/// Eq. (2), weights in one variable, with equal priors: hᵢ(s) = 𝒩(s | cᵢ, σᵢ²) / Σₖ 𝒩(s | cₖ, σₖ²).
#[derive(Clone, Debug, PartialEq)]
pub struct Activations {
    pub drive: Drive,
    /// cᵢ, in the unit of the driving variable.
    pub centers: Vec<f64>,
    /// σᵢ > 0, in the unit of the driving variable.
    pub widths: Vec<f64>,
}

impl Activations {
    /// K = `k` ≥ 1 weights with centres at equally spaced times from 0 to `duration_s` (s); each σ is
    /// `width_ratio` of the mean distance to the neighbouring centres.
    pub fn spread(drive: Drive, k: usize, duration_s: f64, width_ratio: f64) -> Activations {
        assert!(k > 0, "there is at least one weight");
        if k == 1 {
            // The only weight is always 1.
            return Activations { drive, centers: vec![drive.at(0.0)], widths: vec![1.0] };
        }
        let center = |i: usize| drive.at(duration_s * i as f64 / (k - 1) as f64);
        let width = |i: usize| {
            let (before, after) = (i.saturating_sub(1), (i + 1).min(k - 1));
            width_ratio * (center(after) - center(before)).abs() / (after - before) as f64
        };
        let (centers, widths) = ((0..k).map(center).collect(), (0..k).map(width).collect());
        Activations { drive, centers, widths }
    }

    /// K.
    pub fn len(&self) -> usize {
        self.centers.len()
    }

    pub fn is_empty(&self) -> bool {
        self.centers.is_empty()
    }

    /// hᵢ at `t_s` (s): K weights that sum to one, in log space, so that far from all centres the
    /// nearest has all the weight.
    pub fn at(&self, t_s: f64) -> DVector<f64> {
        let s = self.drive.at(t_s);
        let log_density = |(center, width): (&f64, &f64)| {
            let z = (s - center) / width;
            -0.5 * z * z - width.ln()
        };
        let logs: Vec<f64> = self.centers.iter().zip(&self.widths).map(log_density).collect();
        normalised(&logs)
    }

    /// The weights at every time, a row each: T×K.
    pub fn rows(&self, times_s: impl ExactSizeIterator<Item = f64>) -> DMatrix<f64> {
        let mut h = DMatrix::zeros(times_s.len(), self.len());
        for (k, t_s) in times_s.enumerate() {
            h.set_row(k, &self.at(t_s).transpose());
        }
        h
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn weights_sum_to_one_and_each_leads_at_its_centre() {
        for drive in [Drive::Time, Drive::Decay { rate: 2.0 }] {
            let activations = Activations::spread(drive, 7, 3.0, 0.5);
            for i in 0..7 {
                let h = activations.at(3.0 * i as f64 / 6.0);
                assert!((h.sum() - 1.0).abs() < 1e-12);
                assert_eq!(h.imax(), i, "{drive:?}");
            }
            assert!((activations.at(1e9).sum() - 1.0).abs() < 1e-12);
        }
        let late = Activations::spread(Drive::Time, 7, 3.0, 0.5).at(1e9);
        assert_eq!(late[6], 1.0);
    }

    #[test]
    fn a_single_weight_is_always_one() {
        let activations = Activations::spread(Drive::Time, 1, 3.0, 0.5);
        assert_eq!(activations.rows([0.0, 2.0, 1e9].into_iter()).as_slice(), [1.0; 3]);
    }
}
