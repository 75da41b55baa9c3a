//! Primitives trained with dmpbbo (Stulp and Raiola), read from the JSON it writes for its C++ side.
//!
//! Its dynamics, for each coordinate, with a goal g(t) that may be delayed:
//!
//! τ ẏ = z,  τ ż = [k(g(t) − y) − d z]/m + f(t),  f(t) = gating(t) · scale · approximator(phase(t)).
//!
//! With y = x that is Eq. (3) with κᴾ = k/(mτ), κᵛ = d/m and the force f(t)/τ + κᴾ[g(t) − x_T].

mod systems;

use nalgebra::{DMatrix, DVector};
use serde::Deserialize;
use thiserror::Error;

use self::systems::{Approximator, PerCoordinate, System};
use crate::activations::{Activations, Drive};
use crate::dmp::{Dmp, Form};
use crate::integrate::from_rest;
use crate::least_squares::about_mean;

/// Times at which the force is compared.
const N_SAMPLES: usize = 1000;

/// A primitive of dmpbbo.
#[derive(Clone, Debug)]
pub struct Dmpbbo {
    kappa_p: f64,
    kappa_v: f64,
    tau: f64,
    start: DVector<f64>,
    goal: DVector<f64>,
    /// What multiplies the output of each approximator: 1 without scaling.
    scales: Vec<f64>,
    /// One a coordinate; empty for a primitive without forces.
    approximators: Vec<Approximator>,
    phase: System,
    gating: System,
    /// g(t), where the goal is delayed.
    goal_system: Option<System>,
}

/// Why a file of dmpbbo cannot be used.
#[derive(Clone, Debug, PartialEq, Error)]
pub enum DmpbboError {
    #[error("this is dmpbbo's jsonpickle file: write the Dmp with `savejson_for_cpp` instead")]
    Pickle,
    /// What the reader of JSON says: a missing field, or a class that is not supported.
    #[error("not a readable dmpbbo Dmp: {0}")]
    Format(String),
    #[error("a {0} is not supported: a Dmp is")]
    Class(String),
    #[error(
        "the damping changes along the movement (_damping_system), which Eq. (3) does not support: \
         train without it"
    )]
    Damping,
    #[error("{0} differs between coordinates, and Eq. (3) has one for all: train with one")]
    Gains(&'static str),
    #[error(
        "_forcing_term_scaling is {0:?}: NO_SCALING, G_MINUS_Y0_SCALING and AMPLITUDE_SCALING are supported"
    )]
    Scaling(String),
    #[error("{field} has {found} values and the primitive {dim} coordinates")]
    Size { field: &'static str, found: usize, dim: usize },
    #[error("{0} must be positive and finite")]
    NotPositive(&'static str),
    #[error("{0} holds a value that is not finite")]
    NotFinite(&'static str),
    #[error("the movement starts with a velocity (_spring_system._x_init): it must start at rest")]
    Moving,
}

/// A primitive of dmpbbo in the plain form of Eq. (3).
#[derive(Clone, Debug, PartialEq)]
pub struct Conversion {
    pub dmp: Dmp,
    /// Largest distance between its path and that of the original, in the unit of x; infinite where one of them is not
    /// finite.
    pub largest_miss: f64,
}

impl Dmpbbo {
    /// Reads what dmpbbo's `savejson_for_cpp` wrote for a `Dmp`.
    ///
    /// Phases and gates may be time, exponential or sigmoid systems, approximators radial basis
    /// functions or locally weighted regression; the rest is refused by name.
    pub fn from_json(text: &str) -> Result<Dmpbbo, DmpbboError> {
        let format = |error: serde_json::Error| DmpbboError::Format(error.to_string());
        let value: serde_json::Value = serde_json::from_str(text).map_err(format)?;
        if text.contains("\"py/object\"") {
            return Err(DmpbboError::Pickle);
        }
        if let Some(class) = value["class"].as_str().filter(|class| *class != "Dmp") {
            return Err(DmpbboError::Class(class.to_string()));
        }
        File::deserialize(value).map_err(format)?.checked()
    }

    /// d.
    pub fn dim(&self) -> usize {
        self.goal.len()
    }

    /// How long the movement takes: τ, s.
    pub fn duration_s(&self) -> f64 {
        self.tau
    }

    /// Eq. (3): f(t)/τ + κᴾ[g(t) − x_T] (d) at `t_s` (s).
    pub fn force(&self, t_s: f64) -> DVector<f64> {
        let (phase, gate) = (self.phase.at(t_s, 0), self.gating.at(t_s, 0));
        DVector::from_fn(self.dim(), |c, _| {
            let output = self.approximators.get(c).map_or(0.0, |a| a.output(phase));
            let delay = self.goal_system.as_ref().map_or(0.0, |g| g.at(t_s, c) - self.goal[c]);
            gate * self.scales[c] * output / self.tau + self.kappa_p * delay
        })
    }

    /// The path (d×T) from its start, at rest, a point each `period_s` (s) over `duration_s` (s).
    pub fn rollout(&self, duration_s: f64, period_s: f64) -> DMatrix<f64> {
        from_rest(&self.start, duration_s, period_s, |t, x, xd| {
            let spring = (&self.goal - x) * self.kappa_p - xd * self.kappa_v;
            (spring + self.force(t)) / self.tau
        })
    }

    /// The plain form with `n_components` ≥ 1 activations over time, each `width_ratio` of the
    /// distance between centres wide: forces by least squares over the movement. More components
    /// come nearer: of 0.5 m movements trained with dmpbbo, 8 missed 2 to 4 mm and 16 less than 1 mm.
    pub fn plain(&self, n_components: usize, width_ratio: f64) -> Conversion {
        let period_s = self.tau / (N_SAMPLES - 1) as f64;
        let times = (0..N_SAMPLES).map(|k| k as f64 * period_s);
        let activations = Activations::spread(Drive::Time, n_components, self.tau, width_ratio);
        let mut wanted = DMatrix::zeros(N_SAMPLES, self.dim());
        for (k, t_s) in times.clone().enumerate() {
            wanted.set_row(k, &self.force(t_s).transpose());
        }
        let forces = about_mean(&activations.rows(times), &wanted)
            .expect("the weights of every sample sum to one");
        let dmp = Dmp {
            form: Form::Plain,
            activations,
            forces: forces.row_iter().map(|row| row.transpose()).collect(),
            tau: self.tau,
            kappa_p: self.kappa_p,
            kappa_v: self.kappa_v,
            start: self.start.clone(),
            goal: self.goal.clone(),
            duration_s: self.tau,
        };
        let misses = dmp.rollout(self.tau, period_s) - self.rollout(self.tau, period_s);
        let largest =
            |so_far: f64, miss: f64| if miss.is_nan() { f64::INFINITY } else { so_far.max(miss) };
        let largest_miss = misses.column_iter().map(|miss| miss.norm()).fold(0.0, largest);
        Conversion { dmp, largest_miss }
    }
}

/// What is read of a file; fields that only dmpbbo needs are skipped.
#[derive(Deserialize)]
struct File {
    _tau: f64,
    _dim_y: usize,
    _x_init: Vec<f64>,
    /// Written once the start was set; until then the start stands in `_x_init`.
    #[serde(default)]
    _y_init: Option<Vec<f64>>,
    _y_attr: Vec<f64>,
    #[serde(default)]
    _function_approximators: Option<Vec<Approximator>>,
    _forcing_term_scaling: String,
    #[serde(default)]
    _scaling_amplitudes: Option<Vec<f64>>,
    _spring_system: Spring,
    _phase_system: System,
    _gating_system: System,
    #[serde(default)]
    _goal_system: Option<System>,
    #[serde(default)]
    _damping_system: Option<serde_json::Value>,
}

#[derive(Deserialize)]
struct Spring {
    _x_init: Vec<f64>,
    damping_coefficient: PerCoordinate,
    spring_constant: PerCoordinate,
    mass: PerCoordinate,
}

impl File {
    fn checked(self) -> Result<Dmpbbo, DmpbboError> {
        let dim = self._dim_y;
        if dim == 0 {
            return Err(DmpbboError::NotPositive("_dim_y"));
        }
        if self._damping_system.is_some() {
            return Err(DmpbboError::Damping);
        }
        sized("_y_attr", &self._y_attr, dim)?;
        let tau = positive("_tau", self._tau)?;
        let spring = &self._spring_system;
        let stiffness =
            positive("spring_constant", one("spring_constant", &spring.spring_constant)?)?;
        let damping = positive(
            "damping_coefficient",
            one("damping_coefficient", &spring.damping_coefficient)?,
        )?;
        let mass = positive("mass", one("mass", &spring.mass)?)?;
        // The springs integrate from their own start.
        sized("_spring_system._x_init", &spring._x_init, 2 * dim)?;
        if spring._x_init[dim..].iter().any(|z| *z != 0.0) {
            return Err(DmpbboError::Moving);
        }
        let scales = self.scales()?;
        let approximators = self._function_approximators.unwrap_or_default();
        if !approximators.is_empty() && approximators.len() != dim {
            let (field, found) = ("_function_approximators", approximators.len());
            return Err(DmpbboError::Size { field, found, dim });
        }
        approximators.iter().try_for_each(Approximator::check)?;
        self._phase_system.check("_phase_system", 1)?;
        self._gating_system.check("_gating_system", 1)?;
        if let Some(goal_system) = &self._goal_system {
            goal_system.check("_goal_system", dim)?;
        }
        Ok(Dmpbbo {
            kappa_p: positive(
                "spring_constant relative to mass and _tau",
                stiffness / (mass * tau),
            )?,
            kappa_v: positive("damping_coefficient relative to mass", damping / mass)?,
            tau,
            start: DVector::from_column_slice(&self._spring_system._x_init[..dim]),
            goal: DVector::from_vec(self._y_attr),
            scales,
            approximators,
            phase: self._phase_system,
            gating: self._gating_system,
            goal_system: self._goal_system,
        })
    }

    fn scales(&self) -> Result<Vec<f64>, DmpbboError> {
        let dim = self._dim_y;
        match self._forcing_term_scaling.as_str() {
            "NO_SCALING" => Ok(vec![1.0; dim]),
            "AMPLITUDE_SCALING" => {
                let amplitudes = self._scaling_amplitudes.clone().unwrap_or_default();
                sized("_scaling_amplitudes", &amplitudes, dim)?;
                Ok(amplitudes)
            }
            "G_MINUS_Y0_SCALING" => {
                let start = match &self._y_init {
                    Some(y_init) => y_init,
                    None => &self._x_init,
                };
                if start.len() < dim {
                    return Err(DmpbboError::Size { field: "_y_init", found: start.len(), dim });
                }
                sized("_y_init", &start[..dim], dim)?;
                Ok(self._y_attr.iter().zip(start).map(|(goal, start)| goal - start).collect())
            }
            other => Err(DmpbboError::Scaling(other.to_string())),
        }
    }
}

/// A step of it is not zero either, so subnormal numbers are none.
fn positive(field: &'static str, value: f64) -> Result<f64, DmpbboError> {
    let is_positive = value > 0.0 && value.is_normal();
    is_positive.then_some(value).ok_or(DmpbboError::NotPositive(field))
}

fn one(field: &'static str, values: &PerCoordinate) -> Result<f64, DmpbboError> {
    values.all().ok_or(DmpbboError::Gains(field))
}

fn sized(field: &'static str, values: &[f64], dim: usize) -> Result<(), DmpbboError> {
    if values.len() != dim {
        return Err(DmpbboError::Size { field, found: values.len(), dim });
    }
    let finite = values.iter().all(|x| x.is_finite());
    finite.then_some(()).ok_or(DmpbboError::NotFinite(field))
}

#[cfg(test)]
mod tests;
