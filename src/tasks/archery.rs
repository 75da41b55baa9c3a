//! Archery (Kormushev, Calinon, Saegusa and Metta, Humanoids 2010): two hands hold a bow so that the arrow
//! hits the middle of a target.
//!
//! The geometry that the paper does not print is chosen here: the arrow flies as the hands lie to each
//! other, with a speed in proportion to their distance, without drag.

use nalgebra::Vector3;
use physics::action::{ActionWorld, Measured};
use search::Method;
use search::aim::Target;
use search::power::{Elites, PowerConfig, Weights};

use super::{Task, World};
use crate::config::{Config, JudgeConfig};
use crate::report::Pictures;

pub const TASK: Task = Task {
    name: "archery",
    about: "Hold a bow so that the arrow hits the middle of a target 2.2 m away (Humanoids 2010)",
    world: World::Action(|_| Box::new(Archery)),
    configure,
    check: |_| Ok(()),
    has_target: false,
    options: &[],
    action_units: &["_m", "_m", "_m"],
    success: Some("hit"),
    pictures: |_| Pictures::Plain,
};

const GRAVITY: f64 = 9.81;
/// From the bow to the target, m.
const DISTANCE: f64 = 2.2;
/// The floor below the bow, m.
const FLOOR: f64 = -0.8;
/// Speed of the arrow per distance of the hands, s⁻¹.
const SPEED_PER_DRAW: f64 = 15.0;
/// A shot to the left and too high.
const START: [f64; 3] = [-0.02, 0.28, 0.20];

/// The action is the bow's hand seen from the other one, m: to the right, to the target, up.
struct Archery;

/// Where and when an arrow arrives.
struct Shot {
    velocity: Vector3<f64>,
    end_s: f64,
}

impl Shot {
    fn of(action: &[f64]) -> Shot {
        let velocity = SPEED_PER_DRAW * Vector3::new(action[0], action[1], action[2]);
        let vz = velocity.z;
        let falls_s = (vz + (vz * vz - 2.0 * GRAVITY * FLOOR).sqrt()) / GRAVITY;
        let arrives_s = if velocity.y > 0.0 { DISTANCE / velocity.y } else { f64::INFINITY };
        Shot { velocity, end_s: falls_s.min(arrives_s) }
    }

    /// Seen from the bow, m.
    fn position(&self, t_s: f64) -> Vector3<f64> {
        self.velocity * t_s - Vector3::z() * (0.5 * GRAVITY * t_s * t_s)
    }
}

impl ActionWorld for Archery {
    fn dim(&self) -> usize {
        3
    }

    /// The vector from the middle of the target to where the arrow stopped.
    fn measure(&self, action: &[f64]) -> Vec<Measured> {
        let shot = Shot::of(action);
        let miss = shot.position(shot.end_s) - Vector3::y() * DISTANCE;
        let measured = |name, value| Measured { name, unit: "m", value };
        vec![
            measured("miss_m", miss.norm()),
            measured("miss_right_m", miss.x),
            measured("miss_up_m", miss.z),
            measured("short_m", -miss.y),
        ]
    }

    fn path(&self, action: &[f64], period_s: f64) -> Vec<Vector3<f64>> {
        let shot = Shot::of(action);
        (0..=(shot.end_s / period_s) as usize).map(|i| shot.position(i as f64 * period_s)).collect()
    }
}

/// Found on seeds 1 to 20.
fn configure(config: &mut Config) {
    config.task.judge = Some(JudgeConfig::written("exp(-miss_m)", "miss_m < 0.05"));
    let learner = &mut config.learner;
    learner.rollouts = 60;
    learner.action.start = START.to_vec();
    learner.search.method = Method::Power;
    learner.search.power = PowerConfig {
        n_elites: 3,
        elites: Elites::All,
        weights: Weights::Rank,
        n_initial: 5,
        initial_std: 0.03,
        floor_std: 0.015,
        floor_decay: 0.95,
        floor_min: 0.001,
        ..PowerConfig::default()
    };
    // What was measured of the arrow, for a search that learns from it: the middle of the hit.
    let target = |measure| Target::new(measure, [-0.03, 0.03], 0.3);
    learner.search.aim.targets = vec![target("miss_right_m"), target("miss_up_m")];
    learner.search.aim.std = 0.03;
}

#[cfg(test)]
mod tests {
    use super::*;

    fn of(action: &[f64], name: &str) -> f64 {
        let measured = Archery.measure(action);
        measured.iter().find(|measure| measure.name == name).unwrap().value
    }

    #[test]
    fn an_arrow_flies_as_a_stone() {
        // 0.2 s to the target, on which it has fallen 0.5·9.81·0.2² = 0.1962 m.
        let level = [0.0, DISTANCE / 0.2 / SPEED_PER_DRAW, 0.0];
        assert!((of(&level, "miss_up_m") + 0.1962).abs() < 1e-12);
        assert!(of(&level, "miss_right_m") == 0.0 && of(&level, "short_m").abs() < 1e-12);
        let right = [0.05, level[1], level[2]];
        assert!((of(&right, "miss_right_m") - 0.05 * SPEED_PER_DRAW * 0.2).abs() < 1e-12);
    }

    #[test]
    fn a_weak_or_backward_shot_falls_short() {
        assert!(of(&[0.0, 0.05, 0.0], "short_m") > 1.5);
        assert!(of(&[0.0, -0.2, 0.0], "short_m") > DISTANCE);
        assert!(of(&START, "miss_m") > 0.2, "there is something to learn");
    }

    #[test]
    fn the_path_ends_where_the_shot_was_measured() {
        let path = Archery.path(&START, 1e-4);
        let end = path.last().unwrap() - Vector3::y() * DISTANCE;
        assert!((end.norm() - of(&START, "miss_m")).abs() < 2e-3);
    }
}
