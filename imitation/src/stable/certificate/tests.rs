//! What a certificate says of a field, and what it refuses.

use super::*;
use crate::integrate::first_order;

fn vector(x: &[f64]) -> DVector<f64> {
    DVector::from_row_slice(x)
}

/// Two systems with half the weight each at the target (0.2, −0.1): a node, and a spiral.
fn systems() -> Systems {
    let target = vector(&[0.2, -0.1]);
    let A = vec![
        DMatrix::from_row_slice(2, 2, &[-1.0, 0.5, 0.0, -2.0]),
        DMatrix::from_row_slice(2, 2, &[-1.0, 3.0, -3.0, -1.0]),
    ];
    let b = A.iter().map(|A| -(A * &target)).collect();
    let centers = vec![vector(&[0.4, 0.0]), vector(&[0.0, -0.2])];
    let covariance = DMatrix::from_diagonal_element(2, 2, 0.01);
    Systems::new(vec![0.5; 2], centers, vec![covariance; 2], A, b).unwrap()
}

fn certificate(P: [f64; 4]) -> Certificate {
    Certificate { P: DMatrix::from_row_slice(2, 2, &P), target: vector(&[0.2, -0.1]) }
}

const ROUND: [f64; 4] = [1.0, 0.0, 0.0, 1.0];

#[test]
fn the_margin_is_the_slowest_fall_of_v() {
    // λmin of −(A + Aᵀ): that of [[2, −½], [−½, 4]], and 2 of the spiral.
    let node = 3.0 - (1.0_f64 + 0.25).sqrt();
    let margin = certificate(ROUND).check(&systems()).unwrap();
    assert!((margin - node).abs() < 1e-12, "{margin} is not {node}");
    // V scaled is the same statement.
    let scaled = certificate(ROUND.map(|x| 1e-6 * x)).check(&systems()).unwrap();
    assert!((scaled - margin).abs() < 1e-9);
}

#[test]
fn v_falls_at_the_margin_along_every_motion() {
    let (systems, certificate) = (systems(), certificate([1.2, 0.1, 0.1, 1.0]));
    let margin = certificate.check(&systems).unwrap();
    for start in [[1.0, 1.0], [-3.0, 0.2], [0.2, 40.0]] {
        let path = first_order(&vector(&start), 2.0, 0.01, |_, x| systems.output(x, x));
        let V = |k: usize| {
            let off = path.column(k) - &certificate.target;
            off.dot(&(&certificate.P * &off))
        };
        for k in 1..path.ncols() {
            assert!(V(k) <= V(k - 1) * (-margin * 0.01).exp() * (1.0 + 1e-9));
        }
    }
}

#[test]
fn a_spiral_needs_damping_and_with_less_it_opens() {
    // One spiral, −n ± iw: n + w²/n, which is exact: the driven motion has growing modes below w²/n.
    let (n, w) = (0.5, 3.0);
    let A = DMatrix::from_row_slice(2, 2, &[-n, w, -w, -n]);
    let spiral = Systems::new(
        vec![1.0],
        vec![DVector::zeros(2)],
        vec![DMatrix::identity(2, 2)],
        vec![A],
        vec![DVector::zeros(2)],
    )
    .unwrap();
    let certificate = Certificate { P: DMatrix::identity(2, 2), target: DVector::zeros(2) };
    let damping = certificate.damping(&spiral).unwrap();
    assert!((damping - (n + w * w / n)).abs() < 1e-9, "{damping}");
    let end = |damping: f64| {
        let path = crate::integrate::from_rest(&vector(&[1.0, 0.0]), 60.0, 0.01, |_, x, xd| {
            (spiral.output(x, x) - xd) * damping
        });
        path.column(path.ncols() - 1).norm()
    };
    // Just above the bound, where the slowest mode hardly decays, and well above and below it.
    assert!(end(damping) < 1.0, "{}", end(damping));
    assert!(end(2.0 * damping) < 1e-3 && end(w * w / n - 2.0) > 10.0);
}

#[test]
fn what_proves_nothing_is_refused_with_the_component() {
    let unstable = |change: fn(&mut Systems)| {
        let mut systems = systems();
        change(&mut systems);
        certificate(ROUND).check(&systems)
    };
    assert!(matches!(
        unstable(|s| s.b[1][0] += 1e-6),
        Err(CertificateError::Moves { component: 2, .. })
    ));
    // Stable alone, but not in this measure.
    let slanted = |s: &mut Systems| {
        s.A[0] = DMatrix::from_row_slice(2, 2, &[-1.0, 10.0, 0.0, -1.0]);
        s.b[0] = -(&s.A[0] * vector(&[0.2, -0.1]));
    };
    let error = unstable(slanted).unwrap_err();
    assert!(matches!(error, CertificateError::NotStable { component: 1, .. }), "{error}");
    // A centre: V stands still, and rounding decides nothing.
    let centre = |s: &mut Systems| {
        s.A[1] = DMatrix::from_row_slice(2, 2, &[-1e-14, 1.0, -1.0, -1e-14]);
        s.b[1] = -(&s.A[1] * vector(&[0.2, -0.1]));
    };
    assert!(matches!(unstable(centre), Err(CertificateError::NotStable { component: 2, .. })));

    let refused = |P: [f64; 4]| certificate(P).check(&systems()).unwrap_err();
    assert_eq!(refused([1.0, 0.5, 0.4, 1.0]), CertificateError::NotPositive);
    assert_eq!(refused([1.0, 2.0, 2.0, 1.0]), CertificateError::NotPositive);
    assert_eq!(refused([f64::NAN; 4]), CertificateError::NotPositive);
    let mut other = certificate(ROUND);
    other.target = DVector::zeros(3);
    assert!(matches!(other.check(&systems()), Err(CertificateError::Shape { d: 3, .. })));
    other.P = DMatrix::identity(3, 3);
    assert!(matches!(other.check(&systems()), Err(CertificateError::Coordinates { d: 3, .. })));
    other.target[2] = f64::INFINITY;
    assert_eq!(other.check(&systems()), Err(CertificateError::Target));
}

#[test]
fn is_written_and_read_with_every_bit_and_checked() {
    let one = certificate([2.0, 0.1, 0.1, 1.0 / 3.0]);
    let text = serde_json::to_string(&one).unwrap();
    assert_eq!(serde_json::from_str::<Certificate>(&text).unwrap(), one);
    let error = serde_json::from_str::<Certificate>(&text.replace("2.0", "-2.0")).unwrap_err();
    assert!(error.to_string().contains("positive definite"), "{error}");
}
