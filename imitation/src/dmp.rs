//! Dynamic movement primitives, Eq. (3), and their reading as attractors, Eq. (4).

use nalgebra::{DMatrix, DVector};
use thiserror::Error;

use crate::activations::{Activations, Drive};
use crate::attractors::Attractors;
use crate::integrate::from_rest;
use crate::least_squares::{about_mean, least_squares};
use crate::recording::{Recording, RecordingError, check_set};

/// Travel of a coordinate from start to end, relative to its range, below which the scaled form
/// cannot move it.
const MIN_TRAVEL: f64 = 0.01;
/// Times at which a primitive is read as attractors.
const N_SAMPLES: usize = 400;

/// How the forces act.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Form {
    /// f = Σᵢ hᵢ fᵢ, as in Eq. (3). The last force stays after the end: the movement comes to rest at
    /// x_T + f_K/κᴾ, with a fitted f_K of nearly 0.
    Plain,
    /// f = s [x_T − x₀] Σᵢ hᵢ(s) fᵢ, coordinate by coordinate, with a decaying s: the movement scales
    /// with the distance to its end, and the force vanishes there. (Equation below Eq. (3).)
    Scaled,
}

/// Eq. (3): τ ẍ = κᴾ[x_T − x] − κᵛ ẋ + f.
#[derive(Clone, Debug, PartialEq)]
pub struct Dmp {
    pub form: Form,
    /// hᵢ with what drives them: time, or s = exp(−αt/τ) of the canonical system τ ṡ = −α s.
    pub activations: Activations,
    /// fᵢ (d).
    pub forces: Vec<DVector<f64>>,
    /// τ, s; 1 gives accelerations in s⁻² of κᴾ as in Eq. (5).
    pub tau: f64,
    pub kappa_p: f64,
    pub kappa_v: f64,
    /// x₀ (d).
    pub start: DVector<f64>,
    /// x_T (d).
    pub goal: DVector<f64>,
    /// How long the demonstrated movement took, s.
    pub duration_s: f64,
}

/// How a primitive is fitted.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DmpOptions {
    pub form: Form,
    /// The scaled form needs a decay; see [`decay_rate`].
    pub drive: Drive,
    pub n_components: usize,
    /// σ of an activation relative to the distance between centres.
    pub width_ratio: f64,
    pub tau: f64,
    pub kappa_p: f64,
    pub kappa_v: f64,
}

impl Default for DmpOptions {
    /// 20 components over time, κᴾ = 200 s⁻², critically damped: κᵛ = 2√(κᴾτ).
    fn default() -> DmpOptions {
        DmpOptions {
            form: Form::Plain,
            drive: Drive::Time,
            n_components: 20,
            width_ratio: 0.5,
            tau: 1.0,
            kappa_p: 200.0,
            kappa_v: 2.0 * 200_f64.sqrt(),
        }
    }
}

/// Why a primitive cannot be fitted.
#[derive(Clone, Debug, PartialEq, Error)]
pub enum DmpError {
    #[error(transparent)]
    Recordings(#[from] RecordingError),
    #[error("a primitive needs at least one component")]
    NoComponents,
    #[error("τ = {tau} and κᴾ = {kappa_p} must be positive, and κᵛ = {kappa_v} not negative")]
    Gains { tau: f64, kappa_p: f64, kappa_v: f64 },
    #[error("the scaled form is driven by a decay, not by time: give its rate")]
    ScaledByTime,
    /// Coordinates are counted from 1.
    #[error(
        "coordinate {coordinate} ends where it starts (it moves by {travel} within a range of \
         {range}): the scaled form cannot move it; use the plain form"
    )]
    ScaledStill { coordinate: usize, travel: f64, range: f64 },
    #[error("no activation reaches the movement: check the rate of the decay and the widths")]
    Activations,
}

/// α/τ (s⁻¹) with which s = exp(−αt/τ) is 0.01 after `duration_s` (s).
pub fn decay_rate(duration_s: f64) -> f64 {
    100_f64.ln() / duration_s
}

/// A primitive read as attractors.
#[derive(Clone, Debug, PartialEq)]
pub struct Reading {
    pub attractors: Attractors,
    /// Largest distance, over the movement, between the attractor of the primitive and that of the
    /// reading, in the unit of x; 0 for the plain form.
    pub largest_miss: f64,
}

impl Dmp {
    /// The forces that make the primitive follow `recordings`, by least squares over all their points:
    ///
    /// Σᵢ hᵢ fᵢ ≈ τ ẍ + κᵛ ẋ − κᴾ[x_T − x],
    ///
    /// where x_T is each recording's own end; in the scaled form hᵢ is multiplied by s and by the
    /// recording's own [x_T − x₀]. The primitive starts and ends at the means. Recordings are taken to
    /// share a clock: align them first if they do not.
    pub fn fit(recordings: &[Recording], options: &DmpOptions) -> Result<Dmp, DmpError> {
        let d = check_set(recordings)?;
        options.check()?;
        let duration_s = recordings.iter().map(Recording::duration_s).fold(0.0, f64::max);
        let DmpOptions { form, drive, n_components, width_ratio, tau, kappa_p, kappa_v } = *options;
        let mut dmp = Dmp {
            form,
            activations: Activations::spread(drive, n_components, duration_s, width_ratio),
            forces: vec![DVector::zeros(d); n_components],
            tau,
            kappa_p,
            kappa_v,
            start: mean(recordings.iter().map(|r| r.points.column(0).clone_owned())),
            goal: mean(recordings.iter().map(end)),
            duration_s,
        };
        for c in 0..d {
            if form == Form::Scaled {
                check_travel(recordings, c)?;
            }
            let (h, forces) = dmp.equations(recordings, c);
            let solved = match form {
                Form::Plain => about_mean(&h, &forces),
                Form::Scaled => least_squares(&h, &forces),
            };
            let solved = solved.ok_or(DmpError::Activations)?;
            dmp.forces.iter_mut().zip(solved.iter()).for_each(|(f, solved)| f[c] = *solved);
        }
        Ok(dmp)
    }

    /// What multiplies the forces of coordinate `c` (N×K), and what they should add up to (N×1).
    fn equations(&self, recordings: &[Recording], c: usize) -> (DMatrix<f64>, DMatrix<f64>) {
        let n: usize = recordings.iter().map(Recording::n_points).sum();
        let mut h = DMatrix::zeros(n, self.forces.len());
        let mut forces = DMatrix::zeros(n, 1);
        let mut row = 0;
        for recording in recordings {
            let (velocities, accelerations) = (recording.velocities(), recording.accelerations());
            let travel = end(recording)[c] - recording.points[(c, 0)];
            for t in 0..recording.n_points() {
                let t_s = recording.time_s(t);
                let scale = self.scale(t_s, travel);
                h.set_row(row, &(self.activations.at(t_s) * scale).transpose());
                forces[row] = self.tau * accelerations[(c, t)] + self.kappa_v * velocities[(c, t)]
                    - self.kappa_p * (end(recording)[c] - recording.points[(c, t)]);
                row += 1;
            }
        }
        (h, forces)
    }

    /// s[x_T − x₀] of one coordinate, or 1 in the plain form.
    fn scale(&self, t_s: f64, travel: f64) -> f64 {
        match self.form {
            Form::Plain => 1.0,
            Form::Scaled => self.activations.drive.at(t_s) * travel,
        }
    }

    /// f (d) at `t_s` (s) after the start.
    pub fn force(&self, t_s: f64) -> DVector<f64> {
        let h = self.activations.at(t_s);
        let zero = DVector::zeros(self.goal.len());
        let sum = h.iter().zip(&self.forces).fold(zero, |sum, (h, f)| sum + f * *h);
        let travel = &self.goal - &self.start;
        sum.zip_map(&travel, |f, travel| f * self.scale(t_s, travel))
    }

    /// ẍ (d) of Eq. (3) at `t_s` (s), position `x` and velocity `xd` (d each).
    pub fn acceleration(&self, t_s: f64, x: &DVector<f64>, xd: &DVector<f64>) -> DVector<f64> {
        let spring = (&self.goal - x) * self.kappa_p - xd * self.kappa_v;
        (spring + self.force(t_s)) / self.tau
    }

    /// The path (d×T) from rest at x₀, a point each `period_s` (s) over `duration_s` (s).
    pub fn rollout(&self, duration_s: f64, period_s: f64) -> DMatrix<f64> {
        from_rest(&self.start, duration_s, period_s, |t, x, xd| self.acceleration(t, x, xd))
    }

    /// The point the springs pull to at `t_s` (s), for either form: x_T + f(t)/κᴾ (d).
    pub fn attractor(&self, t_s: f64) -> DVector<f64> {
        &self.goal + self.force(t_s) / self.kappa_p
    }

    /// Eq. (4): the primitive as attractors with Kᵢ = (κᴾ/τ) I and damping κᵛ/τ.
    ///
    /// In the plain form, since the hᵢ sum to one, κᴾ[x_T − x] + Σᵢ hᵢ fᵢ = Σᵢ hᵢ κᴾ[μᵢ − x] with
    /// μᵢ = x_T + fᵢ/κᴾ: the two are the same for all x, and for all times.
    ///
    /// In the scaled form the attractor x_T + s [x_T − x₀] Σᵢ hᵢ fᵢ/κᴾ moves with s also where one
    /// component has all the weight, and no constant μᵢ say the same. Those returned are nearest to it
    /// over the movement, by least squares; `largest_miss` says how near. They hold for this x₀ and x_T
    /// only: attractors do not scale.
    pub fn attractors(&self) -> Reading {
        let d = self.goal.len();
        let (mu, largest_miss) = match self.form {
            Form::Plain => {
                let mu = self.forces.iter().map(|f| &self.goal + f / self.kappa_p);
                (mu.collect(), 0.0)
            }
            Form::Scaled => self.nearest_attractors(),
        };
        let K = vec![DMatrix::from_diagonal_element(d, d, self.kappa_p / self.tau); mu.len()];
        let (activations, kappa_v) = (self.activations.clone(), self.kappa_v / self.tau);
        Reading { attractors: Attractors { activations, mu, K, kappa_v }, largest_miss }
    }

    fn nearest_attractors(&self) -> (Vec<DVector<f64>>, f64) {
        let time = |k: usize| self.duration_s * k as f64 / (N_SAMPLES - 1) as f64;
        let h = self.activations.rows((0..N_SAMPLES).map(time));
        let mut wanted = DMatrix::zeros(N_SAMPLES, self.goal.len());
        for k in 0..N_SAMPLES {
            wanted.set_row(k, &self.attractor(time(k)).transpose());
        }
        // Weights that sum to one are never all 0.
        let mu = about_mean(&h, &wanted).expect("the weights of every sample sum to one");
        let misses = (h * &mu - wanted).row_iter().map(|miss| miss.norm()).fold(0.0, f64::max);
        (mu.row_iter().map(|row| row.transpose()).collect(), misses)
    }
}

impl DmpOptions {
    fn check(&self) -> Result<(), DmpError> {
        let DmpOptions { tau, kappa_p, kappa_v, .. } = *self;
        if self.n_components == 0 {
            return Err(DmpError::NoComponents);
        }
        if !(tau > 0.0 && kappa_p > 0.0 && kappa_v >= 0.0) {
            return Err(DmpError::Gains { tau, kappa_p, kappa_v });
        }
        if self.form == Form::Scaled && self.drive == Drive::Time {
            return Err(DmpError::ScaledByTime);
        }
        Ok(())
    }
}

/// Whether coordinate `c` ends far enough from its start in any of the recordings.
fn check_travel(recordings: &[Recording], c: usize) -> Result<(), DmpError> {
    let largest = |of: &dyn Fn(&Recording) -> f64| recordings.iter().map(of).fold(0.0, f64::max);
    let travel = largest(&|r| (end(r)[c] - r.points[(c, 0)]).abs());
    let range = largest(&|r| r.points.row(c).max() - r.points.row(c).min());
    if travel <= MIN_TRAVEL * range {
        return Err(DmpError::ScaledStill { coordinate: c + 1, travel, range });
    }
    Ok(())
}

fn end(recording: &Recording) -> DVector<f64> {
    recording.points.column(recording.n_points() - 1).clone_owned()
}

fn mean(vectors: impl ExactSizeIterator<Item = DVector<f64>>) -> DVector<f64> {
    let n = vectors.len() as f64;
    vectors.reduce(|sum, vector| sum + vector).map_or_else(|| DVector::zeros(0), |sum| sum / n)
}

#[cfg(test)]
mod tests;
