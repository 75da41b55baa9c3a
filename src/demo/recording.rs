//! A recording as it is on disk: rows of joint angles or poses at any times, or what moves so.
#![allow(non_snake_case)] // monogram notation: X_WP, R

use anyhow::{Context, Result, bail};
use imitation::sphere;
use learner::smoothing::smooth;
use learner::trajectory::{Pose, sample};
use nalgebra::{Isometry3, Matrix3, Quaternion, Rotation3, Translation3, UnitQuaternion, Vector3};
use physics::arm::{ArmModel, JointVector, MAX_JOINTS, kinematics};

use super::cell::DecimalMark;
use super::columns::{Column, Columns, Orientation, Quantities};
use super::dialect::Table;
use super::fields::Fields;
use super::gaps;
use super::mapping::Assignment;
use super::rows;
use super::{container, encoding, primitive};

/// Rotation vectors jump at π; nearer than this a recording may not come.
pub const MAX_TURN_RAD: f64 = 3.0;
/// A recorded joint may be this far beyond its limit: sensors and limits are not exact, rad.
const LIMIT_TOLERANCE_RAD: f64 = 0.05;
/// ‖q‖ of a quaternion, or a column of a matrix, may differ this much from 1.
const NORM_TOLERANCE: f64 = 0.02;
/// Farther than this from the origin nothing is whose unit is not stated, m.
const FAR_M: f64 = 50.0;
/// Euler angles and rotation vectors that differ less are the same, rad.
const SAME_ANGLES_RAD: f64 = 0.02;

/// What was recorded at each time.
enum Motion {
    Joints(Vec<[f64; MAX_JOINTS]>),
    /// Poses of the tip in the world frame.
    Poses(Vec<Isometry3<f64>>),
}

/// A movement at strictly increasing times, s since the first row of the file.
pub struct Recording {
    pub times_s: Vec<f64>,
    lines: Vec<u64>,
    motion: Motion,
    /// How the file was understood, in words.
    pub format: Vec<(&'static str, String)>,
    /// Columns that were not read.
    pub ignored: Vec<String>,
    pub warnings: Vec<String>,
}

impl Recording {
    /// Reads `bytes`; `file` names them in messages. `mapping` goes before the names of columns.
    pub fn read(
        file: &str,
        bytes: &[u8],
        model: &ArmModel,
        mapping: &[Assignment],
        orientation: learner::orientation::Orientation,
    ) -> Result<Recording> {
        let n_joints = model.joint_names().len();
        let Some(table) = primitive::table(file, bytes, n_joints, !mapping.is_empty())? else {
            return Recording::of_table(file, bytes, model, mapping, orientation);
        };
        let played = format!("{file}, played as a table");
        let mut recording =
            Recording::of_table(&played, table.as_bytes(), model, mapping, orientation)?;
        recording.format[..2].clone_from_slice(&[
            ("recorder", "dmpbbo".to_string()),
            ("text", "JSON, a primitive that is played".to_string()),
        ]);
        Ok(recording)
    }

    fn of_table(
        file: &str,
        bytes: &[u8],
        model: &ArmModel,
        mapping: &[Assignment],
        orientation: learner::orientation::Orientation,
    ) -> Result<Recording> {
        container::refuse(file, bytes)?;
        let (text, encoding) = encoding::decode(file, bytes)?;
        let table = Table::parse(file, &text)?;
        let fields = Fields::of(file, &table, mapping);
        let columns = Columns::find(&fields, model.joint_names(), mapping)?;
        let read = rows::read(file, &fields, &columns)?;
        let names: Vec<&str> = columns.values().iter().map(|column| &column.name[..]).collect();
        let dense = gaps::fill(file, &names, &read.sparse)?;
        let mut warnings = [read.warnings, columns.warnings.clone(), dense.warnings].concat();
        let is_sphere = !orientation.is_vector();
        let row = |k: usize| Row { file, line: dense.lines[k], values: &dense.rows[k], is_sphere };
        let all = 0..dense.rows.len();
        let motion = match &columns.quantities {
            Quantities::Joints(joints) => {
                Motion::Joints(all.map(|k| row(k).joints(joints, model)).collect::<Result<_>>()?)
            }
            Quantities::Task(position, orientation) => {
                warnings.extend(euler_warning(file, orientation, &dense.rows));
                Motion::Poses(
                    all.map(|k| row(k).pose(position, orientation)).collect::<Result<_>>()?,
                )
            }
        };
        let decimal = match table.decimal_mark {
            DecimalMark::Point => "decimal point",
            DecimalMark::Comma => "decimal comma",
        };
        let separator = table.separator.name();
        let mut format = vec![
            ("recorder", columns.recorder.unwrap_or("unknown").to_string()),
            ("text", format!("{}, {separator}, {decimal}", encoding.name())),
            ("time", read.time),
        ];
        format.push(match columns.quantities {
            Quantities::Joints(_) => ("joints", described(&columns.values(), "rad")),
            Quantities::Task(..) => ("pose", described(&columns.values(), "m, rad")),
        });
        let ignored = columns.ignored.clone();
        Ok(Recording {
            times_s: dense.times_s,
            lines: dense.lines,
            motion,
            format,
            ignored,
            warnings,
        })
    }

    /// The tip at `at_s`, smoothed over `smooth_s` before. Joints are smoothed and interpolated as
    /// joints, so that the arm can follow what becomes of them. With `relative`, turns count from the
    /// first row instead of from the world's axes.
    pub fn path(
        &self,
        file: &str,
        model: &ArmModel,
        smooth_s: Option<f64>,
        at_s: &[f64],
        relative: bool,
    ) -> Result<Vec<Isometry3<f64>>> {
        let times_s = &self.times_s;
        match &self.motion {
            Motion::Joints(joints) => Ok(tips(model, times_s, joints, smooth_s, at_s)),
            Motion::Poses(poses) => {
                let from = if relative { poses[0].rotation } else { UnitQuaternion::identity() };
                let mut vectors: Vec<Pose> = Vec::new();
                for (X_WP, line) in poses.iter().zip(&self.lines) {
                    let r = (X_WP.rotation * from.inverse()).scaled_axis();
                    check_turn(&r, || format!("{file}, line {line}"))?;
                    let p = X_WP.translation.vector;
                    vectors.push([p.x, p.y, p.z, r.x, r.y, r.z]);
                }
                if let Some(width_s) = smooth_s {
                    vectors = smooth(times_s, &vectors, width_s);
                }
                let tip = |v: &Pose| {
                    let rotation = UnitQuaternion::from_scaled_axis(Vector3::new(v[3], v[4], v[5]));
                    Isometry3::from_parts(Translation3::new(v[0], v[1], v[2]), rotation * from)
                };
                Ok(sample(times_s, &vectors, at_s).iter().map(tip).collect())
            }
        }
    }
}

impl Recording {
    /// As [`Recording::path`], with turns instead of rotation vectors: over any number of revolutions.
    pub fn path_on_sphere(
        &self,
        model: &ArmModel,
        smooth_s: Option<f64>,
        at_s: &[f64],
    ) -> Vec<Isometry3<f64>> {
        let times_s = &self.times_s;
        let poses = match &self.motion {
            Motion::Joints(joints) => return tips(model, times_s, joints, smooth_s, at_s),
            Motion::Poses(poses) => poses,
        };
        let rotations: Vec<_> = poses.iter().map(|pose| pose.rotation).collect();
        let vector = |(pose, turn): (&Isometry3<f64>, Vector3<f64>)| -> Pose {
            let p = pose.translation.vector;
            [p.x, p.y, p.z, turn.x, turn.y, turn.z]
        };
        let mut vectors: Vec<Pose> =
            poses.iter().zip(sphere::turns(&rotations)).map(vector).collect();
        if let Some(width_s) = smooth_s {
            vectors = smooth(times_s, &vectors, width_s);
        }
        let turn = |v: &Pose| Vector3::new(v[3], v[4], v[5]);
        let first = UnitQuaternion::from_scaled_axis(turn(&vectors[0])) * rotations[0];
        let knots = sphere::orientations(&first, &vectors.iter().map(turn).collect::<Vec<_>>());
        let tip = |(v, t_s): (&Pose, &f64)| {
            // From the row before on.
            let k = times_s.partition_point(|other| other <= t_s).max(1) - 1;
            let since = turn(v) - turn(&vectors[k]);
            let rotation = UnitQuaternion::from_scaled_axis(since) * knots[k];
            Isometry3::from_parts(Translation3::new(v[0], v[1], v[2]), rotation)
        };
        sample(times_s, &vectors, at_s).iter().zip(at_s).map(tip).collect()
    }
}

/// The tip of an arm whose joints were recorded, at `at_s`.
fn tips(
    model: &ArmModel,
    times_s: &[f64],
    joints: &[[f64; MAX_JOINTS]],
    smooth_s: Option<f64>,
    at_s: &[f64],
) -> Vec<Isometry3<f64>> {
    let smoothed = smooth_s.map(|width_s| smooth(times_s, joints, width_s));
    let joints = sample(times_s, smoothed.as_deref().unwrap_or(joints), at_s);
    let tip = |q: &[f64; MAX_JOINTS]| kinematics::tip_pose(model, &JointVector::from(*q));
    joints.iter().map(tip).collect()
}

/// Refuses a rotation vector (rad) near its jump; `place` says where it is.
pub fn check_turn(rotation: &Vector3<f64>, place: impl Fn() -> String) -> Result<()> {
    let turn = rotation.norm();
    if turn > MAX_TURN_RAD {
        bail!(
            "{}: turned by {turn:.2} rad from the world's axes, and rotation vectors jump at π: record \
             within {MAX_TURN_RAD} rad, turn the tip's frame, let --at-start do so, or set \
             learner.orientation = \"sphere\" in the file of --config",
            place()
        );
    }
    Ok(())
}

/// Columns with their units; what states none is in `usual`.
fn described(columns: &[&Column], usual: &str) -> String {
    let assumed = columns.iter().any(|column| column.unit.is_none());
    let names: Vec<&str> = columns.iter().map(|column| column.name.as_str()).collect();
    let note = if assumed { format!(" ({usual} where no unit is stated)") } else { String::new() };
    format!("{}{note}", names.join(", "))
}

/// Roll, pitch and yaw elsewhere are often Euler angles; that shows only where several turn at once.
fn euler_warning(file: &str, orientation: &Orientation, rows: &[Vec<f64>]) -> Option<String> {
    let Orientation::RotationVector(angles) = orientation else { return None };
    let named = |words: [&str; 3]| {
        let is_named = |(column, word): (&Option<Column>, &str)| {
            column.as_ref().is_none_or(|column| column.name.to_lowercase().contains(word))
        };
        angles.iter().zip(words).all(is_named)
    };
    let ours = named(["pitch_rad", "roll_rad", "yaw_rad"]);
    if ours || !named(["pitch", "roll", "yaw"]) {
        return None;
    }
    let difference = |row: &Vec<f64>| {
        let r = rotation_vector(angles, &row[3..]);
        let euler = UnitQuaternion::from_euler_angles(r.x, r.y, r.z);
        UnitQuaternion::from_scaled_axis(r).angle_to(&euler)
    };
    let largest = rows.iter().map(difference).fold(0.0, f64::max);
    (largest > SAME_ANGLES_RAD).then(|| {
        format!(
            "{file}: pitch, roll and yaw are read as the components y, x, z of a rotation vector; as \
             Euler angles they would differ by up to {largest:.3} rad: convert those to a quaternion"
        )
    })
}

/// From the values of the columns that there are.
fn rotation_vector(angles: &[Option<Column>; 3], values: &[f64]) -> Vector3<f64> {
    let mut values = values.iter();
    let [pitch, roll, yaw] = angles
        .each_ref()
        .map(|column| column.as_ref().and_then(|_| values.next()).copied().unwrap_or(0.0));
    Vector3::new(roll, pitch, yaw)
}

/// Values of one row in SI units, in the order of [`Columns::values`].
struct Row<'a> {
    file: &'a str,
    line: u64,
    values: &'a [f64],
    /// Any turn will do.
    is_sphere: bool,
}

impl Row<'_> {
    fn at(&self) -> String {
        format!("{}, line {}", self.file, self.line)
    }

    fn joints(&self, columns: &[Column], model: &ArmModel) -> Result<[f64; MAX_JOINTS]> {
        let limits = model.limits();
        let mut q = [0.0; MAX_JOINTS];
        for (i, (column, value)) in columns.iter().zip(self.values).enumerate() {
            q[i] = *value;
            let (min, max) = (limits.q_min[i], limits.q_max[i]);
            if q[i] < min - LIMIT_TOLERANCE_RAD || q[i] > max + LIMIT_TOLERANCE_RAD {
                let advice = match column.unit {
                    Some(_) => "check the unit (_rad or _deg) and the arm".to_string(),
                    None => format!(
                        "no unit is stated, so it is read as rad; say --columns q{}_deg=NAME if it is \
                         not, and check the arm",
                        i + 1
                    ),
                };
                bail!(
                    "{}: {} is {:.3} rad, and joint {} moves within {min}..={max} rad: {advice}",
                    self.at(),
                    column.name,
                    q[i],
                    model.joint_names()[i]
                );
            }
        }
        Ok(q)
    }

    fn pose(&self, position: &[Column; 3], orientation: &Orientation) -> Result<Isometry3<f64>> {
        for (column, (value, axis)) in position.iter().zip(self.values.iter().zip(["x", "y", "z"]))
        {
            if column.unit.is_none() && value.abs() > FAR_M {
                bail!(
                    "{}: {} is {value}: no unit is stated, so it is read as m; say --columns \
                     {axis}_mm=NAME (or _cm), for each of x, y and z",
                    self.at(),
                    column.name
                );
            }
        }
        let p = Translation3::new(self.values[0], self.values[1], self.values[2]);
        Ok(Isometry3::from_parts(p, self.rotation(orientation, &self.values[3..])?))
    }

    fn rotation(&self, orientation: &Orientation, values: &[f64]) -> Result<UnitQuaternion<f64>> {
        match orientation {
            Orientation::RotationVector(angles) => {
                let r = rotation_vector(angles, values);
                // Before it becomes a quaternion, which knows no turn beyond π.
                if !self.is_sphere {
                    check_turn(&r, || self.at())?;
                }
                Ok(UnitQuaternion::from_scaled_axis(r))
            }
            Orientation::Quaternion(_) => {
                let quaternion = Quaternion::new(values[0], values[1], values[2], values[3]);
                let norm = quaternion.norm();
                if (norm - 1.0).abs() > NORM_TOLERANCE {
                    bail!(
                        "{}: the quaternion has norm {norm:.3}: give a unit quaternion, qw the real \
                         part",
                        self.at()
                    );
                }
                Ok(UnitQuaternion::from_quaternion(quaternion))
            }
            Orientation::Matrix(_) => {
                let R = Matrix3::from_column_slice(values);
                let error = (R.transpose() * R - Matrix3::identity()).abs().max();
                if error > NORM_TOLERANCE || R.determinant() < 0.0 {
                    return Err(anyhow::anyhow!("its axes are not orthogonal unit vectors"))
                        .with_context(|| format!("{}: this is no rotation matrix", self.at()));
                }
                Ok(UnitQuaternion::from_rotation_matrix(&Rotation3::from_matrix(&R)))
            }
        }
    }
}
