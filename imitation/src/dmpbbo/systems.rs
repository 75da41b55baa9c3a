//! The parts of a primitive of dmpbbo: its phases, gates and delayed goals, and its approximators.

use serde::Deserialize;

use super::DmpbboError;

/// A number, or one for each coordinate.
#[derive(Clone, Debug, Deserialize)]
#[serde(untagged)]
pub enum PerCoordinate {
    All(f64),
    Each(Vec<f64>),
}

impl PerCoordinate {
    /// The number of coordinate `c`, which [`PerCoordinate::check`] has seen to be there.
    fn at(&self, c: usize) -> f64 {
        match self {
            PerCoordinate::All(value) => *value,
            PerCoordinate::Each(values) => values[c],
        }
    }

    /// The number that holds for all coordinates, if there is one.
    pub fn all(&self) -> Option<f64> {
        match self {
            PerCoordinate::All(value) => Some(*value),
            PerCoordinate::Each(values) => {
                let first = *values.first()?;
                values.iter().all(|value| *value == first).then_some(first)
            }
        }
    }

    fn check(&self, field: &'static str, dim: usize) -> Result<(), DmpbboError> {
        match self {
            PerCoordinate::All(value) => super::sized(field, &[*value], 1),
            PerCoordinate::Each(values) => super::sized(field, values, dim),
        }
    }
}

/// A first-order system in closed form.
#[derive(Clone, Debug, Deserialize)]
#[serde(tag = "class")]
pub enum System {
    /// From 0 to 1 in τ, or from 1 to 0, and held.
    #[serde(rename = "TimeSystem")]
    Time {
        #[serde(rename = "_tau")]
        tau: f64,
        #[serde(rename = "_count_down")]
        count_down: bool,
    },
    /// τ ẋ = α(x_attr − x).
    #[serde(rename = "ExponentialSystem")]
    Exponential {
        #[serde(rename = "_tau")]
        tau: f64,
        #[serde(rename = "_x_init")]
        x_init: Vec<f64>,
        #[serde(rename = "_x_attr")]
        x_attr: Vec<f64>,
        alpha: PerCoordinate,
    },
    /// ẋ = r x (1 − x/K), with K such that x is K/2 at the share `inflection_ratio` of τ.
    #[serde(rename = "SigmoidSystem")]
    Sigmoid {
        #[serde(rename = "_tau")]
        tau: f64,
        #[serde(rename = "_x_init")]
        x_init: Vec<f64>,
        #[serde(rename = "_max_rate")]
        max_rate: PerCoordinate,
        #[serde(rename = "_inflection_ratio")]
        inflection_ratio: PerCoordinate,
    },
}

impl System {
    /// The state of coordinate `c` at `t_s` (s).
    pub fn at(&self, t_s: f64, c: usize) -> f64 {
        match self {
            System::Time { tau, count_down } => {
                let passed = (t_s / tau).clamp(0.0, 1.0);
                if *count_down { 1.0 - passed } else { passed }
            }
            System::Exponential { tau, x_init, x_attr, alpha } => {
                x_attr[c] + (x_init[c] - x_attr[c]) * (-alpha.at(c) * t_s / tau).exp()
            }
            System::Sigmoid { tau, x_init, max_rate, inflection_ratio } => {
                // x = K/(1 + b exp(−rt)) with b = K/x₀ − 1, and b exp(−rt) = 1 at the inflection.
                let (r, inflection_s) = (max_rate.at(c), inflection_ratio.at(c) * tau);
                let b = (r * inflection_s).exp();
                x_init[c] * (1.0 + b) / (1.0 + b * (-r * t_s).exp())
            }
        }
    }

    /// Whether it has `dim` coordinates and values that can be computed with.
    pub fn check(&self, field: &'static str, dim: usize) -> Result<(), DmpbboError> {
        match self {
            // One clock, whatever is asked of it.
            System::Time { tau, .. } if dim == 1 => super::positive(field, *tau).map(|_| ()),
            System::Time { .. } => Err(DmpbboError::Size { field, found: 1, dim }),
            System::Exponential { tau, x_init, x_attr, alpha } => {
                super::positive(field, *tau)?;
                super::sized(field, x_init, dim)?;
                super::sized(field, x_attr, dim)?;
                alpha.check(field, dim)
            }
            System::Sigmoid { tau, x_init, max_rate, inflection_ratio } => {
                super::positive(field, *tau)?;
                super::sized(field, x_init, dim)?;
                max_rate.check(field, dim)?;
                inflection_ratio.check(field, dim)
            }
        }
    }
}

/// A function of the phase.
#[derive(Clone, Debug, Deserialize)]
#[serde(tag = "class")]
pub enum Approximator {
    /// Σᵢ wᵢ φᵢ(s): radial basis functions, not normalised.
    #[serde(rename = "FunctionApproximatorRBFN")]
    RadialBasis {
        #[serde(rename = "_model_params")]
        model: RadialBasis,
    },
    /// Σᵢ φᵢ(s)(aᵢ s + bᵢ) / Σᵢ φᵢ(s): locally weighted regression.
    #[serde(rename = "FunctionApproximatorLWR")]
    Lines {
        #[serde(rename = "_model_params")]
        model: Lines,
    },
}

#[derive(Clone, Debug, Deserialize)]
pub struct RadialBasis {
    centers: Vec<[f64; 1]>,
    widths: Vec<[f64; 1]>,
    weights: Vec<[f64; 1]>,
}

#[derive(Clone, Debug, Deserialize)]
pub struct Lines {
    centers: Vec<[f64; 1]>,
    widths: Vec<[f64; 1]>,
    slopes: Vec<[f64; 1]>,
    offsets: Vec<[f64; 1]>,
}

/// log φ(s) = −(s − c)²/2w².
fn log_kernel(s: f64, center: f64, width: f64) -> f64 {
    -0.5 * ((s - center) / width).powi(2)
}

impl Approximator {
    pub fn output(&self, s: f64) -> f64 {
        match self {
            Approximator::RadialBasis { model } => {
                let kernels = model.centers.iter().zip(&model.widths).zip(&model.weights);
                kernels.map(|(([c], [w]), [weight])| weight * log_kernel(s, *c, *w).exp()).sum()
            }
            Approximator::Lines { model } => {
                let kernels = model.centers.iter().zip(&model.widths);
                let logs: Vec<f64> = kernels.map(|([c], [w])| log_kernel(s, *c, *w)).collect();
                let weights = crate::gaussian::normalised(&logs);
                let lines = model.slopes.iter().zip(&model.offsets);
                weights.iter().zip(lines).map(|(h, ([a], [b]))| h * (a * s + b)).sum()
            }
        }
    }

    /// Whether every basis function has its values, and they can be computed with.
    pub fn check(&self) -> Result<(), DmpbboError> {
        let (widths, columns) = match self {
            Approximator::RadialBasis { model } => {
                (&model.widths, vec![&model.centers, &model.widths, &model.weights])
            }
            Approximator::Lines { model } => {
                (&model.widths, vec![&model.centers, &model.widths, &model.slopes, &model.offsets])
            }
        };
        if widths.is_empty() {
            return Err(DmpbboError::Format("an approximator has no basis functions".into()));
        }
        let field = "_function_approximators";
        columns
            .iter()
            .try_for_each(|column| super::sized(field, column.as_flattened(), widths.len()))?;
        widths.iter().try_for_each(|[width]| super::positive("widths", *width).map(|_| ()))
    }
}
