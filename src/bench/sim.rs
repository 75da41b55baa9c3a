//! `skillet bench sim`: what a step of the simulation costs, and what more cores buy.

use std::num::NonZero;
use std::sync::Barrier;
use std::time::{Duration, Instant};

use anyhow::{Context, Result};
use learner::problem::Problem;
use physics::pancake::{PancakeConfig, PancakePlant};
use physics::plant::{Dynamics, Plant};
use physics::referee::{Referee, Toss, TossConfig};
use rt_controller::run::Controlled;
use rt_controller::simulate::simulate;
use shm_types::policy::PolicyMsg;

use super::arm::{Arm, Loop};
use super::{Bench, Plan, Row};
use crate::setup;

pub const BENCH: Bench = Bench {
    name: "sim",
    title: "What the simulation costs",
    about: "A step is one period of the loop: measure, tick, apply, advance the pancake world, \
            timed one by one. Rollouts are whole ones, from a fresh world, of the first policies a \
            session tries; on all cores every thread has its own world, and the rates of the \
            threads are added. One core and all cores are measured in turn, and their ratio is \
            taken round by round.",
    seconds: 30.0,
    run,
};

/// How the arm moves, and sub-steps.
const SETTINGS: [(Dynamics, usize); 5] = [
    (Dynamics::Multibody, 1),
    (Dynamics::Multibody, 2),
    (Dynamics::Multibody, 4),
    (Dynamics::Split, 2),
    (Dynamics::Split, 4),
];
/// Policies that are run in turn.
const N_POLICIES: u64 = 8;

/// The rows of one setting.
struct Rows {
    step: Row,
    one: Row,
    all: Row,
    ratio: Row,
}

impl Rows {
    fn new((dynamics, sub_steps): (Dynamics, usize), cores: usize) -> Rows {
        let s = if sub_steps == 1 { "" } else { "s" };
        let arm = match dynamics {
            Dynamics::Multibody => "multibody",
            Dynamics::Split => "split",
        };
        let scenario = format!("{arm}, {sub_steps} sub-step{s}");
        let all = format!("rollouts, all {cores} cores");
        Rows {
            step: Row::time("Step of the simulation", "step", &scenario),
            one: Row::value("Rollouts", "rollouts, one core", &scenario, "1/s"),
            all: Row::value("Rollouts", &all, &scenario, "1/s"),
            ratio: Row::value("Rollouts", "all cores / one core", &scenario, "1"),
        }
    }
}

fn run(plan: &Plan) -> Result<Vec<Row>> {
    let arm = Arm::new()?;
    let policies = policies(&arm)?;
    let cores = std::thread::available_parallelism().map_or(1, NonZero::get);
    let slice = plan.slice(3 * SETTINGS.len());
    let mut rows: Vec<Rows> = SETTINGS.iter().map(|n| Rows::new(*n, cores)).collect();
    for round in 0..plan.rounds {
        for (rows, (dynamics, solver_iterations)) in rows.iter_mut().zip(SETTINGS) {
            let world = PancakeConfig { dynamics, solver_iterations, ..arm.world() };
            steps(&arm, &world, slice, &mut rows.step)?;
            let rate = |threads| rollouts_per_second(&arm, &policies, &world, threads, slice);
            // Whatever comes first in a round has no other advantage.
            let (one, all) = if round % 2 == 0 {
                let one = rate(1)?;
                (one, rate(cores)?)
            } else {
                let all = rate(cores)?;
                (rate(1)?, all)
            };
            rows.one.add(one);
            rows.all.add(all);
            rows.ratio.add(all / one);
        }
    }
    Ok(rows.into_iter().flat_map(|rows| [rows.step, rows.one, rows.all, rows.ratio]).collect())
}

/// What the search tries first.
fn policies(arm: &Arm) -> Result<Vec<PolicyMsg>> {
    let config = &arm.config.learner;
    let problem = Problem::new(config, &setup::demonstrations(&arm.config)?)?;
    let search = problem.search(config);
    let decode = |rollout| problem.decode(&search.ask(rollout, &[]).theta, Default::default());
    Ok((1..=N_POLICIES).map(decode).collect())
}

fn steps(arm: &Arm, world: &PancakeConfig, slice: Duration, row: &mut Row) -> Result<()> {
    let mut running = Loop::new(arm, arm.policy(8, 4)?, world);
    let begin = Instant::now();
    let before = row.n();
    while row.n() == before || begin.elapsed() < slice {
        // A fresh world is no step.
        running.begin_if_idle();
        let start = Instant::now();
        let measured = running.plant.measure();
        let tau = running.controller.tick(&measured, &mut running.record);
        running.plant.apply(&tau);
        running.plant.advance();
        row.add_time(start.elapsed());
    }
    Ok(())
}

/// Whole rollouts on `threads` threads that begin together, each for `slice` and at least one.
fn rollouts_per_second(
    arm: &Arm,
    policies: &[PolicyMsg],
    world: &PancakeConfig,
    threads: usize,
    slice: Duration,
) -> Result<f64> {
    let barrier = Barrier::new(threads);
    let rate = || -> Result<f64> {
        let mut plant = PancakePlant::new(&arm.model, &arm.q0, world);
        let referee = Referee::Toss(Toss::new(&TossConfig::default()));
        let (model, q0) = (&arm.model, arm.q0);
        let mut controlled = Controlled { model, plant: &mut plant, q0, referee };
        barrier.wait();
        let start = Instant::now();
        let mut n = 0;
        loop {
            let policy = &policies[n % policies.len()];
            simulate(&mut controlled, &arm.config.controller, policy, &mut [])?;
            n += 1;
            let elapsed = start.elapsed();
            if elapsed >= slice {
                return Ok(n as f64 / elapsed.as_secs_f64());
            }
        }
    };
    std::thread::scope(|scope| {
        let threads: Vec<_> = (0..threads).map(|_| scope.spawn(rate)).collect();
        let rates = threads.into_iter().map(|thread| {
            thread.join().ok().context("a thread of the simulation panicked; please report it")?
        });
        rates.sum()
    })
}
