//! A simulated world behind [`Plant`]: what all of them have in common.

use crate::arm::{ArmModel, JointVector};
use crate::plant::{Measurement, ObjectState, Plant};

/// One world with an arm and an object in it.
pub trait Scene: Send + Sized {
    type Config: Copy + Send;

    /// At rest at `q0` (rad), the object at its start.
    fn new(model: &ArmModel, q0: &JointVector, config: &Self::Config) -> Self;
    /// Simulated time of one [`Scene::advance`], s.
    fn period_s(config: &Self::Config) -> f64;
    /// Positions and speeds of the joints, rad and rad/s.
    fn joints(&self) -> (JointVector, JointVector);
    fn object(&self) -> ObjectState;
    /// Lets one period pass under the joint torques `tau`, N·m.
    fn advance(&mut self, model: &ArmModel, tau: &JointVector, config: &Self::Config);
}

/// A scene that is built anew at every reset, and whose samples are counted.
pub struct ScenePlant<S: Scene> {
    model: ArmModel,
    q0: JointVector,
    config: S::Config,
    tau: JointVector,
    sample: u64,
    scene: S,
}

impl<S: Scene> ScenePlant<S> {
    /// Builds the world at rest at `q0` (rad), the object as `config` says.
    ///
    /// The model's last body carries the mass of what is at its tip.
    /// Preconditions: `config` is one of a world that can exist, `q0` lies within the limits.
    pub fn new(model: &ArmModel, q0: &JointVector, config: &S::Config) -> ScenePlant<S> {
        let scene = S::new(model, q0, config);
        let tau = JointVector::zeros();
        ScenePlant { model: model.clone(), q0: *q0, config: *config, tau, sample: 0, scene }
    }
}

impl<S: Scene> Plant for ScenePlant<S> {
    fn is_simulated(&self) -> bool {
        true
    }

    /// Builds a fresh world: putting the old one back in place is not bit-identical, because
    /// Rapier keeps contacts, warm starts and its broad phase.
    fn begin_reset(&mut self) {
        self.tau = JointVector::zeros();
        self.scene = S::new(&self.model, &self.q0, &self.config);
    }

    fn is_ready(&self) -> bool {
        true
    }

    fn measure(&self) -> Measurement {
        let (q, qd) = self.scene.joints();
        let (object, sample) = (self.scene.object(), self.sample);
        let t_ns = sample * (S::period_s(&self.config) * 1e9).round() as u64;
        Measurement { q, qd, object, sample, t_ns }
    }

    fn apply(&mut self, tau: &JointVector) {
        self.tau = *tau;
    }

    fn advance(&mut self) {
        self.scene.advance(&self.model, &self.tau, &self.config);
        self.sample += 1;
    }
}
