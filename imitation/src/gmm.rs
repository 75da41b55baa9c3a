//! Mixtures from data: expectation-maximisation from several starts, and how many components.

mod start;

use std::ops::RangeInclusive;

use nalgebra::{DMatrix, DVector};
use thiserror::Error;

use crate::gaussian::{Gaussian, log_sum_exp};
use crate::mixture::Mixture;

/// Components with less than this many points keep their centre and covariance.
const NO_POINTS: f64 = 1e-8;
/// Spread of a coordinate, relative to its largest value, below which it counts as constant.
const STILL: f64 = 1e-12;

/// How a mixture is fitted.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct GmmOptions {
    /// Starts from different centres; the best fit is kept.
    pub n_starts: usize,
    /// Steps of EM from each start, at most.
    pub n_iterations: usize,
    /// EM ends when a step gains less than this in log-likelihood per point.
    pub tolerance: f64,
    /// ε > 0: what a component of average size gains in variance, relative to each coordinate's own.
    pub regularization: f64,
}

impl Default for GmmOptions {
    fn default() -> GmmOptions {
        GmmOptions { n_starts: 5, n_iterations: 300, tolerance: 1e-7, regularization: 1e-6 }
    }
}

/// A fitted mixture.
#[derive(Clone, Debug, PartialEq)]
pub struct GmmFit {
    pub mixture: Mixture,
    /// Σ log p(x) over the data, in their own units.
    pub log_likelihood: f64,
    /// Steps of EM from the start that was kept.
    pub n_iterations: usize,
}

/// Why a mixture cannot be fitted. Points and coordinates are counted from 1.
#[derive(Clone, Debug, PartialEq, Error)]
pub enum GmmError {
    #[error("K = 0 components: a mixture needs at least one")]
    NoComponents,
    #[error("the range of K is empty: give the smaller number first")]
    NoRange,
    #[error(
        "K = {k} components need at least {needed} points: the recordings have {found}; \
         take fewer components or longer recordings"
    )]
    TooFewPoints { k: usize, needed: usize, found: usize },
    #[error("coordinate {coordinate} never moves (it is always {value}): leave it out")]
    Still { coordinate: usize, value: f64 },
    #[error("coordinate {coordinate} of point {point} is not finite")]
    NotFinite { point: usize, coordinate: usize },
    #[error("the regularization is {0}: it must be positive, 1e-6 for example")]
    Regularization(f64),
}

/// Fits K = `k` components with full covariances to `data` (d×N, one point a column).
///
/// EM maximises the penalised log-likelihood
///
/// Σₙ log Σᵢ πᵢ 𝒩(xₙ | μᵢ, Σᵢ) − (εN/2K) Σᵢ tr Σᵢ⁻¹
///
/// in units of each coordinate's standard deviation, so that the result does not depend on the units
/// of the data, and no component can collapse on a point. Start n draws from stream n of `seed`.
pub fn fit(
    data: &DMatrix<f64>,
    k: usize,
    options: &GmmOptions,
    seed: u64,
) -> Result<GmmFit, GmmError> {
    Standard::new(data, k, options)?.fit(k, options, seed)
}

/// The same with one scale for all coordinates, of which some may never move: for data whose coordinates
/// share a unit and that cannot do without any of them, as rotation vectors.
pub(crate) fn fit_one_scale(
    data: &DMatrix<f64>,
    k: usize,
    options: &GmmOptions,
    seed: u64,
) -> Result<GmmFit, GmmError> {
    Standard::one_scale(data, k, options)?.fit(k, options, seed)
}

/// A fit whose number of components was chosen.
#[derive(Clone, Debug, PartialEq)]
pub struct BicFit {
    pub fit: GmmFit,
    /// Every K with its BIC; the lowest was chosen.
    pub bics: Vec<(usize, f64)>,
}

/// Fits each K of `ks` and keeps the one with the lowest Bayesian information criterion
/// (Schwarz 1978), BIC = p log N − 2 log L, with p = K − 1 + Kd + Kd(d+1)/2 parameters.
///
/// The criterion assumes independent points. Those of a movement are not, so a high sampling rate
/// selects more components than are needed: limit `ks`, or resample to a few hundred points.
pub fn fit_by_bic(
    data: &DMatrix<f64>,
    ks: RangeInclusive<usize>,
    options: &GmmOptions,
    seed: u64,
) -> Result<BicFit, GmmError> {
    let mut best: Option<(f64, GmmFit)> = None;
    let mut bics = Vec::new();
    for k in ks {
        let fit = fit(data, k, options, seed)?;
        let bic = bic(&fit, data.nrows(), data.ncols());
        bics.push((k, bic));
        if best.as_ref().is_none_or(|(lowest, _)| bic < *lowest) {
            best = Some((bic, fit));
        }
    }
    let (_, fit) = best.ok_or(GmmError::NoRange)?;
    Ok(BicFit { fit, bics })
}

fn bic(fit: &GmmFit, d: usize, n: usize) -> f64 {
    let k = fit.mixture.n_components();
    let parameters = k - 1 + k * d + k * d * (d + 1) / 2;
    parameters as f64 * (n as f64).ln() - 2.0 * fit.log_likelihood
}

/// Whether `k` components can be fitted to the data.
fn check(data: &DMatrix<f64>, k: usize, options: &GmmOptions) -> Result<(), GmmError> {
    let (d, n) = data.shape();
    if k == 0 {
        return Err(GmmError::NoComponents);
    }
    if !(options.regularization > 0.0 && options.regularization.is_finite()) {
        return Err(GmmError::Regularization(options.regularization));
    }
    // Each component has a centre and d directions about it.
    let needed = k * (d + 1);
    if n < needed || d == 0 {
        return Err(GmmError::TooFewPoints { k, needed, found: if d == 0 { 0 } else { n } });
    }
    match data.iter().position(|x| !x.is_finite()) {
        Some(i) => Err(GmmError::NotFinite { point: i / d + 1, coordinate: i % d + 1 }),
        None => Ok(()),
    }
}

/// The variance of every coordinate, about its mean: the difference of squares that the library takes
/// is no zero for what never moves.
fn variances(data: &DMatrix<f64>) -> DVector<f64> {
    let mean = data.column_mean();
    let squares = data.column_iter().map(|x| (x - &mean).map(|miss| miss * miss));
    squares.sum::<DVector<f64>>() / data.ncols() as f64
}

/// The data with mean 0 and standard deviation 1 in every coordinate.
struct Standard {
    points: DMatrix<f64>,
    mean: DVector<f64>,
    std: DVector<f64>,
}

impl Standard {
    fn new(data: &DMatrix<f64>, k: usize, options: &GmmOptions) -> Result<Standard, GmmError> {
        check(data, k, options)?;
        let std = variances(data).map(f64::sqrt);
        for (c, std) in std.iter().enumerate() {
            if *std <= STILL * data.row(c).amax() {
                return Err(GmmError::Still { coordinate: c + 1, value: data[(c, 0)] });
            }
        }
        Ok(Standard::scaled(data, std))
    }

    /// The same with the root of the mean variance for every coordinate.
    fn one_scale(
        data: &DMatrix<f64>,
        k: usize,
        options: &GmmOptions,
    ) -> Result<Standard, GmmError> {
        check(data, k, options)?;
        let std = variances(data).mean().sqrt();
        if std <= STILL * data.amax() {
            return Err(GmmError::Still { coordinate: 1, value: data[(0, 0)] });
        }
        Ok(Standard::scaled(data, DVector::from_element(data.nrows(), std)))
    }

    fn scaled(data: &DMatrix<f64>, std: DVector<f64>) -> Standard {
        let mean = data.column_mean();
        let (d, n) = data.shape();
        let points = DMatrix::from_fn(d, n, |c, j| (data[(c, j)] - mean[c]) / std[c]);
        Standard { points, mean, std }
    }

    /// The best of all starts.
    fn fit(&self, k: usize, options: &GmmOptions, seed: u64) -> Result<GmmFit, GmmError> {
        let mut best: Option<Em> = None;
        for start in 0..options.n_starts.max(1) {
            let mut rng = search::normals::stream(seed, start as u64);
            let mut em = Em::new(start::centers(&self.points, k, &mut rng), &self.points);
            em.run(&self.points, options);
            if best.as_ref().is_none_or(|best| em.objective > best.objective) {
                best = Some(em);
            }
        }
        let best = best.expect("there is at least one start");
        Ok(self.back(best))
    }

    /// The fit in the units of the data.
    fn back(&self, em: Em) -> GmmFit {
        let Mixture { priors, means, covariances } = em.mixture;
        let mean = |z: DVector<f64>| &self.mean + z.component_mul(&self.std);
        let scales = DMatrix::from_diagonal(&self.std);
        let covariance = |z: DMatrix<f64>| {
            let scaled = &scales * z * &scales;
            (&scaled + scaled.transpose()) / 2.0
        };
        let volume: f64 = self.std.iter().map(|std| std.ln()).sum();
        GmmFit {
            mixture: Mixture {
                priors,
                means: means.into_iter().map(mean).collect(),
                covariances: covariances.into_iter().map(covariance).collect(),
            },
            log_likelihood: em.log_likelihood - self.points.ncols() as f64 * volume,
            n_iterations: em.n_iterations,
        }
    }
}

/// The state of EM.
struct Em {
    mixture: Mixture,
    log_likelihood: f64,
    /// The penalised log-likelihood, which no step lowers.
    objective: f64,
    n_iterations: usize,
}

impl Em {
    /// From centres (each d), with the covariance of all `points`, which are standardised.
    fn new(centers: Vec<DVector<f64>>, points: &DMatrix<f64>) -> Em {
        let (d, k) = (points.nrows(), centers.len());
        let mixture = Mixture {
            priors: vec![1.0 / k as f64; k],
            means: centers,
            covariances: vec![DMatrix::identity(d, d); k],
        };
        Em {
            mixture,
            log_likelihood: f64::NEG_INFINITY,
            objective: f64::NEG_INFINITY,
            n_iterations: 0,
        }
    }

    fn run(&mut self, points: &DMatrix<f64>, options: &GmmOptions) {
        let gain = options.tolerance * points.ncols() as f64;
        // The first covariances are those of the clusters that the centres come from.
        let clusters = nearest(&self.mixture.means, points);
        maximise(&mut self.mixture, points, &clusters, options);
        let mut h = self.expect(points, options);
        while self.n_iterations < options.n_iterations {
            let before = self.objective;
            maximise(&mut self.mixture, points, &h, options);
            h = self.expect(points, options);
            self.n_iterations += 1;
            if self.objective - before < gain {
                break;
            }
        }
    }

    /// E-step: hᵢ(xₙ) (N×K). Updates the likelihood.
    fn expect(&mut self, points: &DMatrix<f64>, options: &GmmOptions) -> DMatrix<f64> {
        let (n, k) = (points.ncols(), self.mixture.n_components());
        let mut h = DMatrix::zeros(n, k);
        let mut trace = 0.0;
        for i in 0..k {
            let (mean, covariance) = (&self.mixture.means[i], &self.mixture.covariances[i]);
            let gaussian = Gaussian::new(mean.clone(), covariance.clone())
                .expect("the regularisation keeps a covariance positive definite");
            trace += gaussian.precision_trace();
            let log_prior = self.mixture.priors[i].ln();
            let joint = gaussian.log_densities(points).into_iter().map(|log| log_prior + log);
            h.column_mut(i).iter_mut().zip(joint).for_each(|(h, joint)| *h = joint);
        }
        self.log_likelihood = 0.0;
        let mut joint = vec![0.0; k];
        for mut row in h.row_iter_mut() {
            joint.iter_mut().zip(row.iter()).for_each(|(joint, h)| *joint = *h);
            let log_density = log_sum_exp(&joint);
            row.iter_mut().for_each(|h| *h = (*h - log_density).exp());
            self.log_likelihood += log_density;
        }
        self.objective = self.log_likelihood - penalty(options, n, k) / 2.0 * trace;
        h
    }
}

/// εN/K.
fn penalty(options: &GmmOptions, n: usize, k: usize) -> f64 {
    options.regularization * n as f64 / k as f64
}

/// M-step, from hᵢ(xₙ) (N×K), with Nᵢ = Σₙ hᵢ(xₙ):
///
/// πᵢ = Nᵢ/N,  μᵢ = Σₙ hᵢ(xₙ) xₙ / Nᵢ,  Σᵢ = [Σₙ hᵢ(xₙ)(xₙ−μᵢ)(xₙ−μᵢ)ᵀ + (εN/K) I] / Nᵢ.
fn maximise(mixture: &mut Mixture, points: &DMatrix<f64>, h: &DMatrix<f64>, options: &GmmOptions) {
    let (d, n) = points.shape();
    let penalty = penalty(options, n, h.ncols());
    for (i, weights) in h.column_iter().enumerate() {
        let count = weights.sum();
        mixture.priors[i] = count / n as f64;
        if count < NO_POINTS {
            continue;
        }
        let mean = points * weights / count;
        let mut scaled = points.clone();
        for (mut x, weight) in scaled.column_iter_mut().zip(weights.iter()) {
            x -= &mean;
            x *= weight.sqrt();
        }
        let scatter = &scaled * scaled.transpose();
        mixture.covariances[i] = (scatter + DMatrix::identity(d, d) * penalty) / count;
        mixture.means[i] = mean;
    }
    // The sum of N quotients: exactly one matters to those who check.
    let sum: f64 = mixture.priors.iter().sum();
    mixture.priors.iter_mut().for_each(|prior| *prior /= sum);
}

/// 1 for the nearest centre of each point (N×K).
fn nearest(centers: &[DVector<f64>], points: &DMatrix<f64>) -> DMatrix<f64> {
    let mut h = DMatrix::zeros(points.ncols(), centers.len());
    for (n, x) in points.column_iter().enumerate() {
        h[(n, start::nearest(centers, &x).0)] = 1.0;
    }
    h
}

#[cfg(test)]
mod tests;
