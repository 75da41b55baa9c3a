//! What every method for comparison must do: climb, repeat, resume, survive, stay in its box.

use nalgebra::DVector;

use super::*;

const METHODS: [Method; 5] =
    [Method::Cem, Method::Pi2, Method::Rwr, Method::Reinforce, Method::Enac];

fn built(method: Method, seed: u64, space: Space) -> Box<dyn Search> {
    build(&SearchConfig { method, ..SearchConfig::default() }, seed, space)
}

fn origin(dim: usize) -> Space {
    Space::white(DVector::zeros(dim))
}

/// exp(−‖θ − 1‖²/D): 0.37 at the origin.
fn hill(theta: &DVector<f64>) -> f64 {
    (-theta.map(|x| (x - 1.0).powi(2)).mean()).exp()
}

/// Trials `from` to `to` of a search.
fn drive(
    search: &mut dyn Search,
    from: u64,
    to: u64,
    f: impl Fn(&DVector<f64>) -> f64,
) -> Vec<Trial> {
    let trial = |rollout| {
        let Proposal { theta, .. } = search.ask(rollout, &[]);
        let trial =
            Trial { rollout, reward: f(&theta), theta, success: false, measured: Vec::new() };
        search.tell(&trial);
        trial
    };
    (from..=to).map(trial).collect()
}

/// A flat reward, rewards at the ends of the number range, and one trial in a hundred rewarded.
fn hostile(kind: usize, theta: &DVector<f64>) -> f64 {
    match kind {
        0 => 0.0,
        1 => 0.7,
        2 => 1e300 * hill(theta),
        3 => 1e-310 * hill(theta),
        _ => f64::from(theta[0] > 1.6),
    }
}

#[test]
fn all_climb_a_hill() {
    for method in METHODS {
        for (dim, n, reached) in [(2, 300, 0.98), (10, 1500, 0.97)] {
            for seed in 0..5 {
                let mut search = built(method, seed, origin(dim));
                drive(&mut *search, 1, n, hill);
                let found = hill(&search.modes()[0].mean);
                assert!(found > reached, "{method:?}, D = {dim}, seed {seed}: {found}");
            }
        }
    }
}

#[test]
fn all_improve_in_112_dimensions_where_a_batch_has_fewer_trials_than_parameters() {
    for method in METHODS {
        let mut search = built(method, 3, origin(112));
        drive(&mut *search, 1, 500, hill);
        let found = hill(search.mean());
        assert!(found > 0.42, "{method:?}: {found}");
    }
}

#[test]
fn all_repeat_their_bits_and_resume_by_retelling() {
    for method in METHODS {
        let (mut a, mut b) = (built(method, 6, origin(8)), built(method, 6, origin(8)));
        let told = drive(&mut *a, 1, 57, hill);
        told.iter().for_each(|trial| b.tell(trial));
        assert_eq!(a.snapshot(58), b.snapshot(58), "{method:?}");
        assert_eq!(a.ask(58, &[]), b.ask(58, &[]), "{method:?}");
        assert_eq!(a.ask(58, &[]), a.ask(58, &[]), "{method:?}");
        let mut other = built(method, 7, origin(8));
        drive(&mut *other, 1, 57, hill);
        assert_ne!(a.ask(58, &[]), other.ask(58, &[]), "{method:?}");
    }
}

#[test]
fn the_distribution_waits_for_the_whole_batch() {
    for method in METHODS {
        let mut search = built(method, 1, origin(3));
        let before = search.snapshot(1);
        let mut told = 0;
        while search.snapshot(1) == before {
            told += 1;
            drive(&mut *search, told, told, hill);
        }
        assert_eq!(told, if method == Method::Cem { 20 } else { 10 }, "{method:?}");
    }
}

#[test]
fn all_survive_hostile_rewards() {
    for method in METHODS {
        for kind in 0..5 {
            for dim in [1, 8] {
                let mut search = built(method, 2, origin(dim));
                drive(&mut *search, 1, 400, |theta| hostile(kind, theta));
                let at = format!("{method:?}, kind {kind}, D = {dim}");
                assert!(search.ask(401, &[]).theta.iter().all(|x| x.is_finite()), "{at}");
                assert!(search.snapshot(401).std.iter().all(|s| *s > 0.0), "{at}");
                if kind < 2 {
                    assert_eq!(search.mean(), &DVector::zeros(dim), "{at}: nothing to learn");
                }
            }
        }
    }
}

#[test]
fn all_survive_equal_and_far_thetas() {
    for method in METHODS {
        for far in [0.3, 1e6] {
            let mut search = built(method, 2, origin(4));
            for rollout in 1..=100 {
                let theta = DVector::from_element(4, far);
                let reward = rollout as f64;
                search.tell(&Trial {
                    rollout,
                    theta,
                    reward,
                    success: false,
                    measured: Vec::new(),
                });
            }
            assert!(search.ask(101, &[]).theta.iter().all(|x| x.is_finite()), "{method:?}, {far}");
            assert!(search.snapshot(101).std.min() > 0.0, "{method:?}, {far}");
        }
    }
}

#[test]
fn all_stay_in_their_box() {
    for method in METHODS {
        let bounds = Bounds::new(3, &[-0.2; 3], &[0.5; 3]).unwrap();
        let space = Space { bounds: Some(bounds.clone()), ..origin(3) };
        let mut search = built(method, 2, space);
        let told = drive(&mut *search, 1, 200, hill);
        assert!(told.iter().all(|trial| bounds.contains(&trial.theta)), "{method:?}");
        assert!(bounds.contains(search.mean()), "{method:?}");
        assert!(search.mean().min() > 0.35, "{method:?}: the best corner is at 0.5");
    }
}

#[test]
fn settings_outside_their_ranges_are_named() {
    let mut config = SearchConfig::default();
    config.cem.n_elites = 30;
    let error = config.validate().unwrap_err().to_string();
    assert!(error.contains("search.cem.n_elites is 30: use 1 to 20"), "{error}");
    let mut config = SearchConfig::default();
    config.enac.batch.floor_min = 1.0;
    let error = config.validate().unwrap_err().to_string();
    assert!(error.contains("search.enac.batch.floor_min is 1"), "{error}");
}
