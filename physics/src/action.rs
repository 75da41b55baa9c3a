//! Worlds without an arm: one action vector is the whole policy (Sec. 4.2).

use nalgebra::{Vector2, Vector3};

use crate::landscape;

/// One action in, one measured number out.
pub trait ActionWorld: Sync {
    /// Numbers of an action.
    fn dim(&self) -> usize;

    /// What the world measures of `action`, in its unit; `action` has `dim()` finite numbers.
    fn measure(&self, action: &[f64]) -> f64;

    /// Longest rollout, s; 0 when nothing moves.
    fn duration_s(&self) -> f64;

    /// Where the tracked object is `t_s` after the start, m; `None` when the rollout is over.
    fn object_at(&self, action: &[f64], t_s: f64) -> Option<Vector3<f64>>;
}

/// Sec. 4.2, first experiment: the world measures the height of the landscape.
#[derive(Clone, Copy, Debug, Default)]
pub struct Landscape;

impl ActionWorld for Landscape {
    fn dim(&self) -> usize {
        2
    }

    fn measure(&self, action: &[f64]) -> f64 {
        landscape::height(&Vector2::new(action[0], action[1]))
    }

    fn duration_s(&self) -> f64 {
        0.0
    }

    fn object_at(&self, _action: &[f64], _t_s: f64) -> Option<Vector3<f64>> {
        None
    }
}
