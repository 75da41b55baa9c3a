//! A whole run of Algorithm 1 against an independent program, and the properties of the search.

use serde::Deserialize;

use super::super::Bounds;
use super::super::vectors::{Gmm, read};
use super::*;

#[derive(Deserialize)]
struct Replay {
    config: ReplayConfig,
    u: Vec<f64>,
    z: Vec<Vec<f64>>,
    trace: Vec<Step>,
    #[serde(rename = "final")]
    end: Gmm,
}

#[derive(Deserialize)]
struct ReplayConfig {
    #[serde(rename = "M")]
    n_elites: usize,
    n_init: usize,
    s0: f64,
    si: f64,
    #[serde(rename = "TS")]
    split_threshold: f64,
    #[serde(rename = "TM")]
    merge_threshold: f64,
    mu0: Vec<f64>,
    em_iters: usize,
    #[serde(rename = "Kmax")]
    max_components: usize,
    about: String,
}

#[derive(Deserialize)]
struct Step {
    comp: usize,
    theta: Option<Vec<f64>>,
    r: f64,
    /// Bit 1: a split, bit 2: a merge.
    event: u8,
    #[serde(rename = "K")]
    n_components: usize,
    split_gain: Option<f64>,
    merge_loss: Option<f64>,
}

fn search(config: &ReplayConfig) -> Algorithm1 {
    assert_eq!(config.about, "old");
    let settings = Algorithm1Config {
        n_elites: config.n_elites,
        n_initial: config.n_init,
        initial_variance: config.si,
        floor_variance: config.s0,
        em_steps: config.em_iters,
        split_threshold: config.split_threshold,
        merge_threshold: config.merge_threshold,
        max_components: config.max_components,
    };
    Algorithm1::new(settings, 0, Space::white(DVector::from_column_slice(&config.mu0)))
}

fn assert_near(found: Option<f64>, expected: Option<f64>, n: usize) {
    assert_eq!(found.is_some(), expected.is_some(), "trial {n}: {found:?}, not {expected:?}");
    let error = found.unwrap_or(0.0) - expected.unwrap_or(0.0);
    assert!(error.abs() < 1e-9, "trial {n}: {found:?}, not {expected:?}");
}

#[test]
fn replays_a_run_event_by_event() {
    let runs: Vec<Replay> = read("algorithm1_replay.json");
    assert!(!runs.is_empty());
    for run in runs {
        let mut search = search(&run.config);
        for (n, step) in run.trace.iter().enumerate() {
            let z = DVector::from_column_slice(&run.z[n]);
            let (component, theta) = search.mixture().draw(run.u[n], &z);
            assert_eq!(component, step.comp, "trial {n}");
            if let Some(expected) = &step.theta {
                let expected = DVector::from_column_slice(expected);
                assert!((&theta - &expected).amax() <= 1e-9 * expected.amax(), "trial {n}");
            }
            let rollout = n as u64 + 1;
            search.tell(&Trial {
                rollout,
                theta,
                reward: step.r,
                success: false,
                measured: Vec::new(),
            });
            let event = search.last_event();
            assert_eq!((event.split, event.merged), (step.event & 1 != 0, step.event & 2 != 0));
            assert_eq!(search.mixture().components.len(), step.n_components, "trial {n}");
            assert_near(event.split_gain, step.split_gain, n);
            assert_near(event.merge_loss, step.merge_loss, n);
        }
        run.end.assert_close(search.mixture(), 1e-9);
    }
}

fn run(seed: u64, n: u64, reward: impl Fn(&DVector<f64>) -> f64) -> Algorithm1 {
    let start = DVector::from_vec(vec![2.0, 1.0]);
    let mut search = Algorithm1::new(Algorithm1Config::default(), seed, Space::white(start));
    for rollout in 1..=n {
        let Proposal { theta, .. } = search.ask(rollout, &[]);
        search.tell(&Trial {
            rollout,
            reward: reward(&theta),
            theta,
            success: false,
            measured: Vec::new(),
        });
    }
    search
}

fn hill(theta: &DVector<f64>) -> f64 {
    (-0.5 * theta.norm_squared()).exp()
}

#[test]
fn same_seed_same_bits_and_asking_twice_changes_nothing() {
    let (a, b) = (run(6, 50, hill), run(6, 50, hill));
    assert_eq!(a.ask(51, &[]), b.ask(51, &[]));
    assert_eq!(a.ask(51, &[]), a.ask(51, &[]));
    assert_ne!(a.ask(51, &[]), run(7, 50, hill).ask(51, &[]));
}

#[test]
fn waits_for_the_initial_trials_and_for_a_reward() {
    assert_eq!(run(1, 4, hill).mean(), &DVector::from_vec(vec![2.0, 1.0]));
    assert_ne!(run(1, 5, hill).mean(), &DVector::from_vec(vec![2.0, 1.0]));
    let search = run(1, 30, |_| 0.0);
    assert_eq!(search.mean(), &DVector::from_vec(vec![2.0, 1.0]));
    assert_eq!(search.last_event(), Event::default());
}

#[test]
fn stays_sound_on_flat_and_tiny_rewards() {
    for reward in [1.0, 1e-300, 1e300] {
        let search = run(3, 60, |_| reward);
        assert!(search.ask(61, &[]).theta.iter().all(|x| x.is_finite()));
        assert!(search.mixture().components.len() <= 10);
    }
}

#[test]
fn keeps_within_the_box() {
    let bounds = Some(Bounds::new(2, &[0.0, 0.0], &[3.0, 1.5]).unwrap());
    let space = Space { bounds: bounds.clone(), ..Space::white(DVector::from_vec(vec![2.0, 1.0])) };
    let mut search = Algorithm1::new(Algorithm1Config::default(), 1, space);
    for rollout in 1..=100 {
        let Proposal { theta, .. } = search.ask(rollout, &[]);
        assert!(bounds.as_ref().unwrap().contains(&theta), "{theta}");
        search.tell(&Trial {
            rollout,
            reward: theta.sum(),
            theta,
            success: false,
            measured: Vec::new(),
        });
    }
}
