//! The main job over several seeds, in this process: notices a search that learns less than it did.
//!
//! One seed says little: of seeds 1 to 40, the worst ends with 10 % and the best with all of its last
//! rollouts successful. So the test judges sums over seeds.

#[path = "../src/tasks/camera.rs"]
mod camera;
#[path = "../src/tasks/pancake/measurer.rs"] // what the tool measures by
mod measurer;
/// Where the measurer finds the camera.
mod tasks {
    pub(crate) use crate::camera;
}

use std::sync::atomic::{AtomicUsize, Ordering};

use camera::Camera;
use learner::judge::{Judge, Paid};
use learner::parameters::PolicyIds;
use learner::problem::Problem;
use learner::summary::LATE_TRIALS;
use learner::{Demonstration, LearnerConfig};
use measurer::measurer;
use physics::arm::ArmModel;
use physics::pancake::outcome::OutcomeConfig;
use physics::pancake::{PancakeConfig, PancakePlant, WAM7_START_POSTURE};
use physics::referee::{Referee, Toss};
use rt_controller::ControllerConfig;
use rt_controller::run::Controlled;
use rt_controller::simulate::simulate;
use search::Method;
use search::trial::{Proposal, Trial};
use shm_types::episode::{EpisodeHeader, MAX_RECORDS, TickRecord};

const SEEDS: std::ops::RangeInclusive<u64> = 101..=108;
/// At least this many of the eight seeds flip at all, …
const FLIPPING: usize = 7;
/// … and the mean success in the last rollouts is at least this. Measured: 8 and 0.93. Eight seeds drawn
/// from eighty others have a mean below this once in a hundred draws, so another machine, whose
/// rounding makes them other seeds, passes.
const LATE: f64 = 0.65;

/// What each rollout of the session came to.
fn successes(config: &LearnerConfig, demonstration: &Demonstration, arm: &ArmModel) -> Vec<bool> {
    let problem = Problem::new(config, std::slice::from_ref(demonstration)).unwrap();
    let mut search = problem.search(config);
    let (controller, outcome) = (ControllerConfig::default(), OutcomeConfig::default());
    let measurer = measurer(Camera::new(arm, controller.record_s()), &outcome);
    let judge = Judge::new(
        Box::new(measurer),
        Box::new(Paid { verdict: config.reward, weight: config.compliance.weight }),
    )
    .with_compliance(&config.compliance);
    let mut records = vec![TickRecord::ZERO; MAX_RECORDS];
    let rollout = |rollout| {
        let Proposal { theta, .. } = search.ask(rollout, &[]);
        let policy = problem.decode(&theta, PolicyIds::default());
        let mut plant = PancakePlant::new(arm, &WAM7_START_POSTURE, &PancakeConfig::default());
        let (q0, referee) = (WAM7_START_POSTURE, Referee::Toss(Toss::new(&outcome.toss)));
        let mut controlled = Controlled { model: arm, plant: &mut plant, q0, referee };
        let done = simulate(&mut controlled, &controller, &policy, &mut records).unwrap();
        let (_, success, reward) =
            judge.judge(&policy, &EpisodeHeader::default(), &records[..done.n_records]).unwrap();
        search.tell(&Trial { rollout, theta, reward, success, measured: Vec::new() });
        success
    };
    (1..=config.rollouts).map(rollout).collect()
}

/// Runs of all seeds, on all cores, with defaults changed by `change`.
fn runs(change: fn(&mut LearnerConfig)) -> Vec<Vec<bool>> {
    let demonstration =
        Demonstration::parse("pancake.csv", include_str!("../demos/pancake.csv")).unwrap();
    let arm = ArmModel::from_urdf(include_str!("../robots/wam7/wam7_pan.urdf"), "pan").unwrap();
    let seeds: Vec<u64> = SEEDS.collect();
    let next = AtomicUsize::new(0);
    let work = || {
        let mut done = Vec::new();
        while let Some(&seed) = seeds.get(next.fetch_add(1, Ordering::Relaxed)) {
            let mut config = LearnerConfig { seed, ..LearnerConfig::default() };
            change(&mut config);
            done.push(successes(&config, &demonstration, &arm));
        }
        done
    };
    let threads = std::thread::available_parallelism().map_or(1, usize::from);
    std::thread::scope(|scope| {
        let workers: Vec<_> = (0..threads).map(|_| scope.spawn(work)).collect();
        workers.into_iter().flat_map(|worker| worker.join().unwrap()).collect()
    })
}

/// Whether so many seeds flip, and keep flipping, and the numbers.
fn verdict(runs: &[Vec<bool>]) -> Result<String, String> {
    let first = |run: &Vec<bool>| run.iter().position(|success| *success).map(|at| at + 1);
    let late = |run: &Vec<bool>| {
        let late = &run[run.len() - LATE_TRIALS..];
        late.iter().filter(|success| **success).count() as f64 / LATE_TRIALS as f64
    };
    let first: Vec<Option<usize>> = runs.iter().map(first).collect();
    let late: Vec<f64> = runs.iter().map(late).collect();
    let mean = late.iter().sum::<f64>() / late.len() as f64;
    let text = format!("first caught flips {first:?}; late success {late:?}, mean {mean:.3}");
    let flipping = first.iter().flatten().count();
    if flipping >= FLIPPING && mean >= LATE { Ok(text) } else { Err(text) }
}

#[test]
fn eight_seeds_flip_and_then_keep_flipping() {
    println!("{}", verdict(&runs(|_| {})).unwrap());
}

/// The guard can fail: random draws around the demonstration.
#[test]
fn a_search_that_does_not_learn_is_noticed() {
    let broken = runs(|config| config.search.method = Method::Random);
    println!("{}", verdict(&broken).unwrap_err());
}
