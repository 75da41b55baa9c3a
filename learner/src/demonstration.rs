//! A demonstrated movement of the pan, read from CSV and resampled to 100 Hz.
//!
//! ```text
//! t_s,x_m,y_m,z_m,pitch_rad[,roll_rad,yaw_rad]
//! t_s,x_m,y_m,z_m,qw,qx,qy,qz
//! ```
//!
//! Poses are in the world frame; pitch, roll and yaw are the y, x and z components of the rotation
//! vector, and quaternions have unit length. Quaternions are for sessions on the sphere, where a movement
//! may turn any way and any number of times. Whether the arm can reach the poses is not known here: the caller
//! checks them.

use csv::{ReaderBuilder, StringRecord, Trim};
use nalgebra::{Isometry3, Quaternion, Translation3, UnitQuaternion};
use serde::{Deserialize, Serialize};
use thiserror::Error;

use crate::orientation::{Orientation, counted, exp, reached, with_rotation};
use crate::trajectory::{Pose, derivatives, resample};

/// Fewest recorded points.
pub const MIN_POINTS: usize = 10;
/// Shortest and longest demonstration, s. A policy message carries at most 30 s.
pub const DURATION_S: std::ops::RangeInclusive<f64> = 0.1..=30.0;

const COLUMNS: [&str; LONG] = ["t_s", "x_m", "y_m", "z_m", "pitch_rad", "roll_rad", "yaw_rad"];
/// Number of columns with and without roll and yaw, which are zero when absent.
const LONG: usize = 7;
const SHORT: usize = 5;
/// Columns with a quaternion.
pub const QUATERNION_COLUMNS: [&str; WIDEST] = ["t_s", "x_m", "y_m", "z_m", "qw", "qx", "qy", "qz"];
const WIDEST: usize = 8;
/// ‖q‖ of a quaternion may differ this much from 1.
const NORM_TOLERANCE: f64 = 0.02;
/// From line to line an orientation turns less than this, rad: which way is not known near half a turn.
const MAX_STEP_RAD: f64 = 1.5;

/// Why a demonstration was refused.
#[derive(Debug, Error, PartialEq)]
pub enum DemonstrationError {
    #[error(
        "{file}, line 1: header is `{found}`: use `t_s,x_m,y_m,z_m,pitch_rad`, optionally \
         followed by `,roll_rad,yaw_rad`, or `t_s,x_m,y_m,z_m,qw,qx,qy,qz`"
    )]
    Header { file: String, found: String },
    #[error("{file}, line {line}: cannot be read as CSV in UTF-8: {reason}")]
    Syntax { file: String, line: u64, reason: String },
    #[error("{file}, line {line}: {found} values instead of {expected}: give one per column")]
    Columns { file: String, line: u64, found: usize, expected: usize },
    #[error("{file}, line {line}: {column} is `{text}`: use a finite number such as 0.72")]
    Number { file: String, line: u64, column: &'static str, text: String },
    #[error(
        "{file}, line {line}: t_s is {t_s} after {previous_s}: time must increase from line to line"
    )]
    Time { file: String, line: u64, t_s: f64, previous_s: f64 },
    #[error(
        "{file}, line {line}: the quaternion has norm {norm:.3}: give a unit quaternion, qw the real part"
    )]
    Norm { file: String, line: u64, norm: f64 },
    #[error(
        "{file}, line {line}: turns by {turn:.2} rad since the line before, and which way is known only \
         below {MAX_STEP_RAD} rad: record more often"
    )]
    Step { file: String, line: u64, turn: f64 },
    #[error("{file}: {found} points: record at least {MIN_POINTS}")]
    TooFew { file: String, found: usize },
    #[error(
        "{file}: lasts {duration_s} s: record between {} and {} s",
        DURATION_S.start(), DURATION_S.end()
    )]
    Duration { file: String, duration_s: f64 },
}

/// What several demonstrations of a session are to each other.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(rename_all = "lowercase")]
pub enum DemonstrationsAre {
    /// Other ways to do it: the search starts from each.
    #[default]
    Starts,
    /// Repetitions of one way: one policy is fitted to all.
    Repetitions,
}

impl DemonstrationsAre {
    pub fn is_starts(&self) -> bool {
        *self == DemonstrationsAre::Starts
    }

    /// The demonstrations of each start.
    pub fn starts(self, all: &[Demonstration]) -> impl Iterator<Item = &[Demonstration]> {
        all.chunks(if self.is_starts() { 1 } else { all.len().max(1) })
    }
}

/// A demonstration at a uniform rate; time starts at 0.
#[derive(Clone, Debug, PartialEq)]
pub struct Demonstration {
    file: String,
    period_s: f64,
    poses: Vec<Pose>,
    /// What the rotational coordinates of the poses are: rotation vectors, or turns.
    orientation: Orientation,
}

impl Demonstration {
    /// Parses `text`; `file` names it in messages.
    pub fn parse(file: &str, text: &str) -> Result<Self, DemonstrationError> {
        let mut reader = ReaderBuilder::new()
            .flexible(true)
            .has_headers(false)
            .trim(Trim::All)
            .from_reader(text.trim_start_matches('\u{feff}').as_bytes());
        let mut records = reader.records();
        let header = next_record(file, &mut records)?.unwrap_or_default();
        let n_columns = header.len();
        let has_quaternions = header.iter().eq(QUATERNION_COLUMNS);
        let has_vectors = matches!(n_columns, SHORT | LONG)
            && header.iter().eq(COLUMNS[..n_columns].iter().copied());
        if !has_quaternions && !has_vectors {
            let found = header.iter().collect::<Vec<_>>().join(",");
            return Err(DemonstrationError::Header { file: file.into(), found });
        }
        let columns = if has_quaternions { &QUATERNION_COLUMNS[..] } else { &COLUMNS[..n_columns] };
        let (mut times_s, mut poses) = (Vec::<f64>::new(), Vec::new());
        let mut rotations: Vec<UnitQuaternion<f64>> = Vec::new();
        while let Some(record) = next_record(file, &mut records)? {
            let line = line_of(&record);
            let values = parse_row(file, line, &record, columns)?;
            if let Some(&previous_s) = times_s.last().filter(|&&last| values[0] <= last) {
                let t_s = values[0];
                return Err(DemonstrationError::Time { file: file.into(), line, t_s, previous_s });
            }
            times_s.push(values[0]);
            let mut pose = std::array::from_fn(|c| values[c + 1]);
            if has_quaternions {
                let rotation = unit(file, line, &values, rotations.last())?;
                pose = with_rotation(&pose, &rotation.scaled_axis());
                rotations.push(rotation);
            }
            poses.push(pose);
        }
        if poses.len() < MIN_POINTS {
            return Err(DemonstrationError::TooFew { file: file.into(), found: poses.len() });
        }
        let duration_s = times_s[times_s.len() - 1] - times_s[0];
        if !DURATION_S.contains(&duration_s) {
            return Err(DemonstrationError::Duration { file: file.into(), duration_s });
        }
        let orientation = if has_quaternions { Orientation::Sphere } else { Orientation::Vector };
        if has_quaternions {
            poses = counted(&poses, &rotations);
        }
        let (period_s, poses) = resample(&times_s, &poses);
        Ok(Demonstration { file: file.into(), period_s, poses, orientation })
    }

    /// The file it came from.
    pub fn file(&self) -> &str {
        &self.file
    }

    /// Sampling period, s.
    pub fn period_s(&self) -> f64 {
        self.period_s
    }

    /// Time of the last pose, s.
    pub fn duration_s(&self) -> f64 {
        self.period_s * (self.poses.len() - 1) as f64
    }

    /// Poses at 0, `period_s`, 2·`period_s`, …: x, y, z, pitch, roll, yaw in m and rad. Of a demonstration on
    /// the sphere the rotational ones are turns, see [`crate::orientation`].
    pub fn poses(&self) -> &[Pose] {
        &self.poses
    }

    /// What the rotational coordinates of the poses are.
    pub fn orientation(&self) -> Orientation {
        self.orientation
    }

    /// R_WP at the times of [`Demonstration::poses`].
    pub fn rotations(&self) -> Vec<UnitQuaternion<f64>> {
        match self.orientation {
            Orientation::Vector => self.poses.iter().map(exp).collect(),
            Orientation::Sphere => reached(&self.poses),
        }
    }

    /// X_WP at the times of [`Demonstration::poses`].
    pub fn path(&self) -> Vec<Isometry3<f64>> {
        let at = |(pose, rotation): (&Pose, UnitQuaternion<f64>)| {
            Isometry3::from_parts(Translation3::new(pose[0], pose[1], pose[2]), rotation)
        };
        self.poses.iter().zip(self.rotations()).map(at).collect()
    }

    /// The same movement with turns instead of rotation vectors.
    pub fn on_sphere(&self) -> Demonstration {
        let poses = match self.orientation {
            Orientation::Vector => counted(&self.poses, &self.rotations()),
            Orientation::Sphere => self.poses.clone(),
        };
        Demonstration { poses, orientation: Orientation::Sphere, ..self.clone() }
    }

    /// The same movement with other poses at the same times.
    ///
    /// # Panics
    /// If there are not as many poses as before.
    pub fn with_poses(&self, poses: Vec<Pose>) -> Demonstration {
        assert_eq!(poses.len(), self.poses.len(), "one pose a sample");
        Demonstration { poses, ..self.clone() }
    }

    /// ẋ and ẍ at the times of [`Demonstration::poses`]; on the sphere of rotations ω and ω̇.
    pub fn derivatives(&self) -> (Vec<Pose>, Vec<Pose>) {
        derivatives(&self.poses, self.period_s)
    }
}

fn next_record(
    file: &str,
    records: &mut csv::StringRecordsIter<'_, &[u8]>,
) -> Result<Option<StringRecord>, DemonstrationError> {
    records.next().transpose().map_err(|error| DemonstrationError::Syntax {
        file: file.into(),
        line: error.position().map_or(0, csv::Position::line),
        reason: error.to_string(),
    })
}

fn line_of(record: &StringRecord) -> u64 {
    record.position().map_or(0, csv::Position::line)
}

/// t_s and the six coordinates of a row; absent ones are zero.
fn parse_row(
    file: &str,
    line: u64,
    record: &StringRecord,
    columns: &[&'static str],
) -> Result<[f64; WIDEST], DemonstrationError> {
    if record.len() != columns.len() {
        let (file, found, expected) = (file.into(), record.len(), columns.len());
        return Err(DemonstrationError::Columns { file, line, found, expected });
    }
    let mut values = [0.0; WIDEST];
    for ((text, column), value) in record.iter().zip(columns.iter().copied()).zip(&mut values) {
        *value = text.parse().ok().filter(|number: &f64| number.is_finite()).ok_or_else(|| {
            DemonstrationError::Number { file: file.into(), line, column, text: text.into() }
        })?;
    }
    Ok(values)
}

/// The orientation of a row with a quaternion, which follows `before`.
fn unit(
    file: &str,
    line: u64,
    values: &[f64; WIDEST],
    before: Option<&UnitQuaternion<f64>>,
) -> Result<UnitQuaternion<f64>, DemonstrationError> {
    let quaternion = Quaternion::new(values[4], values[5], values[6], values[7]);
    let norm = quaternion.norm();
    if (norm - 1.0).abs() > NORM_TOLERANCE {
        return Err(DemonstrationError::Norm { file: file.into(), line, norm });
    }
    let rotation = UnitQuaternion::from_quaternion(quaternion);
    let turn = before.map_or(0.0, |before| before.angle_to(&rotation));
    if turn > MAX_STEP_RAD {
        return Err(DemonstrationError::Step { file: file.into(), line, turn });
    }
    Ok(rotation)
}

#[cfg(test)]
mod tests {
    use std::f64::consts::TAU;

    use super::*;

    const HEADER: &str = "t_s,x_m,y_m,z_m,pitch_rad";

    /// 12 good rows at 100 Hz, one of them replaced.
    fn text(header: &str, replace: Option<(usize, &str)>) -> String {
        let mut lines = vec![header.to_string()];
        lines.extend((0..12).map(|k| format!("{:.3},0.78,0,0.7{k:02},0.1", k as f64 * 0.01)));
        if let Some((line, row)) = replace {
            lines[line - 1] = row.to_string();
        }
        lines.join("\n")
    }

    fn error(text: &str) -> String {
        Demonstration::parse("pan.csv", text).expect_err("must be refused").to_string()
    }

    #[test]
    fn reads_points_with_and_without_roll_and_yaw() {
        let demonstration = Demonstration::parse("pan.csv", &text(HEADER, None)).unwrap();
        assert_eq!(demonstration.poses().len(), 12);
        assert_eq!(demonstration.poses()[3], [0.78, 0.0, 0.703, 0.1, 0.0, 0.0]);
        assert!((demonstration.duration_s() - 0.11).abs() < 1e-12);

        let rows: String = (0..12).map(|k| format!("0.{k:02},1,2,3,0.1,0.2,0.3\n")).collect();
        let full = format!("\u{feff}{HEADER},roll_rad,yaw_rad\n{rows}");
        let demonstration = Demonstration::parse("pan.csv", &full).unwrap();
        assert_eq!(demonstration.poses()[11], [1.0, 2.0, 3.0, 0.1, 0.2, 0.3]);
    }

    /// A row with the quaternion of a turn by `yaw` rad, of either sign.
    fn turned(k: usize, yaw: f64) -> String {
        let (sin, cos) = (0.5 * yaw).sin_cos();
        let sign = if k.is_multiple_of(3) { -1.0 } else { 1.0 };
        format!("{:.3},0.7,0,0.5,{},0,0,{}\n", 0.04 * k as f64, sign * cos, sign * sin)
    }

    #[test]
    fn quaternions_are_read_as_turns_beyond_a_revolution() {
        let rows: String = (0..=50).map(|k| turned(k, 0.5 + 1.5 * TAU * k as f64 / 50.0)).collect();
        let text = format!("t_s,x_m,y_m,z_m,qw,qx,qy,qz\n{rows}");
        let demonstration = Demonstration::parse("turn.csv", &text).unwrap();
        assert_eq!(demonstration.orientation(), Orientation::Sphere);
        let (first, last) = (demonstration.poses()[0], demonstration.poses()[200]);
        assert!((first[5] - 0.5).abs() < 1e-12 && (last[5] - 0.5 - 1.5 * TAU).abs() < 1e-9);
        // Between the ends, which are held, it turns evenly.
        let rates = demonstration.derivatives().0;
        assert!(rates[10..190].iter().all(|rate| (rate[5] - 1.5 * TAU / 2.0).abs() < 1e-6));
        let rotations = demonstration.rotations();
        assert!((rotations[200].scaled_axis().z - (0.5 + 0.5 * TAU - TAU)).abs() < 1e-9);
        assert_eq!(demonstration.on_sphere(), demonstration);
    }

    #[test]
    fn rotation_vectors_become_turns() {
        let rows: String = (0..=50)
            .map(|k| format!("{:.2},0.7,0,0.5,0,0,{}\n", 0.01 * k as f64, 0.2 * k as f64))
            .collect();
        let text = format!("{HEADER},roll_rad,yaw_rad\n{rows}");
        let vectors = Demonstration::parse("turn.csv", &text).unwrap();
        let turns = vectors.on_sphere();
        assert_eq!((vectors.orientation(), vectors.poses()[50][5]), (Orientation::Vector, 10.0));
        assert!((turns.poses()[50][5] - 10.0).abs() < 1e-9, "about one axis they are the same");
        for (a, b) in vectors.rotations().iter().zip(turns.rotations()) {
            assert!(a.angle_to(&b) < 1e-9);
        }
    }

    #[test]
    fn refuses_what_is_no_path_of_quaternions() {
        let text = |row: &str| {
            let rows: String = (0..12).map(|k| turned(k, 0.1)).collect();
            format!("t_s,x_m,y_m,z_m,qw,qx,qy,qz\n{rows}{row}\n")
        };
        for (row, parts) in [
            ("0.5,0.7,0,0.5,2,0,0,0", ["line 14", "norm 2.000", "qw the real part"]),
            ("0.5,0.7,0,0.5,0,1,0,0", ["line 14", "turns by 3.1", "record more often"]),
            ("0.5,0.7,0,0.5,1,0,0", ["line 14", "7 values", "instead of 8"]),
        ] {
            let message = error(&text(row));
            assert!(parts.iter().all(|part| message.contains(part)), "{message}");
        }
    }

    #[test]
    fn resamples_another_rate_to_100_hz() {
        let rows: String =
            (0..40).map(|k| format!("{},1,2,{},0\n", 5.0 + 0.004 * k as f64, k)).collect();
        let demonstration = Demonstration::parse("pan.csv", &format!("{HEADER}\n{rows}")).unwrap();
        assert_eq!(demonstration.poses().len(), 17);
        assert!((demonstration.period_s() - 0.156 / 16.0).abs() < 1e-12);
        assert!((demonstration.poses()[8][2] - 19.5).abs() < 1e-9);
    }

    #[test]
    fn refuses_each_bad_file_and_names_the_line() {
        let bad_row = |row| error(&text(HEADER, Some((5, row))));
        for (message, parts) in [
            (error(&text("t,x,y,z,pitch", None)), vec!["line 1", "t,x,y,z,pitch", "t_s,x_m"]),
            (error(""), vec!["line 1", "header"]),
            (error(&text("t_s,x_m,y_m,z_m,pitch_rad,roll_rad", None)), vec!["line 1", "yaw_rad"]),
            (bad_row("0.03,0.78,0,high,0"), vec!["line 5", "z_m", "`high`"]),
            (bad_row("0.03,0.78,NaN,0.7,0"), vec!["line 5", "y_m", "`NaN`"]),
            (bad_row("0.03,inf,0,0.7,0"), vec!["line 5", "x_m", "`inf`"]),
            (bad_row("0.03,0.78,0,0.7,"), vec!["line 5", "pitch_rad", "``"]),
            (bad_row("0.03,0.78,0,0.7"), vec!["line 5", "4 values instead of 5"]),
            (bad_row("0.02,0.78,0,0.7,0"), vec!["line 5", "0.02 after 0.02"]),
            (bad_row("0.01,0.78,0,0.7,0"), vec!["line 5", "must increase"]),
            (error(&format!("{HEADER}\n0,1,2,3,0\n0.1,1,2,3,0")), vec!["2 points", "at least 10"]),
        ] {
            for part in ["pan.csv"].iter().chain(&parts) {
                assert!(message.contains(part), "{message:?} lacks {part:?}");
            }
        }
    }

    #[test]
    fn refuses_a_blink_and_an_hour() {
        for (step, duration) in [(0.001, "0.011"), (300.0, "3300")] {
            let rows: String =
                (0..12).map(|k| format!("{:.3},1,2,3,0\n", k as f64 * step)).collect();
            let message = error(&format!("{HEADER}\n{rows}"));
            assert!(message.contains(&format!("lasts {duration} s")), "{message}");
        }
    }
}
