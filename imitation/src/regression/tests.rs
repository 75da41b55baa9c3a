//! The conditional of a mixture by numerical integration, and a letter written in three ways.

use super::*;
use crate::metrics::swept_area;

fn joint() -> Mixture {
    let covariance = |a, b, c| DMatrix::from_row_slice(2, 2, &[a, b, b, c]);
    Mixture::new(
        vec![0.3, 0.5, 0.2],
        vec![
            DVector::from_vec(vec![0.0, 1.0]),
            DVector::from_vec(vec![2.0, -1.0]),
            DVector::from_vec(vec![1.0, 3.0]),
        ],
        vec![covariance(1.0, 0.5, 0.8), covariance(0.4, -0.3, 0.9), covariance(0.5, 0.2, 0.3)],
    )
    .unwrap()
}

#[test]
fn mean_and_covariance_are_those_of_the_integrated_conditional() {
    let (joint, regression) = (joint(), Regression::new(&joint(), 1).unwrap());
    for x in [-3.0, -0.5, 0.0, 0.7, 1.5, 2.5, 6.0] {
        let h = 1e-3;
        let (mut mass, mut first, mut second) = (0.0, 0.0, 0.0);
        for k in -12_000..12_000 {
            let y = k as f64 * h;
            let density = joint.log_density(&DVector::from_vec(vec![x, y])).exp();
            mass += density;
            first += density * y;
            second += density * y * y;
        }
        let mean = first / mass;
        let variance = second / mass - mean * mean;
        let input = DVector::from_element(1, x);
        assert!((regression.output(&input)[0] - mean).abs() < 1e-6, "mean at {x}");
        assert!((regression.covariance(&input)[(0, 0)] - variance).abs() < 1e-6, "at {x}");
    }
}

#[test]
fn far_from_all_data_the_nearest_line_goes_on() {
    let regression = Regression::new(&joint(), 1).unwrap();
    let input = DVector::from_element(1, -1e4);
    let line = &regression.systems.A[0] * &input + &regression.systems.b[0];
    assert_eq!(regression.output(&input), line);
    assert!((regression.covariance(&input) - &regression.covariances[0]).amax() < 1e-9);
}

/// An S in the plane (m), written in 2 s and slow at both ends, three times with some spread.
fn letter() -> Vec<Recording> {
    let write = |spread: f64| {
        let points = DMatrix::from_fn(2, 201, |c, k| {
            let u = k as f64 / 200.0;
            let angle = 1.5 * std::f64::consts::PI * (u * u * (3.0 - 2.0 * u) * 2.0 - 1.0);
            if c == 0 { 0.1 * angle.sin() + spread } else { 0.06 * angle + 0.5 * spread }
        });
        Recording::new(format!("S {spread}"), 0.01, points).unwrap()
    };
    [-0.003, 0.0, 0.003].map(write).to_vec()
}

/// Fig. 1: superposition in time and in space retrieve the same movement.
#[test]
fn a_letter_is_written_in_time_and_in_space() {
    let recordings = letter();
    let start = recordings[1].points.column(0).clone_owned();
    let (length, width) = (0.9, 0.01);
    for map in [Map::TimeToPosition, Map::TimeToVelocity, Map::PositionToVelocity] {
        let regression = Regression::fit(&recordings, map, 8, &GmmOptions::default(), 1).unwrap();
        // At rest nothing that is driven by position moves: it starts a little on its way.
        let first = if map == Map::PositionToVelocity { 20 } else { 0 };
        let start =
            if first == 0 { start.clone() } else { recordings[1].points.column(first).into() };
        let path = map.reproduce(&regression, &start, 2.0 - 0.01 * first as f64, 0.01);
        let demonstrated = recordings[1].points.columns(first, 201 - first).clone_owned();
        let area = swept_area(&demonstrated, &path);
        assert!(area < length * width, "{map:?} sweeps {area} m²");
    }
}

#[test]
fn the_covariance_over_time_is_that_of_the_recordings() {
    let recordings = letter();
    let regression =
        Regression::fit(&recordings, Map::TimeToPosition, 12, &GmmOptions::default(), 1).unwrap();
    // Three points at −3, 0 and 3 mm have a standard deviation of √6 mm.
    let std = regression.covariance(&DVector::from_element(1, 0.3))[(0, 0)].sqrt();
    assert!((0.002..0.004).contains(&std), "{std} m");
}

#[test]
fn errors_name_the_coordinate_of_the_recording() {
    let mut recordings = letter();
    recordings.iter_mut().for_each(|recording| recording.points.row_mut(1).fill(0.5));
    for map in [Map::TimeToPosition, Map::PositionToVelocity] {
        let error = Regression::fit(&recordings, map, 3, &GmmOptions::default(), 0).unwrap_err();
        assert!(error.to_string().starts_with("coordinate 2 never moves"), "{map:?}: {error}");
    }
    let error = Regression::new(&joint(), 2).unwrap_err();
    assert_eq!(error, RegressionError::Inputs { n_inputs: 2, dim: 2 });
}
