//! From somebody's recording to a demonstration: read, trim, smooth, resample, write.

mod columns;
mod recording;
mod summary;

use anyhow::{Result, bail};
use learner::demonstration::DURATION_S;
use learner::smoothing::smooth;
use learner::trajectory::{Pose, sample};
use physics::arm::ArmModel;

use recording::Recording;
pub use summary::Summary;

/// A recorded time that is this little outside of a bound is at it, s.
const ROUNDING_S: f64 = 1e-9;
/// Angles that print as zero need no column, rad.
const NO_ANGLE_RAD: f64 = 5e-10;

pub struct Options {
    pub rate_hz: f64,
    /// Width of the smoothing, see [`learner::smoothing::smooth`].
    pub smooth_s: Option<f64>,
    /// Part of the recording, in its own time.
    pub start_s: Option<f64>,
    pub end_s: Option<f64>,
}

/// A movement at a uniform rate, beginning at time 0.
pub struct Imported {
    pub poses: Vec<Pose>,
    pub rate_hz: f64,
    pub recorded: usize,
    pub ignored: Vec<String>,
    pub warnings: Vec<String>,
}

/// Reads `text` of `file`, and lays samples on it: at start + k / rate, up to the first at or after the
/// end, which holds the last pose.
pub fn import(file: &str, text: &str, model: &ArmModel, options: &Options) -> Result<Imported> {
    let Recording { times_s, mut poses, ignored, warnings } = Recording::parse(file, text, model)?;
    let (first, last) = (times_s[0], times_s[times_s.len() - 1]);
    let start = within(file, "--start", options.start_s.unwrap_or(first), first, last)?;
    let end = within(file, "--end", options.end_s.unwrap_or(last), first, last)?;
    if start >= end {
        bail!("{file}: --start {start} is not before --end {end}: nothing would be left");
    }
    if end - start > *DURATION_S.end() {
        bail!(
            "{file}: {} s from start to end, and a demonstration lasts at most {} s: choose a part \
             with --start and --end, or check the unit of the time",
            end - start,
            DURATION_S.end()
        );
    }
    if let Some(width_s) = options.smooth_s {
        let period = (last - first) / (times_s.len() - 1) as f64;
        if width_s < period {
            bail!(
                "--smooth-s {width_s}: shorter than the {period:.4} s between two rows of {file} and \
                 would change nothing: use at least that, or leave it away"
            );
        }
        poses = smooth(&times_s, &poses, width_s);
    }
    let n = ((end - start - ROUNDING_S) * options.rate_hz).ceil() as usize;
    let at: Vec<f64> = (0..=n).map(|k| (start + k as f64 / options.rate_hz).min(end)).collect();
    let recorded = times_s.len();
    let poses = sample(&times_s, &poses, &at);
    Ok(Imported { poses, rate_hz: options.rate_hz, recorded, ignored, warnings })
}

fn within(file: &str, flag: &str, t_s: f64, first: f64, last: f64) -> Result<f64> {
    if t_s < first - ROUNDING_S || t_s > last + ROUNDING_S {
        bail!("{flag} {t_s}: {file} runs from {first} to {last} s: choose a time in between");
    }
    Ok(t_s.clamp(first, last))
}

impl Imported {
    /// `t_s,x_m,y_m,z_m,pitch_rad`, and roll and yaw where there are any.
    pub fn csv(&self) -> String {
        let turns = |pose: &Pose| pose[4..].iter().any(|angle| angle.abs() > NO_ANGLE_RAD);
        let (more, columns) = match self.poses.iter().any(turns) {
            true => (",roll_rad,yaw_rad", 6),
            false => ("", 4),
        };
        let mut text = format!("{}{more}\n", columns::TASK_HEADER);
        for (k, pose) in self.poses.iter().enumerate() {
            text += &format!("{:.6}", k as f64 / self.rate_hz);
            for value in &pose[..columns] {
                // A zero has no sign.
                text += &format!(",{:.9}", (value * 1e9).round() / 1e9 + 0.0);
            }
            text.push('\n');
        }
        text
    }
}

#[cfg(test)]
mod tests;
