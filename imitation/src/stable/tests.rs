//! Fits of known fields, of movements that have none, and their motions.

use super::*;

/// The motion of ẋ = A(x − x*) from `start`, over `duration_s` at 100 Hz.
fn linear(
    name: &str,
    A: &DMatrix<f64>,
    target: &[f64],
    start: &[f64],
    duration_s: f64,
) -> Recording {
    let target = DVector::from_row_slice(target);
    let path = integrate::first_order(&DVector::from_row_slice(start), duration_s, 0.01, |_, x| {
        A * (x - &target)
    });
    Recording::new(name, 0.01, path).unwrap()
}

fn arc(name: &str, radius: f64) -> Recording {
    let points = DMatrix::from_fn(2, 250, |c, k| {
        let u = k as f64 / 249.0;
        let angle = std::f64::consts::PI * (1.0 - u * u * (3.0 - 2.0 * u));
        if c == 0 { radius * (angle.cos() - 1.0) } else { radius * angle.sin() }
    });
    Recording::new(name, 0.01, points).unwrap()
}

#[test]
fn one_component_learns_a_linear_field() {
    let A = DMatrix::from_row_slice(2, 2, &[-1.0, 1.5, -1.0, -1.2]);
    let target = [0.3, -0.2];
    let recordings = [
        linear("a", &A, &target, &[0.8, 0.1], 12.0),
        linear("b", &A, &target, &[-0.2, 0.3], 12.0),
        linear("c", &A, &target, &[0.3, -0.7], 12.0),
    ];
    let options = StableOptions { n_components: 1, return_weight: 0.0, ..StableOptions::default() };
    let field = fit(&recordings, &options, 0).unwrap();
    assert!((&field.certificate.target - DVector::from_row_slice(&target)).norm() < 1e-4);
    assert!((&field.systems.A[0] - &A).amax() < 0.05, "{}", field.systems.A[0]);
    let margin = field.certificate.check(&field.systems).unwrap();
    assert!(margin > 0.0);
    assert!(field.certificate.damping(&field.systems).unwrap() <= options.damping);
}

#[test]
fn motions_follow_the_recordings_and_end_where_they_do_from_anywhere() {
    let recordings = [arc("a", 0.2), arc("b", 0.22)];
    let options = StableOptions { n_components: 5, ..StableOptions::default() };
    let field = fit(&recordings, &options, 3).unwrap();
    for recording in &recordings {
        let start = recording.points.column(0).clone_owned();
        let motion = field.motion(&start, 2.0 * recording.duration_s(), 0.01);
        let area = crate::metrics::swept_area(&recording.points, &motion);
        // Under 5 mm beside a path of 0.66 m.
        assert!(area < 0.003, "{}: {area} m²", recording.name);
    }
    for start in [[1.0, 1.0], [-3.0, 0.2], [0.1, -0.3]] {
        let start = DVector::from_row_slice(&start);
        for path in [field.motion(&start, 60.0, 0.01), field.driven(&start, 40.0, 60.0, 0.01)] {
            let last = path.column(path.ncols() - 1);
            assert!((last - &field.certificate.target).norm() < 1e-3, "{start} {last}");
        }
    }
}

#[test]
fn a_plane_movement_in_space_and_one_in_a_single_coordinate_are_learnt() {
    let flat = |recording: Recording| {
        let points = recording.points.clone().insert_row(1, 0.4);
        Recording::new(recording.name, 0.01, points).unwrap()
    };
    let line = |recording: Recording| {
        let points = recording.points.rows(0, 1).clone_owned();
        Recording::new(recording.name, 0.01, points).unwrap()
    };
    let options = StableOptions { n_components: 3, n_starts: 1, ..StableOptions::default() };
    let flat = fit(&[flat(arc("a", 0.2)), flat(arc("b", 0.22))], &options, 3).unwrap();
    let motion = flat.motion(&DVector::from_vec(vec![-0.4, 0.4, 0.0]), 3.0, 0.01);
    assert!(motion.row(1).iter().all(|z| (z - 0.4).abs() < 0.01));
    let line = fit(&[line(arc("a", 0.2)), line(arc("b", 0.22))], &options, 3).unwrap();
    assert_eq!(line.certificate.P, DMatrix::identity(1, 1));
}

#[test]
fn a_fit_repeats_with_its_seed_and_does_not_depend_on_units() {
    let recordings = [arc("a", 0.2), arc("b", 0.22)];
    let options = StableOptions { n_components: 3, n_starts: 2, ..StableOptions::default() };
    let one = fit(&recordings, &options, 5).unwrap();
    assert_eq!(one, fit(&recordings, &options, 5).unwrap());
    assert_ne!(one, fit(&recordings, &options, 6).unwrap());
    // A power of two: not a bit is rounded otherwise.
    let other = recordings.map(|r| Recording::new(r.name, 0.01, r.points * 1024.0).unwrap());
    let same = fit(&other, &options, 5).unwrap();
    let x = DVector::from_vec(vec![-0.3, 0.15]);
    let (v, scaled) = (one.velocity(&x), same.velocity(&(x * 1024.0)) / 1024.0);
    assert!((&v - &scaled).norm() < 1e-9 * v.norm(), "{v} {scaled}");
}

#[test]
fn errors_name_the_recording_and_what_helps() {
    let options = StableOptions::default();
    let message = |recordings: &[Recording], options: &StableOptions| {
        fit(recordings, options, 0).unwrap_err().to_string()
    };
    assert!(message(&[], &options).contains("no recordings"));
    let still = Recording::new("still", 0.01, DMatrix::from_element(2, 50, 0.3)).unwrap();
    assert_eq!(message(&[arc("a", 0.2), still], &options), "still never moves: leave it out");
    let short = Recording::new("short", 0.1, arc("a", 0.2).resampled(20).points).unwrap();
    let found = message(&[short], &options);
    assert!(found.starts_with("K = 7 components in 2 coordinates need 35 points"), "{found}");
    let none = StableOptions { n_components: 0, ..options };
    assert!(message(&[arc("a", 0.2)], &none).starts_with("K = 0"));
    let loose = StableOptions { damping: 0.01, ..options };
    assert!(message(&[arc("a", 0.2)], &loose).starts_with("the damping is 0.01 1/s"));
}

/// Out to one side of the end, back through it and out to the other: no V falls along that.
#[test]
fn a_movement_through_its_own_end_is_refused_with_the_place() {
    let points = DMatrix::from_fn(2, 300, |c, k| {
        let u = k as f64 / 299.0;
        let x = (1.0 - u) * (3.0 * std::f64::consts::PI * u).sin();
        if c == 0 { x } else { 0.02 * x + 0.001 * (1.0 - u) }
    });
    let through = Recording::new("through", 0.01, points).unwrap();
    let error = fit(&[through], &StableOptions::default(), 0).unwrap_err();
    let StableError::NoCertificate { from_s, to_s, share, .. } = &error else {
        panic!("{error}");
    };
    assert!(*from_s < *to_s && *share > 25.0, "{error}");
    assert!(error.to_string().starts_with("through leads away from its end from "), "{error}");
}
