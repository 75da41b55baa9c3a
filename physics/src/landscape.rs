//! The solution landscape of Sec. 4.2's first experiment: a weighted sum of three Gaussians.

use std::f64::consts::PI;

use nalgebra::Vector2;

/// Highest value and its place. (The paper's text prints 0.08.)
pub const PEAK: [f64; 2] = [1.522_05, 8.477_95];
pub const PEAK_VALUE: f64 = 0.066_288;
/// The square in which the paper draws the landscape.
pub const BOX: ([f64; 2], [f64; 2]) = ([0.0, 0.0], [10.0, 10.0]);

/// πᵢ, μᵢ and the diagonal of Σᵢ.
const HILLS: [(f64, [f64; 2], [f64; 2]); 3] =
    [(0.4, [3.0, 3.0], [1.0, 9.0]), (0.4, [7.0, 7.0], [9.0, 1.0]), (0.2, [1.5, 8.5], [0.5, 0.5])];

/// Sec. 4.2: r(Θ) = Σᵢ πᵢ 𝒩(Θ | μᵢ, Σᵢ).
pub fn height(theta: &Vector2<f64>) -> f64 {
    HILLS
        .iter()
        .map(|(prior, mean, variance)| {
            let [dx, dy] = [theta.x - mean[0], theta.y - mean[1]];
            let exponent = -0.5 * (dx * dx / variance[0] + dy * dy / variance[1]);
            prior * exponent.exp() / (2.0 * PI * (variance[0] * variance[1]).sqrt())
        })
        .sum()
}
