//! The paper's landscape against reference numbers (`SKILLET_VECTORS` names another directory).

mod common;

use nalgebra::Vector2;
use physics::landscape::{PEAK, PEAK_VALUE, height};
use serde::Deserialize;

#[derive(Deserialize)]
struct Landscape {
    theta: Vec<[f64; 2]>,
    r: Vec<f64>,
}

#[test]
fn matches_the_reference_vectors() {
    let vectors: Landscape = common::vectors("landscape3.json");
    assert!(vectors.theta.len() >= 20 && vectors.theta.len() == vectors.r.len());
    for (theta, r) in vectors.theta.iter().zip(&vectors.r) {
        let found = height(&Vector2::from(*theta));
        assert!((found - r).abs() <= 1e-12 * r, "{theta:?}: {found:e} instead of {r:e}");
    }
}

#[test]
fn the_peak_is_where_it_is_said_to_be() {
    let peak = height(&Vector2::from(PEAK));
    assert!((peak - PEAK_VALUE).abs() < 1e-6, "{peak}");
    for step in [[1e-3, 0.0], [-1e-3, 0.0], [0.0, 1e-3], [0.0, -1e-3]] {
        assert!(height(&(Vector2::from(PEAK) + Vector2::from(step))) < peak);
    }
}
