//! Via-points (Bruno, Calinon and Caldwell, AAAI 2013, DIPOLE): one movement, several ways to do it.
//!
//! From the paper: the hand passes three times, each time through one of the via-points of that pass; three
//! attractors of a virtual spring are learnt, 9 numbers; 300 trials find 2.5 distinct ways a run there, in
//! the mean of 10.
//!
//! The paper prints no coordinates. These are read from its Fig. 3 within some centimetres: left or right,
//! then up or down, then the end, which makes four ways. Its Eq. (9) averages exp(−α ·) of the misses and
//! prints neither α nor a norm: the square with α = 20 m⁻² gives the straight line the 0.75 with which its
//! Fig. 2 begins. The spring, critically damped, and the times are chosen here.

use nalgebra::Vector3;
use physics::action::{ActionWorld, Measured};
use search::Method;

use super::{Task, World};
use crate::config::{Config, JudgeConfig};
use crate::report::Pictures;

pub const TASK: Task = Task {
    name: "via-points",
    about: "Pass by one via-point of each of three passes, in one of four ways (AAAI 2013)",
    world: World::Action(|_| Box::new(ViaPoints)),
    configure,
    check: |_| Ok(()),
    has_target: false,
    options: &[],
    action_units: &["_m"; 9],
    success: Some("way found"),
    pictures: |_| Pictures::Plain,
};

/// s. The hand passes at a third, at two thirds and at the end of the movement.
const PERIOD: f64 = 0.01;
const STEPS: usize = 240;
/// The spring, s⁻².
const STIFFNESS: f64 = 200.0;
/// Width of the activations, in durations; their centres are in the middle of each third.
const WIDTH: f64 = 0.1;
/// Attractors lie within this of the base, m.
const MAX_ATTRACTOR: f64 = 10.0;
/// Where the movement begins, m.
const BEGIN: Vector3<f64> = Vector3::new(0.0, 0.0, 0.4);
/// The via-points of each pass, m.
const VIA_POINTS: [&[Vector3<f64>]; 3] = [
    &[Vector3::new(0.2, 0.2, 0.4), Vector3::new(0.2, -0.2, 0.4)],
    &[Vector3::new(0.5, 0.0, 0.5), Vector3::new(0.5, 0.0, 0.2)],
    &[Vector3::new(0.7, 0.0, 0.4)],
];
/// The straight line, between the via-points: the attractors, m.
const START: [f64; 9] = [0.14, 0.0, 0.4, 0.46, 0.0, 0.4, 0.7, 0.0, 0.4];
/// The box that is searched: the start ± this, m.
const HALF_WIDTH: f64 = 0.3;

/// An action is the places of three attractors (x, y, z of each, m), active one after the other.
struct ViaPoints;

/// ẍ = k [Σ hᵢ(t) μᵢ − x] − 2√k ẋ, by semi-implicit steps: where the hand is before the first and after
/// each of them.
fn movement(action: &[f64]) -> Vec<Vector3<f64>> {
    let inside = |x: f64| x.clamp(-MAX_ATTRACTOR, MAX_ATTRACTOR);
    let attractors: Vec<Vector3<f64>> =
        action.chunks_exact(3).map(|mu| Vector3::from_column_slice(mu).map(inside)).collect();
    let (mut x, mut v) = (BEGIN, Vector3::zeros());
    let mut path = vec![x];
    for step in 0..STEPS {
        let (mut attractor, mut sum) = (Vector3::zeros(), 0.0);
        for (i, mu) in attractors.iter().enumerate() {
            let centre = (i as f64 + 0.5) / attractors.len() as f64;
            let h = (-0.5 * ((step as f64 / STEPS as f64 - centre) / WIDTH).powi(2)).exp();
            attractor += h * mu;
            sum += h;
        }
        v += (STIFFNESS * (attractor / sum - x) - 2.0 * STIFFNESS.sqrt() * v) * PERIOD;
        x += v * PERIOD;
        path.push(x);
    }
    path
}

/// Index of the via-point that is nearest at each pass, and its distance, m.
fn passes(action: &[f64]) -> [(usize, f64); 3] {
    let path = movement(action);
    [0, 1, 2].map(|pass| {
        let x = path[STEPS * (pass + 1) / 3];
        let distances = VIA_POINTS[pass].iter().map(|via| (via - x).norm());
        distances.enumerate().min_by(|a, b| a.1.total_cmp(&b.1)).expect("every pass has one")
    })
}

impl ActionWorld for ViaPoints {
    fn dim(&self) -> usize {
        9
    }

    /// The misses of the three passes and the largest of them; which way was taken: 1 left and up, 2 left
    /// and down, 3 right and up, 4 right and down.
    fn measure(&self, action: &[f64]) -> Vec<Measured> {
        let [first, second, third] = passes(action);
        let metres = |name, value| Measured { name, unit: "m", value };
        vec![
            metres("miss_1_m", first.1),
            metres("miss_2_m", second.1),
            metres("miss_3_m", third.1),
            metres("miss_m", first.1.max(second.1).max(third.1)),
            Measured { name: "way", unit: "1", value: (1 + 2 * first.0 + second.0) as f64 },
        ]
    }

    fn path(&self, action: &[f64], period_s: f64) -> Vec<Vector3<f64>> {
        let path = movement(action);
        let n = (STEPS as f64 * PERIOD / period_s).round() as usize;
        let step = |i: usize| ((i as f64 * period_s / PERIOD).round() as usize).min(STEPS);
        (0..=n).map(|i| path[step(i)]).collect()
    }
}

/// Found on seeds 1 to 40. What is known of the ways is the box and that the straight line lies among them.
fn configure(config: &mut Config) {
    // Eq. (9) of the paper.
    let reward = "(exp(-20*miss_1_m^2) + exp(-20*miss_2_m^2) + exp(-20*miss_3_m^2)) / 3";
    config.task.judge = Some(JudgeConfig::written(reward, "miss_m < 0.05"));
    let learner = &mut config.learner;
    learner.rollouts = 300;
    learner.action.start = START.to_vec();
    // Without the last digits of a sum, which a configuration would show.
    let edge = |by: f64| START.map(|x| ((x + by) * 1e9).round() / 1e9).to_vec();
    (learner.action.min, learner.action.max) = (edge(-HALF_WIDTH), edge(HALF_WIDTH));
    learner.search.method = Method::Niching;
    let niching = &mut learner.search.niching;
    niching.n_candidates = 2;
    niching.start_std = 0.2;
    niching.initial_std = 0.2;
    niching.n_between_tests = 15;
    niching.climb.surrogate = true;
    niching.climb.until_success = true;
    niching.climb.patience = 15;
    niching.climb.n_max = 60;
}

#[cfg(test)]
mod tests {
    use super::*;

    /// μ that lead through the via-points `first` and `second`: solved for, as the hand is linear in the
    /// attractors.
    fn through(first: usize, second: usize) -> Vec<f64> {
        let rest = movement(&[0.0; 9]);
        let column = |i: usize| {
            let unit: Vec<f64> = (0..9).map(|n| f64::from(u8::from(n / 3 == i))).collect();
            let moved = movement(&unit);
            [1, 2, 3].map(|pass| moved[STEPS * pass / 3].x - rest[STEPS * pass / 3].x)
        };
        let response = nalgebra::Matrix3::from_fn(|pass, i| column(i)[pass]);
        let via = [VIA_POINTS[0][first], VIA_POINTS[1][second], VIA_POINTS[2][0]];
        let wanted = nalgebra::Matrix3::from_fn(|pass, axis| {
            via[pass][axis] - rest[STEPS * (pass + 1) / 3][axis]
        });
        let attractors = response.try_inverse().expect("three springs, three passes") * wanted;
        (0..9).map(|n| attractors[(n / 3, n % 3)]).collect()
    }

    fn values(action: &[f64]) -> Vec<f64> {
        ViaPoints.measure(action).iter().map(|measure| measure.value).collect()
    }

    fn reward(action: &[f64]) -> f64 {
        values(action)[..3].iter().map(|miss| (-20.0 * miss * miss).exp()).sum::<f64>() / 3.0
    }

    #[test]
    fn four_ways_lead_through_the_via_points_and_lie_in_the_box() {
        for (first, second, way) in [(0, 0, 1.0), (0, 1, 2.0), (1, 0, 3.0), (1, 1, 4.0)] {
            let action = through(first, second);
            let values = values(&action);
            assert!(values[3] < 1e-9 && values[4] == way, "{values:?}");
            let inside = |(x, start): (&f64, &f64)| (x - start).abs() < HALF_WIDTH;
            assert!(action.iter().zip(&START).all(inside), "{action:?}");
        }
    }

    /// Half way between two ways is no way, and worth less than either.
    #[test]
    fn a_valley_lies_between_any_two_ways() {
        let ways = [(0, 0), (0, 1), (1, 0), (1, 1)].map(|(first, second)| through(first, second));
        for (i, a) in ways.iter().enumerate() {
            for b in &ways[..i] {
                let middle: Vec<f64> = a.iter().zip(b).map(|(a, b)| 0.5 * (a + b)).collect();
                assert!(reward(&middle) < 0.9, "{}", reward(&middle));
                assert!(values(&middle)[3] > 0.05);
            }
        }
    }

    #[test]
    fn the_straight_line_passes_between_them_with_the_published_return() {
        assert!((reward(&START) - 0.75).abs() < 0.01, "{}", reward(&START));
        let path = ViaPoints.path(&START, PERIOD);
        assert_eq!((path.len(), path[0]), (STEPS + 1, BEGIN));
        assert!(path.iter().all(|x| x.y == 0.0 && (x.z - BEGIN.z).abs() < 1e-12));
    }

    #[test]
    fn measures_are_finite_however_far_the_action() {
        for x in [f64::MAX, f64::MIN, 1e3, -1e3] {
            assert!(values(&[x; 9]).iter().all(|value| value.is_finite()));
        }
    }
}
