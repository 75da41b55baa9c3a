//! The built-in verdicts: measures → success and reward.

use std::f64::consts::PI;

use serde::{Deserialize, Serialize};
use shm_types::measures::Measures;

use crate::judge::{Declared, Verdict, VerdictError};
use search::range::{Range, range};

/// Releases beyond these are contact exploits of a simulator, not tosses.
pub const RELEASE_SPEED_MAX_M_S: f64 = 6.0;
pub const RELEASE_SPIN_MAX_RAD_S: f64 = 40.0;

/// Measures used by the rewards of an object that is tossed and caught.
const PAPER_MEASURES: [&str; 4] = ["apex_m", "crossing_time_s", "flip_angle_rad", "distance_m"];
const CATCH_MEASURES: [&str; 8] = [
    "apex_m",
    "crossing_time_s",
    "flip_angle_rad",
    "lateral_m",
    "caught",
    "final_lateral_m",
    "bounce_s",
    "clipped_share",
];

/// Which reward function judges the rollouts.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(rename_all = "lowercase")]
pub enum RewardKind {
    /// Sec. 3.1.
    Paper,
    /// Sec. 4.2, first experiment: the first measure is the reward.
    Value,
    /// Sec. 4.2, second experiment: r = exp(−λ d), d the first measure, a distance.
    Distance,
    /// The paper's reward, plus terms for a calm catch.
    Catch,
}

impl RewardKind {
    /// Its name in the configuration.
    pub fn name(self) -> &'static str {
        match self {
            RewardKind::Paper => "paper",
            RewardKind::Value => "value",
            RewardKind::Distance => "distance",
            RewardKind::Catch => "catch",
        }
    }
}

#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(default, deny_unknown_fields)]
pub struct RewardConfig {
    /// Reward function that judges the rollouts.
    pub kind: RewardKind,
    /// Weight of the flip angle in the paper's reward.
    pub w1: f64,
    /// Weight of the catch distance in the paper's reward.
    pub w2: f64,
    /// Weight of the height in the paper's reward.
    pub w3: f64,
    /// Rate λ at which the reward of `distance` falls.
    pub lambda: f64,
    /// The catch reward: a weight for each term, and its scale.
    pub catch: CatchConfig,
}

/// Weights of the catch reward, and the scale of each of its terms.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(default, deny_unknown_fields)]
pub struct CatchConfig {
    /// Weight of the height.
    pub height: f64,
    /// Height above which there is no further reward.
    pub height_max_m: f64,
    /// Weight of the flip angle.
    pub angle: f64,
    /// Weight of a pancake over the middle of the pan at the crossing.
    pub aim: f64,
    /// Weight of a pancake caught upside down in the middle of the pan.
    pub catch: f64,
    /// Weight of a catch without bouncing.
    pub calm: f64,
    /// Weight of a catch without a torque at its limit.
    pub ease: f64,
    /// Lateral distance at which `aim` and `catch` have fallen to 1/e.
    pub lateral_m: f64,
    /// Bouncing at which `calm` has fallen to 1/e.
    pub bounce_s: f64,
    /// Share of clipped ticks at which `ease` has fallen to 1/e.
    pub clipped_share: f64,
}

impl Default for RewardConfig {
    fn default() -> Self {
        let catch = CatchConfig::default();
        RewardConfig { kind: RewardKind::Catch, w1: 0.5, w2: 0.5, w3: 0.5, lambda: 3.0, catch }
    }
}

impl Default for CatchConfig {
    fn default() -> Self {
        CatchConfig {
            height: 1.5,
            height_max_m: 0.55,
            angle: 1.0,
            aim: 1.0,
            catch: 1.0,
            calm: 0.5,
            ease: 0.5,
            lateral_m: 0.1,
            bounce_s: 0.05,
            clipped_share: 0.05,
        }
    }
}

impl RewardConfig {
    /// Settings and their ranges.
    pub fn ranges(&self) -> Vec<Range> {
        let catch = &self.catch;
        vec![
            range("w1", self.w1, 0.0, 100.0, "1"),
            range("w2", self.w2, 0.0, 100.0, "1"),
            range("w3", self.w3, 0.0, 100.0, "1"),
            range("lambda", self.lambda, 0.0, 1e3, "m⁻¹"),
            range("catch.height", catch.height, 0.0, 100.0, "m⁻¹"),
            range("catch.height_max_m", catch.height_max_m, 0.0, 100.0, "m"),
            range("catch.angle", catch.angle, 0.0, 100.0, "1"),
            range("catch.aim", catch.aim, 0.0, 100.0, "1"),
            range("catch.catch", catch.catch, 0.0, 100.0, "1"),
            range("catch.calm", catch.calm, 0.0, 100.0, "1"),
            range("catch.ease", catch.ease, 0.0, 100.0, "1"),
            range("catch.lateral_m", catch.lateral_m, 1e-3, 10.0, "m"),
            range("catch.bounce_s", catch.bounce_s, 1e-3, 10.0, "s"),
            range("catch.clipped_share", catch.clipped_share, 1e-3, 10.0, "1"),
        ]
    }

    /// The measures it needs that are not among `declared`.
    pub fn missing(&self, declared: &Declared) -> Vec<&'static str> {
        let needed: &[&str] = match self.kind {
            RewardKind::Paper => &PAPER_MEASURES,
            RewardKind::Catch => &CATCH_MEASURES,
            RewardKind::Value | RewardKind::Distance => &[],
        };
        let is_missing = |name: &&str| declared.iter().all(|(there, _)| there != name);
        needed.iter().copied().filter(is_missing).collect()
    }

    /// The reward of a rollout: finite, whatever was measured. That of `value` is as negative as
    /// what the world measures; the others are sums of terms that are not.
    pub fn reward(&self, measures: &Measures) -> f64 {
        let terms = self.terms(measures).into_iter();
        terms.fold(0.0, |sum, (_, term)| sum + term).clamp(f64::MIN, f64::MAX)
    }

    /// What the reward of a rollout is the sum of; nothing of an exploit.
    pub fn terms(&self, measures: &Measures) -> Vec<(&'static str, f64)> {
        if is_exploit(measures) {
            return Vec::new();
        }
        let first = measures.iter().next().map_or(0.0, |measure| measure.value);
        match self.kind {
            RewardKind::Paper => self.paper(measures),
            RewardKind::Value => vec![("value", first)],
            RewardKind::Distance => vec![("distance", (-self.lambda * first.max(0.0)).exp())],
            RewardKind::Catch => self.catch.terms(measures),
        }
    }

    /// Sec. 3.1, reward: r = w₁ arccos(V₀·V)/π + w₂ exp(−‖X − x‖) + w₃ X₃ᵐᵃˣ at the moment the
    /// pancake falls back through Δ_h (angle in rad, distances in m).
    ///
    /// Departure: a pancake that never falls through Δ_h gets the height term only; the paper
    /// does not define this case, in which there is no angle and no distance to judge.
    fn paper(&self, measures: &Measures) -> Vec<(&'static str, f64)> {
        let of = |name| value(measures, name);
        let height = ("height", self.w3 * of("apex_m").max(0.0));
        if of("crossing_time_s") <= 0.0 {
            return vec![height];
        }
        let flip = of("flip_angle_rad").clamp(0.0, PI) / PI;
        let closeness = self.w2 * (-of("distance_m").max(0.0)).exp();
        vec![("flip angle", self.w1 * flip), ("closeness", closeness), height]
    }
}

impl CatchConfig {
    /// r = h·min(X₃ᵐᵃˣ, cap), and at the crossing + a·angle/π + exp(−l/l₀), and after a flipped
    /// catch + exp(−l_end/l₀) + ½exp(−bouncing/t₀) + ½exp(−clipped/c₀), with the default weights.
    ///
    /// Departure: the paper's reward judges the crossing only, where its exp(−‖X − x‖) is nearly
    /// flat, and its height has no end: a high toss that misses is worth as much as a catch. Here
    /// the distance is the lateral one and steep, the height is capped, and a catch pays by itself,
    /// most without bounces and without saturated motors: those two tell which catches survive
    /// another pancake.
    fn terms(&self, measures: &Measures) -> Vec<(&'static str, f64)> {
        let of = |name| value(measures, name);
        let near = |lateral_m: f64| (-lateral_m.max(0.0) / self.lateral_m).exp();
        let mut terms = vec![("height", self.height * of("apex_m").clamp(0.0, self.height_max_m))];
        if of("crossing_time_s") > 0.0 {
            terms.push(("flip angle", self.angle * of("flip_angle_rad").clamp(0.0, PI) / PI));
            terms.push(("aim", self.aim * near(of("lateral_m"))));
        }
        if measures.has("caught") {
            let falls = |name, scale: f64| (-of(name).max(0.0) / scale).exp();
            terms.push(("catch", self.catch * near(of("final_lateral_m"))));
            terms.push(("calm", self.calm * falls("bounce_s", self.bounce_s)));
            terms.push(("ease", self.ease * falls("clipped_share", self.clipped_share)));
        }
        terms
    }
}

fn is_exploit(measures: &Measures) -> bool {
    let of = |name| value(measures, name);
    measures.has("exploit")
        || of("release_speed_m_s").abs() > RELEASE_SPEED_MAX_M_S
        || of("release_spin_rad_s").abs() > RELEASE_SPIN_MAX_RAD_S
}

/// 0 where it was not measured.
fn value(measures: &Measures, name: &str) -> f64 {
    measures.get(name).unwrap_or(0.0)
}

impl Verdict for RewardConfig {
    fn judge(&self, measures: &Measures) -> Result<(bool, f64), VerdictError> {
        Ok((measures.has("caught"), self.reward(measures)))
    }

    fn terms(&self, measures: &Measures) -> Vec<(String, f64)> {
        let terms = RewardConfig::terms(self, measures).into_iter();
        terms.map(|(name, value)| (name.to_owned(), value)).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use shm_types::measures::{Measure, TRUTH};

    const FLIP: [(&str, f64); 6] = [
        ("release_speed_m_s", 2.8),
        ("release_spin_rad_s", 4.7),
        ("apex_m", 0.71),
        ("crossing_time_s", 1.2),
        ("flip_angle_rad", 2.6),
        ("distance_m", 0.12),
    ];
    const NOTHING: [(&str, f64); 0] = [];

    /// The measures `these`, some of them measured otherwise or besides.
    fn with(these: &[(&'static str, f64)], others: &[(&'static str, f64)]) -> Measures {
        let is_kept = |(name, _): &&(&str, f64)| others.iter().all(|(other, _)| other != name);
        let measures = these.iter().filter(is_kept).chain(others).map(|(name, value)| {
            let unit = if matches!(*name, "caught" | "exploit") { TRUTH } else { "1" };
            Measure { name, unit, value: *value }
        });
        Measures::of(measures).unwrap()
    }

    const PAPER: RewardConfig = RewardConfig {
        kind: RewardKind::Paper,
        w1: 0.5,
        w2: 0.5,
        w3: 0.5,
        lambda: 3.0,
        catch: CatchConfig {
            height: 1.5,
            height_max_m: 0.55,
            angle: 1.0,
            aim: 1.0,
            catch: 1.0,
            calm: 0.5,
            ease: 0.5,
            lateral_m: 0.1,
            bounce_s: 0.05,
            clipped_share: 0.05,
        },
    };

    fn reward(others: &[(&'static str, f64)]) -> f64 {
        PAPER.reward(&with(&FLIP, others))
    }

    fn catch(others: &[(&'static str, f64)]) -> f64 {
        RewardConfig { kind: RewardKind::Catch, ..PAPER }.reward(&with(&FLIP, others))
    }

    #[test]
    fn a_calm_catch_earns_most() {
        let crossing = 1.5 * 0.55 + 2.6 / PI + (-0.5_f64).exp();
        assert!((catch(&[("lateral_m", 0.05)]) - crossing).abs() < 1e-14, "the height is capped");
        let low = catch(&[("lateral_m", 0.05), ("crossing_time_s", 0.0), ("apex_m", 0.2)]);
        assert!((low - 0.3).abs() < 1e-14);

        let caught = [("lateral_m", 0.05), ("caught", 1.0), ("final_lateral_m", 0.02)];
        let calm = catch(&caught);
        assert!((calm - (crossing + (-0.2_f64).exp() + 1.0)).abs() < 1e-14);
        let rough = catch(&[&caught[..], &[("bounce_s", 0.1), ("clipped_share", 0.05)]].concat());
        let lost = 0.5 * (1.0 - (-2.0_f64).exp()) + 0.5 * (1.0 - (-1.0_f64).exp());
        assert!((calm - rough - lost).abs() < 1e-14);
        assert_eq!(catch(&[&caught[..], &[("exploit", 1.0)]].concat()), 0.0);
    }

    #[test]
    fn terms_are_what_the_reward_is_made_of() {
        let caught = [("lateral_m", 0.05), ("caught", 1.0), ("final_lateral_m", 0.02)];
        let terms = RewardConfig::default().terms(&with(&FLIP, &caught));
        let names: Vec<&str> = terms.iter().map(|term| term.0).collect();
        assert_eq!(names, ["height", "flip angle", "aim", "catch", "calm", "ease"]);
        assert_eq!(terms[3].1, (-0.2_f64).exp());
        let paper = PAPER.terms(&with(&FLIP, &[("crossing_time_s", 0.0)]));
        assert_eq!(paper, [("height", 0.5 * 0.71)]);
        assert!(PAPER.terms(&with(&FLIP, &[("exploit", 1.0)])).is_empty());
    }

    #[test]
    fn a_catch_is_a_success() {
        let is_success =
            |caught: &[(&'static str, f64)]| PAPER.judge(&with(&FLIP, caught)).unwrap().0;
        assert!(is_success(&[("caught", 1.0)]));
        assert!(!is_success(&[("caught", 0.0)]) && !is_success(&[]));
    }

    #[test]
    fn names_the_measures_that_a_task_lacks() {
        let of = |names: &[&str]| names.iter().map(|name| (name.to_string(), "m".into())).collect();
        let few = of(&["apex_m", "crossing_time_s", "flip_angle_rad"]);
        assert_eq!(PAPER.missing(&few), ["distance_m"]);
        let value = RewardConfig { kind: RewardKind::Value, ..PAPER };
        assert!(value.missing(&few).is_empty());
    }

    #[test]
    fn is_the_weighted_sum_of_section_3_1() {
        let expected = 0.5 * 2.6 / PI + 0.5 * (-0.12_f64).exp() + 0.5 * 0.71;
        assert!((reward(&[]) - expected).abs() < 1e-15);
        let weights = RewardConfig { w1: 1.0, w2: 0.0, w3: 2.0, ..PAPER };
        assert!((weights.reward(&with(&FLIP, &[])) - (2.6 / PI + 1.42)).abs() < 1e-15);
    }

    #[test]
    fn without_a_crossing_only_the_height_counts() {
        assert_eq!(reward(&[("crossing_time_s", 0.0)]), 0.5 * 0.71);
        assert_eq!(PAPER.reward(&with(&NOTHING, &[])), 0.0);
    }

    #[test]
    fn worlds_without_an_arm_are_judged_by_their_first_measure() {
        let of = |kind, value| {
            let measures = with(&NOTHING, &[("height", value), ("other", 7.0)]);
            RewardConfig { kind, ..Default::default() }.reward(&measures)
        };
        assert_eq!(of(RewardKind::Value, 0.25), 0.25);
        assert_eq!(of(RewardKind::Distance, 0.25), (-0.75_f64).exp());
        for value in [-1.0, -1e-300, f64::MIN] {
            assert_eq!(of(RewardKind::Value, value), value, "it is a reward like any other");
        }
    }

    #[test]
    fn exploits_earn_nothing() {
        assert_eq!(reward(&[("release_speed_m_s", 6.1)]), 0.0);
        assert_eq!(reward(&[("release_spin_rad_s", -41.0)]), 0.0);
        assert_eq!(reward(&[("exploit", 1.0)]), 0.0);
    }

    #[test]
    fn is_finite_and_not_negative_whatever_is_measured() {
        let extremes = [f64::MAX, f64::MIN, -1e308, -1.0, 0.0, 1e308];
        for a in extremes {
            for b in extremes {
                for others in [
                    [("apex_m", a), ("flip_angle_rad", b)],
                    [("distance_m", a), ("crossing_time_s", b)],
                ] {
                    for r in [reward(&others), catch(&others)] {
                        assert!(r.is_finite() && r >= 0.0, "{a} {b}: {r}");
                    }
                }
            }
        }
    }
}
