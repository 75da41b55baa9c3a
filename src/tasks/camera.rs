//! What a camera would have seen of a rollout: tip and object, record by record.

#![allow(non_snake_case)] // X_WP is the pose of P in W

use learner::judge::{Declared, Measurer};
use nalgebra::{Isometry3, Quaternion, UnitQuaternion, Vector3};
use physics::arm::{ArmModel, JointVector, kinematics};
use physics::plant::ObjectState;
use shm_types::TASK_DIM;
use shm_types::episode::{EpisodeHeader, FLAG_IN_CONTACT, FLAG_TORQUE_CLIPPED, TickRecord};
use shm_types::measures::{Measure, Measures, MeasuresError};

pub struct Camera {
    model: ArmModel,
    record_s: f64,
}

impl Camera {
    /// `record_s` is the time from record to record, s.
    pub fn new(model: &ArmModel, record_s: f64) -> Camera {
        Camera { model: model.clone(), record_s }
    }

    /// Shows time since the start, s, pose of the tip and the object.
    pub fn show(
        &self,
        records: &[TickRecord],
        mut see: impl FnMut(f64, &Isometry3<f64>, &ObjectState),
    ) {
        for (i, record) in records.iter().enumerate() {
            // A tick that fell back to the hold before the loop knew where the tip is tells nothing.
            if record.x != [0.0; TASK_DIM] {
                let X_WP = kinematics::tip_pose(&self.model, &JointVector::from(record.q));
                see(i as f64 * self.record_s, &X_WP, &object(record));
            }
        }
    }
}

/// Measures what a tracker saw of a rollout.
pub struct Followed<T> {
    pub camera: Camera,
    /// One that has seen nothing.
    pub tracker: T,
    pub observe: fn(&mut T, f64, &Isometry3<f64>, &ObjectState),
    /// All there is to say, with the share of ticks in which a torque was clipped.
    pub measures: fn(&T, f64) -> Vec<Measure<'static>>,
}

impl<T: Copy + Send> Measurer for Followed<T> {
    fn declared(&self) -> Declared {
        let nothing = (self.measures)(&self.tracker, 0.0);
        nothing.iter().map(|measure| (measure.name.into(), measure.unit.into())).collect()
    }

    fn measure(
        &self,
        _: &EpisodeHeader,
        records: &[TickRecord],
    ) -> Result<Measures, MeasuresError> {
        let mut tracker = self.tracker;
        let observe = self.observe;
        self.camera.show(records, |t_s, tip, object| observe(&mut tracker, t_s, tip, object));
        Measures::of((self.measures)(&tracker, clipped_share(records)))
    }
}

/// The share of ticks in which a torque was clipped at its limit.
fn clipped_share(records: &[TickRecord]) -> f64 {
    let clipped = records.iter().filter(|record| record.flags & FLAG_TORQUE_CLIPPED != 0);
    clipped.count() as f64 / records.len().max(1) as f64
}

fn object(record: &TickRecord) -> ObjectState {
    let [w, i, j, k] = record.object_quaternion;
    ObjectState {
        p_WO: Vector3::from(record.object_position),
        // Not normalised again: the loop saw these numbers.
        R_WO: UnitQuaternion::new_unchecked(Quaternion::new(w, i, j, k)),
        in_contact: record.flags & FLAG_IN_CONTACT != 0,
    }
}
