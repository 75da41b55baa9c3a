//! What a task can compute of its measures before a policy is executed.

use std::sync::Arc;

use nalgebra::DVector;
use search::Prediction;
use search::aim::Target;
use shm_types::policy::PolicyMsg;

/// Names and values of some measures.
pub type Predicted = Vec<(&'static str, f64)>;

/// The task's measures as a function of the policy: deterministic, and cheap next to a rollout.
#[derive(Clone)]
pub struct Predictor(Arc<dyn Fn(&PolicyMsg) -> Predicted + Send + Sync>);

impl Predictor {
    pub fn new(of: impl Fn(&PolicyMsg) -> Predicted + Send + Sync + 'static) -> Predictor {
        Predictor(Arc::new(of))
    }

    pub fn of(&self, policy: &PolicyMsg) -> Predicted {
        (self.0)(policy)
    }

    /// The same of θ, for the search: the values of its `targets`, in their order.
    pub fn along(
        self,
        targets: Vec<Target>,
        decode: impl Fn(&DVector<f64>) -> PolicyMsg + Send + Sync + 'static,
    ) -> Prediction {
        Prediction::new(move |theta| {
            let predicted = self.of(&decode(theta));
            let value = |target: &Target| {
                let found = predicted.iter().find(|(name, _)| *name == target.measure);
                found.map(|(_, value)| *value)
            };
            targets.iter().map(value).collect()
        })
    }
}
