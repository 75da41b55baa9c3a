//! Outcome → reward. The world measures, the learner judges; rewards can be recomputed from the
//! stored outcomes at any time.

use std::f64::consts::PI;

use serde::{Deserialize, Serialize};
use shm_types::episode::{OUTCOME_EXPLOIT, OutcomeMsg};

/// Releases beyond these are contact exploits of a simulator, not tosses.
pub const RELEASE_SPEED_MAX_M_S: f64 = 6.0;
pub const RELEASE_SPIN_MAX_RAD_S: f64 = 40.0;

/// Which reward function judges the outcomes.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum RewardKind {
    /// Sec. 3.1.
    Paper,
    /// Sec. 4.2, first experiment: what the world measures is the reward.
    Value,
    /// Sec. 4.2, second experiment: r = exp(−λ d), d the distance the world measures.
    Distance,
}

#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct RewardConfig {
    pub kind: RewardKind,
    /// Weights of flip angle, catch distance and height.
    pub w1: f64,
    pub w2: f64,
    pub w3: f64,
    /// λ of `distance`, 1/m.
    pub lambda: f64,
}

impl Default for RewardConfig {
    fn default() -> Self {
        RewardConfig { kind: RewardKind::Paper, w1: 0.5, w2: 0.5, w3: 0.5, lambda: 3.0 }
    }
}

impl RewardConfig {
    /// The reward of an outcome: finite and never negative, whatever was measured.
    pub fn reward(&self, outcome: &OutcomeMsg) -> f64 {
        if outcome.fields().iter().any(|(_, value)| !value.is_finite()) || is_exploit(outcome) {
            return 0.0;
        }
        let reward = match self.kind {
            RewardKind::Paper => self.paper(outcome),
            RewardKind::Value => outcome.value,
            RewardKind::Distance => (-self.lambda * outcome.value.max(0.0)).exp(),
        };
        reward.clamp(0.0, f64::MAX)
    }

    /// Sec. 3.1, reward: r = w₁ arccos(V₀·V)/π + w₂ exp(−‖X − x‖) + w₃ X₃ᵐᵃˣ at the moment the
    /// pancake falls back through Δ_h (angle in rad, distances in m).
    ///
    /// Departure: a pancake that never falls through Δ_h gets the height term only; the paper
    /// does not define this case, in which there is no angle and no distance to judge.
    fn paper(&self, outcome: &OutcomeMsg) -> f64 {
        let height = self.w3 * outcome.apex_m.max(0.0);
        if outcome.crossing_time_s <= 0.0 {
            return height;
        }
        let flip = outcome.flip_angle_rad.clamp(0.0, PI) / PI;
        self.w1 * flip + self.w2 * (-outcome.distance_m.max(0.0)).exp() + height
    }
}

fn is_exploit(outcome: &OutcomeMsg) -> bool {
    outcome.has(OUTCOME_EXPLOIT)
        || outcome.release_speed_m_s.abs() > RELEASE_SPEED_MAX_M_S
        || outcome.release_spin_rad_s.abs() > RELEASE_SPIN_MAX_RAD_S
}

#[cfg(test)]
mod tests {
    use super::*;
    use shm_types::episode::OUTCOME_TOSSED;

    const FLIP: OutcomeMsg = OutcomeMsg {
        flags: OUTCOME_TOSSED,
        release_speed_m_s: 2.8,
        release_spin_rad_s: 4.7,
        apex_m: 0.71,
        crossing_time_s: 1.2,
        flip_angle_rad: 2.6,
        distance_m: 0.12,
        ..OutcomeMsg::ZERO
    };

    fn reward(outcome: OutcomeMsg) -> f64 {
        RewardConfig::default().reward(&outcome)
    }

    #[test]
    fn is_the_weighted_sum_of_section_3_1() {
        let expected = 0.5 * 2.6 / PI + 0.5 * (-0.12_f64).exp() + 0.5 * 0.71;
        assert!((reward(FLIP) - expected).abs() < 1e-15);
        let weights = RewardConfig { w1: 1.0, w2: 0.0, w3: 2.0, ..Default::default() };
        assert!((weights.reward(&FLIP) - (2.6 / PI + 1.42)).abs() < 1e-15);
    }

    #[test]
    fn without_a_crossing_only_the_height_counts() {
        assert_eq!(reward(OutcomeMsg { crossing_time_s: 0.0, ..FLIP }), 0.5 * 0.71);
        assert_eq!(reward(OutcomeMsg::ZERO), 0.0);
    }

    #[test]
    fn worlds_without_an_arm_are_judged_by_their_value() {
        let outcome = OutcomeMsg { value: 0.25, ..OutcomeMsg::ZERO };
        let of = |kind| RewardConfig { kind, ..Default::default() }.reward(&outcome);
        assert_eq!(of(RewardKind::Value), 0.25);
        assert_eq!(of(RewardKind::Distance), (-0.75_f64).exp());
        let negative = OutcomeMsg { value: -1.0, ..outcome };
        let value = RewardConfig { kind: RewardKind::Value, ..Default::default() };
        assert_eq!(value.reward(&negative), 0.0);
    }

    #[test]
    fn exploits_earn_nothing() {
        assert_eq!(reward(OutcomeMsg { release_speed_m_s: 6.1, ..FLIP }), 0.0);
        assert_eq!(reward(OutcomeMsg { release_spin_rad_s: -41.0, ..FLIP }), 0.0);
        assert_eq!(reward(OutcomeMsg { flags: OUTCOME_EXPLOIT, ..FLIP }), 0.0);
    }

    #[test]
    fn is_finite_and_not_negative_for_any_outcome() {
        let extremes = [f64::NAN, f64::INFINITY, f64::NEG_INFINITY, -1e308, -1.0, 0.0, 1e308];
        for a in extremes {
            for b in extremes {
                for outcome in [
                    OutcomeMsg { apex_m: a, flip_angle_rad: b, ..FLIP },
                    OutcomeMsg { distance_m: a, crossing_time_s: b, ..FLIP },
                ] {
                    let r = reward(outcome);
                    assert!(r.is_finite() && r >= 0.0, "{a} {b}: {r}");
                }
            }
        }
    }
}
