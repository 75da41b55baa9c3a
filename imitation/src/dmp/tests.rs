//! A curved reach, followed, scaled and read as attractors.

use super::*;

/// From `start` to `goal` (m) in 2 s with a bend, slow at both ends.
fn reach(name: &str, start: [f64; 2], goal: [f64; 2]) -> Recording {
    let points = DMatrix::from_fn(2, 201, |c, k| {
        let u = k as f64 / 200.0;
        let rise = u * u * u * (10.0 - 15.0 * u + 6.0 * u * u);
        let bend = [0.3, -0.5][c] * (std::f64::consts::PI * rise).sin();
        start[c] + (goal[c] - start[c]) * (rise + bend)
    });
    Recording::new(name, 0.01, points).unwrap()
}

fn options(form: Form) -> DmpOptions {
    let drive = Drive::Decay { rate: decay_rate(2.0) };
    DmpOptions { form, drive, n_components: 30, width_ratio: 0.7, ..DmpOptions::default() }
}

#[test]
fn every_form_follows_the_recording_it_was_fitted_to() {
    let recording = reach("reach", [0.1, 0.2], [0.6, -0.1]);
    let in_time = DmpOptions { drive: Drive::Time, ..options(Form::Plain) };
    for options in [in_time, options(Form::Plain), options(Form::Scaled)] {
        let dmp = Dmp::fit(std::slice::from_ref(&recording), &options).unwrap();
        let path = dmp.rollout(2.0, 0.01);
        let miss = (path - &recording.points).amax();
        assert!(miss < 5e-3, "{options:?}: {miss} m");
    }
}

#[test]
fn a_time_constant_changes_the_gains_and_not_the_path() {
    let recording = reach("reach", [0.1, 0.2], [0.6, -0.1]);
    for tau in [0.5_f64, 3.0] {
        let kappa_v = 2.0 * (200.0 * tau).sqrt();
        let options = DmpOptions { tau, kappa_v, ..options(Form::Plain) };
        let dmp = Dmp::fit(std::slice::from_ref(&recording), &options).unwrap();
        assert!((dmp.rollout(2.0, 0.01) - &recording.points).amax() < 1e-2, "τ = {tau}");
    }
}

/// Below Eq. (3): with x₀ and x_T the scaled path is stretched, coordinate by coordinate.
#[test]
fn the_scaled_form_stretches_with_its_ends_and_the_plain_form_only_shifts() {
    let recording = reach("reach", [0.1, 0.2], [0.6, -0.1]);
    let (start, goal) = (DVector::from_vec(vec![0.0, 0.1]), DVector::from_vec(vec![1.0, 0.4]));
    let fit = |form| Dmp::fit(std::slice::from_ref(&recording), &options(form)).unwrap();
    let mut scaled = fit(Form::Scaled);
    let before = scaled.rollout(3.0, 0.01);
    (scaled.start, scaled.goal) = (start.clone(), goal.clone());
    let after = scaled.rollout(3.0, 0.01);
    for k in 0..before.ncols() {
        for c in 0..2 {
            let old = (before[(c, k)] - [0.1, 0.2][c]) / ([0.6, -0.1][c] - [0.1, 0.2][c]);
            let stretched = start[c] + (goal[c] - start[c]) * old;
            assert!((after[(c, k)] - stretched).abs() < 1e-9);
        }
    }
    let mut plain = fit(Form::Plain);
    let before = plain.rollout(3.0, 0.01);
    let shift = DVector::from_vec(vec![0.2, -0.3]);
    (plain.start, plain.goal) = (&plain.start + &shift, &plain.goal + &shift);
    let after = plain.rollout(3.0, 0.01);
    for k in 0..before.ncols() {
        assert!((after.column(k) - before.column(k) - &shift).amax() < 1e-9);
    }
}

#[test]
fn the_force_of_the_scaled_form_vanishes_and_the_movement_ends_at_its_goal() {
    let recording = reach("reach", [0.1, 0.2], [0.6, -0.1]);
    let dmp = Dmp::fit(&[recording], &options(Form::Scaled)).unwrap();
    assert!(dmp.force(10.0).amax() < 1e-4 * dmp.force(1.0).amax());
    let path = dmp.rollout(5.0, 0.01);
    assert!((path.column(500) - &dmp.goal).amax() < 1e-3);
}

/// Eq. (4), plain form: the same system, wherever it is.
#[test]
fn the_plain_form_is_the_attractors_it_is_read_as() {
    let recording = reach("reach", [0.1, 0.2], [0.6, -0.1]);
    let options = DmpOptions { tau: 2.0, ..options(Form::Plain) };
    let dmp = Dmp::fit(&[recording], &options).unwrap();
    let Reading { attractors, largest_miss } = dmp.attractors();
    assert_eq!(largest_miss, 0.0);
    assert_eq!(attractors.mu[3], &dmp.goal + &dmp.forces[3] / dmp.kappa_p);
    for k in 0..50 {
        let x = DVector::from_vec(vec![0.1 * k as f64 - 2.0, 0.3]);
        let xd = DVector::from_vec(vec![-0.2, 0.05 * k as f64]);
        let t_s = 0.05 * k as f64;
        let difference = dmp.acceleration(t_s, &x, &xd) - attractors.acceleration(t_s, &x, &xd);
        assert!(difference.amax() < 1e-9);
    }
}

#[test]
fn the_scaled_form_is_near_its_reading_by_what_the_reading_says() {
    let recording = reach("reach", [0.1, 0.2], [0.6, -0.1]);
    let dmp = Dmp::fit(std::slice::from_ref(&recording), &options(Form::Scaled)).unwrap();
    let Reading { attractors, largest_miss } = dmp.attractors();
    assert!(largest_miss > 0.0 && largest_miss < 0.05, "{largest_miss} m");
    let path = attractors.rollout(&dmp.start, 2.0, 0.01, |_| DVector::zeros(2));
    // A critically damped spring moves no further than the point that pulls it.
    assert!((path - dmp.rollout(2.0, 0.01)).amax() <= largest_miss);
}

#[test]
fn several_recordings_give_their_mean() {
    let recordings = [reach("a", [0.1, 0.2], [0.6, -0.1]), reach("b", [0.1, 0.24], [0.64, -0.1])];
    let dmp = Dmp::fit(&recordings, &options(Form::Plain)).unwrap();
    let mean = (&recordings[0].points + &recordings[1].points) / 2.0;
    assert!((dmp.rollout(2.0, 0.01) - mean).amax() < 5e-3);
}

#[test]
fn errors_say_what_cannot_be_and_what_helps() {
    let recording = reach("reach", [0.1, 0.2], [0.6, 0.2]);
    let error = |options| Dmp::fit(std::slice::from_ref(&recording), &options).unwrap_err();
    // The recording bends in proportion to its travel: give the second coordinate a bend of its own.
    let mut bent = recording.clone();
    for k in 0..201 {
        bent.points[(1, k)] += (std::f64::consts::PI * k as f64 / 200.0).sin();
    }
    let still = Dmp::fit(&[bent], &options(Form::Scaled)).unwrap_err().to_string();
    assert!(still.starts_with("coordinate 2 ends where it starts"), "{still}");
    assert!(still.ends_with("use the plain form"), "{still}");
    let in_time = DmpOptions { drive: Drive::Time, ..options(Form::Scaled) };
    assert_eq!(error(in_time), DmpError::ScaledByTime);
    let none = DmpOptions { n_components: 0, ..options(Form::Plain) };
    assert_eq!(error(none), DmpError::NoComponents);
    let flat = DmpOptions { kappa_p: 0.0, ..options(Form::Plain) };
    assert!(matches!(error(flat), DmpError::Gains { .. }));
}
