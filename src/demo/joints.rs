//! Columns of joint positions, as recorders name them.

use anyhow::{Error, Result, anyhow, bail};

use super::cell;
use super::fields::{Column, Field, Fields};
use super::names::{ANGLE, words};

/// What joint positions are called before their number.
const POSITION_WORDS: [&str; 12] = [
    "q",
    "qpos",
    "joint",
    "joints",
    "position",
    "positions",
    "pos",
    "angle",
    "angles",
    "theta",
    "j",
    "axis",
];
/// What may stand after the number or the name of a joint.
const ENDINGS: [&str; 5] = ["position", "pos", "angle", "q", "value"];
/// What is commanded, or no position.
const OTHER_WORDS: [&str; 42] = [
    "target",
    "desired",
    "des",
    "d",
    "cmd",
    "command",
    "commanded",
    "commands",
    "ref",
    "reference",
    "setpoint",
    "goal",
    "action",
    "error",
    "err",
    "velocity",
    "velocities",
    "vel",
    "speed",
    "dq",
    "qd",
    "qdot",
    "ddq",
    "qdd",
    "acceleration",
    "accelerations",
    "acc",
    "effort",
    "efforts",
    "torque",
    "torques",
    "tau",
    "current",
    "currents",
    "temperature",
    "pose",
    "tcp",
    "ee",
    "eef",
    "tool",
    "cartesian",
    "translation",
];
/// What is measured comes before what may be a command.
const MEASURED_WORDS: [&str; 6] = ["actual", "measured", "msr", "meas", "state", "states"];

pub struct Joints {
    pub columns: Vec<Column>,
    /// Named q1, q2, … as this tool writes them.
    pub is_plain: bool,
    pub warning: Option<String>,
}

/// q1, q2, … of `names`' arm, or why columns that look so are not.
pub fn find(fields: &Fields, names: &[String]) -> Result<Option<Joints>, Error> {
    let named = by_name(fields, names)?;
    let mut families = families(fields);
    families.retain(|family| family.rank().is_some());
    families.sort_by_key(Family::rank);
    let plain = families.first().is_some_and(Family::is_plain);
    if let (Some(joints), false) = (named, plain) {
        return Ok(Some(joints));
    }
    let mut problem = None;
    let mut found: Vec<(usize, &Family, Joints)> = Vec::new();
    for family in &families {
        match family.joints(fields, names) {
            Ok(Some(joints)) => found.push((family.rank().unwrap_or(0), family, joints)),
            Ok(None) => {}
            Err(error) if family.is_plain() => return Err(error),
            Err(error) => problem = problem.or(Some(error)),
        }
    }
    if let [(rank, a, _), (other, b, _), ..] = found.as_slice()
        && rank == other
    {
        bail!(
            "{}: both {} and {} may be the joints: say which with --columns q1=NAME,q2=…",
            fields.at(),
            a.members[0].1.text,
            b.members[0].1.text
        );
    }
    match (found.into_iter().next(), problem) {
        (Some((_, _, joints)), _) => Ok(Some(joints)),
        (None, Some(problem)) => Err(problem),
        (None, None) => Ok(None),
    }
}

fn is_other(word: &str) -> bool {
    OTHER_WORDS.contains(&word)
}

/// Columns that carry the names of the arm's joints: `/joint_states/panda_joint1/position`.
fn by_name(fields: &Fields, names: &[String]) -> Result<Option<Joints>> {
    let mut columns = Vec::new();
    for name in names {
        let name = words(name);
        let matches = |field: &&Field| {
            let all = &field.name.words;
            let at = all.windows(name.len().max(1)).position(|window| window == name);
            let Some(at) = at else { return false };
            let (before, after) = (&all[..at], &all[at + name.len()..]);
            let ends = match after {
                [] => true,
                [ending] => ENDINGS.contains(&ending.as_str()),
                _ => false,
            };
            ends && !before.iter().chain(after).any(|word| is_other(word))
        };
        let found: Vec<&Field> = fields.all.iter().filter(matches).collect();
        match found.as_slice() {
            [field] => columns.push(fields.column(field, ANGLE)?),
            _ => return Ok(None),
        }
    }
    Ok(Some(Joints { columns, is_plain: false, warning: None }))
}

/// Columns whose names differ by one number: `actual_q_0`, `actual_q_1`, …
pub struct Family<'a> {
    pub before: Vec<&'a str>,
    pub after: Vec<&'a str>,
    /// Number and column, by their number.
    pub members: Vec<(usize, &'a Field)>,
}

/// By the last number in each name, in the order of the file.
pub fn families<'a>(fields: &'a Fields) -> Vec<Family<'a>> {
    let mut families: Vec<Family> = Vec::new();
    for field in &fields.all {
        let all = &field.name.words;
        let Some(at) = all.iter().rposition(|word| word.parse::<usize>().is_ok()) else { continue };
        let part = |words: &'a [String]| words.iter().map(String::as_str).collect::<Vec<&str>>();
        let (before, after) = (part(&all[..at]), part(&all[at + 1..]));
        let member = (all[at].parse().unwrap_or(usize::MAX), field);
        let known = families.iter_mut().find(|f| f.before == before && f.after == after);
        match known {
            Some(family) => family.members.push(member),
            None => families.push(Family { before, after, members: vec![member] }),
        }
    }
    families.iter_mut().for_each(|family| family.members.sort_by_key(|(number, _)| *number));
    families
}

impl Family<'_> {
    fn is_plain(&self) -> bool {
        self.before == ["q"] && self.after.is_empty()
    }

    fn is_lerobot(&self) -> bool {
        self.before == ["observation", "state"] && self.after.is_empty()
    }

    /// How surely these are measured joint positions; the lowest is surest.
    fn rank(&self) -> Option<usize> {
        let all = || self.before.iter().chain(&self.after);
        if all().any(|word| OTHER_WORDS.contains(word)) {
            return None;
        }
        let ends_well = match self.after.as_slice() {
            [] => true,
            [ending] => ENDINGS.contains(ending),
            _ => false,
        };
        let last = self.before.iter().rfind(|word| !MEASURED_WORDS.contains(word))?;
        let is_position = match *last {
            "j" | "axis" => self.before.len() == 1,
            word => POSITION_WORDS.contains(&word) || self.is_lerobot(),
        };
        if !ends_well || !is_position {
            return None;
        }
        let is_measured = all().any(|word| MEASURED_WORDS.contains(word));
        Some(if self.is_plain() { 0 } else { 2 - usize::from(is_measured) })
    }

    /// As many columns as the arm has joints; counted from 0 or from 1.
    fn joints(&self, fields: &Fields, names: &[String]) -> Result<Option<Joints>> {
        let n = names.len();
        let is_plain = self.is_plain();
        let base = usize::from(self.members[0].0 > 0);
        let member = |i: usize| self.members.iter().find(|(number, _)| *number == i + base);
        for pair in self.members.windows(2) {
            let ((a, first), (b, second)) = (&pair[0], &pair[1]);
            if a == b {
                let (first, second) = (&first.text, &second.text);
                bail!("{}: both {first} and {second} give q{a}: keep one", fields.at());
            }
        }
        if let Some(ordered) = self.by_recorded_names(fields, names)? {
            return Ok(Some(ordered));
        }
        let mut warning = None;
        if let Some((_, extra)) = self.members.iter().find(|(number, _)| *number >= n + base) {
            if !(self.is_lerobot() && self.members.len() == n + 1) {
                bail!(
                    "{}: column {}, but the arm has {n} joints: choose the arm of the recording with \
                     --config (plant.arm, plant.tip), or say which columns are its joints with \
                     --columns q1=NAME,q2=…",
                    fields.at(),
                    extra.text
                );
            }
            warning = Some(format!("{} is taken as the gripper and left out", extra.text));
        }
        let mut columns = Vec::new();
        for i in 0..n {
            match member(i) {
                Some((_, field)) => columns.push(fields.column(field, ANGLE)?),
                None if is_plain => {
                    let missing = i + base;
                    bail!(
                        "{}: has no q{missing}_rad or q{missing}_deg, and the arm has {n} joints: name the \
                         column so, or say --columns q{}=NAME; {}",
                        fields.at(),
                        i + 1,
                        fields.listing()
                    );
                }
                None => return Ok(None),
            }
        }
        Ok(Some(Joints { columns, is_plain, warning }))
    }

    /// A joint state lists its names in columns of their own (`field.name0`), often not in the order of
    /// the arm.
    fn by_recorded_names(&self, fields: &Fields, names: &[String]) -> Result<Option<Joints>> {
        let Some((_, path)) = self.before.split_last() else { return Ok(None) };
        let is_names = |field: &&Field| {
            let [before @ .., last, _] = &field.name.words[..] else { return false };
            before == path && (last == "name" || last == "names")
        };
        let cells = &fields.table.rows[0].cells;
        let text = |field: &Field| {
            let cell = cells.get(field.index).unwrap_or_default();
            let items = field.element.and_then(|at| cell::list(cell)?.get(at).copied());
            cell::bare(items.unwrap_or(cell)).to_string()
        };
        let recorded: Vec<(String, String)> = (fields.all.iter().filter(is_names))
            .filter_map(|field| Some((field.name.words.last()?.clone(), text(field))))
            .collect();
        if recorded.is_empty() {
            return Ok(None);
        }
        let mut columns = Vec::new();
        for name in names {
            let Some((number, _)) = recorded.iter().find(|(_, recorded)| recorded == name) else {
                break;
            };
            let number: usize = number.parse().unwrap_or(usize::MAX);
            match self.members.iter().find(|(member, _)| *member == number) {
                Some((_, field)) => columns.push(fields.column(field, ANGLE)?),
                None => break,
            }
        }
        if columns.len() == names.len() {
            return Ok(Some(Joints { columns, is_plain: false, warning: None }));
        }
        let recorded: Vec<String> = recorded.into_iter().map(|(_, name)| name).collect();
        Err(anyhow!(
            "{}: the joints in it are called {}, those of the arm {}: choose the arm with --config \
             (plant.arm, plant.tip), or say which is which with --columns q1={},q2=…",
            fields.at(),
            recorded.join(", "),
            names.join(", "),
            self.members[0].1.text
        ))
    }
}
