//! Linear least squares with a small ridge.

use nalgebra::DMatrix;

/// Weight of the ridge relative to the mean diagonal of HᵀH: far below the fit's resolution, it only
/// keeps the normal equations solvable when components outnumber what the data show.
const RIDGE: f64 = 1e-9;

/// The W (K×d) with the least ‖H W − Y‖², for H (T×K) and Y (T×d); `None` if H is 0 or not finite.
pub(crate) fn least_squares(H: &DMatrix<f64>, Y: &DMatrix<f64>) -> Option<DMatrix<f64>> {
    let mut normal = H.tr_mul(H);
    let ridge = RIDGE * normal.trace() / normal.nrows() as f64;
    (0..normal.nrows()).for_each(|i| normal[(i, i)] += ridge);
    Some(normal.cholesky()?.solve(&H.tr_mul(Y)))
}

/// The same where the rows of H sum to one: the ridge pulls W towards the mean of Y instead of 0,
/// so that the result does not depend on the origin.
pub(crate) fn about_mean(H: &DMatrix<f64>, Y: &DMatrix<f64>) -> Option<DMatrix<f64>> {
    let mean = Y.row_mean();
    let mut centred = Y.clone();
    centred.row_iter_mut().for_each(|mut row| row -= &mean);
    let mut W = least_squares(H, &centred)?;
    W.row_iter_mut().for_each(|mut row| row += &mean);
    Some(W)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_line_is_found_and_a_shift_moves_the_result_with_it() {
        let H = DMatrix::from_fn(20, 2, |k, i| {
            let u = k as f64 / 19.0;
            if i == 0 { 1.0 - u } else { u }
        });
        let Y = &H * DMatrix::from_row_slice(2, 1, &[3.0, -1.0]);
        let W = least_squares(&H, &Y).unwrap();
        assert!((W[0] - 3.0).abs() < 1e-6 && (W[1] + 1.0).abs() < 1e-6);
        let near = about_mean(&H, &Y).unwrap();
        let far = about_mean(&H, &Y.add_scalar(1e6)).unwrap();
        assert!((near.add_scalar(1e6) - far).amax() < 1e-6);
        assert!(least_squares(&DMatrix::zeros(5, 2), &DMatrix::zeros(5, 1)).is_none());
    }
}
