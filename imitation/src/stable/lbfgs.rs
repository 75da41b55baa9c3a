//! Minimisation of a smooth function of many variables: limited-memory BFGS.

use std::collections::VecDeque;

use nalgebra::DVector;

/// Steps remembered.
const MEMORY: usize = 20;
/// A step must gain this share of what the slope promises, and leave less than this share of the slope.
const SUFFICIENT: f64 = 1e-4;
const CURVATURE: f64 = 0.9;
/// Lengths tried along one direction.
const MAX_TRIES: usize = 30;
/// The search ends when a step gains less than this share of the value.
const TOLERANCE: f64 = 1e-7;

/// A minimum near `start`, after `n_iterations` steps at most. `objective` returns the value at x and writes
/// its gradient; where the value is not finite the search does not go.
///
/// Nocedal and Wright, Numerical Optimization (2006), Algorithms 7.4 and 7.5. The step length is bisected
/// until it satisfies the weak Wolfe conditions (Lewis and Overton 2013).
pub(super) fn minimise(
    start: DVector<f64>,
    n_iterations: usize,
    mut objective: impl FnMut(&DVector<f64>, &mut DVector<f64>) -> f64,
) -> (f64, DVector<f64>) {
    let mut gradient = DVector::zeros(start.len());
    let value = objective(&start, &mut gradient);
    let mut here = Place { x: start, value, gradient };
    let mut history = History::default();
    for _ in 0..n_iterations {
        let direction = history.direction(&here.gradient);
        let Some(next) = step(&here, &direction, history.is_empty(), &mut objective) else {
            if history.is_empty() {
                break;
            }
            // What was remembered led nowhere: straight down from here.
            history = History::default();
            continue;
        };
        let gain = here.value - next.value;
        history.remember(&next.x - &here.x, &next.gradient - &here.gradient);
        here = next;
        if gain <= TOLERANCE * here.value.abs() {
            break;
        }
    }
    (here.value, here.x)
}

struct Place {
    x: DVector<f64>,
    value: f64,
    gradient: DVector<f64>,
}

/// The next place along `direction`, if it leads down.
fn step(
    here: &Place,
    direction: &DVector<f64>,
    is_first: bool,
    objective: &mut impl FnMut(&DVector<f64>, &mut DVector<f64>) -> f64,
) -> Option<Place> {
    let slope = here.gradient.dot(direction);
    let leads_down = slope < 0.0;
    if !leads_down {
        return None;
    }
    let (mut low, mut high) = (0.0, f64::INFINITY);
    let mut length = if is_first { (1.0 / direction.norm()).min(1.0) } else { 1.0 };
    let mut lower = None;
    for _ in 0..MAX_TRIES {
        let x = &here.x + direction * length;
        let mut gradient = DVector::zeros(x.len());
        let value = objective(&x, &mut gradient);
        let is_lower = value <= here.value + SUFFICIENT * length * slope
            && gradient.iter().all(|x| x.is_finite());
        if is_lower {
            let is_flat = gradient.dot(direction) >= CURVATURE * slope;
            lower = Some(Place { x, value, gradient });
            if is_flat {
                break;
            }
            low = length;
        } else {
            high = length;
        }
        length = if high.is_finite() { (low + high) / 2.0 } else { 2.0 * length };
    }
    lower
}

/// The last steps s and the changes of the gradient over them, y.
#[derive(Default)]
struct History(VecDeque<(DVector<f64>, DVector<f64>)>);

impl History {
    fn is_empty(&self) -> bool {
        self.0.is_empty()
    }

    /// Keeps a step over which the function curves upwards, as the approximation needs.
    fn remember(&mut self, s: DVector<f64>, y: DVector<f64>) {
        if s.dot(&y) > 1e-12 * s.norm() * y.norm() {
            self.0.push_back((s, y));
            if self.0.len() > MEMORY {
                self.0.pop_front();
            }
        }
    }

    /// −H∇f with the approximation H of the inverse Hessian, in two loops.
    fn direction(&self, gradient: &DVector<f64>) -> DVector<f64> {
        let mut q = -gradient;
        let mut shares = Vec::with_capacity(self.0.len());
        for (s, y) in self.0.iter().rev() {
            let share = s.dot(&q) / s.dot(y);
            q.axpy(-share, y, 1.0);
            shares.push(share);
        }
        if let Some((s, y)) = self.0.back() {
            q *= s.dot(y) / y.norm_squared();
        }
        for ((s, y), share) in self.0.iter().zip(shares.into_iter().rev()) {
            let back = y.dot(&q) / s.dot(y);
            q.axpy(share - back, s, 1.0);
        }
        q
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn finds_the_bottom_of_a_curved_valley() {
        // Rosenbrock's function in 10 variables.
        let rosenbrock = |x: &DVector<f64>, gradient: &mut DVector<f64>| {
            let mut value = 0.0;
            for i in 0..x.len() - 1 {
                let (a, b) = (1.0 - x[i], x[i + 1] - x[i] * x[i]);
                value += a * a + 100.0 * b * b;
                gradient[i] += -2.0 * a - 400.0 * b * x[i];
                gradient[i + 1] += 200.0 * b;
            }
            value
        };
        let (value, x) = minimise(DVector::from_element(10, -1.2), 1000, rosenbrock);
        assert!(value < 1e-10, "{value}");
        assert!((x.add_scalar(-1.0)).amax() < 1e-4, "{x}");
    }

    #[test]
    fn stays_where_the_function_is_finite() {
        // x − ln x, which is no number left of 0: the first full step leads there.
        let barrier = |x: &DVector<f64>, gradient: &mut DVector<f64>| {
            gradient[0] = 1e3 * (1.0 - 1.0 / x[0]);
            1e3 * (x[0] - x[0].ln())
        };
        let (value, x) = minimise(DVector::from_element(1, 0.01), 100, barrier);
        assert!((x[0] - 1.0).abs() < 1e-3 && value.is_finite(), "{x}");
    }

    #[test]
    fn a_place_that_is_no_number_is_left_alone() {
        let (value, x) = minimise(DVector::zeros(2), 10, |_, _| f64::NAN);
        assert!(value.is_nan());
        assert_eq!(x, DVector::zeros(2));
    }
}
