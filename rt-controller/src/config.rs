//! Settings of the controller; one table `[controller]` of the configuration file.

use serde::{Deserialize, Serialize};
use thiserror::Error;

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
#[serde(rename_all = "lowercase")]
pub enum Alone {
    /// Serves the active policy, else the last good one, rollout after rollout.
    Serve,
    /// Holds the arm.
    Hold,
}

#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct ControllerConfig {
    /// Length of a tick, µs.
    pub period_us: u32,
    /// Sleep until this long before each deadline and spin for the rest, µs: a more precise wake-up at the
    /// cost of CPU time. 0: no spinning.
    pub spin_us: u32,
    /// Deadlines missed in a row after which the arm is held.
    pub overruns_max: u32,
    /// SCHED_FIFO priority of the rt thread when paced by the wall clock.
    pub priority: u8,
    /// Core of the rt thread, which learner and exchange avoid. Default: the last one.
    pub cpu: Option<usize>,
    /// Null-space and Approach posture gains, s⁻² and s⁻¹.
    pub posture_stiffness: f64,
    pub posture_damping: f64,
    /// Fastest change of a torque, in torque limits per second.
    pub torque_rate: f64,
    /// The torque in the direction of motion fades from this fraction of the speed limit to the
    /// limit itself.
    pub speed_taper: f64,
    /// A joint closer than this to its limit is pushed back, rad.
    pub joint_margin_rad: f64,
    /// Damping of the fall-back hold, in torque limits per (rad/s).
    pub hold_damping: f64,
    /// Ticks in a row without a new sample that are tolerated.
    pub stale_ticks: u32,
    /// Largest torque on a joint that the motors do not explain, in its torque limits; 5 N·m at
    /// least.
    pub disturbance_max: f64,
    /// Where a policy may take the pan: this far from the shoulder, m, and above this height, m.
    pub workspace_radius_m: f64,
    pub workspace_floor_m: f64,
    /// A policy that is swapped in during a rollout takes over within this time, s.
    pub blend_s: f64,
    /// What to do while no rollout is requested.
    pub alone: Alone,
    /// A learner without a heartbeat for this long counts as absent, s.
    pub alone_after_s: f64,
    /// Share of the ticks in which the dry run of a policy to be served may exceed a joint's torque
    /// limit. The loop clips it; a learner's proposals, which are experiments, are not dry-run.
    pub dry_run_clipped: f64,
    /// The start posture is held at least this long before a policy takes over, s.
    pub approach_s: f64,
    /// Longest Settle phase, s. A catch is judged 0.5 s after the fall through Δ_h.
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

/// A setting outside its range.
#[derive(Debug, Error, PartialEq)]
#[error("controller.{field} is {value}: use a value within {min}..={max}")]
pub struct ControllerConfigError {
    pub field: &'static str,
    pub value: f64,
    pub min: f64,
    pub max: f64,
}

impl ControllerConfig {
    pub fn validate(&self) -> Result<(), ControllerConfigError> {
        for (field, value, min, max) in [
            ("period_us", f64::from(self.period_us), 250.0, 2000.0),
            ("spin_us", f64::from(self.spin_us), 0.0, f64::from(self.period_us) / 2.0),
            ("overruns_max", f64::from(self.overruns_max), 1.0, 1e6),
            ("priority", f64::from(self.priority), 1.0, 98.0),
            ("posture_stiffness", self.posture_stiffness, 0.0, 1000.0),
            ("posture_damping", self.posture_damping, 0.0, 100.0),
            ("torque_rate", self.torque_rate, 1.0, 1e4),
            ("speed_taper", self.speed_taper, 0.1, 0.99),
            ("joint_margin_rad", self.joint_margin_rad, 1e-3, 0.5),
            ("hold_damping", self.hold_damping, 0.0, 1.0),
            ("stale_ticks", f64::from(self.stale_ticks), 1.0, 1000.0),
            ("disturbance_max", self.disturbance_max, 0.01, 1000.0),
            ("workspace_radius_m", self.workspace_radius_m, 0.1, 100.0),
            ("workspace_floor_m", self.workspace_floor_m, -100.0, 100.0),
            ("blend_s", self.blend_s, 0.0, 2.0),
            ("alone_after_s", self.alone_after_s, 0.5, 3600.0),
            ("dry_run_clipped", self.dry_run_clipped, 0.0, 1.0),
            ("approach_s", self.approach_s, 0.01, 5.0),
            ("settle_s", self.settle_s, 0.6, 5.0),
        ] {
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
