//! Reaching around an obstacle (Kormushev, Calinon and Caldwell, IROS 2010, Sec. III-A): a hand that was shown
//! a straight way learns to go around what stands in it, with two attractors and their stiffness.
//!
//! The paper prints neither places nor the scale of its distances. They are chosen here so that the start,
//! which imitates the straight way, earns about the paper's 0.61.

use nalgebra::{Matrix2, Vector2, Vector3};
use physics::action::{ActionWorld, Measured};
use search::Method;
use search::power::{Elites, PowerConfig, Scatter, Weights};
use shm_types::measures::TRUTH;

use super::{Task, World};
use crate::config::{Config, JudgeConfig};
use crate::report::Pictures;

pub const TASK: Task = Task {
    name: "obstacle",
    about: "Reach around an obstacle with two attractors and their stiffness (IROS 2010)",
    world: World::Action(|config| Box::new(Obstacle { form: Form::of(config) })),
    configure,
    check: |_| Ok(()),
    has_target: false,
    options: &[("stiffness", &["full", "diagonal", "scalar"])],
    action_units: &[],
    success: Some("way around"),
    pictures: |_| Pictures::Plain,
};

/// Steps of a rollout, and their length, s.
pub const STEPS: usize = 200;
pub const PERIOD: f64 = 0.01;
/// Where the hand starts; the goal is the origin. m.
const START: Vector2<f64> = Vector2::new(-0.6, 0.0);
/// The obstacle's middle and radius, m.
const CENTRE: Vector2<f64> = Vector2::new(-0.3, 0.03);
const RADIUS: f64 = 0.135;
/// Distance at which a term of the return has fallen to 1/e, m.
const LENGTH: f64 = 0.6;
/// Centres and width of the activations, as shares of the rollout.
const CENTRES: [f64; 2] = [0.25, 0.75];
const WIDTH: f64 = 0.15;
/// κᴾ of the start, s⁻², κᵛ, s⁻¹, and the range of log(K/κᴾ).
const STIFFNESS: f64 = 100.0;
const DAMPING: f64 = 20.0;
const LOG_RANGE: f64 = 4.6;
/// First attractor of the imitation, as a share of the way.
const FIRST: f64 = 0.2125;

/// What of a stiffness matrix is learnt.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Form {
    Full,
    Diagonal,
    Scalar,
}

impl Form {
    fn of(config: &Config) -> Form {
        match config.task.option(&TASK, "stiffness") {
            "diagonal" => Form::Diagonal,
            "scalar" => Form::Scalar,
            _ => Form::Full,
        }
    }

    fn numbers(self) -> usize {
        match self {
            Form::Full => 3,
            Form::Diagonal => 2,
            Form::Scalar => 1,
        }
    }

    /// K = κᴾ exp(S), S symmetric: positive definite whatever is proposed. s⁻².
    fn stiffness(self, s: &[f64]) -> Matrix2<f64> {
        let log = match self {
            Form::Full => Matrix2::new(s[0], s[1], s[1], s[2]),
            Form::Diagonal => Matrix2::new(s[0], 0.0, 0.0, s[1]),
            Form::Scalar => Matrix2::identity() * s[0],
        };
        let mut eigen = log.symmetric_eigen();
        eigen.eigenvalues = eigen.eigenvalues.map(|x| x.clamp(-LOG_RANGE, LOG_RANGE).exp());
        eigen.recompose() * STIFFNESS
    }
}

/// The action is, for each attractor, its place, m, and what is learnt of S.
struct Obstacle {
    form: Form,
}

/// The way that was shown, after so many steps: straight, with the least jerk. m.
pub fn shown(steps: usize) -> Vector2<f64> {
    let u = steps as f64 / STEPS as f64;
    START * (1.0 - u * u * u * (10.0 - 15.0 * u + 6.0 * u * u))
}

/// What became of a hand.
pub struct Way {
    /// Where it was after every step, m.
    places: Vec<Vector2<f64>>,
    /// How near it came to the obstacle, m: negative once it ran into it, where it stays.
    clearance: f64,
}

impl Way {
    /// That of a hand at rest at the start, which `accelerates` as the number of the step, its place, m, and its
    /// velocity, m/s, say, m/s².
    pub fn of(accelerates: impl Fn(usize, &Vector2<f64>, &Vector2<f64>) -> Vector2<f64>) -> Way {
        let (mut x, mut xd, mut clearance) = (START, Vector2::zeros(), f64::INFINITY);
        let mut places = Vec::with_capacity(STEPS);
        for step in 0..STEPS {
            xd += accelerates(step, &x, &xd) * PERIOD;
            let next = x + xd * PERIOD;
            if clearance >= 0.0 {
                clearance = clearance.min((next - CENTRE).norm() - RADIUS);
            }
            if clearance >= 0.0 {
                x = next;
            }
            places.push(x);
        }
        Way { places, clearance }
    }

    pub fn measured(&self) -> [Measured; 4] {
        let steps = self.places.iter().enumerate();
        let near = steps.map(|(i, x)| (-(x - shown(i + 1)).norm() / LENGTH).exp());
        let tracking = near.sum::<f64>() / STEPS as f64;
        let collided = f64::from(u8::from(self.clearance < 0.0));
        [
            Measured { name: "tracking", unit: "1", value: tracking },
            Measured { name: "goal_m", unit: "m", value: self.places[STEPS - 1].norm() },
            Measured { name: "clearance_m", unit: "m", value: self.clearance },
            Measured { name: "collided", unit: TRUTH, value: collided },
        ]
    }
}

impl Obstacle {
    fn way(&self, action: &[f64]) -> Way {
        let attractors: Vec<(Vector2<f64>, Matrix2<f64>)> = action
            .chunks_exact(2 + self.form.numbers())
            .map(|part| (Vector2::new(part[0], part[1]), self.form.stiffness(&part[2..])))
            .collect();
        Way::of(|step, x, xd| {
            let share = step as f64 / STEPS as f64;
            let h = CENTRES.map(|centre| (-0.5 * ((share - centre) / WIDTH).powi(2)).exp());
            let pulls = attractors.iter().zip(h).map(|((mu, k), h)| k * (mu - x) * h);
            pulls.sum::<Vector2<f64>>() / h.iter().sum::<f64>() - xd * DAMPING
        })
    }
}

impl ActionWorld for Obstacle {
    fn dim(&self) -> usize {
        2 * (2 + self.form.numbers())
    }

    fn measure(&self, action: &[f64]) -> Vec<Measured> {
        self.way(action).measured().into()
    }

    fn path(&self, action: &[f64], period_s: f64) -> Vec<Vector3<f64>> {
        let Way { places, .. } = self.way(action);
        let n = (STEPS as f64 * PERIOD / period_s) as usize;
        (0..n).map(|i| places[(i as f64 * period_s / PERIOD) as usize].push(0.0)).collect()
    }
}

/// Found on seeds 1 to 20, with the same settings for every form of stiffness.
fn configure(config: &mut Config) {
    let numbers = Form::of(config).numbers();
    let part = |x: f64, stiffness: f64| [vec![x, 0.0], vec![stiffness; numbers]].concat();
    let unit = [vec![1.0; 2], vec![6.0; numbers]].concat();
    let reward = "0.5*tracking + 0.5*exp(-goal_m/0.6)";
    config.task.judge = Some(JudgeConfig::written(reward, "not collided and goal_m < 0.03"));
    let learner = &mut config.learner;
    learner.rollouts = 100;
    learner.action.start = [part(START.x * (1.0 - FIRST), 0.0), part(0.0, 0.0)].concat();
    learner.action.unit = [unit.clone(), unit].concat();
    learner.search.method = Method::Power;
    learner.search.power = PowerConfig {
        n_elites: 6,
        elites: Elites::All,
        weights: Weights::Rank,
        scatter: Scatter::New,
        memory: 0,
        n_initial: 10,
        initial_std: 0.12,
        floor_std: 0.048,
        floor_decay: 0.97,
        floor_min: 0.005,
        ..PowerConfig::default()
    };
}

#[cfg(test)]
mod tests {
    use super::*;

    fn of(world: &Obstacle, action: &[f64], name: &str) -> f64 {
        let measured = world.measure(action);
        measured.iter().find(|measure| measure.name == name).unwrap().value
    }

    #[test]
    fn the_straight_way_is_blocked_and_earns_what_the_paper_prints() {
        let config = Config::of_task(TASK.name);
        let world = Obstacle { form: Form::Full };
        let start = &config.learner.action.start;
        let goal = of(&world, start, "goal_m");
        let earned = 0.5 * of(&world, start, "tracking") + 0.5 * (-goal / LENGTH).exp();
        assert!((earned - 0.61).abs() < 0.01, "{earned}");
        assert_eq!(of(&world, start, "collided"), 1.0);
        assert!(goal > 0.3, "it stays where it ran into it");
    }

    #[test]
    fn a_way_around_comes_to_the_goal() {
        let around = [-0.3, -0.35, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0, 1.0];
        let world = Obstacle { form: Form::Full };
        assert!(of(&world, &around, "clearance_m") > 0.0);
        assert!(of(&world, &around, "goal_m") < 0.05, "{}", of(&world, &around, "goal_m"));
    }

    #[test]
    fn every_form_is_a_full_one_without_the_rest() {
        let full = Form::Full.stiffness(&[0.4, 0.0, -0.3]);
        assert!((Form::Diagonal.stiffness(&[0.4, -0.3]) - full).norm() < 1e-9);
        let equal = Form::Full.stiffness(&[0.4, 0.0, 0.4]);
        assert!((Form::Scalar.stiffness(&[0.4]) - equal).norm() < 1e-9);
        assert!((Form::Full.stiffness(&[0.1, 0.9, 0.2])).symmetric_eigenvalues().min() > 0.0);
    }
}
