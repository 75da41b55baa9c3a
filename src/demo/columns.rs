//! The header of a recording → where its quantities are, and in which unit.

use anyhow::{Result, bail};
use csv::StringRecord;

type Units = &'static [(&'static str, f64)];

const TIME: Units = &[("s", 1.0), ("ms", 1e-3), ("us", 1e-6), ("ns", 1e-9)];
const LENGTH: Units = &[("m", 1.0), ("cm", 1e-2), ("mm", 1e-3)];
const ANGLE: Units = &[("rad", 1.0), ("deg", std::f64::consts::PI / 180.0)];

/// Header for messages that say what to write.
pub const TASK_HEADER: &str = "t_s,x_m,y_m,z_m,pitch_rad";

/// One quantity of a recording.
#[derive(Clone, Debug, PartialEq)]
pub struct Column {
    pub index: usize,
    pub name: String,
    /// SI units in one unit of the column.
    pub scale: f64,
}

/// What the rows say.
#[derive(Debug, PartialEq)]
#[allow(clippy::large_enum_variant)] // there is one a file
pub enum Quantities {
    /// q₁, q₂, …
    Joints(Vec<Column>),
    /// Position, and the orientation.
    Task([Column; 3], Orientation),
}

#[derive(Debug, PartialEq)]
pub enum Orientation {
    /// Pitch, roll, yaw: the y, x, z components of the rotation vector; 0 where absent.
    RotationVector([Option<Column>; 3]),
    /// w, x, y, z.
    Quaternion([Column; 4]),
}

#[derive(Debug, PartialEq)]
pub struct Columns {
    pub time: Column,
    pub quantities: Quantities,
    /// Names of the columns nobody asked for.
    pub ignored: Vec<String>,
}

impl Columns {
    /// Finds the columns by their names, in any order; `n_joints` is what the arm has.
    pub fn find(file: &str, header: &StringRecord, n_joints: usize) -> Result<Columns> {
        let search = Search { file, header };
        let time = search.required("t", TIME)?;
        let joints = search.joints(n_joints)?;
        let position = search.all(["x", "y", "z"], LENGTH)?;
        let quantities = match (joints, position) {
            (Some(_), Some(_)) => bail!(
                "{file}, line 1: holds both joints (q1…) and positions (x…): remove the columns that \
                 should not count"
            ),
            (Some(joints), None) => Quantities::Joints(joints),
            (None, Some(position)) => Quantities::Task(position, search.orientation()?),
            (None, None) => bail!(
                "{file}, line 1: the header `{}` has neither joints nor positions: use \
                 t_s,q1_rad,…,q{n_joints}_rad or {TASK_HEADER}, with commas between (also _deg, _mm)",
                search.text()
            ),
        };
        let mut columns = Columns { time, quantities, ignored: Vec::new() };
        let used: Vec<usize> = columns.used().iter().map(|column| column.index).collect();
        let unused = header.iter().enumerate().filter(|(i, _)| !used.contains(i));
        columns.ignored = unused.map(|(_, name)| name.to_string()).collect();
        Ok(columns)
    }

    fn used(&self) -> Vec<&Column> {
        let mut used = vec![&self.time];
        match &self.quantities {
            Quantities::Joints(joints) => used.extend(joints),
            Quantities::Task(position, orientation) => {
                used.extend(position);
                match orientation {
                    Orientation::RotationVector(angles) => used.extend(angles.iter().flatten()),
                    Orientation::Quaternion(parts) => used.extend(parts),
                }
            }
        }
        used
    }
}

struct Search<'a> {
    file: &'a str,
    header: &'a StringRecord,
}

impl Search<'_> {
    fn text(&self) -> String {
        self.header.iter().collect::<Vec<_>>().join(",")
    }

    /// The column `<quantity>_<unit>` with one of `units`.
    fn find(&self, quantity: &str, units: Units) -> Result<Option<Column>> {
        let file = self.file;
        let mut found: Option<Column> = None;
        for (index, name) in self.header.iter().enumerate() {
            let unit = name.strip_prefix(quantity).and_then(|rest| rest.strip_prefix('_'));
            let Some((_, scale)) = units.iter().find(|(known, _)| Some(*known) == unit) else {
                continue;
            };
            if let Some(first) = &found {
                bail!("{file}, line 1: both {} and {name} give {quantity}: keep one", first.name);
            }
            found = Some(Column { index, name: name.into(), scale: *scale });
        }
        Ok(found)
    }

    fn required(&self, quantity: &str, units: Units) -> Result<Column> {
        let Some(column) = self.find(quantity, units)? else {
            let names: Vec<String> =
                units.iter().map(|(unit, _)| format!("{quantity}_{unit}")).collect();
            bail!(
                "{}, line 1: the header `{}` has no {}: name the column so, with its unit",
                self.file,
                self.text(),
                names.join(" or ")
            );
        };
        Ok(column)
    }

    /// All of `quantities`, or none of them.
    fn all<const N: usize>(
        &self,
        quantities: [&str; N],
        units: Units,
    ) -> Result<Option<[Column; N]>> {
        let mut any = false;
        for quantity in quantities {
            any |= self.find(quantity, units)?.is_some();
        }
        if !any {
            return Ok(None);
        }
        let columns: Result<Vec<Column>> =
            quantities.iter().map(|quantity| self.required(quantity, units)).collect();
        Ok(Some(columns?.try_into().expect("as many as asked for")))
    }

    /// q1 to q<n>, or none.
    fn joints(&self, n_joints: usize) -> Result<Option<Vec<Column>>> {
        if self.find("q1", ANGLE)?.is_none() {
            return Ok(None);
        }
        if let Some(extra) = self.find(&format!("q{}", n_joints + 1), ANGLE)? {
            bail!(
                "{}, line 1: column {}, but the arm has {n_joints} joints: choose the arm of the \
                 recording with --config (plant.arm, plant.tip)",
                self.file,
                extra.name
            );
        }
        (1..=n_joints)
            .map(|i| self.required(&format!("q{i}"), ANGLE))
            .collect::<Result<_>>()
            .map(Some)
    }

    fn orientation(&self) -> Result<Orientation> {
        let mut angles = [None, None, None];
        for (angle, name) in angles.iter_mut().zip(["pitch", "roll", "yaw"]) {
            *angle = self.find(name, ANGLE)?;
        }
        let plain = |name: &str| -> Option<Column> {
            let index = self.header.iter().position(|column| column == name)?;
            Some(Column { index, name: name.into(), scale: 1.0 })
        };
        let parts: Vec<Column> = ["qw", "qx", "qy", "qz"].into_iter().filter_map(plain).collect();
        let has_angles = angles.iter().any(Option::is_some);
        match (parts.len(), has_angles) {
            (0, _) => Ok(Orientation::RotationVector(angles)),
            (4, false) => {
                Ok(Orientation::Quaternion(parts.try_into().expect("four parts were counted")))
            }
            (4, true) => bail!(
                "{}, line 1: holds a quaternion and pitch, roll or yaw: keep one of them",
                self.file
            ),
            (n, _) => bail!(
                "{}, line 1: {n} of the columns qw,qx,qy,qz: a quaternion needs all four",
                self.file
            ),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn find(header: &str) -> Result<Columns> {
        Columns::find("r.csv", &StringRecord::from(header.split(',').collect::<Vec<_>>()), 2)
    }

    #[test]
    fn finds_columns_in_any_order_with_their_units() {
        let columns = find("q2_deg,qd1_rad_s,t_ms,q1_rad").unwrap();
        assert_eq!((columns.time.index, columns.time.scale), (2, 1e-3));
        assert_eq!(columns.ignored, ["qd1_rad_s"]);
        let Quantities::Joints(joints) = columns.quantities else { panic!("joints") };
        assert_eq!((joints[0].index, joints[0].scale), (3, 1.0));
        assert!((joints[1].scale * 180.0 - std::f64::consts::PI).abs() < 1e-15);

        let columns = find("t_s,x_mm,y_mm,z_m,qw,qx,qy,qz").unwrap();
        let Quantities::Task(position, Orientation::Quaternion(_)) = columns.quantities else {
            panic!("a pose with a quaternion")
        };
        assert_eq!(position.map(|column| column.scale), [1e-3, 1e-3, 1.0]);
        assert!(columns.ignored.is_empty());
    }

    #[test]
    fn refuses_each_bad_header_and_says_what_to_write() {
        for (header, words) in [
            ("time,x_m,y_m,z_m", ["has no t_s", "t_ms"]),
            ("t_s;x_m;y_m;z_m", ["has no t_s", "t_s;x_m"]),
            ("t_s,a,b", ["neither joints nor positions", "t_s,q1_rad,…,q2_rad"]),
            ("t_s,x_m,z_m", ["has no y_m", "y_mm"]),
            ("t_s,x_m,x_mm,y_m,z_m", ["both x_m and x_mm", "keep one"]),
            ("t_s,q1_rad,q3_rad", ["q3_rad", "2 joints"]),
            ("t_s,q1_rad", ["has no q2_rad", "q2_deg"]),
            ("t_s,q1_rad,q2_rad,x_m,y_m,z_m", ["both joints", "remove"]),
            ("t_s,x_m,y_m,z_m,qw,qx", ["2 of the columns", "all four"]),
            ("t_s,x_m,y_m,z_m,qw,qx,qy,qz,pitch_rad", ["quaternion and pitch", "keep one"]),
        ] {
            let message = find(header).expect_err(header).to_string();
            for word in words.iter().chain(&["r.csv, line 1"]) {
                assert!(message.contains(word), "{header}: no '{word}' in: {message}");
            }
        }
    }
}
