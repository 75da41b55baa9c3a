//! The columns of a recording → where its quantities are, and in which unit.

use anyhow::{Result, bail};

pub use super::fields::Column;
use super::fields::Fields;
use super::joints;
use super::mapping::Assignment;
use super::names::{ANGLE, LENGTH, NONE, TIME, Units};
use super::pose;
pub use super::pose::Orientation;
use super::time;

/// Header for messages that say what to write.
pub const TASK_HEADER: &str = "t_s,x_m,y_m,z_m,pitch_rad";

/// What the rows say.
#[derive(Debug, PartialEq)]
#[allow(clippy::large_enum_variant)] // there is one a file
pub enum Quantities {
    /// q₁, q₂, …
    Joints(Vec<Column>),
    /// Position, and the orientation.
    Task([Column; 3], Orientation),
}

#[derive(Debug)]
pub struct Columns {
    /// One, or seconds and nanoseconds, which add up.
    pub time: Vec<Column>,
    pub quantities: Quantities,
    /// Names of the ignored columns.
    pub ignored: Vec<String>,
    pub warnings: Vec<String>,
    /// What writes such a file, where the names tell.
    pub recorder: Option<&'static str>,
}

impl Columns {
    /// Finds the columns by `mapping` first, then by their names, in any order; `joint_names` are the
    /// arm's.
    pub fn find(
        fields: &Fields,
        joint_names: &[String],
        mapping: &[Assignment],
    ) -> Result<Columns> {
        let search = Search { fields, joint_names, mapping };
        let time = match search.mapped("t", TIME)? {
            Some(column) => Ok(vec![column]),
            None => time::columns(fields),
        };
        let (time, (quantities, warnings)) = match (time, search.quantities()) {
            (Ok(time), Ok(quantities)) => (time, quantities),
            (Err(error), Ok((quantities, _))) => {
                bail!("{error}; recognised are {}", listed(&quantities.columns()))
            }
            (Ok(time), Err(error)) => {
                bail!(
                    "{error}; recognised is the time, {}",
                    listed(&time.iter().collect::<Vec<_>>())
                )
            }
            (Err(error), Err(_)) => return Err(error),
        };
        let mut columns =
            Columns { time, quantities, ignored: Vec::new(), warnings, recorder: recorder(fields) };
        let used = columns.used();
        let is_used = |field: &&super::fields::Field| {
            used.iter().any(|column| (column.index, column.element) == (field.index, field.element))
        };
        let unused = fields.all.iter().filter(|field| !is_used(field) && !field.text.is_empty());
        columns.ignored = unused.map(|field| field.text.clone()).collect();
        Ok(columns)
    }

    /// Those of the quantities.
    pub fn values(&self) -> Vec<&Column> {
        self.quantities.columns()
    }

    fn used(&self) -> Vec<&Column> {
        self.time.iter().chain(self.values()).collect()
    }
}

impl Quantities {
    /// In the order of their declaration.
    fn columns(&self) -> Vec<&Column> {
        match self {
            Quantities::Joints(joints) => joints.iter().collect(),
            Quantities::Task(position, orientation) => {
                let mut used: Vec<&Column> = position.iter().collect();
                match orientation {
                    Orientation::RotationVector(angles) => used.extend(angles.iter().flatten()),
                    Orientation::Quaternion(parts) => used.extend(parts),
                    Orientation::Matrix(entries) => used.extend(entries.iter()),
                }
                used
            }
        }
    }
}

fn listed(columns: &[&Column]) -> String {
    columns.iter().map(|column| column.name.as_str()).collect::<Vec<_>>().join(", ")
}

struct Search<'a> {
    fields: &'a Fields<'a>,
    joint_names: &'a [String],
    mapping: &'a [Assignment],
}

impl Search<'_> {
    /// The column that --columns names for `quantity`.
    fn mapped(&self, quantity: &str, units: Units) -> Result<Option<Column>> {
        let mut assigned = self.mapping.iter().filter(|a| a.quantity == quantity);
        let Some(assignment) = assigned.next() else { return Ok(None) };
        if assigned.next().is_some() {
            bail!("--columns names {quantity} twice: give it once");
        }
        let field = self.fields.named(&assignment.column)?;
        let stated = assignment.unit.as_deref().or(field.name.unit.as_deref());
        self.fields.column_in(field, units, stated).map(Some)
    }

    fn is_mapped(&self, quantities: &[&str]) -> bool {
        self.mapping.iter().any(|assignment| quantities.contains(&assignment.quantity.as_str()))
    }

    fn quantities(&self) -> Result<(Quantities, Vec<String>)> {
        let is_joint = |assignment: &Assignment| {
            assignment.quantity.strip_prefix('q').is_some_and(|rest| rest.parse::<usize>().is_ok())
        };
        let (joints, position) =
            (self.mapping.iter().any(is_joint), self.is_mapped(&["x", "y", "z"]));
        if joints && position {
            bail!("--columns names both joints (q1…) and positions (x…): keep one of them");
        }
        if joints {
            return Ok((Quantities::Joints(self.mapped_joints()?), Vec::new()));
        }
        if position {
            return Ok((self.mapped_pose()?, Vec::new()));
        }
        let (fields, at) = (self.fields, self.fields.at());
        let joints = joints::find(fields, self.joint_names);
        let pose = pose::find(fields);
        match (joints, pose) {
            (Ok(Some(joints)), Ok(Some(pose))) if joints.is_plain && pose.is_plain => bail!(
                "{at}: holds both joints (q1…) and positions (x…): remove the columns that should not \
                 count, or say which do with --columns"
            ),
            (Ok(Some(joints)), _) => {
                Ok((Quantities::Joints(joints.columns), joints.warning.into_iter().collect()))
            }
            (Ok(None) | Err(_), Ok(Some(pose))) => {
                let orientation = match self.mapped_orientation()? {
                    Some(orientation) => orientation,
                    None => pose.orientation,
                };
                Ok((Quantities::Task(pose.position, orientation), Vec::new()))
            }
            (Err(error), _) | (Ok(None), Err(error)) => Err(error),
            (Ok(None), Ok(None)) => bail!(
                "{at}: has neither joints nor positions that are recognised: name the columns \
                 t_s,q1_rad,…,q{}_rad or {TASK_HEADER} (also _deg, _mm), or say which they are with \
                 --columns q1=NAME,… or x=NAME,…; {}",
                self.joint_names.len(),
                fields.listing()
            ),
        }
    }

    /// q1 to q<n>, each as mapped or by its own name.
    fn mapped_joints(&self) -> Result<Vec<Column>> {
        let n = self.joint_names.len();
        let number = |a: &Assignment| a.quantity.strip_prefix('q')?.parse::<usize>().ok();
        if let Some(extra) = self.mapping.iter().filter_map(number).find(|number| *number > n) {
            bail!(
                "--columns names q{extra}, but the arm has {n} joints: choose the arm of the recording \
                 with --config (plant.arm, plant.tip)"
            );
        }
        (1..=n).map(|i| self.mapped_or_plain(&format!("q{i}"), ANGLE)).collect()
    }

    fn mapped_pose(&self) -> Result<Quantities> {
        let [x, y, z] = ["x", "y", "z"].map(|axis| self.mapped_or_plain(axis, LENGTH));
        let orientation = match self.mapped_orientation()? {
            Some(orientation) => orientation,
            None => pose::orientation(self.fields, &[])?,
        };
        Ok(Quantities::Task([x?, y?, z?], orientation))
    }

    fn mapped_orientation(&self) -> Result<Option<Orientation>> {
        let (angles, parts) = (["pitch", "roll", "yaw"], ["qw", "qx", "qy", "qz"]);
        match (self.is_mapped(&angles), self.is_mapped(&parts)) {
            (false, false) => Ok(None),
            (true, true) => {
                bail!("--columns names a quaternion and pitch, roll or yaw: keep one of them")
            }
            (true, false) => {
                let [pitch, roll, yaw] = angles.map(|angle| self.mapped(angle, ANGLE));
                Ok(Some(Orientation::RotationVector([pitch?, roll?, yaw?])))
            }
            (false, true) => {
                let [w, x, y, z] = parts.map(|part| self.mapped_or_plain(part, NONE));
                Ok(Some(Orientation::Quaternion([w?, x?, y?, z?])))
            }
        }
    }

    /// As mapped, or the column that is called so.
    fn mapped_or_plain(&self, quantity: &str, units: Units) -> Result<Column> {
        if let Some(column) = self.mapped(quantity, units)? {
            return Ok(column);
        }
        let is_it = |field: &&super::fields::Field| field.name.words.concat() == quantity;
        let mut found = self.fields.all.iter().filter(is_it);
        match (found.next(), found.next()) {
            (Some(field), None) => self.fields.column(field, units),
            (Some(a), Some(b)) => {
                bail!(
                    "{}: both {} and {} give {quantity}: say which with --columns {quantity}=NAME",
                    self.fields.at(),
                    a.text,
                    b.text
                )
            }
            (None, _) => bail!(
                "{}: --columns does not name {quantity}, and no column is called so: add {quantity}=NAME; \
                 {}",
                self.fields.at(),
                self.fields.listing()
            ),
        }
    }
}

/// What writes columns of such names.
fn recorder(fields: &Fields) -> Option<&'static str> {
    if fields.is_tum {
        return Some("TUM trajectory");
    }
    if fields.all.first().is_some_and(|field| field.text == "__time") {
        return Some("PlotJuggler");
    }
    let has = |words: &[&str]| {
        fields.all.iter().any(|field| {
            let name = &field.name.words;
            name.len() >= words.len() && name.iter().zip(words).all(|(a, b)| a == b)
        })
    };
    [
        ("rostopic echo -p", &["field", "header"][..]),
        ("UR RTDE", &["actual", "q"]),
        ("UR RTDE", &["actual", "tcp", "pose"]),
        ("LeRobot", &["observation", "state"]),
        ("libfranka", &["state", "q"]),
        ("libfranka", &["o", "t", "ee"]),
    ]
    .into_iter()
    .find(|(_, words)| has(words))
    .map(|(recorder, _)| recorder)
}

#[cfg(test)]
mod tests;
