//! The encodings that time drives, learnt from the same recordings: all of them as Eq. (5), ẍ = Σᵢ hᵢ(t)[Kᵢ(μᵢ − x) − κᵛẋ],
//! with an acceleration that is given over time added.

use std::error::Error;

use imitation::activations::{Activations, Drive};
use imitation::align::{Alignment, align};
use imitation::dmp::DmpOptions;
use imitation::gmm::{self, GmmOptions};
use imitation::regression::Regression;
use imitation::variability::{self, VariabilityOptions};
use imitation::{Attractors, Dmp, Recording};
use nalgebra::{DMatrix, DVector};

use super::{PERIOD_S, SEED};

/// Components of the regression, as many as the stable field has.
const N_COMPONENTS: usize = 7;

pub struct TimeDriven {
    pub name: &'static str,
    springs: Attractors,
    /// λ ô(t) of a regression in time.
    output: Option<(f64, Regression)>,
}

/// From recordings on one clock.
pub type Fit = fn(&[Recording]) -> Result<TimeDriven, Box<dyn Error>>;

/// The recordings on one clock.
pub fn on_one_clock(train: &[Recording]) -> Result<Vec<Recording>, Box<dyn Error>> {
    Ok(align(train, Alignment::Warped)?)
}

impl TimeDriven {
    /// Eq. (5), stiff where the recordings agree.
    pub fn springs(aligned: &[Recording]) -> Result<TimeDriven, Box<dyn Error>> {
        let springs = variability::attractors(aligned, &VariabilityOptions::default())?;
        Ok(TimeDriven { name: "springs, Eq. (5)", springs, output: None })
    }

    /// Eq. (3), read as Eq. (4).
    pub fn dmp(aligned: &[Recording]) -> Result<TimeDriven, Box<dyn Error>> {
        let dmp = Dmp::fit(aligned, &DmpOptions::default())?;
        Ok(TimeDriven { name: "DMP, Eq. (3)", springs: dmp.attractors().attractors, output: None })
    }

    /// ẍ = λ(ô(t) − κx − ẋ), where ô is the regression of κx + ẋ + ẍ/λ in time: what the loop makes of a velocity
    /// that time drives, with λ = 2√κᴾ and κ = κᴾ/λ.
    pub fn gmr(aligned: &[Recording]) -> Result<TimeDriven, Box<dyn Error>> {
        let kappa_p = DmpOptions::default().kappa_p;
        let lambda = 2.0 * kappa_p.sqrt();
        let (d, n) = (aligned[0].dim(), aligned[0].n_points());
        let mut data = DMatrix::zeros(1 + d, n * aligned.len());
        for (r, recording) in aligned.iter().enumerate() {
            let outputs = &recording.points * (kappa_p / lambda)
                + recording.velocities()
                + recording.accelerations() / lambda;
            for k in 0..n {
                data[(0, r * n + k)] = recording.time_s(k);
                data.view_mut((1, r * n + k), (d, 1)).copy_from(&outputs.column(k));
            }
        }
        let joint = gmm::fit(&data, N_COMPONENTS, &GmmOptions::default(), SEED)?.mixture;
        let springs = Attractors {
            activations: Activations::spread(Drive::Time, 1, aligned[0].duration_s(), 1.0),
            mu: vec![DVector::zeros(d)],
            K: vec![DMatrix::identity(d, d) * kappa_p],
            kappa_v: lambda,
        };
        let output = Some((lambda, Regression::new(&joint, 1)?));
        Ok(TimeDriven { name: "GMR in time", springs, output })
    }

    /// The path (d×T) from rest at `start` and at `from_s` (s) of a movement of `duration_s` (s), a point each
    /// period, for `patience_s` (s). When the movement is over, its time stands still.
    pub fn motion(
        &self,
        start: &DVector<f64>,
        from_s: f64,
        duration_s: f64,
        patience_s: f64,
    ) -> DMatrix<f64> {
        let mut springs = self.springs.clone();
        springs.activations.centers.iter_mut().for_each(|center| *center -= from_s);
        springs.rollout(start, patience_s, PERIOD_S, |t| match &self.output {
            None => DVector::zeros(start.len()),
            Some((lambda, regression)) => {
                let t_s = (from_s + t).min(duration_s);
                regression.output(&DVector::from_element(1, t_s)) * *lambda
            }
        })
    }
}
