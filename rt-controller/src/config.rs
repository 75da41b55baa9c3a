//! Settings of the controller; one table `[controller]` of the configuration file.

use serde::{Deserialize, Serialize};
use thiserror::Error;

/// More cores than a host has.
const MAX_CPU: f64 = 8191.0;

/// What paces the loop.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Pace {
    /// The wall clock.
    Realtime,
    /// The simulation: the next tick starts when the last has ended. Same results, sooner.
    Max,
    /// The samples of an external plant, which is the clock.
    Plant,
}

/// What a controller does without a learner and without a pinned policy.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(rename_all = "lowercase")]
pub enum Alone {
    /// Serves the active policy, else the last good one, rollout after rollout.
    Serve,
    /// Holds the arm.
    Hold,
}

#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields, default)]
pub struct ControllerConfig {
    /// Length of a control period, called a tick.
    pub period_us: u32,
    /// Time before each deadline from which the loop spins instead of sleeping, at most half of `period_us`: a more
    /// precise wake-up at the cost of CPU time. 0: no spinning.
    pub spin_us: u32,
    /// Missed deadlines in a row after which the arm is held.
    pub overruns_max: u32,
    /// SCHED_FIFO priority of the real-time thread when paced by the wall clock.
    pub priority: u8,
    /// Core of the real-time thread, which learner and exchange avoid. Default: the last one.
    pub cpu: Option<usize>,
    /// Stiffness of the posture in the null space and during Approach, per unit of inertia.
    pub posture_stiffness: f64,
    /// Damping of the posture in the null space and during Approach, per unit of inertia.
    pub posture_damping: f64,
    /// Fastest change of a torque, in torque limits per second.
    pub torque_rate: f64,
    /// Share of a joint's speed limit from which the torque in the direction of motion fades, to 0 at the limit.
    pub speed_taper: f64,
    /// A joint closer than this to its limit is pushed back.
    pub joint_margin_rad: f64,
    /// Damping of the fall-back hold, in torque limits per rad/s.
    pub hold_damping: f64,
    /// Tolerated ticks in a row without a new sample.
    pub stale_ticks: u32,
    /// Largest torque on a joint that the motors do not explain, in its torque limits; at least 5 N·m are tolerated.
    pub disturbance_max: f64,
    /// Largest distance from the shoulder to which a policy may take the pan.
    pub workspace_radius_m: f64,
    /// Lowest height to which a policy may take the pan.
    pub workspace_floor_m: f64,
    /// Time within which a policy that is swapped in during a rollout takes over.
    pub blend_s: f64,
    /// What the controller does while no rollout is requested.
    pub alone: Alone,
    /// Time without a heartbeat after which a learner counts as absent.
    pub alone_after_s: f64,
    /// Share of the ticks in which the dry run of a policy to be served may exceed a joint's torque
    /// limit. The loop clips it; a learner's proposals, which are experiments, are not dry-run.
    pub dry_run_clipped: f64,
    /// Shortest time for which the start posture is held before a policy takes over.
    pub approach_s: f64,
    /// Longest Settle phase. A catch is judged 0.5 s after the fall through Δ_h.
    pub settle_s: f64,
}

impl Default for ControllerConfig {
    fn default() -> Self {
        ControllerConfig {
            period_us: 1000,
            spin_us: 0,
            overruns_max: 50,
            priority: 80,
            cpu: None,
            posture_stiffness: 50.0,
            posture_damping: 14.0,
            torque_rate: 200.0,
            speed_taper: 0.9,
            joint_margin_rad: 0.05,
            hold_damping: 0.1,
            stale_ticks: 5,
            disturbance_max: 0.25,
            workspace_radius_m: 1.5,
            workspace_floor_m: -0.5,
            blend_s: 0.1,
            alone: Alone::Serve,
            alone_after_s: 2.0,
            dry_run_clipped: 0.0,
            approach_s: 0.05,
            settle_s: 1.2,
        }
    }
}

/// A setting, its value, its limits and their unit; `1` of a number without one.
pub type Range = (&'static str, f64, f64, f64, &'static str);

/// A setting outside its range.
#[derive(Debug, Error, PartialEq)]
#[error("controller.{field} is {value}: use {min} to {max}")]
pub struct ControllerConfigError {
    pub field: &'static str,
    pub value: f64,
    pub min: f64,
    pub max: f64,
}

impl ControllerConfig {
    /// Every setting with its range.
    pub fn ranges(&self) -> [Range; 20] {
        [
            ("period_us", f64::from(self.period_us), 250.0, 2000.0, "µs"),
            ("spin_us", f64::from(self.spin_us), 0.0, 1000.0, "µs"),
            ("overruns_max", f64::from(self.overruns_max), 1.0, 1e6, "1"),
            ("priority", f64::from(self.priority), 1.0, 98.0, "1"),
            ("cpu", self.cpu.unwrap_or(0) as f64, 0.0, MAX_CPU, "1"),
            ("posture_stiffness", self.posture_stiffness, 0.0, 1000.0, "s⁻²"),
            ("posture_damping", self.posture_damping, 0.0, 100.0, "s⁻¹"),
            ("torque_rate", self.torque_rate, 1.0, 1e4, "s⁻¹"),
            ("speed_taper", self.speed_taper, 0.1, 0.99, "1"),
            ("joint_margin_rad", self.joint_margin_rad, 1e-3, 0.5, "rad"),
            ("hold_damping", self.hold_damping, 0.0, 1.0, "s/rad"),
            ("stale_ticks", f64::from(self.stale_ticks), 1.0, 1000.0, "1"),
            ("disturbance_max", self.disturbance_max, 0.01, 1000.0, "1"),
            ("workspace_radius_m", self.workspace_radius_m, 0.1, 100.0, "m"),
            ("workspace_floor_m", self.workspace_floor_m, -100.0, 100.0, "m"),
            ("blend_s", self.blend_s, 0.0, 2.0, "s"),
            ("alone_after_s", self.alone_after_s, 0.5, 3600.0, "s"),
            ("dry_run_clipped", self.dry_run_clipped, 0.0, 1.0, "1"),
            ("approach_s", self.approach_s, 0.01, 5.0, "s"),
            ("settle_s", self.settle_s, 0.6, 5.0, "s"),
        ]
    }

    pub fn validate(&self) -> Result<(), ControllerConfigError> {
        let (spin_us, period_us) = (f64::from(self.spin_us), f64::from(self.period_us));
        let of_period = ("spin_us", spin_us, 0.0, period_us / 2.0, "µs");
        for (field, value, min, max, _) in self.ranges().into_iter().chain([of_period]) {
            if !(min..=max).contains(&value) {
                return Err(ControllerConfigError { field, value, min, max });
            }
        }
        Ok(())
    }

    pub fn period_ns(&self) -> u64 {
        u64::from(self.period_us) * 1000
    }

    /// Time from record to record, s.
    pub fn record_s(&self) -> f64 {
        self.period_s() * self.record_stride() as f64
    }

    /// Ticks per record: records are never closer than 1 ms.
    pub fn record_stride(&self) -> usize {
        1000_usize.div_ceil(self.period_us as usize)
    }

    pub fn blend_ticks(&self) -> u32 {
        (self.blend_s / self.period_s()).round() as u32
    }

    pub fn period_s(&self) -> f64 {
        f64::from(self.period_us) * 1e-6
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_the_field_that_is_out_of_range() {
        assert_eq!(ControllerConfig::default().validate(), Ok(()));
        let bad = ControllerConfig { speed_taper: f64::NAN, ..Default::default() };
        let message = bad.validate().unwrap_err().to_string();
        assert!(message.contains("controller.speed_taper"), "{message}");
    }
}
