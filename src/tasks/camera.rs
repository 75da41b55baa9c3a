//! What a camera would have seen of a rollout: tip and object, record by record.

#![allow(non_snake_case)] // X_WP is the pose of P in W

use learner::judge::{Declared, Measurer};
use nalgebra::{Isometry3, Quaternion, UnitQuaternion, Vector3};
use physics::arm::{ArmModel, JointVector, kinematics};
use physics::plant::ObjectState;
use shm_types::episode::{EpisodeHeader, FLAG_IN_CONTACT, FLAG_TORQUE_CLIPPED, TickRecord};
use shm_types::measures::{Measure, Measures, MeasuresError};
use shm_types::{MAX_JOINTS, TASK_DIM};

/// Names of the joints' highest torques, from the base outwards.
const TORQUES: [&str; MAX_JOINTS] = [
    "torque_1_nm",
    "torque_2_nm",
    "torque_3_nm",
    "torque_4_nm",
    "torque_5_nm",
    "torque_6_nm",
    "torque_7_nm",
];

pub struct Camera {
    model: ArmModel,
    record_s: f64,
}

impl Camera {
    /// `record_s` is the time from record to record, s.
    pub fn new(model: &ArmModel, record_s: f64) -> Camera {
        Camera { model: model.clone(), record_s }
    }

    /// The highest torque of each joint, either way.
    fn torques(&self, records: &[TickRecord]) -> impl Iterator<Item = Measure<'static>> {
        let highest = |joint: usize| records.iter().map(|r| r.tau[joint].abs()).fold(0.0, f64::max);
        let of_joint = move |(joint, name)| Measure { name, unit: "N·m", value: highest(joint) };
        TORQUES.into_iter().enumerate().map(of_joint)
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
    /// All there is to say but the torques, with the share of ticks in which a torque was clipped.
    pub measures: fn(&T, f64) -> Vec<Measure<'static>>,
}

impl<T: Copy + Send> Measurer for Followed<T> {
    fn declared(&self) -> Declared {
        let nothing = (self.measures)(&self.tracker, 0.0);
        let all = nothing.into_iter().chain(self.camera.torques(&[]));
        all.map(|measure| (measure.name.into(), measure.unit.into())).collect()
    }

    fn measure(
        &self,
        _: &EpisodeHeader,
        records: &[TickRecord],
    ) -> Result<Measures, MeasuresError> {
        let mut tracker = self.tracker;
        let observe = self.observe;
        self.camera.show(records, |t_s, tip, object| observe(&mut tracker, t_s, tip, object));
        let of_task = (self.measures)(&tracker, clipped_share(records));
        Measures::of(of_task.into_iter().chain(self.camera.torques(records)))
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
