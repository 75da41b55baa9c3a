//! The methods of the comparisons, and the settings from which each is tuned: as many random ones
//! for every method, from ranges that hold the usual values for a space of some width.

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
#[cfg(feature = "baselines")]
use search::subspace::Subspace;
use search::{Method, Search, SearchConfig, Space, build};

#[cfg(feature = "baselines")]
use super::cmaes::{Cma, CmaConfig};

/// Settings drawn for each method.
pub const N_SETTINGS: u64 = 40;

/// From where to where settings are drawn that depend on how wide the space is and how many trials there
/// are. Standard deviations in units of exploration.
#[derive(Clone, Copy, Debug)]
pub struct Ranges {
    pub initial_std: [f64; 2],
    pub floor_std: [f64; 2],
    /// Standard deviations of random search, which never narrows.
    pub random_std: [f64; 2],
    #[cfg_attr(not(feature = "baselines"), expect(dead_code, reason = "only CMA-ES restarts"))]
    pub restart_std: [f64; 2],
    /// Trials a batch, and trials before the first update of PoWER.
    pub batch: [usize; 2],
    pub n_initial: [usize; 2],
}

/// A space about ten units wide, 200 trials.
pub const TEN_WIDE: Ranges = Ranges {
    initial_std: [0.5, 5.0],
    floor_std: [0.05, 3.0],
    random_std: [0.5, 10.0],
    restart_std: [1.0, 10.0],
    batch: [5, 40],
    n_initial: [3, 40],
};
/// Seed of these draws.
const DRAW_SEED: u64 = 2013;

/// A method to compare with.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Contender {
    Search(Method),
    #[cfg(feature = "baselines")]
    Cma,
    #[cfg(feature = "baselines")]
    CmaRestarts,
}

/// The methods that are tuned, with their names. CMA-ES comes from a crate with linear algebra of its own, which only
/// builds with the feature `baselines` carry.
pub const CONTENDERS: &[(&str, Contender)] = &[
    ("random", Contender::Search(Method::Random)),
    ("PoWER", Contender::Search(Method::Power)),
    ("CEM", Contender::Search(Method::Cem)),
    ("PI2-CMA", Contender::Search(Method::Pi2)),
    ("RWR", Contender::Search(Method::Rwr)),
    ("REINFORCE", Contender::Search(Method::Reinforce)),
    ("eNAC", Contender::Search(Method::Enac)),
    #[cfg(feature = "baselines")]
    ("CMA-ES", Contender::Cma),
    #[cfg(feature = "baselines")]
    ("CMA-ES restarts", Contender::CmaRestarts),
];

/// The search of a contender with its settings number `setting` from `ranges`.
pub fn search(
    contender: Contender,
    setting: u64,
    ranges: Ranges,
    seed: u64,
    space: Space,
) -> Box<dyn Search> {
    let mut draw = Draw::new(setting, ranges);
    match contender {
        Contender::Search(method) => build(&draw.search(method), seed, space),
        #[cfg(feature = "baselines")]
        Contender::Cma | Contender::CmaRestarts => {
            let config = draw.cma(contender == Contender::CmaRestarts);
            let cma = |space| -> Box<dyn Search> { Box::new(Cma::new(config, seed, space)) };
            if space.is_white() { cma(space) } else { Box::new(Subspace::new(space, cma)) }
        }
    }
}

/// Draws settings.
struct Draw {
    rng: ChaCha8Rng,
    ranges: Ranges,
}

impl Draw {
    fn new(setting: u64, ranges: Ranges) -> Draw {
        Draw { rng: stream(DRAW_SEED, setting), ranges }
    }

    fn uniform(&mut self, low: f64, high: f64) -> f64 {
        self.rng.random_range(low..high)
    }

    /// Uniform in the logarithm: for scales.
    fn log(&mut self, low: f64, high: f64) -> f64 {
        self.uniform(low.ln(), high.ln()).exp()
    }

    fn std(&mut self, [low, high]: [f64; 2]) -> f64 {
        self.log(low, high)
    }

    fn count(&mut self, low: usize, high: usize) -> usize {
        self.log(low as f64, high as f64 + 1.0).floor() as usize
    }

    fn batch(&mut self) -> BatchConfig {
        let Ranges { initial_std, floor_std, batch: [least, most], .. } = self.ranges;
        let floor_std = self.std(floor_std);
        BatchConfig {
            size: self.count(least, most),
            initial_std: self.std(initial_std),
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
        let Ranges { initial_std, floor_std, random_std, n_initial: [least, most], .. } =
            self.ranges;
        match method {
            Method::Power => {
                let floor_std = self.std(floor_std);
                config.power = PowerConfig {
                    elites: Elites::All,
                    min_successes: 1,
                    weights: Weights::Reward,
                    scatter: Scatter::Old,
                    memory: 0,
                    n_elites: self.count(2, 20),
                    n_initial: self.count(least, most) as u64,
                    initial_std: self.std(initial_std),
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
            _ => config.random = RandomConfig { std: self.std(random_std) },
        }
        config
    }

    #[cfg(feature = "baselines")]
    fn cma(&mut self, restarts: bool) -> CmaConfig {
        let Ranges { initial_std, restart_std, .. } = self.ranges;
        CmaConfig {
            population: Some(self.count(4, 20)),
            initial_std: self.std(initial_std),
            max_generations: restarts.then(|| self.count(5, 20)),
            restart_std: self.std(restart_std),
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
        for (name, contender) in CONTENDERS.iter().copied() {
            for setting in 0..N_SETTINGS {
                #[cfg_attr(not(feature = "baselines"), expect(irrefutable_let_patterns))]
                if let Contender::Search(method) = contender {
                    let config = Draw::new(setting, TEN_WIDE).search(method);
                    config.validate().unwrap_or_else(|error| panic!("{name} {setting}: {error}"));
                }
                let ask = || search(contender, setting, TEN_WIDE, 1, space.clone()).ask(2, &[]);
                assert_eq!(ask(), ask(), "{name}");
            }
        }
    }
}
