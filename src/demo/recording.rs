//! A recording as it is on disk: rows of joint angles or poses at any times.

use anyhow::{Context, Result, bail};
use csv::{ReaderBuilder, StringRecord, Trim};
use learner::trajectory::Pose;
use nalgebra::{Quaternion, UnitQuaternion, Vector3};
use physics::arm::{ArmModel, JointVector, kinematics};

use super::columns::{Column, Columns, Orientation, Quantities};

/// Rotation vectors jump at π; nearer than this a recording may not come.
const MAX_TURN_RAD: f64 = 3.0;
/// A recorded joint may be this far beyond its limit: sensors and limits are not exact, rad.
const LIMIT_TOLERANCE_RAD: f64 = 0.05;
/// ‖q‖ of a quaternion may differ this much from 1.
const NORM_TOLERANCE: f64 = 0.02;
/// A pause longer than this many usual periods is worth a warning.
const GAP_PERIODS: f64 = 5.0;

/// Poses of the tip in the world frame, m and rad, at strictly increasing times, s.
pub struct Recording {
    pub times_s: Vec<f64>,
    pub poses: Vec<Pose>,
    /// Columns that were not read.
    pub ignored: Vec<String>,
    /// Pauses, where what was between is made up.
    pub warnings: Vec<String>,
}

impl Recording {
    /// Parses `text`; `file` names it in messages. Joints go through the kinematics of `model`.
    pub fn parse(file: &str, text: &str, model: &ArmModel) -> Result<Recording> {
        let mut reader = ReaderBuilder::new()
            .flexible(true)
            .has_headers(false)
            .comment(Some(b'#'))
            .trim(Trim::All)
            .from_reader(text.trim_start_matches('\u{feff}').as_bytes());
        let mut records = reader.records();
        let header = match records.next() {
            Some(header) => header.with_context(|| format!("{file}: cannot be read as CSV"))?,
            None => bail!("{file}: is empty: begin it with a header, then one row a sample"),
        };
        let columns = Columns::find(file, &header, model.n_joints())?;
        let (mut times_s, mut poses, mut lines) = (Vec::<f64>::new(), Vec::new(), Vec::new());
        for record in records {
            let record = record.with_context(|| format!("{file}: cannot be read as CSV"))?;
            let row = Row { file, line: record.position().map_or(0, csv::Position::line), record };
            if row.record.len() != header.len() {
                let (at, found, expected) = (row.at(), row.record.len(), header.len());
                bail!("{at}: {found} values instead of {expected}: give one per column");
            }
            let t_s = row.value(&columns.time)?;
            if let Some(last) = times_s.last().filter(|last| t_s <= **last) {
                bail!(
                    "{}: {} is {t_s} s after {last} s: time must increase from row to row; remove the \
                     row, or sort them",
                    row.at(),
                    columns.time.name
                );
            }
            times_s.push(t_s);
            poses.push(row.pose(&columns.quantities, model)?);
            lines.push(row.line);
        }
        if poses.len() < 3 {
            bail!("{file}: {} rows: record at least 3, better 100 a second", poses.len());
        }
        let warnings = gaps(file, &times_s, &lines);
        Ok(Recording { times_s, poses, ignored: columns.ignored, warnings })
    }
}

/// One line for every pause.
fn gaps(file: &str, times_s: &[f64], lines: &[u64]) -> Vec<String> {
    let periods: Vec<f64> = times_s.windows(2).map(|pair| pair[1] - pair[0]).collect();
    let mut sorted = periods.clone();
    sorted.sort_by(f64::total_cmp);
    let usual = sorted[sorted.len() / 2];
    let gap = |(i, period): (usize, &f64)| {
        (*period > GAP_PERIODS * usual).then(|| {
            format!(
                "{file}, line {}: {period:.3} s since the row before, usual are {usual:.4} s: what is \
                 between is made up; record again if it matters",
                lines[i + 1]
            )
        })
    };
    periods.iter().enumerate().filter_map(gap).collect()
}

struct Row<'a> {
    file: &'a str,
    line: u64,
    record: StringRecord,
}

impl Row<'_> {
    fn at(&self) -> String {
        format!("{}, line {}", self.file, self.line)
    }

    /// In SI units.
    fn value(&self, column: &Column) -> Result<f64> {
        let text = &self.record[column.index];
        let number: Option<f64> = text.parse().ok().filter(|number: &f64| number.is_finite());
        number.map(|number| number * column.scale).with_context(|| {
            format!(
                "{}: {} is `{text}`: use a finite number such as 0.72, or remove the row",
                self.at(),
                column.name
            )
        })
    }

    fn pose(&self, quantities: &Quantities, model: &ArmModel) -> Result<Pose> {
        let (position, rotation) = match quantities {
            Quantities::Joints(joints) => {
                let pose = kinematics::tip_pose(model, &self.joints(joints, model)?);
                (pose.translation.vector, pose.rotation.scaled_axis())
            }
            Quantities::Task(position, orientation) => {
                let [x, y, z] = position;
                let position = Vector3::new(self.value(x)?, self.value(y)?, self.value(z)?);
                (position, self.rotation(orientation)?)
            }
        };
        let turn = rotation.norm();
        if turn > MAX_TURN_RAD {
            bail!(
                "{}: turned by {turn:.2} rad from the world's axes, and rotation vectors jump at π: \
                 record within {MAX_TURN_RAD} rad, or turn the tip's frame",
                self.at()
            );
        }
        Ok([position.x, position.y, position.z, rotation.y, rotation.x, rotation.z])
    }

    fn joints(&self, columns: &[Column], model: &ArmModel) -> Result<JointVector> {
        let limits = model.limits();
        let mut q = JointVector::zeros();
        for (i, column) in columns.iter().enumerate() {
            q[i] = self.value(column)?;
            let (min, max) = (limits.q_min[i], limits.q_max[i]);
            if q[i] < min - LIMIT_TOLERANCE_RAD || q[i] > max + LIMIT_TOLERANCE_RAD {
                bail!(
                    "{}: {} is {:.3} rad, and joint {} moves within {min}..={max} rad: check the unit \
                     (_rad or _deg) and the arm",
                    self.at(),
                    column.name,
                    q[i],
                    model.joint_names()[i]
                );
            }
        }
        Ok(q)
    }

    /// As a rotation vector, rad.
    fn rotation(&self, orientation: &Orientation) -> Result<Vector3<f64>> {
        match orientation {
            Orientation::RotationVector(angles) => {
                let [pitch, roll, yaw] = angles.each_ref().map(|column| match column {
                    Some(column) => self.value(column),
                    None => Ok(0.0),
                });
                Ok(Vector3::new(roll?, pitch?, yaw?))
            }
            Orientation::Quaternion([w, x, y, z]) => {
                let (w, x, y, z) = (self.value(w)?, self.value(x)?, self.value(y)?, self.value(z)?);
                let quaternion = Quaternion::new(w, x, y, z);
                let norm = quaternion.norm();
                if (norm - 1.0).abs() > NORM_TOLERANCE {
                    bail!(
                        "{}: the quaternion has norm {norm:.3}: give a unit quaternion, qw the real \
                         part",
                        self.at()
                    );
                }
                Ok(UnitQuaternion::from_quaternion(quaternion).scaled_axis())
            }
        }
    }
}
