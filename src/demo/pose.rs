//! Columns of a pose, as recorders name them: position, and an orientation beside it.

use anyhow::{Result, bail};

use super::fields::{Column, Field, Fields};
use super::joints::{Family, families};
use super::names::{ANGLE, LENGTH, NONE};

/// What may stand before x, y, z.
const POSITION_WORDS: [&str; 16] = [
    "position",
    "pos",
    "translation",
    "trans",
    "p",
    "t",
    "pose",
    "tcp",
    "ee",
    "eef",
    "tool",
    "tip",
    "pan",
    "hand",
    "flange",
    "point",
];
/// What may stand before w, x, y, z.
const ROTATION_WORDS: [&str; 8] =
    ["orientation", "rotation", "rot", "quat", "quaternion", "q", "ori", "attitude"];
/// What is commanded, or no pose.
const OTHER_WORDS: [&str; 22] = [
    "target",
    "desired",
    "des",
    "d",
    "cmd",
    "command",
    "commanded",
    "c",
    "ref",
    "reference",
    "setpoint",
    "goal",
    "action",
    "velocity",
    "vel",
    "linear",
    "angular",
    "twist",
    "force",
    "torque",
    "acceleration",
    "wrench",
];

#[derive(Clone, Debug, PartialEq)]
pub enum Orientation {
    /// Pitch, roll, yaw: the y, x, z components of the rotation vector; 0 where absent.
    RotationVector([Option<Column>; 3]),
    /// w, x, y, z.
    Quaternion([Column; 4]),
    /// Entries of the rotation matrix, column by column.
    Matrix(Box<[Column; 9]>),
}

pub struct Pose {
    pub position: [Column; 3],
    pub orientation: Orientation,
    /// Named x, y, z as this tool writes them.
    pub is_plain: bool,
}

/// Axis and the words before it: `/tool/pose/position/x`, `tx`.
fn axis<'a>(field: &'a Field, axes: &[&'a str]) -> Option<(&'a str, Vec<&'a str>)> {
    let (last, before) = field.name.words.split_last()?;
    let mut before: Vec<&str> = before.iter().map(String::as_str).collect();
    if before.iter().any(|word| OTHER_WORDS.contains(word)) {
        return None;
    }
    if axes.contains(&last.as_str()) {
        return Some((last, before));
    }
    // Two letters in one: tx, px, qx.
    let (kind, axis) = last.split_at_checked(1)?;
    if !matches!(kind, "t" | "p" | "q") || !axes.contains(&axis) {
        return None;
    }
    before.push(kind);
    Some((axis, before))
}

/// The words that position and orientation of one pose have in common.
fn root<'a>(before: &[&'a str], kind: &[&str]) -> Option<Vec<&'a str>> {
    match before {
        [] => Some(Vec::new()),
        // EuRoC: p_RS_R_x and q_RS_w.
        [first, ..] if before.len() > 1 && matches!(*first, "p" | "q") && kind.contains(first) => {
            Some(Vec::new())
        }
        [path @ .., last] if kind.contains(last) => Some(path.to_vec()),
        _ => None,
    }
}

/// The words before an axis, and the columns that have them.
type Group<'a> = (Vec<&'a str>, Vec<(&'a str, &'a Field)>);

pub fn find(fields: &Fields) -> Result<Option<Pose>> {
    let mut groups: Vec<Group> = Vec::new();
    for field in &fields.all {
        let Some((axis, before)) = axis(field, &["x", "y", "z"]) else { continue };
        if root(&before, &POSITION_WORDS).is_none() {
            continue;
        }
        match groups.iter_mut().find(|(known, _)| *known == before) {
            Some((_, members)) => members.push((axis, field)),
            None => groups.push((before, vec![(axis, field)])),
        }
    }
    let is_whole = |members: &[(&str, &Field)]| {
        ["x", "y", "z"].iter().all(|axis| members.iter().any(|(other, _)| other == axis))
    };
    groups.retain(|(before, members)| before.is_empty() || is_whole(members));
    groups.sort_by_key(|(before, _)| before.len().min(1));
    let (arrays, at) = (arrays(fields)?, fields.at());
    match groups.as_slice() {
        [] => {
            if let [_, _, ..] = arrays.as_slice() {
                let (a, b) = (&arrays[0].position[0].name, &arrays[1].position[0].name);
                bail!(
                    "{at}: both {a} and {b} may be the position: say which with --columns x=NAME,y=…"
                );
            }
            Ok(arrays.into_iter().next())
        }
        [(a, first), (_, second), ..] if !a.is_empty() => bail!(
            "{at}: both {} and {} may be the position: say which with --columns x=NAME,y=…",
            first[0].1.text,
            second[0].1.text
        ),
        [(before, members), ..] => {
            let position = ["x", "y", "z"].map(|axis| one(fields, axis, members));
            let [x, y, z] = position;
            let orientation = orientation(fields, before)?;
            Ok(Some(Pose { position: [x?, y?, z?], orientation, is_plain: before.is_empty() }))
        }
    }
}

fn one(fields: &Fields, axis: &str, members: &[(&str, &Field)]) -> Result<Column> {
    let mut found = members.iter().filter(|(other, _)| *other == axis).map(|(_, field)| field);
    match (found.next(), found.next()) {
        (Some(first), Some(second)) => {
            let (first, second) = (&first.text, &second.text);
            bail!("{}: both {first} and {second} give {axis}: keep one", fields.at())
        }
        (Some(field), None) => fields.column(field, LENGTH),
        (None, _) => bail!(
            "{}: has no {axis}_m or {axis}_cm or {axis}_mm: name the column so, or say --columns \
             {axis}=NAME; {}",
            fields.at(),
            fields.listing()
        ),
    }
}

/// What turns the pose whose position stands behind the words `before`.
pub fn orientation(fields: &Fields, before: &[&str]) -> Result<Orientation> {
    let root_of_position = root(before, &POSITION_WORDS).unwrap_or_default();
    let belongs = |words: &[&str]| {
        let root = root(words, &ROTATION_WORDS);
        words == before || root.is_some_and(|root| root == root_of_position || root == before)
    };
    let (mut parts, mut angles) = ([None, None, None, None], [None, None, None]);
    for field in &fields.all {
        let quaternion = axis(field, &["w", "x", "y", "z"]).filter(|(_, words)| {
            let is_rotation = words.first() == Some(&"q")
                || words.last().is_some_and(|last| ROTATION_WORDS.contains(last));
            is_rotation && belongs(words)
        });
        if let Some((part, _)) = quaternion {
            let at = ["w", "x", "y", "z"].iter().position(|axis| *axis == part).unwrap_or(0);
            parts[at] = Some(fields.column(field, NONE)?);
        }
        let Some((last, words)) = field.name.words.split_last() else { continue };
        let words: Vec<&str> = words.iter().map(String::as_str).collect();
        let at = match last.as_str() {
            "pitch" | "ry" => 0,
            "roll" | "rx" => 1,
            "yaw" | "rz" => 2,
            _ => continue,
        };
        if words == root_of_position || belongs(&words) {
            angles[at] = Some(fields.column(field, ANGLE)?);
        }
    }
    let has_angles = angles.iter().any(Option::is_some);
    match (parts.iter().flatten().count(), has_angles) {
        (0, _) => Ok(Orientation::RotationVector(angles)),
        (4, false) => {
            Ok(Orientation::Quaternion(parts.map(|part| part.expect("four were counted"))))
        }
        (4, true) => {
            bail!("{}: holds a quaternion and pitch, roll or yaw: keep one of them", fields.at())
        }
        (n, _) => {
            bail!("{}: {n} of the columns qw,qx,qy,qz: a quaternion needs all four", fields.at())
        }
    }
}

/// Poses as numbered columns: `O_T_EE[0..15]`, column by column, and UR's `actual_TCP_pose_0..5`, position
/// and rotation vector.
fn arrays(fields: &Fields) -> Result<Vec<Pose>> {
    let mut poses = Vec::new();
    for Family { before, after, members } in families(fields) {
        let is_command = before.iter().any(|word| OTHER_WORDS.contains(word));
        let is_counted = members.iter().enumerate().all(|(i, (number, _))| *number == i);
        if is_command || !is_counted || !after.is_empty() {
            continue;
        }
        let at = |i: usize, units| fields.column(members[i].1, units);
        if before.ends_with(&["o", "t", "ee"]) && members.len() == 16 {
            let rotation = [0, 1, 2, 4, 5, 6, 8, 9, 10].map(|i| at(i, NONE));
            let rotation: Vec<Column> = rotation.into_iter().collect::<Result<_>>()?;
            let rotation = Box::new(rotation.try_into().expect("nine were taken"));
            let position = [at(12, LENGTH)?, at(13, LENGTH)?, at(14, LENGTH)?];
            let orientation = Orientation::Matrix(rotation);
            poses.push(Pose { position, orientation, is_plain: false });
        }
        if before.ends_with(&["tcp", "pose"]) && members.len() == 6 {
            let position = [at(0, LENGTH)?, at(1, LENGTH)?, at(2, LENGTH)?];
            let angles = [Some(at(4, ANGLE)?), Some(at(3, ANGLE)?), Some(at(5, ANGLE)?)];
            let orientation = Orientation::RotationVector(angles);
            poses.push(Pose { position, orientation, is_plain: false });
        }
    }
    Ok(poses)
}
