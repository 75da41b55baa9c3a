//! A scripted toss in the simulated world, watched by the tracker: the two must tell one story.

// Monogram notation.
#![allow(non_snake_case)]

mod common;

use common::{BOTH, quintic, wam_with_pan};
use nalgebra::{UnitQuaternion, Vector3};
use physics::arm::inverse_kinematics;
use physics::arm::{ArmModel, JointVector, dynamics, kinematics};
use physics::pancake::outcome::{OutcomeConfig, OutcomeTracker};
use physics::pancake::{PancakeConfig, PancakePlant, WAM7_START_POSTURE};
use physics::plant::{Dynamics, Plant};

const PERIOD_S: f64 = 1e-3;

/// The posture with the pan's centre `up` m above its start, `pitch` rad nose-down.
fn posture(model: &ArmModel, up: f64, pitch: f64) -> JointVector {
    let q0 = WAM7_START_POSTURE;
    let mut X_WP = kinematics::tip_pose(model, &q0);
    X_WP.translation.vector.z += up;
    X_WP.rotation *= UnitQuaternion::from_axis_angle(&Vector3::y_axis(), pitch);
    inverse_kinematics::solve(model, &X_WP, &q0).unwrap()
}

/// Desired joint motion (q, q̇, q̈) along quintics between waypoints (arrival time s, posture).
fn along(waypoints: &[(f64, JointVector)], t_s: f64) -> (JointVector, JointVector, JointVector) {
    let next = waypoints.iter().position(|(arrival, _)| t_s < *arrival);
    let Some(next) = next else {
        let (_, q) = waypoints[waypoints.len() - 1];
        return (q, JointVector::zeros(), JointVector::zeros());
    };
    let ((start, from), (end, to)) = (waypoints[next - 1], waypoints[next]);
    let duration = end - start;
    let (s, sd, sdd) = quintic((t_s - start) / duration);
    let way = to - from;
    (from + way * s, way * (sd / duration), way * (sdd / duration.powi(2)))
}

#[test]
fn scripted_flick_flips_the_pancake_and_catches_it() {
    let apexes = BOTH.map(flick);
    assert!((apexes[0] - apexes[1]).abs() < 2e-3, "{apexes:?}");
}

/// Height of the toss, m.
fn flick(dynamics: Dynamics) -> f64 {
    let model = wam_with_pan();
    let waypoints = [
        (0.0, WAM7_START_POSTURE),
        (0.4, posture(&model, -0.08, 0.3)),
        (0.66, posture(&model, 0.2, -0.5)),
        (0.96, WAM7_START_POSTURE),
    ];
    let solver_iterations = dynamics.substeps();
    let config = PancakeConfig { dynamics, solver_iterations, ..PancakeConfig::default() };
    let mut plant = PancakePlant::new(&model, &WAM7_START_POSTURE, &config);
    let mut tracker = OutcomeTracker::new(&OutcomeConfig::default());
    let mut heights = Vec::new();
    while !tracker.is_finished() && heights.len() < 3000 {
        let t_s = heights.len() as f64 * PERIOD_S;
        let state = plant.measure();
        tracker.observe(t_s, &kinematics::tip_pose(&model, &state.q), &state.object);
        heights.push(state.object.p_WO.z);
        let (q_d, qd_d, qdd_d) = along(&waypoints, t_s);
        let qdd_c = qdd_d + (qd_d - state.qd) * 40.0 + (q_d - state.q) * 400.0;
        plant.apply(&dynamics::rnea(&model, &state.q, &state.qd, &qdd_c));
        plant.advance();
    }
    let outcome = tracker.outcome();
    println!("{outcome:#?}");
    assert!(tracker.is_finished() && outcome.flipped_and_caught && !outcome.exploit);
    assert!((1.0..3.0).contains(&outcome.release_speed));

    // Between release and crossing nothing but gravity acts: the contact flag tells the truth, but
    // for two ticks, because it speaks of the last sub-step.
    let tick = |t_s: f64| (t_s / PERIOD_S).round() as usize;
    let flight = &heights[tick(outcome.release_time_s) + 3..=tick(outcome.crossing_time_s)];
    assert!(flight.len() > 300);
    for z in flight.windows(3) {
        let acceleration = (z[2] - 2.0 * z[1] + z[0]) / PERIOD_S.powi(2);
        assert!((acceleration + 9.81).abs() < 1e-6, "{acceleration} m/s² in flight");
    }
    let highest = heights.iter().copied().fold(f64::NEG_INFINITY, f64::max);
    assert_eq!(outcome.apex_m, highest - heights[0]);
    outcome.apex_m
}
