//! Every θ stands for a certified field.

use search::normals::{standard_normal, stream};

use super::*;
use crate::stable::Certificate;
use crate::systems::Systems;

/// Parameters and some θ for them, from tame to wild.
fn drawn(case: u64) -> (Parameters, DVector<f64>) {
    let (d, k) = (1 + case as usize % 4, 1 + case as usize % 3);
    let damping = if case % 5 == 4 { f64::INFINITY } else { 12.0 };
    let parameters = Parameters { d, k, damping, slowest: 0.02 };
    let mut rng = stream(case, 0);
    let wild = 0.3 + case as f64 / 20.0;
    let theta = DVector::from_fn(parameters.len(), |_, _| wild * standard_normal(&mut rng));
    (parameters, theta)
}

fn systems(parameters: &Parameters, theta: &DVector<f64>) -> (Systems, Certificate) {
    let (d, k) = (parameters.d, parameters.k);
    let model = parameters.unpack(theta);
    let field = parameters.field(&model).unwrap();
    let systems = Systems::new(
        vec![1.0 / k as f64; k],
        model.components.iter().map(|c| c.center.clone()).collect(),
        vec![DMatrix::identity(d, d); k],
        field.A.chunks(d * d).map(|rows| DMatrix::from_row_slice(d, d, rows)).collect(),
        vec![DVector::zeros(d); k],
    );
    let P = &model.L * model.L.transpose();
    (systems.unwrap(), Certificate { P, target: DVector::zeros(d) })
}

#[test]
fn whatever_the_parameters_the_field_is_certified_driven_and_not() {
    for case in 0..60 {
        let (parameters, theta) = drawn(case);
        let (systems, certificate) = systems(&parameters, &theta);
        let margin = certificate.check(&systems).unwrap();
        assert!(margin >= 2.0 * parameters.slowest * (1.0 - 1e-6), "case {case}: {margin}");
        let damping = certificate.damping(&systems).unwrap();
        assert!(damping < parameters.damping, "case {case}: {damping}");
    }
}

#[test]
fn a_model_comes_back_from_its_parameters() {
    let (parameters, theta) = drawn(7);
    let again = parameters.pack(&parameters.unpack(&theta));
    assert!((again - &theta).amax() < 1e-12);
}

#[test]
fn the_factors_of_a_stable_system_give_it_back() {
    let parameters = Parameters { d: 3, k: 1, damping: f64::INFINITY, slowest: 0.02 };
    let N = DMatrix::from_row_slice(3, 3, &[2.0, 0.3, 0.1, 0.3, 1.0, 0.0, 0.1, 0.0, 0.5]);
    let W = DMatrix::from_row_slice(3, 3, &[0.0, 1.0, -2.0, -1.0, 0.0, 0.7, 2.0, -0.7, 0.0]);
    let (B, Z) = parameters.factors(N.clone(), &W).unwrap();
    let component =
        Component { log_prior: 0.0, center: DVector::zeros(3), G: DMatrix::identity(3, 3), B, Z };
    let expected = W - N - DMatrix::identity(3, 3) * 0.02;
    assert!((parameters.in_metric(&component) - expected).amax() < 1e-12);
}

#[test]
fn derivatives_agree_with_differences() {
    for case in 0..12 {
        let (parameters, theta) = drawn(case);
        let d = parameters.d;
        let mut rng = stream(case, 1);
        let mut draw = || standard_normal(&mut rng);
        let x: Vec<f64> = (0..d).map(|_| draw()).collect();
        let by_f: Vec<f64> = (0..d).map(|_| draw()).collect();
        let number = |theta: &DVector<f64>, x: &[f64]| {
            let field = parameters.field(&parameters.unpack(theta)).unwrap();
            let mut at = field.evaluation();
            field.evaluate(x, &mut at);
            at.f.iter().zip(&by_f).map(|(f, by)| f * by).sum::<f64>()
        };
        let model = parameters.unpack(&theta);
        let field = parameters.field(&model).unwrap();
        let mut at = field.evaluation();
        field.evaluate(&x, &mut at);
        let (mut by_field, mut by_x) = (Field::zeros(d, parameters.k), vec![0.0; d]);
        field.pull_back(&x, &at, &by_f, &mut by_field, &mut by_x);
        let by_theta = parameters.pull_back(&model, &field, &by_field);
        let agrees = |found: f64, up: f64, down: f64| {
            let expected = (up - down) / 2e-6;
            assert!((found - expected).abs() < 1e-5 * (1.0 + expected.abs()), "{found} {expected}");
        };
        for i in 0..theta.len() {
            let moved = |step: f64| {
                let mut theta = theta.clone();
                theta[i] += step;
                number(&theta, &x)
            };
            agrees(by_theta[i], moved(1e-6), moved(-1e-6));
        }
        for r in 0..d {
            let moved = |step: f64| {
                let mut x = x.clone();
                x[r] += step;
                number(&theta, &x)
            };
            agrees(by_x[r], moved(1e-6), moved(-1e-6));
        }
    }
}
