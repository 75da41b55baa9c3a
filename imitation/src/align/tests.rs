//! One movement at several speeds.

use super::*;

/// A bend in the plane (m), with `timing` from [0, 1] onto [0, 1].
fn bend(name: &str, n: usize, period_s: f64, timing: impl Fn(f64) -> f64) -> Recording {
    let points = DMatrix::from_fn(2, n, |c, k| {
        let u = timing(k as f64 / (n - 1) as f64);
        if c == 0 { u } else { (3.0 * u).sin() }
    });
    Recording::new(name, period_s, points).unwrap()
}

fn three() -> Vec<Recording> {
    vec![
        bend("even", 150, 0.01, |u| u),
        bend("late", 220, 0.01, |u| u * u),
        bend("early", 400, 0.005, |u| 1.0 - (1.0 - u) * (1.0 - u)),
    ]
}

fn largest_difference(recordings: &[Recording]) -> f64 {
    let mean = mean_path(recordings);
    let misses = recordings.iter().map(|r| (&r.points - &mean).amax());
    misses.fold(0.0, f64::max)
}

#[test]
fn warped_recordings_lie_on_each_other_and_share_a_clock() {
    let aligned = align(&three(), Alignment::Warped).unwrap();
    for (recording, name) in aligned.iter().zip(["even", "late", "early"]) {
        assert_eq!(recording.name, name);
        assert_eq!((recording.n_points(), recording.period_s), (150, 0.01), "those of the medoid");
    }
    assert!(largest_difference(&aligned) < 0.02, "{}", largest_difference(&aligned));
    let linear = align(&three(), Alignment::Linear).unwrap();
    assert!(largest_difference(&linear) > 0.2, "{}", largest_difference(&linear));
}

#[test]
fn both_alignments_keep_the_ends() {
    for alignment in [Alignment::Linear, Alignment::Warped] {
        for (aligned, recording) in align(&three(), alignment).unwrap().iter().zip(three()) {
            let last = (aligned.n_points() - 1, recording.n_points() - 1);
            let ends = [(0, 0), last];
            for (one, other) in ends {
                let miss = aligned.points.column(one) - recording.points.column(other);
                assert!(miss.amax() < 1e-12, "{alignment:?} of {}", recording.name);
            }
        }
    }
}

#[test]
fn a_clock_never_runs_backwards_and_is_that_of_the_movement() {
    let [even, early] = [0, 2].map(|i| three()[i].resampled(N_COMPARED).points);
    let clock = clock(&warp(&even, &early), N_COMPARED);
    assert!(clock.windows(2).all(|pair| pair[1] >= pair[0]));
    let last = (N_COMPARED - 1) as f64;
    assert_eq!((clock[0], clock[N_COMPARED - 1]), (0.0, last));
    for (k, place) in clock.iter().enumerate() {
        // 1 − (1 − v)² = u.
        let truth = last * (1.0 - (1.0 - k as f64 / last).sqrt());
        assert!((place - truth).abs() < 5.0, "{place} is not {truth}");
    }
}

/// By hand: (0), (0), (1), (3) against (0), (1), (1), (3) are paired with nothing between them.
#[test]
fn warping_pairs_equal_points() {
    let a = DMatrix::from_row_slice(1, 4, &[0.0, 0.0, 1.0, 3.0]);
    let b = DMatrix::from_row_slice(1, 4, &[0.0, 1.0, 1.0, 3.0]);
    let warp = warp(&a, &b);
    assert_eq!(warp.distance, 0.0);
    assert_eq!(warp.pairs, [(0, 0), (1, 0), (2, 1), (2, 2), (3, 3)]);
}

#[test]
fn a_path_is_resampled_at_equal_distances() {
    let path = DMatrix::from_row_slice(1, 4, &[0.0, 0.0, 1.0, 4.0]);
    assert_eq!(resampled_by_length(&path, 5).as_slice(), [0.0, 1.0, 2.0, 3.0, 4.0]);
    let still = DMatrix::from_element(2, 3, 0.5);
    assert_eq!(resampled_by_length(&still, 4), DMatrix::from_element(2, 4, 0.5));
    let point = DMatrix::from_element(2, 1, 0.5);
    assert_eq!(resampled_by_length(&point, 2), DMatrix::from_element(2, 2, 0.5));
}

#[test]
fn durations_that_differ_tenfold_are_refused_with_both_names() {
    let recordings = [bend("long", 2000, 0.01, |u| u), bend("short", 150, 0.01, |u| u)];
    let error = align(&recordings, Alignment::Linear).unwrap_err().to_string();
    assert!(error.starts_with("long takes 19.99 s and short only 1.49 s"), "{error}");
    assert!(matches!(align(&[], Alignment::Warped), Err(AlignError::Recordings(_))));
}
