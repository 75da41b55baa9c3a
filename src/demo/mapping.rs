//! `--columns t=…,q1_deg=…`: which column is which quantity, said by the user.

use std::str::FromStr;

use anyhow::{Result, bail};

use super::names::{self, Name, Units};

/// One `quantity=column`.
#[derive(Clone, Debug, PartialEq)]
pub struct Assignment {
    /// t, q1 to q7, x, y, z, pitch, roll, yaw, qw, qx, qy or qz.
    pub quantity: String,
    /// Unit of the column, if its name lacks it or is wrong.
    pub unit: Option<String>,
    /// Name of the column, or its number from 1.
    pub column: String,
}

fn units_of(quantity: &str) -> Option<Units> {
    match quantity {
        "t" => Some(names::TIME),
        "x" | "y" | "z" => Some(names::LENGTH),
        "pitch" | "roll" | "yaw" => Some(names::ANGLE),
        "qw" | "qx" | "qy" | "qz" => Some(names::NONE),
        _ => {
            let number: usize = quantity.strip_prefix('q')?.parse().ok()?;
            (number > 0).then_some(names::ANGLE)
        }
    }
}

impl FromStr for Assignment {
    type Err = anyhow::Error;

    fn from_str(text: &str) -> Result<Assignment> {
        let Some((key, column)) = text.split_once('=').filter(|(_, column)| !column.is_empty())
        else {
            bail!("`{text}`: write quantity=column, such as t=timestamp or q1_deg=joint_a");
        };
        let Name { words, unit } = Name::parse(key);
        let quantity = words.concat();
        match (units_of(&quantity), &unit) {
            (None, _) => bail!(
                "`{key}`: use t, q1, q2, …, x, y, z, pitch, roll, yaw, qw, qx, qy or qz, with a unit as in \
                 t_ms, x_mm or q1_deg where the file does not state it"
            ),
            (Some(units), Some(unit)) if names::unit(units, unit).is_none() => {
                let known: Vec<&str> = units.iter().map(|(names, _)| names[0]).collect();
                bail!("`{key}`: {quantity} has no unit `{unit}`: use one of {}", known.join(", "))
            }
            (Some(_), _) => Ok(Assignment { quantity, unit, column: column.trim().into() }),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn reads_quantity_unit_and_column() {
        for (text, quantity, unit, column) in [
            ("t=__time", "t", None, "__time"),
            ("t_ms=a=b", "t", Some("ms"), "a=b"),
            ("q1_deg=/arm/joint_a", "q1", Some("deg"), "/arm/joint_a"),
            ("qw=4", "qw", None, "4"),
            ("x_mm=TCP X", "x", Some("mm"), "TCP X"),
        ] {
            let assignment: Assignment = text.parse().unwrap();
            let expected = (quantity, unit, column);
            let found =
                (&assignment.quantity[..], assignment.unit.as_deref(), &assignment.column[..]);
            assert_eq!(found, expected);
        }
        for (text, words) in [
            ("t", "quantity=column"),
            ("t=", "quantity=column"),
            ("force=a", "use t, q1"),
            ("q0=a", "use t, q1"),
            ("x_deg=a", "no unit `deg`"),
        ] {
            let message = text.parse::<Assignment>().unwrap_err().to_string();
            assert!(message.contains(words), "{message}");
        }
    }
}
