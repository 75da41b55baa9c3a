//! What is measured of a toss: pan and pancake, followed through the records as a camera would.

#![allow(non_snake_case)] // X_WP is the pose of P in W

use learner::judge::{Declared, Measurer};
use nalgebra::{Quaternion, UnitQuaternion, Vector3};
use physics::arm::{ArmModel, JointVector, kinematics};
use physics::pancake::outcome::{Outcome, OutcomeConfig, OutcomeTracker};
use physics::plant::ObjectState;
use shm_types::TASK_DIM;
use shm_types::episode::{EpisodeHeader, FLAG_IN_CONTACT, FLAG_TORQUE_CLIPPED, TickRecord};
use shm_types::measures::{Measure, Measures, MeasuresError, TRUTH};

pub struct PancakeMeasurer {
    pub model: ArmModel,
    pub outcome: OutcomeConfig,
    /// Time from record to record, s.
    pub record_s: f64,
}

impl Measurer for PancakeMeasurer {
    fn declared(&self) -> Declared {
        let nothing = all(&Outcome::default(), 0.0);
        nothing.map(|measure| (measure.name.into(), measure.unit.into())).into()
    }

    fn measure(
        &self,
        _: &EpisodeHeader,
        records: &[TickRecord],
    ) -> Result<Measures, MeasuresError> {
        let mut tracker = OutcomeTracker::new(&self.outcome);
        for (i, record) in records.iter().enumerate() {
            // A tick that fell back to the hold before the loop knew where the tip is tells nothing.
            if record.x != [0.0; TASK_DIM] {
                let q = JointVector::from(record.q);
                let X_WP = kinematics::tip_pose(&self.model, &q);
                tracker.observe(i as f64 * self.record_s, &X_WP, &object(record));
            }
        }
        let clipped = records.iter().filter(|record| record.flags & FLAG_TORQUE_CLIPPED != 0);
        let clipped_share = clipped.count() as f64 / records.len().max(1) as f64;
        Measures::of(all(&tracker.outcome(), clipped_share))
    }
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

/// What [`Outcome`] says, and the share of ticks in which a torque was clipped at its limit.
fn all(outcome: &Outcome, clipped_share: f64) -> [Measure<'static>; 16] {
    let truth = |name, value| Measure { name, unit: TRUTH, value: f64::from(u8::from(value)) };
    let number = |name, unit, value| Measure { name, unit, value };
    [
        truth("tossed", outcome.tossed),
        truth("caught", outcome.flipped_and_caught),
        truth("dropped", outcome.dropped),
        truth("exploit", outcome.exploit),
        number("release_time_s", "s", outcome.release_time_s),
        number("release_speed_m_s", "m/s", outcome.release_speed),
        number("release_spin_rad_s", "rad/s", outcome.release_spin),
        number("release_pitch_rate_rad_s", "rad/s", outcome.release_pitch_rate),
        number("apex_m", "m", outcome.apex_m),
        number("crossing_time_s", "s", outcome.crossing_time_s),
        number("flip_angle_rad", "rad", outcome.flip_angle_rad),
        number("distance_m", "m", outcome.distance_m),
        number("lateral_m", "m", outcome.lateral_m),
        number("final_lateral_m", "m", outcome.final_lateral_m),
        number("bounce_s", "s", outcome.bounce_s),
        number("clipped_share", "1", clipped_share),
    ]
}
