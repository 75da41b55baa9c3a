//! Ball and string against what is known of pendulums, throws and bounces; the cup on the arm.

// Monogram notation.
#![allow(non_snake_case)]

mod common;

use common::{BOTH, wam};
use nalgebra::{Isometry3, Translation3, UnitQuaternion, Vector3};
use physics::arm::{JointVector, dynamics, kinematics};
use physics::cup::outcome::OutcomeTracker;
use physics::cup::{Ball, CupConfig, CupMotion, CupPlant, Reaction, WAM7_CUP_POSTURE};
use physics::plant::{ObjectState, Plant};

const GRAVITY: Vector3<f64> = Vector3::new(0.0, 0.0, -9.81);
const DT: f64 = 2.5e-4;

fn still(X_WP: Isometry3<f64>) -> CupMotion {
    CupMotion { X_WP, v_WP: Vector3::zeros(), w_WP: Vector3::zeros() }
}

/// Steps `ball` for `duration_s` under a cup that stands still; returns the sum of what it received.
fn swing(ball: &mut Ball, cup: &CupMotion, duration_s: f64) -> Reaction {
    let mut reaction = Reaction::NONE;
    for _ in 0..(duration_s / DT).round() as usize {
        ball.step(cup, &GRAVITY, DT, &CupConfig::default(), &mut reaction);
    }
    reaction
}

#[test]
fn a_ball_at_rest_hangs_and_the_cup_carries_its_weight() {
    let (config, cup) = (CupConfig::default(), still(Isometry3::identity()));
    let mut ball = Ball::hanging(&cup.X_WP, &config);
    let reaction = swing(&mut ball, &cup, 1.0);
    assert!((ball.p_WO + Vector3::z() * config.string_length).norm() < 1e-9, "{ball:?}");
    let weight = config.ball_mass * 9.81;
    assert!((reaction.impulse.z + weight).abs() < 1e-3 * weight, "{reaction:?}");
}

/// T = 2π √(L/g) for small angles, and next to no loss.
#[test]
fn a_small_swing_has_the_period_of_a_pendulum() {
    let (config, cup) = (CupConfig::default(), still(Isometry3::identity()));
    let mut ball = Ball::hanging(&cup.X_WP, &config);
    let (L, angle) = (config.string_length, 0.05_f64);
    ball.p_WO = Vector3::new(angle.sin(), 0.0, -angle.cos()) * L;
    let period_s = std::f64::consts::TAU * (L / 9.81).sqrt();
    swing(&mut ball, &cup, period_s);
    assert!((ball.p_WO.x - angle.sin() * L).abs() < 0.02 * angle * L, "{ball:?}");
    swing(&mut ball, &cup, period_s / 4.0);
    assert!(ball.p_WO.x.abs() < 0.05 * angle * L, "{ball:?}");
    let speed = angle * (9.81 * L).sqrt();
    assert!((ball.v_WO.norm() - speed).abs() < 0.02 * speed, "{ball:?}");
}

#[test]
fn a_slack_string_lets_the_ball_fly_and_holds_it_at_its_length() {
    let (config, cup) = (CupConfig::default(), still(Isometry3::identity()));
    let mut ball = Ball::hanging(&cup.X_WP, &config);
    ball.p_WO = Vector3::new(0.2, 0.0, 0.0);
    ball.v_WO = Vector3::new(0.0, 0.0, 1.0);
    swing(&mut ball, &cup, 0.1);
    let flown = 0.1 - 0.5 * 9.81 * 0.01;
    assert!((ball.p_WO.z - flown).abs() < 1e-3 && ball.p_WO.x == 0.2, "{ball:?}");
    ball.v_WO = Vector3::new(30.0, 0.0, 0.0);
    for _ in 0..4000 {
        swing(&mut ball, &cup, DT);
        assert!(ball.p_WO.norm() < config.string_length + 1e-9, "{ball:?}");
    }
}

/// From above into the middle, and from above onto the rim.
#[test]
fn a_ball_falls_into_the_cup_and_stays_and_bounces_off_its_outside() {
    let (config, cup) = (CupConfig::default(), still(Isometry3::identity()));
    let mut ball = Ball::hanging(&cup.X_WP, &config);
    ball.p_WO = Vector3::new(0.01, -0.02, 0.2);
    swing(&mut ball, &cup, 2.0);
    assert!(Ball::is_inside(&ball.p_WO, &config) && ball.is_touching, "{ball:?}");
    assert!(ball.v_WO.norm() < 0.1, "{ball:?}");

    let mut ball = Ball::hanging(&cup.X_WP, &config);
    ball.p_WO = Vector3::new(0.08, 0.0, 0.2);
    let mut nearest = f64::INFINITY;
    for _ in 0..8000 {
        swing(&mut ball, &cup, DT);
        nearest = nearest.min(ball.p_WO.xy().norm());
        assert!(!Ball::is_inside(&ball.p_WO, &config), "{ball:?}");
    }
    assert!(nearest < config.rim_radius, "it came under the cup: {nearest}");
}

/// The ball never leaves through wall or bottom, however the cup is shaken below what throws it out.
#[test]
fn a_tilted_cup_keeps_the_ball() {
    let config = CupConfig::default();
    let mut ball = Ball::hanging(&Isometry3::identity(), &config);
    ball.p_WO = Vector3::new(0.0, 0.0, 0.03);
    let mut reaction = Reaction::NONE;
    for step in 0..20_000 {
        let t_s = f64::from(step) * DT;
        let (angle, rate) = (0.4 * (3.0 * t_s).sin(), 1.2 * (3.0 * t_s).cos());
        let R = UnitQuaternion::from_axis_angle(&Vector3::y_axis(), angle);
        let p = Vector3::new(0.05 * (5.0 * t_s).sin(), 0.0, 0.0);
        let cup = CupMotion {
            X_WP: Isometry3::from_parts(Translation3::from(p), R),
            v_WP: Vector3::new(0.25 * (5.0 * t_s).cos(), 0.0, 0.0),
            w_WP: Vector3::new(0.0, rate, 0.0),
        };
        ball.step(&cup, &GRAVITY, DT, &config, &mut reaction);
        let p_PO = cup.X_WP.inverse_transform_point(&ball.p_WO.into()).coords;
        assert!(Ball::is_inside(&p_PO, &config), "{t_s}: {p_PO}");
    }
}

/// The arm, held where it is, carries the ball; a reset begins anew, bit for bit.
#[test]
fn the_arm_feels_the_ball_and_a_reset_repeats_every_bit() {
    let model = wam("wam7_cup.urdf", "cup");
    let q0 = WAM7_CUP_POSTURE;
    let run = |plant: &mut CupPlant| -> (JointVector, ObjectState) {
        plant.begin_reset();
        for _ in 0..1500 {
            let state = plant.measure();
            let qdd = (q0 - state.q) * 400.0 - state.qd * 40.0;
            plant.apply(&dynamics::rnea(&model, &state.q, &state.qd, &qdd));
            plant.advance();
        }
        let state = plant.measure();
        (state.q, state.object)
    };
    let height = |q: &JointVector| kinematics::tip_pose(&model, q).translation.vector.z;
    let sags = BOTH.map(|dynamics| {
        let light = CupConfig { dynamics, ..CupConfig::default() };
        let heavy = CupConfig { ball_mass: 0.05, ..light };
        let mut plant = CupPlant::new(&model, &q0, &light);
        let first = run(&mut plant);
        assert_eq!(first, run(&mut plant));
        let (sagged, object) = run(&mut CupPlant::new(&model, &q0, &heavy));
        let (lightly, heavily) = (height(&q0) - height(&first.0), height(&q0) - height(&sagged));
        assert!(heavily > 3.0 * lightly && lightly > 0.0, "{dynamics:?}: {lightly} {heavily}");
        let below = height(&sagged) - object.p_WO.z;
        assert!((below - heavy.string_length).abs() < 1e-3, "{dynamics:?}: {below}");
        heavily
    });
    // The weight is the same, whichever way the arm is moved.
    assert!((sags[0] / sags[1] - 1.0).abs() < 1e-3, "{sags:?}");
}

/// A ball on a parabola that comes down beside the middle, and one that stays inside.
#[test]
fn the_tracker_tells_apex_miss_and_catch() {
    let config = CupConfig::default();
    let X_WP = Isometry3::translation(0.5, 0.0, 0.7);
    let at = |x: f64, z: f64| ObjectState {
        p_WO: Vector3::new(0.5 + x, 0.0, 0.7 + z),
        R_WO: UnitQuaternion::identity(),
        in_contact: false,
    };
    let mut tracker = OutcomeTracker::new(&config);
    for tick in 0..=400 {
        let t_s = f64::from(tick) * 1e-3;
        tracker.observe(t_s, &X_WP, &at(0.1 * t_s, config.depth + 4.0 * t_s * (0.3 - t_s)));
    }
    let outcome = tracker.outcome();
    assert!((outcome.apex_m - 0.09).abs() < 1e-6, "{outcome:?}");
    assert!(outcome.crossed && (outcome.crossing_time_s - 0.3).abs() < 1.5e-3, "{outcome:?}");
    assert!((outcome.miss_m - 0.03).abs() < 1e-3 && !outcome.caught, "{outcome:?}");

    for tick in 401..=700 {
        tracker.observe(f64::from(tick) * 1e-3, &X_WP, &at(0.0, 0.03));
        assert_eq!(tracker.outcome().caught, tick > 601, "{tick}");
    }

    let mut low = OutcomeTracker::new(&config);
    low.observe(0.0, &X_WP, &at(0.0, -config.string_length));
    low.observe(0.1, &X_WP, &at(0.3, 0.0));
    let outcome = low.outcome();
    assert!(!outcome.crossed && (outcome.apex_m + config.depth).abs() < 1e-12, "{outcome:?}");
    assert!((outcome.miss_m - config.depth.hypot(0.3)).abs() < 1e-12, "{outcome:?}");
}
