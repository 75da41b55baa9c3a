//! The methods of the comparison, and the settings from which each is tuned: as many random ones
//! for every method, from ranges that hold the usual values for a space about ten units wide.

use rand::RngExt;
use rand_chacha::ChaCha8Rng;
use search::batch::BatchConfig;
use search::cem::CemConfig;
use search::enac::EnacConfig;
use search::gradient::StepConfig;
use search::normals::stream;
use search::pi2::Pi2Config;
use search::power::{Elites, PowerConfig, Scatter, Weights};
use search::random::RandomConfig;
use search::reinforce::ReinforceConfig;
use search::rwr::RwrConfig;
use search::{Method, Search, SearchConfig, Space, build};

use super::cmaes::{Cma, CmaConfig};

/// Settings drawn for each method.
pub const N_SETTINGS: u64 = 40;
/// Seed of these draws.
const DRAW_SEED: u64 = 2013;

/// A method to compare with.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Contender {
    Search(Method),
    Cma,
    CmaRestarts,
}

/// The methods that are tuned, with their names.
pub const CONTENDERS: [(&str, Contender); 9] = [
    ("random", Contender::Search(Method::Random)),
    ("PoWER", Contender::Search(Method::Power)),
    ("CEM", Contender::Search(Method::Cem)),
    ("PI2-CMA", Contender::Search(Method::Pi2)),
    ("RWR", Contender::Search(Method::Rwr)),
    ("REINFORCE", Contender::Search(Method::Reinforce)),
    ("eNAC", Contender::Search(Method::Enac)),
    ("CMA-ES", Contender::Cma),
    ("CMA-ES restarts", Contender::CmaRestarts),
];

/// The search of a contender with its settings number `setting`.
pub fn search(contender: Contender, setting: u64, seed: u64, space: Space) -> Box<dyn Search> {
    let mut draw = Draw(stream(DRAW_SEED, setting));
    match contender {
        Contender::Search(method) => build(&draw.search(method), seed, space),
        Contender::Cma | Contender::CmaRestarts => {
            let restarts = contender == Contender::CmaRestarts;
            Box::new(Cma::new(draw.cma(restarts), seed, space))
        }
    }
}

/// Draws settings.
struct Draw(ChaCha8Rng);

impl Draw {
    fn uniform(&mut self, low: f64, high: f64) -> f64 {
        self.0.random_range(low..high)
    }

    /// Uniform in the logarithm: for scales.
    fn log(&mut self, low: f64, high: f64) -> f64 {
        self.uniform(low.ln(), high.ln()).exp()
    }

    fn count(&mut self, low: usize, high: usize) -> usize {
        self.log(low as f64, high as f64 + 1.0).floor() as usize
    }

    fn batch(&mut self) -> BatchConfig {
        let floor_std = self.log(0.05, 3.0);
        BatchConfig {
            size: self.count(5, 40),
            initial_std: self.log(0.5, 5.0),
            floor_std,
            floor_decay: self.uniform(0.7, 1.0),
            floor_min: floor_std * self.log(0.01, 1.0),
        }
    }

    fn step(&mut self) -> StepConfig {
        StepConfig { mean: self.log(0.1, 5.0), log_std: self.log(0.01, 1.0) }
    }

    fn search(&mut self, method: Method) -> SearchConfig {
        let mut config = SearchConfig { method, ..SearchConfig::default() };
        match method {
            Method::Power => {
                let floor_std = self.log(0.05, 3.0);
                config.power = PowerConfig {
                    elites: Elites::All,
                    min_successes: 1,
                    weights: Weights::Reward,
                    scatter: Scatter::Old,
                    memory: 0,
                    n_elites: self.count(2, 20),
                    n_initial: self.count(3, 40) as u64,
                    initial_std: self.log(0.5, 5.0),
                    floor_std,
                    floor_decay: self.uniform(0.95, 1.0),
                    floor_min: floor_std * self.log(0.01, 1.0),
                    ..PowerConfig::default()
                };
            }
            Method::Cem => {
                let batch = self.batch();
                config.cem = CemConfig { n_elites: self.count(1, batch.size.div_ceil(2)), batch };
            }
            Method::Pi2 => {
                config.pi2 = Pi2Config { greediness: self.log(1.0, 50.0), batch: self.batch() };
            }
            Method::Rwr => {
                config.rwr = RwrConfig { tau: self.log(0.05, 20.0), batch: self.batch() }
            }
            Method::Reinforce => {
                config.reinforce = ReinforceConfig { step: self.step(), batch: self.batch() };
            }
            Method::Enac => {
                let ridge = self.log(0.01, 10.0);
                config.enac = EnacConfig { ridge, step: self.step(), batch: self.batch() };
            }
            _ => config.random = RandomConfig { std: self.log(0.5, 10.0) },
        }
        config
    }

    fn cma(&mut self, restarts: bool) -> CmaConfig {
        CmaConfig {
            population: Some(self.count(4, 20)),
            initial_std: self.log(0.5, 5.0),
            max_generations: restarts.then(|| self.count(5, 20)),
            restart_std: self.log(1.0, 10.0),
        }
    }
}

#[cfg(test)]
mod tests {
    use nalgebra::DVector;

    use super::*;

    #[test]
    fn all_drawn_settings_are_within_their_ranges_and_build() {
        let space = Space::white(DVector::from_vec(vec![8.0, 2.0]));
        for (name, contender) in CONTENDERS {
            for setting in 0..N_SETTINGS {
                if let Contender::Search(method) = contender {
                    let config = Draw(stream(DRAW_SEED, setting)).search(method);
                    config.validate().unwrap_or_else(|error| panic!("{name} {setting}: {error}"));
                }
                let asked = search(contender, setting, 1, space.clone()).ask(2);
                assert_eq!(asked, search(contender, setting, 1, space.clone()).ask(2), "{name}");
            }
        }
    }
}
