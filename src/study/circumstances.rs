//! Circumstances that change: a ceiling comes down, a joint tires, the pan gets heavier. What the session
//! would go on with, and what its repertoire has instead, without a rollout in between. On the split plant.

use anyhow::Result;
use learner::history::History;
use learner::repertoire::serve;
use learner::replay::{ask, told_anew};
use learner::wish::{Telling, Wish, Wishes};
use nalgebra::DVector;
use physics::arm::ArmModel;
use physics::pancake::PancakeConfig;

use super::Sample;
use super::pancake::{Bench, JUDGING, Judged, PAN_MASS, hold_stiffly, scaled, share};
use super::repertoire::{Learnt, TRIED, config, learn, record};
use crate::config::Config;
use crate::setup;

/// Rollouts with which the search follows.
const FOLLOWED: u64 = 10;
/// What the tired joint has left of its torque.
const HALF: f64 = 0.5;
/// The pan, so much heavier than the controller's model knows.
const HEAVIER: f64 = 2.0;

/// What changes, and what is wished for then.
struct Circumstance {
    name: &'static str,
    wish: &'static str,
    /// What is not so is no success any more.
    is_rule: bool,
    /// Edits of the arm, and of what the controller takes it for.
    arm: fn(&str) -> Result<String>,
    model: fn(&str) -> Result<String>,
}

const CIRCUMSTANCES: [Circumstance; 3] = [
    Circumstance {
        name: "ceiling at 0.45 m",
        wish: "apex_m < 0.45",
        is_rule: true,
        arm: same,
        model: same,
    },
    Circumstance {
        name: "half the torque of the wrist",
        wish: "torque_6_nm < 3.25",
        is_rule: false,
        arm: tired,
        model: tired,
    },
    Circumstance {
        name: "pan twice as heavy",
        wish: "apex_m < 0.4",
        is_rule: false,
        arm: heavier,
        model: same,
    },
];

pub fn run_seed(seed: u64) -> Result<Vec<Sample>> {
    let learnt = learn(&Bench::new(held(config(seed)), false)?)?;
    let mut samples = Vec::new();
    for circumstance in &CIRCUMSTANCES {
        samples.extend(changed(circumstance, seed, &learnt)?);
    }
    Ok(samples)
}

/// With a hold that bears a pan of unknown weight.
fn held(mut config: Config) -> Config {
    hold_stiffly(&mut config);
    config
}

fn changed(circumstance: &Circumstance, seed: u64, learnt: &Learnt) -> Result<Vec<Sample>> {
    let config = held(config(seed));
    let text = setup::arm_text(&config)?;
    let of = |text: String| Ok::<_, anyhow::Error>(ArmModel::from_urdf(&text, &config.plant.tip)?);
    let (arm, model) = (of((circumstance.arm)(&text)?)?, of((circumstance.model)(&text)?)?);
    let bench = Bench::new(config, false)?.with_arm(arm, model);
    let parse = |text: &str| Wish::parse(text, &bench.judge.declared());
    let (any, wish) = (parse("true")?, parse(circumstance.wish)?);
    let world = World { bench: &bench, learnt, rule: circumstance.is_rule.then_some(&wish) };

    let space = &learnt.problem.spaces[0];
    let before = world.tries(seed, &serve(space, &learnt.trials, &any)?.theta)?;
    // Where nothing serves the wish the cell can do no other than before.
    let next = match serve(space, &learnt.trials, &wish) {
        Ok(served) => world.tries(seed, &served.theta)?,
        Err(_) => before,
    };
    let followed = world.follow(&wish)?;
    let sample = |metric: &str, value| Sample::mean(circumstance.name, metric, value);
    Ok(vec![
        sample("success of the answer before", before),
        sample("success of the policy for the wish", next),
        sample("success of the session's next rollout", followed[0]),
        sample(&format!("of its next {FOLLOWED}"), followed.iter().sum::<f64>() / FOLLOWED as f64),
    ])
}

/// The world after the change.
struct World<'a> {
    bench: &'a Bench,
    learnt: &'a Learnt,
    /// What a success must be like there.
    rule: Option<&'a Wish>,
}

impl World<'_> {
    fn rollout(&self, theta: &DVector<f64>, world: &PancakeConfig) -> Result<Judged> {
        let mut plant = self.bench.plant(world);
        let (measures, success, reward) =
            self.bench.judged_on(&self.learnt.problem, theta, &mut plant)?;
        Ok((measures, success && self.rule.is_none_or(|rule| rule.holds(&measures)), reward))
    }

    /// Success with other pancakes.
    fn tries(&self, seed: u64, theta: &DVector<f64>) -> Result<f64> {
        share(TRIED, |n| Ok(self.rollout(theta, &self.bench.perturbed(seed, JUDGING + n))?.1))
    }

    /// The search goes on with the wish: success of its next rollouts, 0 or 1 each.
    fn follow(&self, wish: &Wish) -> Result<Vec<f64>> {
        let (config, problem) = (&self.bench.config.learner, &self.learnt.problem);
        let (mut search, mut telling) =
            told_anew(config, problem, Telling::new(Some(wish)), &self.learnt.trials)?;
        let before = &self.learnt.trials;
        let first = before.len() as u64 + 1;
        let wishes = Wishes::of(vec![(before.len() as u64, Some(wish.clone()))]);
        let history = History { wishes, ..History::default() };
        let mut successes = Vec::new();
        for rollout in first..first + FOLLOWED {
            let theta = ask(&mut search, problem, &history, before, rollout).theta;
            let judged = self.rollout(&theta, &self.bench.world)?;
            successes.push(f64::from(u8::from(judged.1)));
            let record = record(rollout, &theta, judged);
            if let Some(trial) = telling.trial(&record, config.search.targets()) {
                search.tell(&trial)?;
                telling.was_told(&trial);
            }
        }
        Ok(successes)
    }
}

fn same(urdf: &str) -> Result<String> {
    Ok(urdf.into())
}

fn heavier(urdf: &str) -> Result<String> {
    scaled(urdf, PAN_MASS, HEAVIER)
}

fn tired(urdf: &str) -> Result<String> {
    scaled(urdf, ["<joint name=\"j6_wrist_pitch\"", "effort=\""], HALF)
}
