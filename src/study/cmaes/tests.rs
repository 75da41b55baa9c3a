//! The crate behind the trait: it climbs, repeats, resumes, restarts, survives, stays in its box.

use search::Bounds;

use super::*;

fn origin(dim: usize) -> Space {
    Space::white(DVector::zeros(dim))
}

fn hill(theta: &DVector<f64>) -> f64 {
    (-theta.map(|x| (x - 1.0).powi(2)).mean()).exp()
}

fn drive(search: &mut Cma, n: u64, f: impl Fn(&DVector<f64>) -> f64) -> Vec<Trial> {
    let trial = |rollout| {
        let Proposal { theta, .. } = search.ask(rollout, &[]);
        let trial =
            Trial { rollout, reward: f(&theta), theta, success: false, measured: Vec::new() };
        search.tell(&trial);
        trial
    };
    (1..=n).map(trial).collect()
}

fn restarts() -> CmaConfig {
    CmaConfig { max_generations: Some(5), population: Some(6), ..CmaConfig::default() }
}

#[test]
fn climbs_a_hill() {
    let config = CmaConfig { initial_std: 0.7, ..CmaConfig::default() };
    for (dim, n) in [(2, 200), (10, 1000)] {
        let mut search = Cma::new(config, 1, origin(dim));
        drive(&mut search, n, hill);
        assert!(hill(search.mean()) > 0.999, "D = {dim}: {}", hill(search.mean()));
    }
    // A generation of 18 in 112 dimensions.
    let mut search = Cma::new(config, 1, origin(112));
    drive(&mut search, 400, hill);
    assert!(hill(search.mean()) > 0.5, "{}", hill(search.mean()));
}

/// The replayed points are those the crate itself would have visited.
#[test]
fn visits_the_points_of_the_crates_own_loop() {
    let config = CmaConfig { population: Some(6), ..CmaConfig::default() };
    let mut search = Cma::new(config, 5, origin(3));
    let told = drive(&mut search, 60, hill);
    let mut visited: Vec<Vec<f64>> = Vec::new();
    let cost = |x: &cmaes::DVector<f64>| {
        visited.push(x.as_slice().to_vec());
        -(hill(&DVector::from_column_slice(x.as_slice())) + f64::MIN_POSITIVE).ln()
    };
    let mut cma = cmaes::CMAESOptions::new(vec![0.0; 3], config.initial_std)
        .population_size(6)
        .seed(stream(!5, 0).next_u64())
        .build(cost)
        .unwrap();
    (0..10).for_each(|_| drop(cma.next()));
    drop(cma);
    let told: Vec<Vec<f64>> = told.iter().map(|trial| trial.theta.as_slice().to_vec()).collect();
    assert_eq!(told, visited);
}

#[test]
fn repeats_its_bits_and_resumes_by_retelling() {
    for config in [CmaConfig::default(), restarts()] {
        let (mut a, mut b) = (Cma::new(config, 6, origin(4)), Cma::new(config, 6, origin(4)));
        drive(&mut a, 101, hill).iter().for_each(|trial| b.tell(trial));
        assert_eq!(a.snapshot(102), b.snapshot(102));
        assert_eq!(a.ask(102, &[]), b.ask(102, &[]));
        assert_eq!(a.ask(102, &[]), a.ask(102, &[]));
        let mut other = Cma::new(config, 7, origin(4));
        drive(&mut other, 101, hill);
        assert_ne!(a.ask(102, &[]), other.ask(102, &[]));
    }
}

#[test]
fn restarts_elsewhere_and_answers_with_the_best_of_its_runs() {
    // Two equal hills, at −3 and 3.
    let two = |theta: &DVector<f64>| (-(theta[0].abs() - 3.0).powi(2)).exp();
    let mut search = Cma::new(restarts(), 1, origin(1));
    drive(&mut search, 600, two);
    assert_eq!(search.run, 20);
    let modes = search.modes();
    assert!(modes.iter().any(|mode| mode.mean[0] < -2.5));
    assert!(modes.iter().any(|mode| mode.mean[0] > 2.5));
    assert!(modes.iter().all(|mode| two(&mode.mean) > 0.89));
}

#[test]
fn survives_hostile_rewards() {
    let rewards: [fn(&DVector<f64>) -> f64; 4] =
        [|_| 0.0, |_| 0.7, |theta| 1e300 * hill(theta), |theta| f64::from(theta[0] > 1.6)];
    for reward in rewards {
        for dim in [1, 8] {
            let mut search = Cma::new(CmaConfig::default(), 2, origin(dim));
            let told = drive(&mut search, 600, reward);
            assert!(told.iter().all(|trial| trial.theta.iter().all(|x| x.is_finite())));
        }
    }
}

#[test]
fn stays_in_its_box() {
    let bounds = Bounds::new(3, &[-0.2; 3], &[0.5; 3]).unwrap();
    let space = Space { bounds: Some(bounds.clone()), ..origin(3) };
    let mut search = Cma::new(CmaConfig { initial_std: 0.3, ..restarts() }, 2, space);
    let told = drive(&mut search, 200, hill);
    assert!(told.iter().all(|trial| bounds.contains(&trial.theta)));
    assert!(search.modes().iter().all(|mode| hill(&mode.mean) > 0.65));
}
