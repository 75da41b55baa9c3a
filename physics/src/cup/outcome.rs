//! What happened to the ball: how high it came, how it met the cup's mouth, whether it stayed.

use nalgebra::{Isometry3, Point3};

use super::{Ball, CupConfig};
use crate::plant::ObjectState;

/// A caught ball was inside for the last so many seconds: falling in at the end is not enough.
const STAY_S: f64 = 0.2;

/// What one rollout did to the ball. No reward: that is computed elsewhere, and can be again.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Outcome {
    /// Highest centre of the ball over the middle of the rim, along the vertical, m.
    pub apex_m: f64,
    /// The ball came down through the height of the rim.
    pub crossed: bool,
    /// When it did so first, s; 0 without.
    pub crossing_time_s: f64,
    /// How far from the middle of the rim it did so, m: what Kober and Peters reward. Without a
    /// crossing, how far the ball was from there when it was highest.
    pub miss_m: f64,
    /// Where it did so, seen from the middle of the rim along the world's x and y axes, m; 0 without a
    /// crossing.
    pub miss_forward_m: f64,
    pub miss_left_m: f64,
    /// Success: the ball lies in the cup at the end.
    pub caught: bool,
}

/// Watches cup and ball, tick by tick, without allocation.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct OutcomeTracker {
    config: CupConfig,
    was_above: bool,
    inside_since_s: Option<f64>,
    outcome: Outcome,
}

impl OutcomeTracker {
    /// A tracker for one rollout.
    pub fn new(config: &CupConfig) -> OutcomeTracker {
        let nothing = Outcome {
            apex_m: -config.string_length - config.depth,
            crossed: false,
            crossing_time_s: 0.0,
            miss_m: config.string_length + config.depth,
            miss_forward_m: 0.0,
            miss_left_m: 0.0,
            caught: false,
        };
        OutcomeTracker { config: *config, was_above: false, inside_since_s: None, outcome: nothing }
    }

    /// Takes one tick: time (s, increasing), pose of the cup, state of the ball.
    pub fn observe(&mut self, t_s: f64, X_WP: &Isometry3<f64>, object: &ObjectState) {
        let rim = (X_WP * Point3::new(0.0, 0.0, self.config.depth)).coords;
        let from_rim = object.p_WO - rim;
        let is_above = from_rim.z > 0.0;
        let outcome = &mut self.outcome;
        if from_rim.z > outcome.apex_m {
            outcome.apex_m = from_rim.z;
            if !outcome.crossed {
                outcome.miss_m = from_rim.norm();
            }
        }
        if self.was_above && !is_above && !outcome.crossed {
            outcome.crossed = true;
            outcome.crossing_time_s = t_s;
            outcome.miss_m = from_rim.xy().norm();
            (outcome.miss_forward_m, outcome.miss_left_m) = (from_rim.x, from_rim.y);
        }
        self.was_above = is_above;

        let p_PO = X_WP.inverse_transform_point(&object.p_WO.into()).coords;
        self.inside_since_s = match self.inside_since_s {
            _ if !Ball::is_inside(&p_PO, &self.config) => None,
            None => Some(t_s),
            since => since,
        };
        outcome.caught = self.inside_since_s.is_some_and(|since_s| t_s - since_s >= STAY_S);
    }

    /// What has happened so far.
    pub fn outcome(&self) -> Outcome {
        self.outcome
    }
}
