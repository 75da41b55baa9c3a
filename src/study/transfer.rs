//! What is learnt in one simulator, tried in another: Rapier and MuJoCo, there and back.
//!
//! `SKILLET_PYTHON` names an interpreter that has the packages mujoco and numpy, else it is `python3`. To be
//! run where `examples/plant_mujoco.py` is.

use anyhow::Result;
use learner::problem::Problem;
use nalgebra::DVector;
use physics::pancake::PancakeConfig;
use physics::plant::Plant;
use search::Search;

use super::Sample;
use super::pancake::{Bench, JUDGING, N_PERTURBED, share, summary};
use super::runs::{Executed, trial};
use crate::children;
use crate::config::Config;
use crate::config::plant::PlantKind;
use crate::external::Started;
use crate::setup;

const PROGRAM: &str = "examples/plant_mujoco.py";
/// Rollouts at home, and how many more in the other world.
const HOME: u64 = 100;
const AWAY: u64 = 20;

/// A simulator: a world to learn in and others to be judged in.
struct Simulator {
    name: &'static str,
    nominal: Box<dyn Plant>,
    perturbed: Vec<Box<dyn Plant>>,
}

pub fn run_seed(seed: u64) -> Result<Vec<Sample>> {
    let mut config = Config::default();
    config.learner.seed = seed;
    let bench = Bench::new(config, false)?;
    let mut both = [
        Simulator::new("Rapier", seed, &bench, |bench, world| Ok(Box::new(bench.plant(world))))?,
        Simulator::new("MuJoCo", seed, &bench, mujoco)?,
    ];
    let mut samples = Vec::new();
    for _ in 0..2 {
        samples.extend(transfer(&bench, &mut both)?);
        both.reverse();
    }
    Ok(samples)
}

/// Learns in the first of them, then goes on in the second.
fn transfer(bench: &Bench, [home, away]: &mut [Simulator; 2]) -> Result<Vec<Sample>> {
    let config = &bench.config.learner;
    let problem = Problem::new(config, &setup::demonstrations(&bench.config)?)?;
    let mut search = problem.search(config);
    let executed = session(bench, &problem, &mut *search, 1..=HOME, &mut home.nominal)?;
    let mut samples = summary(home.name, &executed);
    let answer = search.mean().clone();
    let there = home.robustness(bench, &problem, &answer)?;
    let elsewhere = away.robustness(bench, &problem, &answer)?;
    session(bench, &problem, &mut *search, HOME + 1..=HOME + AWAY, &mut away.nominal)?;
    let settled = away.robustness(bench, &problem, search.mean())?;
    for (metric, value) in [
        (format!("robustness in {}", home.name), there),
        (format!("robustness in {}", away.name), elsewhere),
        (format!("robustness there after {AWAY} rollouts more"), settled),
    ] {
        samples.push(Sample::mean(home.name, &metric, value));
    }
    Ok(samples)
}

/// Rollouts of these numbers.
fn session(
    bench: &Bench,
    problem: &Problem,
    search: &mut dyn Search,
    rollouts: impl Iterator<Item = u64>,
    plant: &mut Box<dyn Plant>,
) -> Result<Vec<Executed>> {
    let mut one = |rollout| {
        trial(search, rollout, |theta: &DVector<f64>| bench.rollout_on(problem, theta, plant))
    };
    rollouts.map(&mut one).collect()
}

impl Simulator {
    fn new(
        name: &'static str,
        seed: u64,
        bench: &Bench,
        of: fn(&Bench, &PancakeConfig) -> Result<Box<dyn Plant>>,
    ) -> Result<Simulator> {
        let perturbed = |n| of(bench, &bench.perturbed(seed, JUDGING + n));
        Ok(Simulator {
            name,
            nominal: of(bench, &bench.world)?,
            perturbed: (0..N_PERTURBED).map(perturbed).collect::<Result<_>>()?,
        })
    }

    fn robustness(
        &mut self,
        bench: &Bench,
        problem: &Problem,
        theta: &DVector<f64>,
    ) -> Result<f64> {
        share(N_PERTURBED, |n| {
            let plant = &mut self.perturbed[n as usize];
            Ok(bench.rollout_on(problem, theta, plant)?.success)
        })
    }
}

/// A process with this world.
fn mujoco(bench: &Bench, world: &PancakeConfig) -> Result<Box<dyn Plant>> {
    let mut config = bench.config.clone();
    let python = children::python();
    let plant = &mut config.plant;
    (plant.kind, plant.program) = (PlantKind::External, vec![python, PROGRAM.into()]);
    plant.pancake_mass_kg = world.pancake_mass;
    plant.pancake_offset_m = world.pancake_offset;
    plant.friction = world.friction;
    Ok(Box::new(Started::new(&config, &bench.arm)?))
}
