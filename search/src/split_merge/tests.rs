//! Eqs. (8) and (9) against reference vectors, and that one undoes the other.

use serde::Deserialize;

use super::super::normals::{standard_normal, stream};
use super::super::vectors::{Gmm, read};
use super::*;

#[derive(Deserialize)]
struct Cases {
    split: Vec<SplitCase>,
    merge: Vec<MergeCase>,
}

#[derive(Deserialize)]
struct SplitCase {
    i: usize,
    alpha: f64,
    beta: f64,
    u: f64,
    gmm: Gmm,
    expected: Gmm,
}

#[derive(Deserialize)]
struct MergeCase {
    j: usize,
    k: usize,
    gmm: Gmm,
    expected: Gmm,
}

#[test]
fn matches_the_reference_vectors() {
    let cases: Cases = read("split_merge.json");
    assert!(!cases.split.is_empty() && !cases.merge.is_empty());
    for SplitCase { i, alpha, beta, u, gmm, expected } in cases.split {
        expected.assert_close(&split(&gmm.mixture(), i, Split { alpha, beta, u }), 1e-12);
    }
    for MergeCase { j, k, gmm, expected } in cases.merge {
        expected.assert_close(&merge(&gmm.mixture(), j, k), 1e-12);
    }
}

fn assert_restored(parent: &Mixture, choice: Split) {
    let children = split(parent, 0, choice);
    let sum: f64 = children.components.iter().map(|component| component.prior).sum();
    assert!((sum - 1.0).abs() < 1e-15, "the priors sum to {sum}");
    let k = children.components.len() - 1;
    let restored = merge(&children, 0, k);
    let (a, b) = (&restored.components[0], &parent.components[0]);
    assert!((a.prior - b.prior).abs() < 1e-15);
    assert!((a.gaussian.mean() - b.gaussian.mean()).amax() < 1e-11 * b.gaussian.mean().amax());
    let error = (a.gaussian.covariance() - b.gaussian.covariance()).amax();
    // The covariance of a point is jitter only.
    let allowed = 1e-11 * b.gaussian.covariance().amax() + 1e-100;
    assert!(error < allowed, "{error:e} with {choice:?}");
}

#[test]
fn merging_the_halves_of_a_split_restores_the_parent() {
    for seed in 0..100 {
        let mut rng = stream(seed, 1);
        let dim = 1 + seed as usize % 6;
        let mut normal = || standard_normal(&mut rng);
        let factor = DMatrix::from_fn(dim, dim, |_, _| normal());
        let mean = DVector::from_fn(dim, |_, _| 3.0 * normal());
        let within = |x: f64| 0.5 + 0.4 * x.tanh();
        let choice = Split { alpha: within(normal()), beta: within(normal()), u: within(normal()) };
        let covariance = &factor * factor.transpose();
        for choice in [choice, Split::default()] {
            let gaussian = Gaussian::new(mean.clone(), covariance.clone());
            assert_restored(&Mixture::single(gaussian), choice);
        }
    }
}

#[test]
fn splits_repeated_eigenvalues_and_flat_covariances() {
    let mean = DVector::from_element(3, 1.0);
    assert_restored(&Mixture::single(Gaussian::isotropic(mean.clone(), 2.0)), Split::default());
    let flat = DMatrix::from_element(3, 3, 1.0);
    assert_restored(&Mixture::single(Gaussian::new(mean.clone(), flat)), Split::default());
    let point = Mixture::single(Gaussian::new(mean, DMatrix::zeros(3, 3)));
    assert_restored(&point, Split::default());
}

#[test]
fn merging_two_vanished_components_is_defined() {
    let mut children =
        split(&Mixture::single(Gaussian::isotropic(DVector::zeros(2), 1.0)), 0, Split::default());
    children.components.iter_mut().for_each(|component| component.prior = 0.0);
    let merged = merge(&children, 0, 1);
    assert_eq!(merged.components[0].prior, 0.0);
    assert!((merged.components[0].gaussian.covariance() - DMatrix::identity(2, 2)).amax() < 1e-12);
}
