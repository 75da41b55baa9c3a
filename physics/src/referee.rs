//! What a control loop must know of a task: is the rollout over? Nothing of what it was worth.

use nalgebra::Isometry3;

use crate::plant::{Measurement, ObjectState};

/// How a rollout stands.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum State {
    /// Nothing happens that the end of the movement would have to wait for.
    Running,
    /// The object is on its way: what becomes of it is worth waiting for, once the movement is over.
    Airborne,
    /// What is to be seen has been seen; the movement may still be finished.
    Settled,
    /// The object is lost: there is nothing to go on for.
    Lost,
}

/// One a task; a plain copy, watched tick by tick in the hot path.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Referee {
    /// The policy's clock alone.
    Clock,
    /// An object that is thrown off the tip and caught again.
    Toss(Toss),
}

impl Referee {
    /// Takes one tick of a rollout: time since its start, s, pose of the tip, and what was measured.
    pub fn observe(&mut self, t_s: f64, X_WP: &Isometry3<f64>, measured: &Measurement) {
        match self {
            Referee::Clock => {}
            Referee::Toss(toss) => toss.observe(t_s, X_WP, &measured.object),
        }
    }

    pub fn state(&self) -> State {
        match self {
            Referee::Clock => State::Running,
            Referee::Toss(toss) => toss.state(),
        }
    }
}

/// Thresholds of a toss. Heights are the world's vertical difference of object and tip.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TossConfig {
    /// Δ_h of Sec. 3.1: an object that falls back through this height comes back, m.
    pub drop_height_m: f64,
    /// From then on until it is seen whether it stays, s.
    pub hold_s: f64,
    /// It is lost when it is this far below the tip, m.
    pub dropped_below_m: f64,
}

impl Default for TossConfig {
    fn default() -> Self {
        TossConfig { drop_height_m: 0.1, hold_s: 0.5, dropped_below_m: 0.2 }
    }
}

/// Follows an object up and down.
///
/// It comes back at the first tick at or below Δ_h that follows a tick above it, both without contact.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Toss {
    config: TossConfig,
    is_off: bool,
    was_above: bool,
    crossing_s: Option<f64>,
    is_over: bool,
    is_lost: bool,
}

impl Toss {
    pub fn new(config: &TossConfig) -> Toss {
        Toss {
            config: *config,
            is_off: false,
            was_above: false,
            crossing_s: None,
            is_over: false,
            is_lost: false,
        }
    }

    /// Ticks after the end are ignored.
    pub fn observe(&mut self, t_s: f64, X_WP: &Isometry3<f64>, object: &ObjectState) {
        if self.is_over {
            return;
        }
        let height = object.p_WO.z - X_WP.translation.vector.z;
        let is_above = height > self.config.drop_height_m;
        self.is_off = !object.in_contact;
        if self.crossing_s.is_none() && self.is_off && self.was_above && !is_above {
            self.crossing_s = Some(t_s);
        }
        self.was_above = self.is_off && is_above;
        self.is_lost = height < -self.config.dropped_below_m;
        let is_held =
            self.crossing_s.is_some_and(|crossing_s| t_s >= crossing_s + self.config.hold_s);
        self.is_over = is_held || self.is_lost;
    }

    /// When the object fell back through Δ_h, s.
    pub fn crossing_s(&self) -> Option<f64> {
        self.crossing_s
    }

    pub fn state(&self) -> State {
        match self {
            Toss { is_lost: true, .. } => State::Lost,
            Toss { is_over: true, .. } => State::Settled,
            Toss { is_off: true, .. } | Toss { crossing_s: Some(_), .. } => State::Airborne,
            _ => State::Running,
        }
    }
}
