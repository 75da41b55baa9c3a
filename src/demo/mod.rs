//! From a recording to a demonstration: read, trim, smooth, resample, move, write.
//!
//! bytes → [`encoding`] → [`dialect`] (rows of cells) → [`fields`] → [`columns`] (what is what) →
//! [`rows`] (values and times) → [`gaps`] → [`recording`] → [`import`]. A primitive of dmpbbo is played before
//! ([`primitive`]), and its path is the table.

mod cell;
mod columns;
mod container;
mod dialect;
mod effort;
mod encoding;
mod fields;
mod gaps;
mod joints;
mod mapping;
mod names;
mod pose;
mod primitive;
mod recording;
mod rows;
mod shift;
mod summary;
mod time;
mod time_names;

use anyhow::{Result, bail};
use imitation::sphere;
use learner::demonstration::{DURATION_S, MIN_POINTS, QUATERNION_COLUMNS};
use learner::orientation::Orientation;
use learner::trajectory::Pose;
use nalgebra::{Isometry3, UnitQuaternion};
use physics::arm::ArmModel;

pub use effort::Effort;
pub use mapping::Assignment;
use recording::{Recording, check_turn};
pub use summary::Summary;

/// A recorded time that is this little outside of a bound is at it, s.
/// Seconds since 1970 have 52 bits, so this much is noise.
const ROUNDING_S: f64 = 1e-6;
/// Angles that print as zero need no column, rad.
const NO_ANGLE_RAD: f64 = 5e-10;

#[derive(Clone)]
pub struct Options {
    pub rate_hz: f64,
    /// Width of the smoothing, see [`learner::smoothing::smooth`].
    pub smooth_s: Option<f64>,
    /// Part of the recording, s since its first row.
    pub start_s: Option<f64>,
    pub end_s: Option<f64>,
    /// How many times slower than it was recorded.
    pub slow: f64,
    /// Where it is to begin; where it was recorded without.
    pub at_start: Option<Isometry3<f64>>,
    /// Columns that the user names.
    pub columns: Vec<Assignment>,
    /// Rotation vectors, or quaternions of any number of turns.
    pub orientation: Orientation,
}

/// All of a recording, at its speed and where it was recorded.
pub const AS_IT_IS: Options = Options {
    rate_hz: 100.0,
    smooth_s: None,
    start_s: None,
    end_s: None,
    slow: 1.0,
    at_start: None,
    columns: Vec::new(),
    orientation: Orientation::Vector,
};

/// A movement at a uniform rate, beginning at time 0.
pub struct Imported {
    /// On the sphere without their rotations.
    pub poses: Vec<Pose>,
    /// On the sphere: with the signs of a path.
    pub quaternions: Option<Vec<UnitQuaternion<f64>>>,
    pub rate_hz: f64,
    pub recorded: usize,
    /// How the file was understood, in words.
    pub format: Vec<(&'static str, String)>,
    pub ignored: Vec<String>,
    pub warnings: Vec<String>,
}

/// Reads the `bytes` of `file`, and lays samples on them: at start + k / rate, up to the first at or
/// after the end, which holds the last pose.
pub fn import(file: &str, bytes: &[u8], model: &ArmModel, options: &Options) -> Result<Imported> {
    let orientation = options.orientation;
    let recording = Recording::read(file, bytes, model, &options.columns, orientation)?;
    let times_s = &recording.times_s;
    let (first, last) = (times_s[0], times_s[times_s.len() - 1]);
    let start = within(file, "--start", options.start_s.unwrap_or(first), first, last)?;
    let end = within(file, "--end", options.end_s.unwrap_or(last), first, last)?;
    if start >= end {
        bail!("{file}: --start {start} is not before --end {end}: nothing would be left");
    }
    let duration = (end - start) * options.slow;
    if duration > *DURATION_S.end() {
        bail!(
            "{file}: {duration} s from start to end, and a demonstration lasts at most {} s: choose a \
             part with --start and --end, or check the unit of the time (--columns t_ms=NAME)",
            DURATION_S.end()
        );
    }
    let n = ((duration - ROUNDING_S) * options.rate_hz).ceil() as usize;
    if duration < *DURATION_S.start() - ROUNDING_S || n + 1 < MIN_POINTS {
        bail!(
            "{file}: {duration:.3} s from start to end, {} samples at {} Hz: a demonstration lasts at \
             least {} s and has {MIN_POINTS} samples: record more of it",
            n + 1,
            options.rate_hz,
            DURATION_S.start()
        );
    }
    if let Some(width_s) = options.smooth_s {
        let period = (last - first) / (times_s.len() - 1) as f64;
        if width_s < period {
            bail!(
                "--smooth-s {width_s}: shorter than the {period:.4} s between two rows of {file} and \
                 would change nothing: use at least that, or omit it"
            );
        }
    }
    let rate = options.rate_hz * options.slow;
    let at: Vec<f64> = (0..=n).map(|k| (start + k as f64 / rate).min(end)).collect();
    let relative = options.at_start.is_some();
    let mut path = match orientation {
        Orientation::Vector => recording.path(file, model, options.smooth_s, &at, relative)?,
        Orientation::Sphere => recording.path_on_sphere(model, options.smooth_s, &at),
    };
    if let Some(start) = &options.at_start {
        shift::begin_at(&mut path, start);
    }
    let pose = |(pose, t): (&Isometry3<f64>, &f64)| match orientation {
        Orientation::Vector => pose_at(file, pose, *t),
        Orientation::Sphere => {
            let p = pose.translation.vector;
            Ok([p.x, p.y, p.z, 0.0, 0.0, 0.0])
        }
    };
    let rotations: Vec<UnitQuaternion<f64>> = path.iter().map(|pose| pose.rotation).collect();
    let is_sphere = orientation == Orientation::Sphere;
    Ok(Imported {
        poses: path.iter().zip(&at).map(pose).collect::<Result<_>>()?,
        quaternions: is_sphere.then(|| sphere::continuous(&rotations)),
        rate_hz: options.rate_hz,
        recorded: times_s.len(),
        format: recording.format,
        ignored: recording.ignored,
        warnings: recording.warnings,
    })
}

fn within(file: &str, flag: &str, t_s: f64, first: f64, last: f64) -> Result<f64> {
    if t_s < first - ROUNDING_S || t_s > last + ROUNDING_S {
        bail!(
            "{flag} {t_s}: {file} runs from {first} to {last} s, counted from its first row: choose a \
             time in between"
        );
    }
    Ok(t_s.clamp(first, last))
}

/// x, y, z, pitch, roll, yaw.
fn pose_at(file: &str, pose: &Isometry3<f64>, t_s: f64) -> Result<Pose> {
    let (p, r) = (pose.translation.vector, pose.rotation.scaled_axis());
    check_turn(&r, || format!("{file}, {t_s:.3} s after its first row"))?;
    Ok([p.x, p.y, p.z, r.y, r.x, r.z])
}

impl Imported {
    /// `t_s,x_m,y_m,z_m,pitch_rad`, and roll and yaw where there are any; on the sphere a quaternion.
    pub fn csv(&self) -> String {
        if let Some(quaternions) = &self.quaternions {
            let mut text = format!("{}\n", QUATERNION_COLUMNS.join(","));
            for (k, (pose, q)) in self.poses.iter().zip(quaternions).enumerate() {
                let row = [pose[0], pose[1], pose[2], q.w, q.i, q.j, q.k];
                text += &self.row(k, &row);
            }
            return text;
        }
        let turns = |pose: &Pose| pose[4..].iter().any(|angle| angle.abs() > NO_ANGLE_RAD);
        let (more, columns) = match self.poses.iter().any(turns) {
            true => (",roll_rad,yaw_rad", 6),
            false => ("", 4),
        };
        let mut text = format!("{}{more}\n", columns::TASK_HEADER);
        for (k, pose) in self.poses.iter().enumerate() {
            text += &self.row(k, &pose[..columns]);
        }
        text
    }

    /// Time and `values` of sample `k`, a line.
    fn row(&self, k: usize, values: &[f64]) -> String {
        let mut text = format!("{:.6}", k as f64 / self.rate_hz);
        for value in values {
            // A zero has no sign.
            text += &format!(",{:.9}", (value * 1e9).round() / 1e9 + 0.0);
        }
        text.push('\n');
        text
    }
}

#[cfg(test)]
mod tests;
