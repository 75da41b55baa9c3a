//! What is measured of a toss: pan and pancake, followed through the records as a camera would.

use physics::pancake::outcome::{OutcomeConfig, OutcomeTracker};
use shm_types::measures::Measure;

use crate::tasks::camera::{Camera, Followed};

pub fn measurer(camera: Camera, outcome: &OutcomeConfig) -> Followed<OutcomeTracker> {
    let tracker = OutcomeTracker::new(outcome);
    Followed { camera, tracker, observe: OutcomeTracker::observe, measures }
}

fn measures(tracker: &OutcomeTracker, clipped_share: f64) -> Vec<Measure<'static>> {
    let (outcome, truth) = (tracker.outcome(), Measure::truth);
    let number = |name, unit, value| Measure { name, unit, value };
    vec![
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
        number("forward_m", "m", outcome.forward_m),
        number("turn_rad", "rad", outcome.turn_rad),
        number("final_lateral_m", "m", outcome.final_lateral_m),
        number("bounce_s", "s", outcome.bounce_s),
        number("clipped_share", "1", clipped_share),
    ]
}
