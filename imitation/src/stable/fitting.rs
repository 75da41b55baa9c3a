//! From courses to a certified field, in units of the recordings' own size and speed.

use nalgebra::{DMatrix, DVector};

use super::course::{Course, N_POINTS, directions};
use super::objective::{Objective, Way};
use super::parameters::{Component, Model, Parameters};
use super::samples::Samples;
use super::{StableError, StableOptions, lbfgs, metric};
use crate::gmm::{self, GmmOptions};
use crate::systems::Systems;

/// Points of a path from which P is found, samples of velocity on it, and points of a way along it.
const N_METRIC: usize = 80;
const N_SAMPLES: usize = 100;
const N_WAY: usize = 60;
/// Ways begin at these shares of a path.
const WAY_STARTS: [f64; 3] = [0.0, 0.27, 0.53];
/// Weight of directions beside places in the mixture that a fit begins with.
const DIRECTION: f64 = 0.7;
/// Added to the variances of its components.
const WIDER: f64 = 0.01;
/// Steps of the fit to velocities, and of that to ways.
const N_ROUGH: usize = 200;
const N_FINE: usize = 300;
/// Weights of directions and of velocities beside ways.
const DIRECTION_WEIGHT: f64 = 0.1;
const VELOCITY_WEIGHT: f64 = 0.1;
/// ε: every system halves V in less than some 20 of the recordings' own times.
const SLOWEST: f64 = 0.02;
/// N in the systems that a fit begins with, at least.
const FIRST_SLOWEST: f64 = 0.1;

/// Courses in units of their size (the rms distance from the end, by √2) and of their speed.
pub(super) struct Scaled {
    size: f64,
    /// Unit of time, s.
    time_s: f64,
    /// As recorded, and pulled towards the end so that V falls along them (d×[`N_POINTS`]).
    recorded: Vec<DMatrix<f64>>,
    certified: Vec<DMatrix<f64>>,
    /// Along the certified paths (d×N).
    places: DMatrix<f64>,
    velocities: DMatrix<f64>,
    /// L with P = LLᵀ.
    L: DMatrix<f64>,
}

impl Scaled {
    pub fn new(courses: &[Course], seed: u64) -> Scaled {
        let rms = |values: &mut dyn Iterator<Item = f64>| {
            let (sum, n) = values.fold((0.0, 0), |(sum, n), x| (sum + x * x, n + 1));
            (sum / n as f64 / 2.0).sqrt()
        };
        let points = courses.iter().flat_map(|course| course.points.column_iter());
        let size = rms(&mut points.map(|x| x.norm()));
        let speed = rms(&mut courses.iter().flat_map(|course| course.speeds.iter().copied()));
        let recorded: Vec<DMatrix<f64>> =
            courses.iter().map(|course| &course.points / size).collect();
        let coarse: Vec<DMatrix<f64>> =
            recorded.iter().map(|path| path.select_columns(&spread(N_POINTS, N_METRIC))).collect();
        let L = metric::metric(&coarse, seed);

        let (mut certified, mut places, mut velocities) = (Vec::new(), Vec::new(), Vec::new());
        for (path, course) in recorded.iter().zip(courses) {
            let pulled = metric::pulled(path, &L);
            let directions = directions(&pulled);
            // The end itself teaches nothing: the field is 0 there.
            for k in &spread(N_POINTS, N_SAMPLES)[..N_SAMPLES - 1] {
                places.push(pulled.column(*k).clone_owned());
                velocities.push(directions.column(*k) * (course.speeds[*k] / speed));
            }
            certified.push(pulled);
        }
        Scaled {
            size,
            time_s: size / speed,
            recorded,
            certified,
            places: DMatrix::from_columns(&places),
            velocities: DMatrix::from_columns(&velocities),
            L,
        }
    }

    /// How far the points of each course were pulled, for V to fall along it, in the unit of the recordings.
    pub fn departures(&self) -> impl Iterator<Item = Vec<f64>> {
        let departures = |(recorded, certified): (&DMatrix<f64>, &DMatrix<f64>)| {
            (recorded - certified).column_iter().map(|off| off.norm() * self.size).collect()
        };
        self.recorded.iter().zip(&self.certified).map(departures)
    }

    /// The field with its end in `target`, and P, in the units of the recordings.
    pub fn fit(
        &self,
        options: &StableOptions,
        target: &DVector<f64>,
        seed: u64,
    ) -> Result<(Systems, DMatrix<f64>), StableError> {
        let damping = options.damping * self.time_s;
        let leaves_room = damping > 2.0 * SLOWEST;
        if !leaves_room {
            let (duration_s, needed) = (self.time_s, 2.0 * SLOWEST / self.time_s);
            return Err(StableError::Damping { damping: options.damping, duration_s, needed });
        }
        let d = target.len();
        let parameters = Parameters { d, k: options.n_components, damping, slowest: SLOWEST };
        let samples = Samples::around(&self.places, &self.velocities, options.return_weight, seed);
        let ways = self.ways();
        let mut best: Option<(f64, DVector<f64>)> = None;
        for start in 0..options.n_starts.max(1) {
            let first = parameters.pack(&self.first(&parameters, start, seed)?);
            let objective = |ways, direction_weight, velocity_weight| Objective {
                parameters,
                start: first.clone(),
                samples: &samples,
                ways,
                direction_weight,
                velocity_weight,
            };
            let rough = objective(&[], 0.0, 1.0);
            let fine = objective(&ways, DIRECTION_WEIGHT, VELOCITY_WEIGHT);
            let (_, theta) =
                lbfgs::minimise(first.clone(), N_ROUGH, |theta, by| rough.value(theta, by));
            let found = lbfgs::minimise(theta, N_FINE, |theta, by| fine.value(theta, by));
            if best.as_ref().is_none_or(|best| found.0 < best.0) {
                best = Some(found);
            }
        }
        let (_, theta) = best.expect("there is at least one start");
        self.in_units(&parameters, &parameters.unpack(&theta), target)
    }

    /// What a fit begins with: a mixture over places and directions, and in each of its components the
    /// system that fits the velocities there best.
    fn first(
        &self,
        parameters: &Parameters,
        start: usize,
        seed: u64,
    ) -> Result<Model, StableError> {
        let (d, n) = self.places.shape();
        let mut points = self.places.clone().resize_vertically(2 * d, 0.0);
        for (k, v) in self.velocities.column_iter().enumerate() {
            points.rows_mut(d, d).set_column(k, &(v * (DIRECTION / v.norm().max(0.1))));
        }
        let gmm_options = GmmOptions { n_starts: 1, regularization: 1e-3, ..GmmOptions::default() };
        // Another stream of starts for each fit.
        let seed = seed.wrapping_add((start as u64) << 48);
        let mixture = gmm::fit_one_scale(&points, parameters.k, &gmm_options, seed)?.mixture;
        let h: Vec<DVector<f64>> =
            points.column_iter().map(|x| mixture.responsibilities(&x.clone_owned())).collect();
        let component = |i: usize| {
            let weights: Vec<f64> = (0..n).map(|k| h[k][i]).collect();
            self.first_component(parameters, mixture.priors[i], &weights)
        };
        let components: Option<Vec<Component>> = (0..parameters.k).map(component).collect();
        Ok(Model { L: self.L.clone(), components: components.ok_or(StableError::Overflow)? })
    }

    /// The moments of the places under `weights`, and the least-squares system made stable.
    fn first_component(
        &self,
        parameters: &Parameters,
        prior: f64,
        weights: &[f64],
    ) -> Option<Component> {
        let (d, n) = self.places.shape();
        let sum = weights.iter().sum::<f64>().max(1e-9);
        let center: DVector<f64> = (0..n).map(|k| self.places.column(k) * (weights[k] / sum)).sum();
        let mut covariance = DMatrix::from_diagonal_element(d, d, WIDER);
        let mut inputs = DMatrix::from_diagonal_element(d, d, WIDER);
        let mut outputs = DMatrix::<f64>::zeros(d, d);
        for (k, weight) in weights.iter().enumerate() {
            let off = self.places.column(k) - &center;
            covariance.ger(weight / sum, &off, &off, 1.0);
            let (y, yd) =
                (self.L.tr_mul(&self.places.column(k)), self.L.tr_mul(&self.velocities.column(k)));
            let weight = weight / (yd.norm_squared() + 0.1);
            inputs.ger(weight, &y, &y, 1.0);
            outputs.ger(weight, &yd, &y, 1.0);
        }
        let A = inputs.cholesky()?.solve(&outputs.transpose()).transpose();
        let mut falling = (-(&A + A.transpose()) / 2.0).symmetric_eigen();
        falling.eigenvalues.apply(|rate| *rate = rate.max(FIRST_SLOWEST));
        let (B, Z) = parameters.factors(falling.recompose(), &((&A - A.transpose()) / 2.0))?;
        let G = covariance.cholesky()?.unpack();
        Some(Component { log_prior: prior.max(1e-9).ln(), center, G, B, Z })
    }

    /// Where motions from the recordings' starts, and from places along them, should be.
    fn ways(&self) -> Vec<Way> {
        let mut ways = Vec::new();
        for (recorded, certified) in self.recorded.iter().zip(&self.certified) {
            for (i, share) in WAY_STARTS.into_iter().enumerate() {
                let from = (share * N_POINTS as f64) as usize;
                let mut lengths = vec![0.0];
                for k in from + 1..N_POINTS {
                    let step = (certified.column(k) - certified.column(k - 1)).norm();
                    lengths.push(lengths[lengths.len() - 1] + step);
                }
                // As far along the path that can be followed, the place that was recorded.
                let step = lengths[lengths.len() - 1] / N_WAY as f64;
                let mut points = DMatrix::zeros(self.L.nrows(), N_WAY);
                let mut k = 0;
                for (j, mut point) in points.column_iter_mut().enumerate() {
                    while k + 1 < lengths.len() && lengths[k] < step * (j + 1) as f64 {
                        k += 1;
                    }
                    point.copy_from(&recorded.column(from + k));
                }
                // The recorded start; later on, the nearest place a motion can pass through.
                let start = if i == 0 { recorded.column(0) } else { certified.column(from) };
                ways.push(Way { start: start.clone_owned(), step, points });
            }
        }
        ways
    }

    /// Systems and P of a model, in the units of the recordings, with the end in `target`.
    fn in_units(
        &self,
        parameters: &Parameters,
        model: &Model,
        target: &DVector<f64>,
    ) -> Result<(Systems, DMatrix<f64>), StableError> {
        let d = target.len();
        let highest =
            model.components.iter().map(|c| c.log_prior).fold(f64::NEG_INFINITY, f64::max);
        let shares: Vec<f64> =
            model.components.iter().map(|c| (c.log_prior - highest).exp()).collect();
        let sum: f64 = shares.iter().sum();
        let field = parameters.field(model).ok_or(StableError::Overflow)?;
        let A: Vec<DMatrix<f64>> = field
            .A
            .chunks(d * d)
            .map(|rows| DMatrix::from_row_slice(d, d, rows) / self.time_s)
            .collect();
        let covariance = |c: &Component| {
            let covariance = parameters.covariance(c) * (self.size * self.size);
            (&covariance + covariance.transpose()) / 2.0
        };
        let systems = Systems::new(
            shares.into_iter().map(|share| share / sum).collect(),
            model.components.iter().map(|c| &c.center * self.size + target).collect(),
            model.components.iter().map(covariance).collect(),
            A.clone(),
            A.iter().map(|A| -(A * target)).collect(),
        )?;
        let P = &model.L * model.L.transpose();
        let P = &P / P.trace();
        Ok((systems, (&P + P.transpose()) / 2.0))
    }
}

/// `n` of `from` indices at equal distances, both ends included.
fn spread(from: usize, n: usize) -> Vec<usize> {
    (0..n).map(|k| k * (from - 1) / (n - 1)).collect()
}
