//! The tracker on synthetic flights, where everything is known in closed form.

// Monogram notation.
#![allow(non_snake_case)]

use std::f64::consts::PI;

use nalgebra::{Isometry3, Translation3, UnitQuaternion, Vector3};
use physics::pancake::outcome::{Outcome, OutcomeConfig, OutcomeTracker};
use physics::plant::ObjectState;
use physics::referee::{self, State, TossConfig};

const DT_S: f64 = 1e-3;
const G: f64 = 9.81;
const RESTING_HEIGHT: f64 = 0.005;

/// A still pan, and a pancake that leaves it at `release_s` with velocity (vx, 0, vz) m/s, turning
/// about y. Back at its resting height it stays there, flat, with the side up it landed on.
#[derive(Clone, Copy)]
struct Toss {
    release_s: f64,
    vx: f64,
    vz: f64,
    spin: f64,
    /// Does the pan catch it? Otherwise it falls on.
    lands: bool,
}

impl Toss {
    /// 2.5 m/s upwards; the spin makes a half flip by the landing.
    fn half_flip() -> Toss {
        let vz = 2.5;
        Toss { release_s: 0.3, vx: 0.05, vz, spin: PI / (2.0 * vz / G), lands: true }
    }

    fn pan() -> Isometry3<f64> {
        Isometry3::from_parts(Translation3::new(0.78, 0.0, 0.72), UnitQuaternion::identity())
    }

    /// Time from release until the pancake falls through `height` above its resting place.
    fn fall_time(&self, height: f64) -> f64 {
        (self.vz + (self.vz * self.vz - 2.0 * G * height).sqrt()) / G
    }

    fn object(&self, t_s: f64) -> ObjectState {
        let air_time = t_s - self.release_s;
        let rest_after = if self.lands { 2.0 * self.vz / G } else { f64::INFINITY };
        let flown = air_time.clamp(0.0, rest_after);
        let offset = Vector3::new(
            self.vx * flown,
            0.0,
            RESTING_HEIGHT + self.vz * flown - 0.5 * G * flown * flown,
        );
        let mut angle = self.spin * flown;
        let in_contact = air_time <= 0.0 || air_time >= rest_after;
        if in_contact {
            angle = (angle / PI).round() * PI;
        }
        ObjectState {
            p_WO: Toss::pan().translation.vector + offset,
            R_WO: UnitQuaternion::from_axis_angle(&Vector3::y_axis(), angle),
            in_contact,
        }
    }
}

/// Feeds `seconds` of a track, or up to the end of the rollout.
fn track(seconds: f64, object: impl Fn(f64) -> ObjectState) -> OutcomeTracker {
    let mut tracker = OutcomeTracker::new(&OutcomeConfig::default());
    for tick in 0..(seconds / DT_S) as usize {
        let t_s = tick as f64 * DT_S;
        tracker.observe(t_s, &Toss::pan(), &object(t_s));
    }
    tracker
}

fn outcome(toss: Toss) -> Outcome {
    let tracker = track(3.0, |t_s| toss.object(t_s));
    assert!(tracker.is_finished());
    tracker.outcome()
}

fn assert_near(measured: f64, expected: f64, tolerance: f64) {
    assert!((measured - expected).abs() <= tolerance, "{measured} is not {expected}");
}

#[test]
fn measures_a_half_flip() {
    let toss = Toss::half_flip();
    let outcome = outcome(toss);
    println!("{outcome:#?}");
    let air_time = toss.fall_time(0.1 - RESTING_HEIGHT);
    assert!(outcome.tossed && outcome.released && outcome.flipped_and_caught);
    assert!(!outcome.exploit && !outcome.dropped);
    assert_near(outcome.release_time_s, toss.release_s, 1.5 * DT_S);
    // Gravity slows the pancake during the first ticks.
    assert_near(outcome.release_speed, toss.vz.hypot(toss.vx), 2.0 * G * DT_S);
    assert_near(outcome.release_spin, toss.spin, 1e-6);
    assert_near(outcome.release_pitch_rate, toss.spin, 1e-6);
    assert_eq!(outcome.bounce_s, 0.0);
    assert_near(outcome.apex_m, toss.vz * toss.vz / (2.0 * G), 1e-5);
    assert_near(outcome.crossing_time_s, toss.release_s + air_time, DT_S);
    assert_near(outcome.flip_angle_rad, toss.spin * air_time, toss.spin * DT_S);
    assert_near(outcome.lateral_m, toss.vx * air_time, 1e-4);
    assert_near(outcome.distance_m, 0.1_f64.hypot(outcome.lateral_m), toss.vz * DT_S);
    assert_near(outcome.final_lateral_m, toss.vx * 2.0 * toss.vz / G, 1e-9);
    assert_near(outcome.final_tilt_rad, PI, 1e-6);
}

#[test]
fn finishes_half_a_second_after_the_crossing() {
    let toss = Toss::half_flip();
    let end_s = toss.release_s + toss.fall_time(0.1 - RESTING_HEIGHT) + 0.5;
    assert!(!track(end_s - 2.0 * DT_S, |t_s| toss.object(t_s)).is_finished());
    assert!(track(end_s + 2.0 * DT_S, |t_s| toss.object(t_s)).is_finished());
}

#[test]
fn bouncing_is_the_time_off_the_pan_after_the_first_touch() {
    let toss = Toss::half_flip();
    let landing_s = track(3.0, |t_s| toss.object(t_s)).outcome().release_time_s + 2.0 * toss.vz / G;
    // Off the pan for 40 ms, 100 ms after it landed, and for 20 ms after another 100 ms.
    let bounces = |t_s: f64| {
        let t_s = t_s - landing_s;
        (0.1..0.14).contains(&t_s) || (0.24..0.26).contains(&t_s)
    };
    let object = |t_s: f64| {
        let object = toss.object(t_s);
        ObjectState { in_contact: object.in_contact && !bounces(t_s), ..object }
    };
    let outcome = track(3.0, object).outcome();
    assert!(outcome.flipped_and_caught);
    assert_near(outcome.bounce_s, 0.06, 2.5 * DT_S);
    let backwards = track(3.0, |t_s| Toss { spin: -toss.spin, ..toss }.object(t_s)).outcome();
    assert_near(backwards.release_pitch_rate, -toss.spin, 1e-6);
}

#[test]
fn later_ticks_change_nothing() {
    let toss = Toss::half_flip();
    let mut tracker = track(3.0, |t_s| toss.object(t_s));
    let before = tracker.outcome();
    tracker.observe(9.0, &Isometry3::identity(), &toss.object(0.0));
    assert_eq!(tracker.outcome(), before);
}

#[test]
fn full_turn_is_caught_but_not_flipped() {
    let toss = Toss { spin: 2.0 * Toss::half_flip().spin, ..Toss::half_flip() };
    let outcome = outcome(toss);
    assert!(outcome.tossed && !outcome.flipped_and_caught);
    assert_near(outcome.final_tilt_rad, 0.0, 1e-6);
    // arccos(V₀·V) cannot exceed π: what is beyond a half turn counts back.
    let turned = toss.spin * toss.fall_time(0.1 - RESTING_HEIGHT);
    assert_near(outcome.flip_angle_rad, 2.0 * PI - turned, toss.spin * DT_S);
}

/// To both sides, beyond half a turn, and seen from a pan that is not level.
#[test]
fn the_turn_is_not_wrapped_and_counts_from_the_pan() {
    let pitch = 0.2;
    for (spin, vx) in [(1.0, 0.05), (2.0, -0.05), (-1.0, 0.0), (-2.6, 0.08)] {
        let toss = Toss { spin: spin * Toss::half_flip().spin, vx, ..Toss::half_flip() };
        let mut tracker = OutcomeTracker::new(&OutcomeConfig::default());
        for tick in 0..1500 {
            let t_s = tick as f64 * DT_S;
            let tilt = UnitQuaternion::from_axis_angle(&Vector3::y_axis(), pitch);
            let pan = if t_s > toss.release_s { tilt } else { UnitQuaternion::identity() };
            let X_WP = Isometry3::from_parts(Toss::pan().translation, pan);
            tracker.observe(t_s, &X_WP, &toss.object(t_s));
        }
        let (outcome, air_time) = (tracker.outcome(), toss.fall_time(0.1 - RESTING_HEIGHT));
        assert_near(outcome.turn_rad, toss.spin * air_time - pitch, toss.spin.abs() * DT_S);
        assert_near(outcome.forward_m, vx * air_time, 1e-4);
    }
}

#[test]
fn landing_beside_the_pan_is_no_catch() {
    let outcome = outcome(Toss { vx: 0.4, ..Toss::half_flip() });
    assert!(outcome.tossed && !outcome.flipped_and_caught);
    assert!(outcome.final_lateral_m > 0.13);
}

#[test]
fn falling_past_the_pan_ends_as_dropped() {
    let toss = Toss { lands: false, ..Toss::half_flip() };
    let outcome = outcome(toss);
    assert!(outcome.tossed && outcome.dropped && !outcome.flipped_and_caught);
}

#[test]
fn sliding_off_is_a_drop_without_toss() {
    let toss = Toss { vx: 0.3, vz: 0.0, spin: 1.0, lands: false, release_s: 0.3 };
    let outcome = outcome(toss);
    assert!(outcome.dropped && !outcome.tossed);
    assert_eq!(outcome.apex_m, 0.0);
    assert_eq!((outcome.flip_angle_rad, outcome.distance_m), (0.0, 0.0));
}

#[test]
fn low_hop_is_no_toss_but_has_an_apex() {
    // Rises 8 cm, below Δ_h = 10 cm.
    let vz = (2.0 * G * 0.08_f64).sqrt();
    let tracker = track(3.0, |t_s| Toss { vz, ..Toss::half_flip() }.object(t_s));
    let outcome = tracker.outcome();
    assert!(!tracker.is_finished() && !outcome.tossed && !outcome.flipped_and_caught);
    assert!(outcome.released);
    assert_near(outcome.apex_m, 0.08, 1e-5);
}

#[test]
fn flicker_of_the_contact_is_no_release() {
    let toss = Toss::half_flip();
    let flickering = |t_s: f64| {
        let mut object = toss.object(t_s);
        // 40 ms without contact in every 50 while the pancake lies in the dipping pan.
        let lies = t_s < toss.release_s;
        object.in_contact = if lies { t_s % 0.05 < 0.01 } else { object.in_contact };
        object
    };
    let outcome = track(3.0, flickering).outcome();
    assert!(outcome.flipped_and_caught);
    // The last flicker joins the flight.
    assert_near(outcome.release_time_s, toss.release_s, 0.05);

    let only_flicker =
        track(3.0, |t_s| ObjectState { in_contact: t_s % 0.05 < 0.01, ..toss.object(0.0) });
    assert!(!only_flicker.outcome().released);
}

#[test]
fn flickering_contact_after_the_catch_still_counts() {
    let toss = Toss::half_flip();
    let tracker = track(3.0, |t_s| {
        let mut object = toss.object(t_s);
        object.in_contact &= t_s < toss.release_s || t_s % 0.03 < 0.002;
        object
    });
    assert!(tracker.outcome().flipped_and_caught);
}

#[test]
fn floating_over_the_pan_is_no_catch() {
    let toss = Toss::half_flip();
    let tracker = track(3.0, |t_s| {
        let mut object = toss.object(t_s);
        object.in_contact &= t_s < toss.release_s;
        object
    });
    assert!(tracker.is_finished() && !tracker.outcome().flipped_and_caught);
}

/// What the referee says at `t_s`.
fn state(t_s: f64, object: impl Fn(f64) -> ObjectState) -> State {
    let mut referee = referee::Toss::new(&TossConfig::default());
    for tick in 0..(t_s / DT_S) as usize {
        let t_s = tick as f64 * DT_S;
        referee.observe(t_s, &Toss::pan(), &object(t_s));
    }
    referee.state()
}

#[test]
fn the_referee_waits_for_a_toss_and_gives_up_what_is_lost() {
    let toss = Toss::half_flip();
    let at = |t_s: f64| state(t_s, |t_s| toss.object(t_s));
    let crossing_s = toss.release_s + toss.fall_time(0.1 - RESTING_HEIGHT);
    assert_eq!(at(toss.release_s - 0.01), State::Running);
    assert_eq!(at(toss.release_s + 0.01), State::Airborne);
    assert_eq!(at(crossing_s + 0.45), State::Airborne, "caught, but it may jump out again");
    assert_eq!(at(crossing_s + 0.55), State::Settled);

    let missed = Toss { lands: false, ..toss };
    assert_eq!(state(2.0, |t_s| missed.object(t_s)), State::Lost);

    // A hop that never rises to 0.1 m is over with its landing.
    let hop = Toss { vz: 1.0, ..toss };
    let at = |t_s: f64| state(t_s, |t_s| hop.object(t_s));
    assert_eq!(at(hop.release_s + 0.1), State::Airborne);
    assert_eq!(at(hop.release_s + 2.0 * hop.vz / G + 0.01), State::Running);
}

#[test]
fn too_fast_a_release_is_an_exploit() {
    let slow_enough = outcome(Toss { vz: 5.9, spin: PI / (2.0 * 5.9 / G), ..Toss::half_flip() });
    assert!(
        !slow_enough.exploit
            && slow_enough.flipped_and_caught == (slow_enough.final_lateral_m < 0.13)
    );
    let too_fast =
        outcome(Toss { vz: 6.1, vx: 0.0, spin: PI / (2.0 * 6.1 / G), ..Toss::half_flip() });
    assert!(too_fast.exploit && too_fast.tossed && !too_fast.flipped_and_caught);
}

#[test]
fn too_fast_a_spin_is_an_exploit() {
    let half_turn = Toss::half_flip().spin;
    for (turns, is_exploit) in [(5.0, false), (7.0, true)] {
        // An odd number of half turns lands upside down.
        let outcome = outcome(Toss { spin: turns * half_turn, ..Toss::half_flip() });
        assert_eq!(outcome.exploit, is_exploit, "{} rad/s", outcome.release_spin);
        assert_eq!(outcome.flipped_and_caught, !is_exploit);
    }
}

#[test]
fn height_is_over_the_pan_and_apex_over_the_start() {
    // The pan is taken away downwards: the pancake "falls back" to Δ_h without having risen.
    let pan = |t_s: f64| {
        let mut X_WP = Toss::pan();
        X_WP.translation.vector.z -= if t_s < 0.3 { 0.0 } else { 0.3 };
        X_WP
    };
    let fallen = |t_s: f64| 0.5 * G * (t_s - 0.3_f64).max(0.0).powi(2);
    let mut tracker = OutcomeTracker::new(&OutcomeConfig::default());
    for tick in 0..1000 {
        let t_s = tick as f64 * DT_S;
        let mut object = Toss::half_flip().object(0.0);
        object.in_contact = t_s < 0.3 || fallen(t_s) > 0.3;
        object.p_WO.z -= fallen(t_s).min(0.3);
        tracker.observe(t_s, &pan(t_s), &object);
    }
    let outcome = tracker.outcome();
    assert!(outcome.tossed && !outcome.flipped_and_caught);
    assert_eq!(outcome.apex_m, 0.0);
}

#[test]
fn tilted_pan_measures_lateral_distance_in_its_plane() {
    let tilt = UnitQuaternion::from_axis_angle(&Vector3::y_axis(), 0.4);
    let X_WP = Isometry3::from_parts(Toss::pan().translation, tilt);
    let object = ObjectState {
        p_WO: (X_WP * nalgebra::Point3::new(0.03, 0.04, 0.005)).coords,
        R_WO: tilt * UnitQuaternion::from_axis_angle(&Vector3::x_axis(), PI),
        in_contact: true,
    };
    let mut tracker = OutcomeTracker::new(&OutcomeConfig::default());
    tracker.observe(0.0, &X_WP, &object);
    assert_near(tracker.outcome().final_lateral_m, 0.05, 1e-12);
    assert_near(tracker.outcome().final_tilt_rad, PI, 1e-7);
}
