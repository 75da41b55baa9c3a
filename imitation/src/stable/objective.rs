//! What a fit minimises, with its derivatives: misses of places along whole courses, of directions and of
//! velocities.

use nalgebra::{DMatrix, DVector};

use super::field::{Evaluation, Field};
use super::parameters::Parameters;
use super::samples::Samples;

/// Weight of the squared distance of θ from where it began: no entry drifts where nothing depends on it.
const ANCHOR: f64 = 1e-6;
/// Squared misses of velocity count relative to the squared velocity and this, in units of the recordings'
/// speed: slow parts are to be as true as fast ones.
const SLOW: f64 = 0.1;
/// Speeds below this have no direction (squared: of samples, and along courses).
const NO_DIRECTION: f64 = 1e-6;
const NO_SPEED: f64 = 0.02 * 0.02;

/// Where a motion from `start` should be after each of equal lengths of path.
#[derive(Clone, Debug)]
pub(super) struct Way {
    /// d.
    pub start: DVector<f64>,
    /// Length of path between two points.
    pub step: f64,
    /// d×T.
    pub points: DMatrix<f64>,
}

/// J(θ) = mean over ways of ‖x − x_way‖² + w_dir Σₙ wₙ ‖f/|f| − v/|v|‖² + w_vel Σₙ wₙ ‖f − v‖²/(|v|² + ¹⁄₁₀),
/// in units of the recordings' size and speed, where x moves along ways at unit speed: dx/ds = f/|f|.
///
/// Departure: published fits of stable fields minimise misses of velocity only. Small ones add up along a
/// motion, and in the slow parts of a movement large ones pass unnoticed.
pub(super) struct Objective<'a> {
    pub parameters: Parameters,
    pub start: DVector<f64>,
    pub samples: &'a Samples,
    pub ways: &'a [Way],
    pub direction_weight: f64,
    pub velocity_weight: f64,
}

impl Objective<'_> {
    /// J(θ); its derivatives go to `by_theta`. Not a number where θ stands for no field.
    pub fn value(&self, theta: &DVector<f64>, by_theta: &mut DVector<f64>) -> f64 {
        let model = self.parameters.unpack(theta);
        let Some(field) = self.parameters.field(&model) else { return f64::NAN };
        let mut by_field = Field::zeros(field.d, field.k());
        let mut at = field.evaluation();
        let mut value = self.misses(&field, &mut at, &mut by_field);
        for way in self.ways {
            value += self.miss_along(way, &field, &mut at, &mut by_field);
        }
        *by_theta = self.parameters.pull_back(&model, &field, &by_field);
        let off = theta - &self.start;
        *by_theta += &off * (2.0 * ANCHOR);
        value + ANCHOR * off.norm_squared()
    }

    /// The terms of directions and velocities.
    fn misses(&self, field: &Field, at: &mut Evaluation, by_field: &mut Field) -> f64 {
        let d = field.d;
        let mut value = 0.0;
        let (mut by_f, mut by_x) = (vec![0.0; d], vec![0.0; d]);
        let samples = self.samples;
        for (n, weight) in samples.weights.iter().enumerate() {
            let x = &samples.places.as_slice()[n * d..(n + 1) * d];
            let v = &samples.velocities.as_slice()[n * d..(n + 1) * d];
            field.evaluate(x, at);
            let (speed, length) = (norm(v, 0.0), norm(&at.f, NO_DIRECTION));
            let by_velocity = self.velocity_weight * weight / (speed * speed + SLOW);
            let by_direction = self.direction_weight * weight;
            let miss = |r: usize| at.f[r] / length - v[r] / speed.max(1e-6);
            let radial = (0..d).map(|r| miss(r) * at.f[r]).sum::<f64>() / (length * length);
            for r in 0..d {
                value += by_velocity * (at.f[r] - v[r]).powi(2) + by_direction * miss(r).powi(2);
                by_f[r] = 2.0 * by_velocity * (at.f[r] - v[r])
                    + 2.0 * by_direction * (miss(r) - at.f[r] * radial) / length;
            }
            field.pull_back(x, at, &by_f, by_field, &mut by_x);
        }
        value
    }

    /// The term of one way: x by the midpoint rule, then the chain rule back along it.
    fn miss_along(
        &self,
        way: &Way,
        field: &Field,
        at: &mut Evaluation,
        by_field: &mut Field,
    ) -> f64 {
        let (d, n) = way.points.shape();
        let share = 1.0 / (n * self.ways.len()) as f64;
        let mut value = 0.0;
        // Place and midpoint of every step.
        let mut walked = Vec::with_capacity(2 * d * n);
        let mut x = way.start.as_slice().to_vec();
        let mut ends = Vec::with_capacity(d * n);
        for k in 0..n {
            walked.extend_from_slice(&x);
            let middle = advance(field, at, &x, &x, way.step / 2.0);
            x = advance(field, at, &middle, &x, way.step);
            walked.extend_from_slice(&middle);
            ends.extend_from_slice(&x);
            value += share * (0..d).map(|r| (x[r] - way.points[(r, k)]).powi(2)).sum::<f64>();
        }
        let mut by_x = vec![0.0; d];
        for k in (0..n).rev() {
            for r in 0..d {
                by_x[r] += 2.0 * share * (ends[k * d + r] - way.points[(r, k)]);
            }
            let (x, middle) = walked[2 * k * d..2 * (k + 1) * d].split_at(d);
            let mut by_middle = vec![0.0; d];
            retreat(field, at, middle, &by_x, way.step, by_field, &mut by_middle);
            let mut by_start: Vec<f64> = by_x.iter().zip(&by_middle).map(|(a, b)| a + b).collect();
            retreat(field, at, x, &by_middle, way.step / 2.0, by_field, &mut by_start);
            by_x = by_start;
        }
        value
    }
}

/// `from` + step·f(at)/|f(at)|.
fn advance(field: &Field, at: &mut Evaluation, place: &[f64], from: &[f64], step: f64) -> Vec<f64> {
    field.evaluate(place, at);
    let length = norm(&at.f, NO_SPEED);
    from.iter().zip(&at.f).map(|(x, f)| x + step * f / length).collect()
}

/// Adds to `by_field` and `by_place` what a number changes by, if it changes `by_end` with the end of a step
/// whose velocity is taken at `place`.
fn retreat(
    field: &Field,
    at: &mut Evaluation,
    place: &[f64],
    by_end: &[f64],
    step: f64,
    by_field: &mut Field,
    by_place: &mut [f64],
) {
    field.evaluate(place, at);
    let length = norm(&at.f, NO_SPEED);
    let radial = by_end.iter().zip(&at.f).map(|(a, b)| a * b).sum::<f64>() / (length * length);
    let by_f: Vec<f64> =
        by_end.iter().zip(&at.f).map(|(by, f)| step * (by - f * radial) / length).collect();
    field.pull_back(place, at, &by_f, by_field, by_place);
}

/// √(Σ xᵢ² + ε²).
fn norm(x: &[f64], squared_floor: f64) -> f64 {
    (x.iter().map(|x| x * x).sum::<f64>() + squared_floor).sqrt()
}

#[cfg(test)]
mod tests;
