//! What varying stiffness is worth: which stiffnesses are learnt, on which world they are tried.
//!
//! Every kind has the same directions of movement, the same draws along them, the same reward and the same
//! choice among candidates. The heavy, bouncy pancake and the push were fixed before any result was seen.

use std::ops::Range;

use anyhow::Result;
use learner::LearnerConfig;
use learner::activation::stiffness;
use learner::exploration::StiffnessKind;
use learner::problem::Problem;
use nalgebra::{DVector, Vector3};
use physics::pancake::PancakeConfig;
use rand::RngExt;
use search::normals::{standard_normal, stream};
use shm_types::episode::{EpisodeHeader, TickRecord};
use shm_types::policy::PolicyMsg;

use super::Sample;
use super::disturbance::{Begins, Disturbed, PUSH_S, Push};
use super::pancake::{
    Answer, Bench, JUDGING, LEARNING, N_PERTURBED, learn, learn_by, share, summary, uniform,
};
use crate::config::Config;
use crate::config::plant::DynamicsKind;

/// A pancake of this mass, kg, and restitution, never learnt on.
const HEAVY: (f64, f64) = (0.1, 0.4);
/// Worlds to learn in that vary: mass, kg, and restitution are drawn from these.
const MASSES: [f64; 2] = [0.02, 0.12];
const RESTITUTIONS: [f64; 2] = [0.0, 0.4];
/// A person's push on the pan, N: downwards from the crossing on, or any way in worlds that vary, where it
/// begins so long after the throw, s.
const PUSH_N: f64 = 2.0;
const PUSH_AFTER_S: f64 = 0.3;
/// The throw is the end of what comes before the release, s.
const THROW_S: f64 = 0.2;
/// Height among the coordinates of a policy.
const Z: usize = 2;

const DEFAULT: &str = "full";

/// What may be learnt of the stiffness.
struct Kind {
    name: &'static str,
    config: fn(&mut LearnerConfig),
}

const KINDS: [Kind; 7] = [
    Kind { name: "uniform, unpaid", config: uniform },
    Kind { name: "fixed", config: |c| c.exploration.stiffness = StiffnessKind::Fixed },
    Kind { name: "uniform", config: |c| c.exploration.stiffness = StiffnessKind::Uniform },
    Kind { name: "components", config: |c| c.exploration.stiffness = StiffnessKind::Components },
    Kind { name: "phases", config: |c| c.exploration.stiffness = StiffnessKind::Phases },
    Kind { name: DEFAULT, config: |c| c.exploration.stiffness = StiffnessKind::Full },
    Kind {
        name: "phases, own dampers",
        config: |c| {
            (c.exploration.stiffness, c.damping_ratio) = (StiffnessKind::Phases, 1.0);
        },
    },
];

pub fn run_seed(seed: u64) -> Result<Vec<Sample>> {
    let mut samples = Vec::new();
    for kind in &KINDS {
        let bench = bench(kind, seed)?;
        let (executed, answer) = learn(&bench, |_| bench.world)?;
        samples.extend(summary(kind.name, &executed));
        samples.extend(judge(kind.name, &bench, &answer, seed)?);
    }
    Ok(samples)
}

/// Learnt in worlds that vary from rollout to rollout.
pub fn run_varying_seed(seed: u64) -> Result<Vec<Sample>> {
    let mut samples = Vec::new();
    for kind in &KINDS {
        let bench = bench(kind, seed)?;
        let rollout = |problem: &Problem, theta: &DVector<f64>, draw| {
            let plant = bench.plant(&varying(&bench, seed, draw));
            let push = push(seed, draw, bench.world.period_s);
            let mut pushed = Disturbed::new(plant, &bench.arm, push);
            bench.rollout_on(problem, theta, &mut pushed)
        };
        let (executed, (problem, theta)) =
            learn_by(&bench, |problem, n, theta| rollout(problem, theta, LEARNING + n))?;
        samples.extend(summary(kind.name, &executed));
        let robust = share(N_PERTURBED, |n| Ok(rollout(&problem, &theta, JUDGING + n)?.success))?;
        samples.push(Sample::mean(kind.name, "robustness in such worlds", robust));
    }
    Ok(samples)
}

/// (time, s; stiffness, s⁻²)
pub type Curve = Vec<(f64, f64)>;

/// What a seed has come to with the default, and what it started from.
pub struct Learnt {
    policy: PolicyMsg,
    start: PolicyMsg,
}

impl Learnt {
    /// K_cc(t) = Σ hᵢ(t) Kᵢ,cc over the movement.
    pub fn curve(&self, c: usize) -> Curve {
        curve(&self.policy, c)
    }

    pub fn initial(&self, c: usize) -> Curve {
        curve(&self.start, c)
    }
}

fn curve(policy: &PolicyMsg, c: usize) -> Curve {
    const N: usize = 140;
    let times = (0..=N).map(|k| policy.duration_s * k as f64 / N as f64);
    times.map(|t_s| (t_s, stiffness(policy, t_s)[(c, c)])).collect()
}

/// The default's answers, one a seed.
pub fn answers(seeds: Range<u64>) -> Result<Vec<Learnt>> {
    let default = KINDS.iter().find(|kind| kind.name == DEFAULT).expect("it is among them");
    let answer = |seed| {
        let bench = bench(default, seed)?;
        let (_, (problem, theta)) = learn(&bench, |_| bench.world)?;
        let start = bench.policy(&problem, &problem.spaces[0].theta_0);
        Ok(Learnt { policy: bench.policy(&problem, &theta), start })
    };
    seeds.map(answer).collect()
}

fn bench(kind: &Kind, seed: u64) -> Result<Bench> {
    let mut config = Config::default();
    config.learner.seed = seed;
    config.plant.dynamics = DynamicsKind::Split;
    // The arm's model knows nothing of a pancake; with less the wrist would sag by 100 g so far that no
    // rollout begins.
    (config.controller.posture_stiffness, config.controller.posture_damping) = (400.0, 40.0);
    (kind.config)(&mut config.learner);
    Bench::new(config, false)
}

/// A push in any direction, some time after the throw.
fn push(seed: u64, draw: u64, period_s: f64) -> Push {
    let mut rng = stream(seed, draw + (2 << 40));
    let way = Vector3::from_fn(|_, _| standard_normal(&mut rng));
    let after_s = rng.random_range(0.0..=PUSH_AFTER_S);
    Push::new(way.normalize() * PUSH_N, Begins::Thrown(after_s), period_s)
}

/// A world of [`Bench::perturbed`] with another mass and restitution.
fn varying(bench: &Bench, seed: u64, draw: u64) -> PancakeConfig {
    let mut rng = stream(seed, draw + (1 << 40));
    PancakeConfig {
        pancake_mass: rng.random_range(MASSES[0]..=MASSES[1]),
        restitution: rng.random_range(RESTITUTIONS[0]..=RESTITUTIONS[1]),
        ..bench.perturbed(seed, draw)
    }
}

fn judge(name: &str, bench: &Bench, answer: &Answer, seed: u64) -> Result<Vec<Sample>> {
    let heavy = |n| {
        let world = bench.perturbed(seed, JUDGING + n);
        let pancake_mass = world.pancake_mass * HEAVY.0 / bench.world.pancake_mass;
        PancakeConfig { pancake_mass, restitution: HEAVY.1, ..world }
    };
    let mut samples = vec![
        Sample::mean(
            name,
            "robustness",
            bench.robustness(answer, |n| bench.perturbed(seed, JUDGING + n))?,
        ),
        Sample::mean(name, "robustness, heavy and bouncy", bench.robustness(answer, heavy)?),
    ];
    if let Some(profile) = profile(bench, answer)? {
        let Profile { throw, catch, off_diagonal, yields_m, reach_m } = profile;
        samples.extend([
            Sample::median(name, "K_zz at the throw, 1/s2", throw),
            Sample::median(name, "K_zz at the catch, 1/s2", catch),
            Sample::median(name, "K_zz, catch / throw", catch / throw),
            Sample::rate(name, "K_zz, catch / throw below 0.7", catch / throw < 0.7),
            Sample::median(name, "largest coupling", off_diagonal),
            Sample::median(name, "yields to a push of 2 N, mm", 1e3 * yields_m),
            Sample::median(name, "farthest attractor, m", reach_m),
        ]);
    }
    Ok(samples)
}

/// Stiffness of an answer in its own rollout.
struct Profile {
    /// Means of K_zz before the release and after the crossing, s⁻².
    throw: f64,
    catch: f64,
    /// Largest |K_ij|/√(K_ii K_jj) of a component.
    off_diagonal: f64,
    yields_m: f64,
    reach_m: f64,
}

/// `None` where nothing is tossed.
fn profile(bench: &Bench, (problem, theta): &Answer) -> Result<Option<Profile>> {
    let policy = bench.policy(problem, theta);
    let period_s = bench.world.period_s;
    let new = |begins| {
        let push = Push::new(Vector3::z() * -PUSH_N, begins, period_s);
        Disturbed::new(bench.plant(&bench.world), &bench.arm, push)
    };
    let mut plant = new(Begins::Never);
    let records = bench.records(problem, theta, &mut plant)?;
    let (measures, _, _) = bench.judge.judge(&policy, &EpisodeHeader::default(), &records)?;
    let of = |name: &str| measures.get(name).unwrap_or(0.0);
    if of("tossed") == 0.0 {
        return Ok(None);
    }
    let (release_s, crossing_s) = (of("release_time_s"), of("crossing_time_s"));
    // The records begin with the movement, some ticks after the world.
    let begin = plant.by.heights.len() - ticks_of(&records, bench);
    let from = begin + (crossing_s / period_s) as usize;
    let mut pushed = new(Begins::At(from));
    bench.records(problem, theta, &mut pushed)?;
    let end = from + (PUSH_S / period_s) as usize;
    let at = end.min(plant.by.heights.len().min(pushed.by.heights.len()) - 1);
    Ok(Some(Profile {
        throw: mean_k_zz(&policy, release_s - THROW_S, release_s),
        catch: mean_k_zz(&policy, crossing_s, crossing_s + PUSH_S),
        off_diagonal: largest_coupling(&policy),
        yields_m: plant.by.heights[at] - pushed.by.heights[at],
        reach_m: farthest_attractor(&policy),
    }))
}

/// Ticks of the loop that so many records stand for.
fn ticks_of(records: &[TickRecord], bench: &Bench) -> usize {
    let stride = bench.config.controller.record_s() / bench.world.period_s;
    ((records.len() as f64) * stride).round() as usize
}

/// Mean of K_zz(t) = Σ hᵢ(t) Kᵢ,zz from one time to another, s⁻².
fn mean_k_zz(policy: &PolicyMsg, from_s: f64, to_s: f64) -> f64 {
    const N: usize = 50;
    let at = |part: usize| {
        stiffness(policy, from_s + (to_s - from_s) * (part as f64 + 0.5) / N as f64)[(Z, Z)]
    };
    (0..N).map(at).sum::<f64>() / N as f64
}

fn largest_coupling(policy: &PolicyMsg) -> f64 {
    let d = policy.task_dim as usize;
    let of = |component: &shm_types::policy::Component| {
        let k = |row, col| component.stiffness_at(row, col);
        let pairs = (0..d).flat_map(move |row| (0..row).map(move |col| (row, col)));
        pairs.map(|(i, j)| k(i, j).abs() / (k(i, i) * k(j, j)).sqrt()).fold(0.0, f64::max)
    };
    policy.components().iter().map(of).fold(0.0, f64::max)
}

/// From the first attractor, m.
fn farthest_attractor(policy: &PolicyMsg) -> f64 {
    let place = |i: usize| Vector3::from_column_slice(&policy.components[i].attractor[..3]);
    (0..policy.components().len()).map(|i| (place(i) - place(0)).norm()).fold(0.0, f64::max)
}
