//! What a controller sees of the world: measure, apply, advance.

use std::ops::DerefMut;
use std::time::Duration;

use nalgebra::{UnitQuaternion, Vector3};

use crate::arm::JointVector;

/// The tracked object O, as a motion-capture system would report it (paper, Sec. 3.1: four
/// markers), and whether it touches the pan.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ObjectState {
    /// Centre of the object in the world, m.
    pub p_WO: Vector3<f64>,
    /// Orientation of the object in the world. A pancake's normal is its z axis, which points
    /// away from the pan at the start.
    pub R_WO: UnitQuaternion<f64>,
    /// True while the object touches the pan. It flickers when the object is nearly weightless.
    pub in_contact: bool,
}

/// One sample of the plant.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Measurement {
    /// Joint positions, rad.
    pub q: JointVector,
    /// Joint speeds, rad/s.
    pub qd: JointVector,
    /// The tracked object.
    pub object: ObjectState,
    /// Counts the samples that were really taken: another number is a new sample, the same number
    /// the old one again.
    pub sample: u64,
    /// When it was taken, ns by the plant's own clock: a later sample has a larger stamp.
    pub t_ns: u64,
}

/// How a simulated arm moves.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Dynamics {
    /// A Rapier multibody in the world of what it touches.
    #[default]
    Multibody,
    /// The equations of motion of [`crate::arm`], and a body in the world that stands for the tip; see
    /// [`crate::split`].
    Split,
}

impl Dynamics {
    /// Sub-steps of the world in a millisecond that suffice, as the study of the simulation shows
    /// (docs/simulation.md). The multibody needs more of them, because it is integrated to first order.
    pub const fn substeps(self) -> usize {
        match self {
            Dynamics::Multibody => 4,
            Dynamics::Split => 2,
        }
    }
}

/// Whether there is a sample to answer.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Presence {
    There,
    /// It has not finished what it was last asked for: its time stands still.
    Busy,
    /// It has not come yet, and has shown no posture.
    Absent,
    /// It was there and is gone.
    Lost,
}

/// A torque-controlled arm and its surroundings, simulated or real.
///
/// The torque given by [`apply`](Plant::apply) acts until it is replaced.
pub trait Plant: Send {
    /// A simulation: its time passes in [`advance`](Plant::advance) alone, and
    /// [`begin_reset`](Plant::begin_reset) makes another world. A real arm's time passes by itself, a reset
    /// leaves it where it is, and nothing may be tried out on it.
    fn is_simulated(&self) -> bool;
    /// Announces the session's rollout that the next reset is for; a world that varies draws from this number.
    fn announce(&mut self, _rollout: u64) {}
    /// Begins to put the world back to its start: a simulator builds a fresh one, in which the arm
    /// rests at its start posture as if held there. Elsewhere it takes its time, in which the arm is
    /// held: a person puts the object back.
    fn begin_reset(&mut self);
    /// The world is at its start.
    fn is_ready(&self) -> bool;
    /// The state at the end of the last period.
    fn measure(&self) -> Measurement;
    /// Commands joint torques, N·m. Precondition: finite, within the arm's limits.
    fn apply(&mut self, tau: &JointVector);
    /// Lets one period pass.
    fn advance(&mut self);

    /// Before every tick: takes in what has come. A plant in this process is always there.
    fn presence(&mut self) -> Presence {
        Presence::There
    }

    /// Waits for the next sample of a plant that is the clock, at most so long.
    fn wait(&mut self, _longest: Duration) {}
}

/// What leads to a plant is one: a box, or what keeps its process.
impl<T: DerefMut<Target: Plant> + Send> Plant for T {
    fn is_simulated(&self) -> bool {
        (**self).is_simulated()
    }

    fn announce(&mut self, rollout: u64) {
        (**self).announce(rollout);
    }

    fn begin_reset(&mut self) {
        (**self).begin_reset();
    }

    fn is_ready(&self) -> bool {
        (**self).is_ready()
    }

    fn measure(&self) -> Measurement {
        (**self).measure()
    }

    fn apply(&mut self, tau: &JointVector) {
        (**self).apply(tau);
    }

    fn advance(&mut self) {
        (**self).advance();
    }

    fn presence(&mut self) -> Presence {
        (**self).presence()
    }

    fn wait(&mut self, longest: Duration) {
        (**self).wait(longest);
    }
}
