//! What is measured of a toss: pan and pancake, followed through the records as a camera would.

use learner::judge::{Declared, Measurer};
use physics::pancake::outcome::{Outcome, OutcomeConfig, OutcomeTracker};
use shm_types::episode::{EpisodeHeader, TickRecord};
use shm_types::measures::{Measure, Measures, MeasuresError, TRUTH};

use crate::tasks::camera::{Camera, clipped_share};

pub struct PancakeMeasurer {
    pub camera: Camera,
    pub outcome: OutcomeConfig,
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
        self.camera.show(records, |t_s, tip, object| tracker.observe(t_s, tip, object));
        Measures::of(all(&tracker.outcome(), clipped_share(records)))
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
