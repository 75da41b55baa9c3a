//! Properties of EM, and mixtures that were planted.

use search::normals::{standard_normal, stream};

use super::*;

/// N = `n` points of two coordinates from each planted centre, with unequal correlated spreads, in turn.
fn planted(centers: &[[f64; 2]], n: usize, seed: u64) -> DMatrix<f64> {
    let mut rng = stream(seed, 77);
    let mut data = DMatrix::zeros(2, n * centers.len());
    for (j, mut x) in data.column_iter_mut().enumerate() {
        let center = centers[j % centers.len()];
        let (a, b) = (standard_normal(&mut rng), standard_normal(&mut rng));
        x[0] = center[0] + 0.5 * a;
        x[1] = 100.0 * (center[1] + 0.2 * a + 0.3 * b);
    }
    data
}

const THREE: [[f64; 2]; 3] = [[0.0, 0.0], [4.0, 1.0], [1.0, 3.0]];

#[test]
fn the_penalised_likelihood_never_falls_during_em() {
    for seed in 0..20 {
        let data = planted(&THREE, 40, seed);
        let k = 1 + seed as usize % 6;
        for regularization in [1e-12, 1e-6, 1e-2] {
            let options = GmmOptions { regularization, ..GmmOptions::default() };
            let points = Standard::new(&data, k, &options).unwrap().points;
            let mut em = Em::new(start::centers(&points, k, &mut stream(seed, 0)), &points);
            let mut before = f64::NEG_INFINITY;
            for step in 0..60 {
                let h = em.expect(&points, &options);
                let slack = 1e-9 * em.objective.abs();
                assert!(em.objective >= before - slack, "seed {seed}, step {step}");
                before = em.objective;
                maximise(&mut em.mixture, &points, &h, &options);
            }
        }
    }
}

#[test]
fn recovers_three_planted_gaussians() {
    for seed in 0..10 {
        let fit = fit(&planted(&THREE, 400, seed), 3, &GmmOptions::default(), seed).unwrap();
        for center in THREE {
            let truth = DVector::from_vec(vec![center[0], 100.0 * center[1]]);
            let distance = |mean: &&DVector<f64>| {
                let miss = *mean - &truth;
                (miss[0].powi(2) + (miss[1] / 100.0).powi(2)).sqrt()
            };
            let nearest =
                fit.mixture.means.iter().min_by(|a, b| distance(a).total_cmp(&distance(b)));
            assert!(distance(&nearest.unwrap()) < 0.15, "seed {seed}: {:?}", fit.mixture.means);
        }
        for (prior, covariance) in fit.mixture.priors.iter().zip(&fit.mixture.covariances) {
            assert!((prior - 1.0 / 3.0).abs() < 0.03);
            assert!((covariance[(0, 0)] / 0.25 - 1.0).abs() < 0.3);
            assert!((covariance[(0, 1)] / 10.0 - 1.0).abs() < 0.4);
        }
    }
}

#[test]
fn bic_finds_the_planted_number_of_components() {
    for seed in 0..10 {
        let data = planted(&THREE, 150, seed);
        let chosen = fit_by_bic(&data, 1..=6, &GmmOptions::default(), seed).unwrap();
        assert_eq!(chosen.fit.mixture.n_components(), 3, "seed {seed}: {:?}", chosen.bics);
        assert_eq!(chosen.bics.len(), 6);
    }
}

#[test]
fn one_component_has_the_mean_and_covariance_of_the_data() {
    let data = planted(&THREE, 100, 5);
    let options = GmmOptions { regularization: 1e-12, ..GmmOptions::default() };
    let fit = fit(&data, 1, &options, 0).unwrap();
    assert!((&fit.mixture.means[0] - data.column_mean()).amax() < 1e-9);
    let variance = variances(&data);
    for c in 0..2 {
        assert!((fit.mixture.covariances[0][(c, c)] / variance[c] - 1.0).abs() < 1e-9);
    }
    let sum: f64 = data.column_iter().map(|x| fit.mixture.log_density(&x.clone_owned())).sum();
    assert!((sum - fit.log_likelihood).abs() < 1e-6, "{sum} is not {}", fit.log_likelihood);
}

/// The same points in another order: a step of EM gives the same, and so does the best of all starts.
#[test]
fn the_order_of_the_data_changes_nothing() {
    let data = planted(&THREE, 60, 9);
    let n = data.ncols();
    let reversed = DMatrix::from_fn(2, n, |c, j| data[(c, n - 1 - j)]);
    let options = GmmOptions::default();
    let step = |data: &DMatrix<f64>| {
        let points = Standard::new(data, 3, &options).unwrap().points;
        let centers = [[-1.0, -1.0], [1.0, 0.0], [0.0, 1.0]].map(|c| DVector::from_row_slice(&c));
        let mut em = Em::new(centers.to_vec(), &points);
        let h = em.expect(&points, &options);
        maximise(&mut em.mixture, &points, &h, &options);
        em
    };
    let (one, other) = (step(&data), step(&reversed));
    assert!((one.objective - other.objective).abs() < 1e-9);
    for i in 0..3 {
        assert!((&one.mixture.means[i] - &other.mixture.means[i]).amax() < 1e-12);
        assert!((&one.mixture.covariances[i] - &other.mixture.covariances[i]).amax() < 1e-12);
    }
    let (one, other) =
        (fit(&data, 3, &options, 1).unwrap(), fit(&reversed, 3, &options, 1).unwrap());
    assert!((one.log_likelihood - other.log_likelihood).abs() < 1e-3);
}

#[test]
fn units_change_nothing_but_themselves() {
    let data = planted(&THREE, 60, 4);
    let other = DMatrix::from_fn(2, data.ncols(), |c, j| [1e-3, 1e4][c] * data[(c, j)] + 7.0);
    let (one, two) = (
        fit(&data, 3, &GmmOptions::default(), 2).unwrap().mixture,
        fit(&other, 3, &GmmOptions::default(), 2).unwrap().mixture,
    );
    for i in 0..3 {
        assert!((one.priors[i] - two.priors[i]).abs() < 1e-6);
        let scaled = (two.means[i][0] - 7.0) / 1e-3;
        assert!((one.means[i][0] - scaled).abs() < 1e-6, "{} {scaled}", one.means[i][0]);
        let scaled = two.covariances[i][(0, 1)] / 1e1;
        assert!((one.covariances[i][(0, 1)] / scaled - 1.0).abs() < 1e-5);
    }
}

#[test]
fn a_fit_repeats_and_is_a_mixture() {
    // Points that coincide, and fewer clusters than components.
    let data = DMatrix::from_fn(2, 60, |c, j| if j % 2 == 0 { c as f64 } else { 3.0 - c as f64 });
    let one = fit(&data, 4, &GmmOptions::default(), 3).unwrap();
    assert_eq!(one, fit(&data, 4, &GmmOptions::default(), 3).unwrap());
    let Mixture { priors, means, covariances } = one.mixture;
    assert!(Mixture::new(priors, means, covariances).is_ok());
}

#[test]
fn errors_say_what_is_missing() {
    let data = planted(&THREE, 10, 0);
    let options = GmmOptions::default();
    let message = |data: &DMatrix<f64>, k| fit(data, k, &options, 0).unwrap_err().to_string();
    assert_eq!(
        message(&data, 12),
        "K = 12 components need at least 36 points: the recordings have 30; take fewer components or \
         longer recordings"
    );
    let mut still = data.clone();
    still.row_mut(1).fill(0.25);
    assert_eq!(message(&still, 1), "coordinate 2 never moves (it is always 0.25): leave it out");
    still[(0, 3)] = f64::NAN;
    assert_eq!(message(&still, 1), "coordinate 1 of point 4 is not finite");
    assert_eq!(fit(&data, 0, &options, 0), Err(GmmError::NoComponents));
    #[allow(clippy::reversed_empty_ranges)]
    let empty = fit_by_bic(&data, 3..=2, &options, 0);
    assert_eq!(empty, Err(GmmError::NoRange));
    let unregularized = GmmOptions { regularization: 0.0, ..options };
    assert_eq!(fit(&data, 1, &unregularized, 0), Err(GmmError::Regularization(0.0)));
}
