//! What a camera would have seen of a rollout: tip and object, record by record.

#![allow(non_snake_case)] // X_WP is the pose of P in W

use nalgebra::{Isometry3, Quaternion, UnitQuaternion, Vector3};
use physics::arm::{ArmModel, JointVector, kinematics};
use physics::plant::ObjectState;
use shm_types::TASK_DIM;
use shm_types::episode::{FLAG_IN_CONTACT, FLAG_TORQUE_CLIPPED, TickRecord};

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

/// The share of ticks in which a torque was clipped at its limit.
pub fn clipped_share(records: &[TickRecord]) -> f64 {
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
