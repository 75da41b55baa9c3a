//! A repertoire from one demonstration: flips learnt at every height, then asked for by height and executed
//! with other pancakes. On the split plant.

use anyhow::Result;
use learner::problem::Problem;
use learner::repertoire::serve;
use learner::store::TrialRecord;
use learner::wish::Wish;
use nalgebra::DVector;
use search::Method;
use search::aim::{Target, Then};
use search::trial::Trial;

use super::Sample;
use super::pancake::{Bench, JUDGING, Judged, learn_by};
use crate::config::Config;
use crate::config::plant::DynamicsKind;

const ROLLOUTS: u64 = 200;
/// Other pancakes that try each policy.
pub const TRIED: u64 = 10;
/// Tenths of what is asked for at least, and of all that is covered, m.
const FLOOR: [f64; 2] = [0.3, 0.6];
const WHOLE: [f64; 2] = [0.25, 0.75];
const TENTHS: usize = 10;
/// Parts that are covered, two a tenth.
const PARTS: usize = 20;
/// Another pancake flies a little higher or lower than the one it was learnt with, m.
const ABOUT: f64 = 0.02;

/// A session at rest: what `--where` chooses from.
pub struct Learnt {
    pub problem: Problem,
    pub trials: Vec<TrialRecord>,
}

pub fn run_seed(seed: u64) -> Result<Vec<Sample>> {
    let mut samples = Vec::new();
    let cover = config(seed);
    let mut power = cover.clone();
    power.learner.search = Config::of_task("pancake").learner.search;
    for (name, config) in [("cover", cover), ("power", power)] {
        let bench = Bench::new(config, false)?;
        let learnt = learn(&bench)?;
        samples.push(successes(name, &learnt));
        for (range, [min, max]) in [("0.30–0.60 m", FLOOR), ("0.25–0.75 m", WHOLE)] {
            samples.extend(asked(name, range, &bench, &learnt, seed, [min, max])?);
        }
    }
    Ok(samples)
}

/// As in `config/pancake-repertoire.toml`.
pub fn config(seed: u64) -> Config {
    let mut config = Config::of_task("pancake");
    config.plant.dynamics = DynamicsKind::Split;
    (config.learner.seed, config.learner.rollouts) = (seed, ROLLOUTS);
    let search = &mut config.learner.search;
    search.method = Method::Aim;
    search.aim.then = Then::Cover;
    search.aim.targets[0] = Target { parts: PARTS, ..Target::new("apex_m", WHOLE, 0.12) };
    config
}

/// A session as `skillet learn` runs it, without one on disk.
pub fn learn(bench: &Bench) -> Result<Learnt> {
    let (mut plant, mut trials) = (bench.plant(&bench.world), Vec::new());
    let (_, (problem, _)) = learn_by(bench, |problem, rollout, theta| {
        let judged = bench.judged_on(problem, theta, &mut plant)?;
        trials.push(record(rollout, theta, judged));
        Ok(bench.came(&judged))
    })?;
    Ok(Learnt { problem, trials })
}

/// As a session would store it.
pub fn record(
    rollout: u64,
    theta: &DVector<f64>,
    (measures, success, reward): Judged,
) -> TrialRecord {
    let (theta, measured) = (theta.clone(), Vec::new());
    TrialRecord::of(Trial { rollout, theta, reward, success, measured }, measures)
}

fn successes(name: &str, learnt: &Learnt) -> Sample {
    let n = learnt.trials.iter().filter(|trial| trial.success).count() as f64;
    Sample::mean(name, &format!("successes in {ROLLOUTS}"), n)
}

/// Asks for every tenth of a range of heights.
fn asked(
    name: &str,
    range: &str,
    bench: &Bench,
    learnt: &Learnt,
    seed: u64,
    [min, max]: [f64; 2],
) -> Result<Vec<Sample>> {
    let mut samples = Vec::new();
    let (mut worst, mut all) = (1.0_f64, 0.0);
    for tenth in 0..TENTHS {
        let edge = |i: usize| min + (max - min) * i as f64 / TENTHS as f64;
        let window = [edge(tenth), edge(tenth + 1)];
        let (succeeded, within) = served(bench, learnt, seed, window)?;
        let metric = format!("{:.2}–{:.2} m", window[0], window[1]);
        samples.push(Sample::mean(name, &format!("{metric}, success"), succeeded));
        samples.push(Sample::mean(name, &format!("{metric}, apex within 2 cm of it"), within));
        worst = worst.min(succeeded);
        all += succeeded / TENTHS as f64;
    }
    samples.push(Sample::mean(name, &format!("{range}, success"), all));
    samples.push(Sample::mean(name, &format!("{range}, worst tenth"), worst));
    Ok(samples)
}

/// Success of the policy for a height with other pancakes, and how often it came to that height; neither
/// where there is no policy.
fn served(bench: &Bench, learnt: &Learnt, seed: u64, [min, max]: [f64; 2]) -> Result<(f64, f64)> {
    let wish = format!("apex_m >= {min} and apex_m < {max}");
    let wish = Wish::parse(&wish, &bench.judge.declared())?;
    let Ok(served) = serve(&learnt.problem.spaces[0], &learnt.trials, &wish) else {
        return Ok((0.0, 0.0));
    };
    let (mut succeeded, mut within) = (0.0, 0.0);
    for n in 0..TRIED {
        let mut plant = bench.plant(&bench.perturbed(seed, JUDGING + n));
        let (measures, success, _) = bench.judged_on(&learnt.problem, &served.theta, &mut plant)?;
        let apex_m = measures.get("apex_m").unwrap_or(0.0);
        let is_within = (min - ABOUT..max + ABOUT).contains(&apex_m);
        succeeded += f64::from(u8::from(success)) / TRIED as f64;
        within += f64::from(u8::from(is_within)) / TRIED as f64;
    }
    Ok((succeeded, within))
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use super::*;

    #[test]
    fn the_file_says_what_the_study_learns() {
        let config = super::config(1);
        let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("config/pancake-repertoire.toml");
        let file = Config::load(Some(&path)).unwrap();
        let targets = |config: &Config| {
            let targets = config.learner.search.targets().iter();
            targets.map(|t| (t.measure.clone(), t.parts, t.scale)).collect::<Vec<_>>()
        };
        assert_eq!(targets(&file), targets(&config));
        for (a, b) in file.learner.search.targets().iter().zip(config.learner.search.targets()) {
            assert!((a.min - b.min).abs() < 0.01 && (a.max - b.max).abs() < 0.01);
        }
        assert_eq!(file.plant, config.plant);
        assert_eq!(file.learner.search.aim.then, config.learner.search.aim.then);
    }
}
