//! The search on landscapes whose regions are known.

use super::*;

fn space() -> Space {
    let bounds = Bounds::new(2, &[-5.0, 0.0], &[5.0, 1.0]).unwrap();
    Space { bounds: Some(bounds), ..Space::white(DVector::zeros(2)) }
}

/// 150 trials of a reward over fractions of the box.
fn run(
    config: RegionsConfig,
    seed: u64,
    reward: impl Fn(f64, f64) -> f64,
) -> (Regions, Vec<Trial>) {
    let mut search = Regions::new(config, seed, space());
    let mut trials = Vec::new();
    for rollout in 1..=150 {
        let theta = search.ask(rollout, &[]).theta;
        assert_eq!(search.ask(rollout, &[]).theta, theta);
        assert!(search.bounds.contains(&theta), "{theta}");
        let u = search.bounds.fractions(&theta);
        trials.push(Trial {
            rollout,
            theta,
            reward: reward(u[0], u[1]),
            success: false,
            measured: Vec::new(),
        });
        search.tell(trials.last().unwrap());
    }
    (search, trials)
}

fn hill(x: f64, y: f64, centre: [f64; 2]) -> f64 {
    (-30.0 * ((x - centre[0]).powi(2) + (y - centre[1]).powi(2))).exp()
}

/// r = 1 all along a circle, which is one region without a centre.
fn ring(x: f64, y: f64) -> f64 {
    (-10.0 * ((x - 0.5).hypot(y - 0.5) - 0.3).abs()).exp()
}

#[test]
fn two_hills_are_two_regions_and_a_lower_one_is_none() {
    for seed in 0..5 {
        let (search, _) = run(RegionsConfig::default(), seed, |x, y| {
            let low = 0.6 * hill(x, y, [0.2, 0.8]);
            hill(x, y, [0.2, 0.2]).max(hill(x, y, [0.8, 0.7])).max(low)
        });
        let modes = search.modes();
        assert_eq!(modes.len(), 2, "seed {seed}");
        assert!((modes.iter().map(|mode| mode.prior).sum::<f64>() - 1.0).abs() < 1e-12);
        for centre in [[0.2, 0.2], [0.8, 0.7]] {
            let expected = search.bounds.at(&centre);
            let near = |mode: &&Mode| {
                (search.bounds.fractions(&mode.mean) - DVector::from_column_slice(&centre)).norm()
                    < 0.03
            };
            let mode = modes.iter().find(near).unwrap_or_else(|| panic!("nothing at {expected}"));
            assert!(mode.covariance.clone().cholesky().is_some());
        }
    }
}

/// What the bridges are for: without them the ring is several regions.
#[test]
fn a_ring_is_one_region() {
    let count = |n_bridges: usize| {
        let config = RegionsConfig { n_bridges, ..RegionsConfig::default() };
        let n_modes = |seed| run(config, seed, ring).0.modes().len();
        (0..5).map(n_modes).collect::<Vec<usize>>()
    };
    assert_eq!(count(60), [1; 5]);
    assert!(count(0).iter().sum::<usize>() > 8);
}

#[test]
fn every_estimator_leads_to_the_same_regions_here() {
    for estimator in [Estimator::Persistence, Estimator::Dirichlet, Estimator::Spectral] {
        let config = RegionsConfig { estimator, ..RegionsConfig::default() };
        let two = |x, y| hill(x, y, [0.2, 0.2]).max(hill(x, y, [0.8, 0.7]));
        assert_eq!(run(config, 3, two).0.modes().len(), 2, "{estimator:?}");
    }
}

#[test]
fn telling_the_same_trials_again_resumes() {
    let (search, trials) = run(RegionsConfig::default(), 4, ring);
    let mut other = Regions::new(RegionsConfig::default(), 4, space());
    trials.iter().for_each(|trial| other.tell(trial));
    assert_eq!(other.ask(151, &[]), search.ask(151, &[]));
    assert_eq!(other.modes(), search.modes());
    let seeds = [4, 5].map(|seed| run(RegionsConfig::default(), seed, ring).1);
    assert_ne!(seeds[0], seeds[1]);
}

/// As long as nothing is rewarded the box is filled more densely; the first reward is climbed.
#[test]
fn without_rewards_it_goes_on_filling() {
    let (search, trials) = run(RegionsConfig::default(), 1, |_, _| 0.0);
    assert!(matches!(search.step, Step::Fill));
    assert_eq!(search.modes().len(), 1);
    assert_ne!(trials[140].theta, trials[149].theta);

    let (search, _) = run(RegionsConfig::default(), 1, |x, _| (x - 0.99).max(0.0));
    assert!(search.best_reward() > 0.009, "{}", search.best_reward());
}

/// Equal trials, trials far outside of the box, rewards near the ends of the number range.
#[test]
fn told_trials_may_be_anything() {
    for theta in [[0.0, 0.5], [1e6, -1e6]] {
        let mut search = Regions::new(RegionsConfig::default(), 1, space());
        for rollout in 1..=120 {
            let reward = [1e-300, 1e300, 1.0, 0.0][rollout as usize % 4];
            let theta = DVector::from_column_slice(&theta);
            search.tell(&Trial { rollout, theta, reward, success: false, measured: Vec::new() });
            let asked = search.ask(rollout + 1, &[]).theta;
            assert!(search.bounds.contains(&asked), "{asked}");
        }
        assert!(search.modes().iter().all(|mode| mode.mean.iter().all(|x| x.is_finite())));
    }
}

#[test]
fn without_a_box_there_is_one_around_the_start() {
    let start = DVector::from_vec(vec![100.0, -100.0]);
    let config = RegionsConfig { half_width: 2.0, ..RegionsConfig::default() };
    let search = Regions::new(config, 1, Space::white(start.clone()));
    assert!((search.ask(1, &[]).theta - start).amax() <= 2.0);
}
