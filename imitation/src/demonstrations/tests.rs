//! Sets of recordings with one thing wrong each.

use std::f64::consts::PI;

use nalgebra::DMatrix;

use super::*;

fn recording(name: &str, n: usize, at: impl Fn(f64) -> [f64; 2]) -> Recording {
    let points = DMatrix::from_fn(2, n, |c, k| at(k as f64 / (n - 1) as f64)[c]);
    Recording::new(name, 0.01, points).unwrap()
}

/// Slow at both ends.
fn rise(u: f64) -> f64 {
    u * u * u * (10.0 - 15.0 * u + 6.0 * u * u)
}

fn arc(name: &str, off: f64) -> Recording {
    recording(name, 200, |u| [rise(u), 0.3 * (PI * rise(u)).sin() + off * (1.0 - rise(u))])
}

#[test]
fn recordings_of_one_movement_have_no_problems() {
    let set = [arc("a", 0.0), arc("b", 0.05), arc("c", -0.05)];
    assert_eq!(problems(&set, DrivenBy::State), []);
    assert_eq!(problems(&set, DrivenBy::Time), []);
    assert_eq!(problems(&[], DrivenBy::State), []);
}

#[test]
fn one_that_never_moves_is_named() {
    let set = [arc("a", 0.0), recording("still", 200, |_| [1.0, 0.0])];
    assert_eq!(problems(&set, DrivenBy::State), [Problem::NeverMoves { name: "still".into() }]);
}

#[test]
fn one_that_stands_still_is_named_with_the_time() {
    // It moves during the first 30 % of 4 s, with a trembling hand before and after.
    let pausing = recording("pausing", 401, |u| {
        let u4 = rise((u / 0.3).min(1.0));
        [u4 + 1e-4 * (900.0 * u).sin(), 0.3 * (PI * u4).sin()]
    });
    let found = problems(&[arc("a", 0.0), pausing], DrivenBy::Time);
    let [Problem::StandsStill { name, share, from_s, to_s }] = &found[..] else {
        panic!("{found:?}");
    };
    assert_eq!(name, "pausing");
    assert!((65.0..80.0).contains(share) && (0.9..1.3).contains(from_s), "{share} {from_s}");
    assert!((*to_s - 4.0).abs() < 0.1);
    let text = found[0].to_string();
    assert!(text.starts_with("pausing stands still for 7"), "{text}");
}

#[test]
fn one_that_ends_elsewhere_is_named_and_the_others_are_not() {
    let elsewhere = recording("elsewhere", 200, |u| [rise(u), 0.3 * rise(u)]);
    let found = problems(&[arc("a", 0.0), elsewhere, arc("c", 0.02)], DrivenBy::Time);
    let [Problem::EndsElsewhere { name, distance, .. }] = &found[..] else { panic!("{found:?}") };
    assert_eq!(name, "elsewhere");
    assert!((distance - 0.3).abs() < 1e-9);
}

#[test]
fn durations_that_differ_tenfold_are_named() {
    let long = recording("long", 2500, |u| [rise(u), 0.3 * (PI * rise(u)).sin()]);
    let found = problems(&[arc("short", 0.0), long], DrivenBy::Time);
    assert!(matches!(&found[..], [Problem::UnequalDurations { long, .. }] if long == "long"));
}

#[test]
fn there_and_back_on_one_line_crosses_itself_when_driven_by_state() {
    let back = recording("back", 300, |u| [(PI * rise(u)).sin(), 0.001 * u]);
    assert_eq!(problems(std::slice::from_ref(&back), DrivenBy::Time), []);
    let found = problems(&[back], DrivenBy::State);
    let [Problem::Crosses { first_s, second_s, angle_deg, .. }] = &found[..] else {
        panic!("{found:?}");
    };
    assert!(*angle_deg > 175.0);
    // The same place on the way there and on the way back.
    assert!((first_s + second_s - 2.99).abs() < 0.1, "{first_s} s and {second_s} s");
    let text = found[0].to_string();
    assert!(text.starts_with("back at ") && text.ends_with("drive it by time"), "{text}");
}

#[test]
fn a_crossing_at_more_than_a_right_angle_is_found_and_one_at_less_is_not() {
    // Legs through the origin with slopes of ±`steepness`, joined by a wide bend on the right.
    let crossing = |steepness: f64| {
        recording("bow", 300, |u| {
            let (x, side) = if u < 0.4 {
                (-1.0 + 5.0 * u, 1.0)
            } else if u < 0.6 {
                let angle = PI * (u - 0.4) / 0.2;
                return [1.0 + 0.5 * angle.sin(), steepness * angle.cos()];
            } else {
                (1.0 - 5.0 * (u - 0.6), -1.0)
            };
            [x, side * steepness * x]
        })
    };
    let flat = problems(&[crossing(0.5)], DrivenBy::State);
    let [Problem::Crosses { first_s, second_s, angle_deg, .. }] = &flat[..] else {
        panic!("{flat:?}");
    };
    assert!((angle_deg - (180.0 - 2.0 * 0.5_f64.atan().to_degrees())).abs() < 3.0, "{angle_deg}°");
    assert!((first_s - 0.6).abs() < 0.05 && (second_s - 2.4).abs() < 0.05);
    let steep = problems(&[crossing(3.0)], DrivenBy::State);
    assert_eq!(steep, []);
}

#[test]
fn recordings_that_run_against_each_other_are_both_named() {
    let there = recording("there", 200, |u| [rise(u), 0.0]);
    let back = recording("back", 200, |u| [1.0 - rise(u), 0.0]);
    let found = problems(&[there, back], DrivenBy::State);
    let crossing = found.iter().find(|problem| matches!(problem, Problem::Crosses { .. })).unwrap();
    let text = crossing.to_string();
    assert!(text.contains("there at ") && text.contains(" and back at "), "{text}");
}
