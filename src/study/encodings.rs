//! Every encoding of a skill on the same tasks: pancake, ball-in-a-cup, and the obstacle, whose hand moves as the
//! loop's policies say. Each task keeps its search and its exploration.

use anyhow::Result;
use learner::demonstration::Demonstration;
use learner::encoding::EncodingKind;
use learner::exploration::ExplorationKind;
use learner::problem::Problem;
use learner::{LearnerConfig, LearnerError};
use nalgebra::{Vector2, Vector6};
use rt_controller::hot::policy::Policy;
use rt_controller::hot::task_space::TaskState;
use search::trial::Trial;
use shm_types::episode::EpisodeHeader;
use shm_types::measures::{Measure, Measures};
use shm_types::policy::PolicyMsg;

use super::Sample;
use super::robots::{ROLLOUTS, summary};
use super::runs::session;
use super::tasks::learn;
use crate::config::Config;
use crate::config::plant::DynamicsKind;
use crate::judging;
use crate::tasks::obstacle::{PERIOD, STEPS, Way, shown};

/// Tasks with an arm.
const TASKS: [&str; 2] = ["pancake", "ball-in-a-cup"];
const OBSTACLE: &str = "obstacle";

pub fn run_seed(seed: u64) -> Result<Vec<Sample>> {
    let mut samples = Vec::new();
    for encoding in EncodingKind::ALL {
        for task in TASKS {
            let config = config(task, encoding, seed);
            let learnt = learn(&config, |problem| problem.search(&config.learner));
            samples.extend(match learnt {
                Err(error) if is_no_fit(&error) => refused(encoding.name(), task),
                learnt => summary(encoding.name(), task, &learnt?.trials),
            });
        }
        samples.extend(summary(encoding.name(), OBSTACLE, &around_obstacle(encoding, seed)?));
    }
    Ok(samples)
}

/// A demonstration that the encoding cannot hold.
fn is_no_fit(error: &anyhow::Error) -> bool {
    matches!(error.downcast_ref(), Some(LearnerError::Fit(_)))
}

/// Where no session starts there is no success.
fn refused(method: &str, task: &str) -> Vec<Sample> {
    vec![
        Sample::median(method, &format!("{task}: first success"), f64::INFINITY),
        Sample::rate(method, &format!("{task}: success by {ROLLOUTS}"), false),
        Sample::mean(method, &format!("{task}: success in the last 20"), 0.0),
    ]
}

fn config(task: &str, encoding: EncodingKind, seed: u64) -> Config {
    let mut config = Config::of_task(task);
    config.learner = config.learner.encoded(encoding);
    (config.learner.seed, config.learner.rollouts) = (seed, ROLLOUTS);
    // The faster plant, most of all for a ball on a string.
    config.plant.dynamics = DynamicsKind::Split;
    config
}

/// A session of a hand that was shown the straight way and is driven by policies of an encoding. All parameters
/// are explored: nothing that alters a straight way leads around the obstacle.
fn around_obstacle(encoding: EncodingKind, seed: u64) -> Result<Vec<Trial>> {
    let config = config(OBSTACLE, encoding, seed);
    let judge = judging::judge(&config)?;
    let learner = hand(&config);
    let problem = Problem::new(&learner, &[straight()?])?;
    let mut search = problem.search(&learner);
    let executed = session(&mut *search, learner.rollouts, |_, theta| {
        let policy = problem.decode(theta, Default::default());
        let way = follow(&policy).measured().into_iter();
        let measures = way.map(|one| Measure { name: one.name, unit: one.unit, value: one.value });
        let header = EpisodeHeader { measures: Measures::of(measures)?, ..Default::default() };
        let (_, success, reward) = judge.judge(&policy, &header, &[])?;
        Ok((success, reward))
    })?;
    Ok(executed.into_iter().map(|executed| executed.trial).collect())
}

/// What a hand in the plane learns.
fn hand(config: &Config) -> LearnerConfig {
    let mut learner = config.learner.clone();
    // Found on seeds 0 to 9. A component of a field has more numbers than others.
    learner.n_components = if learner.encoding == EncodingKind::Seds { 3 } else { 6 }.into();
    (learner.task_dim, learner.kappa_p) = (3, 100.0);
    learner.exploration.kind = ExplorationKind::White;
    // As in the task itself, a unit is a metre and a large change of stiffness.
    (learner.scales.position_m, learner.scales.log_stiffness) = (1.0, 3.0);
    learner
}

/// The straight way as a demonstration.
fn straight() -> Result<Demonstration> {
    let row = |steps: usize| {
        let (t_s, x) = (steps as f64 * PERIOD, shown(steps));
        format!("{t_s:.2},{:.6},{:.6},0,0\n", x.x, x.y)
    };
    let rows: String = (0..=STEPS).map(row).collect();
    Ok(Demonstration::parse("the straight way", &format!("t_s,x_m,y_m,z_m,pitch_rad\n{rows}"))?)
}

/// The way of a hand in the plane that `policy` accelerates.
fn follow(policy: &PolicyMsg) -> Way {
    let policy = Policy::new(policy);
    let task = |of: &Vector2<f64>| Vector6::new(of.x, of.y, 0.0, 0.0, 0.0, 0.0);
    Way::of(|step, x, xd| {
        let state = TaskState::at(task(x), task(xd));
        policy.command(step as f64 * PERIOD, &state).xdd.xy()
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use learner::encoding::fit;

    /// Every encoding imitates what was shown: the hand runs into the obstacle.
    #[test]
    fn every_fit_follows_the_straight_way_into_the_obstacle() {
        for encoding in EncodingKind::ALL {
            let learner = hand(&config(OBSTACLE, encoding, 1));
            let policy = fit(&learner.encoding(), &[straight().unwrap()]).unwrap();
            let [tracking, goal, _, collided] = follow(&policy).measured().map(|one| one.value);
            assert!(
                collided == 1.0 && goal > 0.3 && tracking > 0.5,
                "{encoding:?}: {tracking} {goal}"
            );
        }
    }
}
