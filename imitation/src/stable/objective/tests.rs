//! The derivatives of what a fit minimises.

use search::normals::{standard_normal, stream};

use super::*;

#[test]
fn derivatives_agree_with_differences_along_ways_too() {
    for (d, k) in [(2, 3), (3, 2)] {
        let parameters = Parameters { d, k, damping: 20.0, slowest: 0.02 };
        let mut rng = stream(d as u64, 0);
        let mut draw =
            |rows, columns| DMatrix::from_fn(rows, columns, |_, _| standard_normal(&mut rng));
        let samples = Samples {
            places: draw(d, 6),
            velocities: draw(d, 6),
            weights: vec![0.3, 0.1, 0.1, 0.2, 0.2, 0.1],
        };
        let way = |points: DMatrix<f64>| Way {
            start: points.column(0).clone_owned() * 1.5,
            step: 0.2,
            points,
        };
        let ways = [way(draw(d, 8)), way(draw(d, 8))];
        let theta = draw(parameters.len(), 1).column(0) * 0.5;
        let objective = Objective {
            parameters,
            start: theta.map(|x| x + 0.3),
            samples: &samples,
            ways: &ways,
            direction_weight: 0.7,
            velocity_weight: 0.4,
        };
        let value =
            |theta: &DVector<f64>| objective.value(theta, &mut DVector::zeros(parameters.len()));
        let mut by_theta = DVector::zeros(parameters.len());
        objective.value(&theta, &mut by_theta);
        for i in 0..theta.len() {
            let moved = |step: f64| {
                let mut theta = theta.clone();
                theta[i] += step;
                value(&theta)
            };
            let expected = (moved(1e-6) - moved(-1e-6)) / 2e-6;
            assert!(
                (by_theta[i] - expected).abs() < 1e-5 * (1.0 + expected.abs()),
                "entry {i} of {}: {} {expected}",
                theta.len(),
                by_theta[i]
            );
        }
    }
}

#[test]
fn a_field_that_moves_as_sampled_misses_nothing() {
    // One system, ẋ = −x: ways are straight lines to the origin.
    let parameters = Parameters { d: 2, k: 1, damping: f64::INFINITY, slowest: 0.5 };
    let mut theta = DVector::zeros(parameters.len());
    // log B on the diagonal: BBᵀ = ½ I.
    theta[9] = 0.5_f64.sqrt().ln();
    theta[11] = theta[9];
    let places = DMatrix::from_row_slice(2, 3, &[1.0, 0.5, -1.0, 0.0, 2.0, 0.3]);
    let samples = Samples { velocities: -&places, places, weights: vec![1.0 / 3.0; 3] };
    let points = DMatrix::from_fn(2, 7, |c, k| if c == 0 { 0.9 - 0.1 * k as f64 } else { 0.0 });
    let way = Way { start: DVector::from_vec(vec![1.0, 0.0]), step: 0.1, points };
    let objective = Objective {
        parameters,
        start: theta.clone(),
        samples: &samples,
        ways: &[way],
        direction_weight: 1.0,
        velocity_weight: 1.0,
    };
    let mut by_theta = DVector::zeros(parameters.len());
    let value = objective.value(&theta, &mut by_theta);
    // The floors of speed and direction leave a little.
    assert!(value < 1e-5, "{value}");
    assert!(by_theta.amax() < 1e-2, "{by_theta}");
}
