//! What was imported, for people and for machines.

use std::path::Path;

use anyhow::Error;
use learner::Demonstration;
use learner::trajectory::Pose;
use serde_json::json;

use super::{Effort, Imported};

const NAMES: [&str; 6] = ["x_m", "y_m", "z_m", "pitch_rad", "roll_rad", "yaw_rad"];

pub struct Summary<'a> {
    pub out: &'a Path,
    pub imported: &'a Imported,
    /// As the learner reads it.
    pub demonstration: &'a Demonstration,
    /// What it asks of the joints, where the arm reaches all of it.
    pub effort: Option<&'a Effort>,
    /// Why the configured arm cannot follow it.
    pub misfit: Option<&'a Error>,
}

impl Summary<'_> {
    /// Smallest and largest value of a coordinate.
    fn range(&self, coordinate: usize) -> [f64; 2] {
        let values = self.demonstration.poses().iter().map(|pose| pose[coordinate]);
        values.fold([f64::MAX, f64::MIN], |[low, high], x| [low.min(x), high.max(x)])
    }

    /// Largest norms of ẋ and ẍ: speed m/s, turning rad/s, acceleration m/s², angular rad/s².
    fn peaks(&self) -> [f64; 4] {
        let (velocity, acceleration) = self.demonstration.derivatives();
        let peak = |poses: &[Pose], from: usize| {
            let norm = |pose: &Pose| pose[from..from + 3].iter().map(|x| x * x).sum::<f64>().sqrt();
            poses.iter().map(norm).fold(0.0, f64::max)
        };
        [peak(&velocity, 0), peak(&velocity, 3), peak(&acceleration, 0), peak(&acceleration, 3)]
    }

    pub fn json(&self) -> serde_json::Value {
        let [speed, turning, acceleration, angular] = self.peaks();
        let range: serde_json::Map<String, serde_json::Value> = NAMES
            .iter()
            .enumerate()
            .map(|(c, name)| (name.to_string(), json!(self.range(c))))
            .collect();
        let format: serde_json::Map<String, serde_json::Value> = self
            .imported
            .format
            .iter()
            .map(|(key, value)| (key.to_string(), json!(value)))
            .collect();
        json!({
            "file": self.out,
            "recorded_samples": self.imported.recorded,
            "samples": self.imported.poses.len(),
            "rate_hz": self.imported.rate_hz,
            "duration_s": self.demonstration.duration_s(),
            "range": range,
            "speed_max_m_s": speed,
            "turning_max_rad_s": turning,
            "acceleration_max_m_s2": acceleration,
            "angular_acceleration_max_rad_s2": angular,
            "joint_speed_peak": self.effort.map(|effort| effort.speed.json()),
            "joint_torque_peak": self.effort.map(|effort| effort.torque.json()),
            "fits_arm": self.misfit.is_none(),
            "misfit": self.misfit.map(|misfit| format!("{misfit:#}")),
            "format": format,
            "ignored_columns": self.imported.ignored,
            "warnings": self.imported.warnings,
        })
    }

    pub fn text(&self) -> String {
        let Imported { poses, rate_hz, recorded, format, ignored, .. } = self.imported;
        let [speed, turning, acceleration, angular] = self.peaks();
        let mut text = format!(
            "{}: {} samples at {rate_hz} Hz, {:.3} s, from {recorded} rows\n",
            self.out.display(),
            poses.len(),
            self.demonstration.duration_s()
        );
        for (key, value) in format.iter().filter(|(_, value)| value != "unknown") {
            text += &format!("  {key:10} {}\n", shortened(value));
        }
        for (c, name) in NAMES.iter().enumerate() {
            let [low, high] = self.range(c);
            text += &format!("  {name:10} {low:9.4} … {high:.4}\n");
        }
        text += &format!(
            "  largest    {speed:.3} m/s, {turning:.3} rad/s, {acceleration:.2} m/s², \
             {angular:.2} rad/s²\n"
        );
        if !ignored.is_empty() {
            text += &format!("  not read   {}\n", shortened(&ignored.join(", ")));
        }
        if let Some(Effort { speed, torque, .. }) = self.effort {
            for (key, peak, unit) in [("speed", speed, "rad/s"), ("torque", torque, "N·m")] {
                text += &format!(
                    "  {key:10} up to {:.0} % of a limit: joint {} {:.3} of {} {unit} at {:.2} s\n",
                    100.0 * peak.share(),
                    peak.joint,
                    peak.value,
                    peak.limit,
                    peak.t_s
                );
            }
        }
        text += &match self.misfit {
            None => "the arm reaches all of it, at this speed\n".to_string(),
            Some(misfit) => format!("NOT FOR THIS ARM: {misfit:#}\n"),
        };
        text
    }
}

/// A line of a terminal; `--json` has all of it.
fn shortened(text: &str) -> String {
    match text.char_indices().nth(160) {
        Some((at, _)) => format!("{}…", &text[..at]),
        None => text.to_string(),
    }
}
