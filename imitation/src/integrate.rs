//! Motions, step by step: the classical Runge-Kutta method with one step a period.

use nalgebra::{DMatrix, DVector};

/// The path (d×T) of ẋ = `velocity`(t, x) from `start`, a point each `period_s` (s) over `duration_s` (s).
pub(crate) fn first_order(
    start: &DVector<f64>,
    duration_s: f64,
    period_s: f64,
    velocity: impl Fn(f64, &DVector<f64>) -> DVector<f64>,
) -> DMatrix<f64> {
    let n = (duration_s / period_s).round() as usize + 1;
    let h = period_s;
    let mut x = start.clone();
    let mut path = DMatrix::zeros(start.len(), n);
    for k in 0..n {
        path.set_column(k, &x);
        let t = k as f64 * h;
        let v1 = velocity(t, &x);
        let v2 = velocity(t + h / 2.0, &(&x + &v1 * (h / 2.0)));
        let v3 = velocity(t + h / 2.0, &(&x + &v2 * (h / 2.0)));
        let v4 = velocity(t + h, &(&x + &v3 * h));
        x += (v1 + (v2 + v3) * 2.0 + v4) * (h / 6.0);
    }
    path
}

/// The path (d×T) of ẍ = `acceleration`(t, x, ẋ) from rest at `start`.
pub(crate) fn from_rest(
    start: &DVector<f64>,
    duration_s: f64,
    period_s: f64,
    acceleration: impl Fn(f64, &DVector<f64>, &DVector<f64>) -> DVector<f64>,
) -> DMatrix<f64> {
    let d = start.len();
    let state = start.clone().resize_vertically(2 * d, 0.0);
    let path = first_order(&state, duration_s, period_s, |t, state| {
        let (x, xd) = (state.rows(0, d).clone_owned(), state.rows(d, d).clone_owned());
        let xdd = acceleration(t, &x, &xd);
        DVector::from_iterator(2 * d, xd.iter().chain(xdd.iter()).copied())
    });
    path.rows(0, d).clone_owned()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_critically_damped_spring_follows_its_closed_form() {
        let w = 10.0;
        let path = from_rest(&DVector::from_element(1, 1.0), 1.0, 0.01, |_, x, v| {
            -x * (w * w) - v * (2.0 * w)
        });
        assert_eq!(path.ncols(), 101);
        for k in 0..101 {
            let t = k as f64 * 0.01;
            assert!((path[k] - (1.0 + w * t) * (-w * t).exp()).abs() < 1e-5);
        }
    }

    #[test]
    fn what_changes_in_time_is_followed() {
        let path =
            from_rest(&DVector::zeros(1), 2.0, 0.1, |t, _, _| DVector::from_element(1, 6.0 * t));
        assert!((path[20] - 8.0).abs() < 1e-9, "ẍ = 6t is x = t³");
    }
}
