//! CMA-ES (Hansen and Ostermeier, Evolutionary Computation 2001) from the crate `cmaes`, as a
//! [`Search`], once or with restarts (Auger and Hansen, CEC 2005, without growing populations).
//!
//! The crate asks and tells in one call. As it is seeded, a run is made again with the costs told so
//! far; where they end it stands in the next generation, whose points are what is asked for.

use nalgebra::{DMatrix, DVector};
use rand::{Rng, RngExt};
use search::normals::{standard_normal, stream};
use search::trial::{Proposal, Trial};
use search::{Mode, Search, SearchSnapshot, Space};

/// Settings; standard deviations in units of θ.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CmaConfig {
    /// λ; `None` for the crate's 4 + ⌊3 ln D⌋.
    pub population: Option<usize>,
    /// σ of the first generation.
    pub initial_std: f64,
    /// A run ends after so many generations, if it has not stagnated before; `None` for no limit.
    pub max_generations: Option<usize>,
    /// Spread of the starts after the first around θ₀, where no box is known.
    pub restart_std: f64,
}

impl Default for CmaConfig {
    fn default() -> Self {
        CmaConfig { population: None, initial_std: 2.0, max_generations: None, restart_std: 4.0 }
    }
}

/// A generation: its points, and the distribution they come from.
struct Generation {
    points: Vec<DVector<f64>>,
    mean: DVector<f64>,
    std: DVector<f64>,
    /// The run should not go on.
    ended: bool,
}

/// CMA-ES on −ln r. A run that ends is followed by one from another start.
pub struct Cma {
    config: CmaConfig,
    seed: u64,
    space: Space,
    /// Number of the run, from 0.
    run: u64,
    /// Costs of the run in the order of its points.
    costs: Vec<f64>,
    generation: Generation,
    /// Best trial of each run.
    best: Vec<Trial>,
}

impl Cma {
    pub fn new(config: CmaConfig, seed: u64, space: Space) -> Cma {
        let generation = replay(&config, seed, 0, &space, &[]);
        Cma { config, seed, space, run: 0, costs: Vec::new(), generation, best: Vec::new() }
    }

    /// Points outside the box are moved to its edge, and judged there.
    fn inside(&self, theta: &DVector<f64>) -> DVector<f64> {
        self.space.bounds.as_ref().map_or_else(|| theta.clone(), |bounds| bounds.clamp(theta))
    }
}

/// Start of a run: θ₀ first, then uniform in the box or normal around θ₀.
fn start(config: &CmaConfig, seed: u64, run: u64, space: &Space) -> DVector<f64> {
    let mut rng = stream(seed, run);
    match &space.bounds {
        _ if run == 0 => space.theta_0.clone(),
        Some(bounds) => {
            let fractions: Vec<f64> = (0..space.dim()).map(|_| rng.random()).collect();
            bounds.at(&fractions)
        }
        None => space.theta_0.map(|x| x + config.restart_std * standard_normal(&mut rng)),
    }
}

/// The generation of a run that follows `costs`, which are those of whole generations.
fn replay(config: &CmaConfig, seed: u64, run: u64, space: &Space, costs: &[f64]) -> Generation {
    let mut points = Vec::new();
    let mut told = costs.iter().copied();
    let cost = |x: &cmaes::DVector<f64>| {
        told.next().unwrap_or_else(|| {
            points.push(DVector::from_column_slice(x.as_slice()));
            0.0
        })
    };
    let first = start(config, seed, run, space).as_slice().to_vec();
    let mut options = cmaes::CMAESOptions::new(first, config.initial_std);
    // A stream's seed is as good as any; the run's start has the beginning of the same stream.
    options = options.seed(stream(!seed, run).next_u64());
    if let Some(population) = config.population {
        options = options.population_size(population);
    }
    let n_generations = costs.len() / options.population_size;
    let mut cma = options.build(cost).expect("the settings are in the crate's ranges");
    let mut ended = config.max_generations.is_some_and(|limit| n_generations >= limit);
    for _ in 0..n_generations {
        ended |= cma.next().is_some();
    }
    let mean = DVector::from_column_slice(cma.mean().as_slice());
    let variance = cma.covariance_matrix().diagonal();
    let std = DVector::from_fn(mean.len(), |i, _| cma.sigma() * variance[i].sqrt());
    // Costs of zero for all: its verdict on them is of no interest.
    let _ = cma.next();
    drop(cma);
    ended |= points.iter().any(|point| point.iter().any(|x| !x.is_finite()));
    Generation { points, mean, std, ended }
}

impl Search for Cma {
    /// Points are matched to rewards by their order, so the trials told count, not `rollout`.
    fn ask(&self, rollout: u64, _pending: &[Proposal]) -> Proposal {
        let index = self.costs.len() % self.generation.points.len();
        Proposal { rollout, theta: self.inside(&self.generation.points[index]) }
    }

    fn tell(&mut self, trial: &Trial) {
        match self.best.get_mut(self.run as usize) {
            Some(best) if best.reward >= trial.reward => {}
            Some(best) => *best = trial.clone(),
            None => self.best.push(trial.clone()),
        }
        self.costs.push(-(trial.reward + f64::MIN_POSITIVE).ln());
        if !self.costs.len().is_multiple_of(self.generation.points.len()) {
            return;
        }
        self.generation = replay(&self.config, self.seed, self.run, &self.space, &self.costs);
        if self.generation.ended {
            self.run += 1;
            self.costs.clear();
            self.generation = replay(&self.config, self.seed, self.run, &self.space, &[]);
        }
    }

    fn mean(&self) -> &DVector<f64> {
        &self.generation.mean
    }

    fn snapshot(&self, _rollout: u64) -> SearchSnapshot {
        let Generation { mean, std, .. } = &self.generation;
        SearchSnapshot { mean: mean.clone(), std: std.clone(), floor: 0.0 }
    }

    /// The best trial of each run that comes within 0.9 of the best of all; of a single run its
    /// mean, as it is for every other search.
    fn modes(&self) -> Vec<Mode> {
        let covariance = DMatrix::from_diagonal(&self.generation.std.map(|s| s * s));
        if self.run == 0 {
            let mean = self.inside(&self.generation.mean);
            return vec![Mode { prior: 1.0, mean, covariance }];
        }
        let mut best: Vec<&Trial> = self.best.iter().collect();
        best.sort_by(|a, b| b.reward.total_cmp(&a.reward));
        let threshold = 0.9 * best[0].reward;
        best.retain(|trial| trial.reward >= threshold);
        let prior = 1.0 / best.len() as f64;
        let mode = |trial: &Trial| {
            let (mean, covariance) = (trial.theta.clone(), covariance.clone());
            Mode { prior, mean, covariance }
        };
        best.into_iter().map(mode).collect()
    }
}

#[cfg(test)]
mod tests;
