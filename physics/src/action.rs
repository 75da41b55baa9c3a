//! Worlds without an arm: one action vector is the whole policy (Sec. 4.2).

use nalgebra::{Vector2, Vector3};

use crate::landscape;
use crate::skittles::{SkittlesConfig, Swing, Throw, horizon};

/// One named number of a rollout.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Measured {
    pub name: &'static str,
    /// `1` for a number without unit, `bool` for a truth value.
    pub unit: &'static str,
    pub value: f64,
}

/// One action in, measured numbers out.
pub trait ActionWorld: Send + Sync {
    /// Numbers of an action.
    fn dim(&self) -> usize;

    /// What the world measures of `action`, which has `dim()` finite numbers: always the same names.
    fn measure(&self, action: &[f64]) -> Vec<Measured>;

    /// Where the tracked object is every `period_s` from the start to the end of the rollout, m;
    /// empty when nothing moves.
    fn path(&self, action: &[f64], period_s: f64) -> Vec<Vector3<f64>>;
}

/// Sec. 4.2, first experiment: the world measures the height of the landscape.
#[derive(Clone, Copy, Debug, Default)]
pub struct Landscape;

impl ActionWorld for Landscape {
    fn dim(&self) -> usize {
        2
    }

    fn measure(&self, action: &[f64]) -> Vec<Measured> {
        let value = landscape::height(&Vector2::new(action[0], action[1]));
        vec![Measured { name: "height", unit: "1", value }]
    }

    fn path(&self, _action: &[f64], _period_s: f64) -> Vec<Vector3<f64>> {
        Vec::new()
    }
}

/// Sec. 4.2, second experiment: the world measures the ball's smallest distance to the skittle, m.
impl ActionWorld for SkittlesConfig {
    fn dim(&self) -> usize {
        2
    }

    fn measure(&self, action: &[f64]) -> Vec<Measured> {
        let value = self.fly(&throw(action)).distance_m;
        vec![Measured { name: "distance_m", unit: "m", value }]
    }

    fn path(&self, action: &[f64], period_s: f64) -> Vec<Vector3<f64>> {
        let throw = throw(action);
        let end_s = self.fly(&throw).collision_time_s.unwrap_or_else(horizon);
        let swing = Swing::new(&throw, self.model);
        let times = (0..=(end_s / period_s) as usize).map(|i| i as f64 * period_s);
        times.map(|t_s| swing.position(t_s).push(0.0)).collect()
    }
}

fn throw(action: &[f64]) -> Throw {
    Throw { alpha: action[0], alpha_dot: action[1] }
}
