//! Pay for compliance against its formula, and what a search knows of it.

use super::*;
use crate::LearnerConfig;
use crate::demonstration::Demonstration;
use crate::parameters::PolicyIds;
use crate::problem::Problem;
use search::normals::{standard_normal, stream};

fn pancake() -> Demonstration {
    let path = concat!(env!("CARGO_MANIFEST_DIR"), "/../demos/pancake.csv");
    let text = std::fs::read_to_string(path).expect("the project's demonstration");
    Demonstration::parse("pancake.csv", &text).expect("it is valid")
}

fn config() -> ComplianceConfig {
    ComplianceConfig { weight: 1.0, stiff: 900.0, soft: 50.0 }
}

/// A policy of eight components with the stiffness `k` of each.
fn policy(k: impl Fn(usize) -> f64) -> PolicyMsg {
    let mut policy = crate::initial_policy::initial_policy(
        &pancake(),
        &LearnerConfig::default().initial_policy(),
    );
    for (i, component) in policy.components[..8].iter_mut().enumerate() {
        for c in 0..4 {
            component.stiffness[shm_types::policy::packed_index(c, c)] = k(i);
        }
    }
    policy.sealed()
}

#[test]
fn half_the_stiffness_pays_the_same_anywhere_within_bounds() {
    let of = |k: f64| config().measure(&policy(|_| k));
    assert!((of(200.0) - (900.0_f64 / 200.0).ln()).abs() < 1e-12);
    assert!((of(100.0) - of(200.0) - 2.0_f64.ln()).abs() < 1e-12);
    assert_eq!(of(900.0), 0.0);
    assert_eq!(of(5000.0), 0.0, "nothing is taken away");
    assert!((of(10.0) - of(50.0)).abs() < 1e-12, "nor paid without end");
    // A part of the movement counts as much as it lasts; the two halves together are the whole.
    let [first, second] = [0..4, 4..8].map(|half: std::ops::Range<usize>| {
        config().measure(&policy(|i| if half.contains(&i) { 100.0 } else { 200.0 })) - of(200.0)
    });
    assert!((first + second - 2.0_f64.ln()).abs() < 1e-12);
    assert!((first / second - 1.0).abs() < 0.05, "{first} {second}");
}

/// A search prefers the more compliant of two policies, by the difference in compliance.
#[test]
fn a_search_knows_what_will_be_measured() {
    let learner = LearnerConfig::default();
    let problem = Problem::new(&learner, &[pancake()]).unwrap();
    let space = &problem.spaces[0];
    let known = space.known.as_ref().expect("compliance pays by default");
    let inner = known.along(&space.theta_0, &space.exploration);
    let mut rng = stream(3, 1);
    let of = |e: &DVector<f64>| {
        let theta = &space.theta_0 + &space.exploration * e;
        let measured = learner.compliance.measure(&problem.decode(&theta, PolicyIds::default()));
        assert!((known.of(&theta) - inner.of(e)).abs() < 1e-9);
        measured - inner.of(e)
    };
    let start = of(&DVector::zeros(space.exploration.ncols()));
    for _ in 0..50 {
        let e = DVector::from_fn(space.exploration.ncols(), |_, _| standard_normal(&mut rng));
        assert!((of(&e) - start).abs() < 1e-9, "{} {start}", of(&e));
    }
}
