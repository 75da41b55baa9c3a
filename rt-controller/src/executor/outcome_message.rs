//! The measured outcome as a message.

use shm_types::episode::{
    OUTCOME_DROPPED, OUTCOME_EXPLOIT, OUTCOME_SUCCESS, OUTCOME_TOSSED, OutcomeMsg,
};

use crate::hot::tick::Controller;

/// What the rollout that just ended achieved.
pub(crate) fn outcome_message(controller: &Controller) -> OutcomeMsg {
    let outcome = controller.outcome();
    let mut flags = 0;
    for (set, flag) in [
        (outcome.tossed, OUTCOME_TOSSED),
        (outcome.flipped_and_caught, OUTCOME_SUCCESS),
        (outcome.dropped, OUTCOME_DROPPED),
        (outcome.exploit, OUTCOME_EXPLOIT),
    ] {
        if set {
            flags |= flag;
        }
    }
    OutcomeMsg {
        flags,
        value: 0.0,
        release_time_s: outcome.release_time_s,
        release_speed_m_s: outcome.release_speed,
        release_spin_rad_s: outcome.release_spin,
        apex_m: outcome.apex_m,
        crossing_time_s: outcome.crossing_time_s,
        flip_angle_rad: outcome.flip_angle_rad,
        distance_m: outcome.distance_m,
        lateral_m: outcome.lateral_m,
        final_lateral_m: outcome.final_lateral_m,
        release_pitch_rate_rad_s: outcome.release_pitch_rate,
        bounce_s: outcome.bounce_s,
        clipped_share: controller.clipped_share(),
    }
}
