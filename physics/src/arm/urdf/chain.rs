//! The chain from base to tip: which joints it moves, which are held and where; and, without a
//! given tip, which chain of the file is its arm.

use std::collections::HashMap;

use super::document::{Joint, Kind, Link};
use super::finding::{Findings, UrdfError, UrdfFault};
use super::tree::Tree;
use super::{ArmSettings, HeldJoint};
use crate::arm::MAX_JOINTS;

/// A joint and the position it is held at, by name.
pub(super) type Positions<'a> = HashMap<&'a str, f64>;

/// The moving joints between base and tip. Everything that cannot be moved there is found.
pub(super) fn moving<'a>(
    tree: &Tree<'a>,
    tip: &str,
    settings: &ArmSettings,
    findings: &mut Findings,
) -> Result<Vec<&'a Joint>, UrdfError> {
    tree.expect_link("tip", tip)?;
    let path = tree.path(tip);
    let start = match &settings.base {
        None => 0,
        Some(base) => {
            tree.expect_link("base", base)?;
            let on_path = path.iter().position(|joint| joint.parent == *base);
            on_path.ok_or_else(|| UrdfFault::BaseBesideTip {
                base: base.clone(),
                tip: tip.into(),
                between: path.iter().map(|j| j.parent.as_str()).collect::<Vec<_>>().join(", "),
            })?
        }
    };
    check_held(tree, settings, findings);
    let is_held = |joint: &Joint| settings.held.contains_key(&joint.name);
    let on_chain = path[start..].iter().filter(|joint| joint.is_moving() && !is_held(joint));
    let (revolute, others): (Vec<&Joint>, Vec<&Joint>) =
        on_chain.copied().partition(|joint| joint.is_revolute());
    let base_beyond = |joint: &Joint| match path.last() {
        Some(last) if last.name != joint.name => {
            format!("or `base = \"{}\"` to begin the arm beyond it", joint.child)
        }
        _ => "or choose a tip before it".to_string(),
    };
    for joint in others {
        findings.fault(
            joint.line,
            UrdfFault::UnsupportedJoint {
                joint: joint.name.clone(),
                key: toml_key(&joint.name),
                kind: kind(joint),
                other: base_beyond(joint),
            },
        );
    }
    match revolute.len() {
        0 => {
            let line = tree.link(tip).map(|link| link.line);
            findings.fault(line, UrdfFault::NoMovingJoint(tip.into()));
        }
        1..=MAX_JOINTS => {}
        n => {
            let named = |j: &&Joint| format!("{} (line {})", j.name, j.line);
            let joints = revolute.iter().map(named).collect::<Vec<_>>().join(", ");
            let base = revolute[n - MAX_JOINTS].parent.clone();
            let line = revolute[MAX_JOINTS].line;
            findings.fault(line, UrdfFault::TooManyJoints { n, joints, base });
        }
    }
    Ok(revolute)
}

fn kind(joint: &Joint) -> String {
    match (&joint.mimic, joint.kind) {
        (Some(mimic), _) => format!("a mimic joint, which follows \"{}\"", mimic.joint),
        (None, kind) => format!("{kind:?}").to_lowercase(),
    }
}

/// A name as the key of a TOML table.
fn toml_key(name: &str) -> String {
    let is_bare = |c: char| c.is_ascii_alphanumeric() || c == '_' || c == '-';
    if !name.is_empty() && name.chars().all(is_bare) { name.into() } else { format!("{name:?}") }
}

/// `held` names joints that move, and puts them where they can be.
fn check_held(tree: &Tree, settings: &ArmSettings, findings: &mut Findings) {
    let moving = tree.robot.joints.iter().filter(|joint| joint.is_moving());
    let names = moving.map(|joint| joint.name.as_str()).collect::<Vec<_>>().join(", ");
    for (name, &position) in &settings.held {
        let joint = tree.robot.joints.iter().find(|joint| joint.name == *name);
        let problem = match joint {
            None => Some("does not exist"),
            Some(joint) if !joint.is_moving() => Some("is fixed"),
            Some(_) if !position.is_finite() => Some("needs a finite position, in rad or m"),
            Some(_) => None,
        };
        let line = joint.map(|joint| joint.line);
        if let Some(problem) = problem {
            let (joint, joints) = (name.clone(), names.clone());
            findings.fault(line, UrdfFault::CannotHold { joint, problem, joints });
            continue;
        }
        let (lower, upper) = range(joint.expect("checked"));
        if !(lower - 1e-9..=upper + 1e-9).contains(&position) {
            let joint = name.clone();
            findings.fault(line, UrdfFault::HeldOutOfRange { joint, position, lower, upper });
        }
    }
}

/// Where a joint beside the chain may be; anywhere if the file does not say.
fn range(joint: &Joint) -> (f64, f64) {
    let anywhere = (f64::NEG_INFINITY, f64::INFINITY);
    match (joint.kind, joint.limit.lower, joint.limit.upper) {
        (Kind::Continuous, ..) | (_, None, None) => anywhere,
        (_, lower, upper) => {
            let (lower, upper) = (lower.unwrap_or(0.0), upper.unwrap_or(0.0));
            if lower <= upper { (lower, upper) } else { anywhere }
        }
    }
}

/// Where every joint that is not on the chain is held: as `held` says, else as the joint it mimics
/// says, else at zero or the position nearest to it within its limits.
pub(super) fn hold<'a>(
    tree: &Tree<'a>,
    chain: &[&Joint],
    settings: &ArmSettings,
) -> (Positions<'a>, Vec<HeldJoint>) {
    let beside =
        |joint: &&Joint| joint.is_moving() && !chain.iter().any(|moving| moving.name == joint.name);
    let mut positions = HashMap::new();
    let joints: Vec<&Joint> = tree.robot.joints.iter().filter(beside).collect();
    for joint in &joints {
        let (lower, upper) = range(joint);
        let given = settings.held.get(&joint.name).copied();
        positions.insert(joint.name.as_str(), given.unwrap_or(0.0_f64.clamp(lower, upper)));
    }
    for joint in &joints {
        let Some(mimic) = &joint.mimic else { continue };
        if settings.held.contains_key(&joint.name) {
            continue;
        }
        // One that follows a joint of the chain would have to move: it stays as if that were at 0.
        let leader = positions.get(mimic.joint.as_str()).copied().unwrap_or(0.0);
        let position = mimic.multiplier * leader + mimic.offset;
        if position.is_finite() {
            positions.insert(joint.name.as_str(), position);
        }
    }
    let held = |joint: &&Joint| HeldJoint {
        joint: joint.name.clone(),
        line: joint.line,
        position: positions[joint.name.as_str()],
        is_linear: joint.kind == Kind::Prismatic,
        is_given: settings.held.contains_key(&joint.name),
    };
    let held = joints.iter().map(held).collect();
    (positions, held)
}

/// A chain that could be the arm.
#[derive(Debug, Clone, PartialEq)]
pub struct ChainCandidate {
    /// Link whose joints before it are held; none if the chain begins at the root.
    pub base: Option<String>,
    /// The outermost link that may be the tip.
    pub tip: String,
    /// Its joints, from base to tip.
    pub joints: Vec<String>,
}

/// The serial chains of revolute joints, longest first, then in the order of the file.
///
/// A chain ends where it branches into several of much the same length, as in a hand or at a torso;
/// a short branch beside a long one, as of a camera, does not end it.
pub(super) fn candidates(tree: &Tree) -> Vec<ChainCandidate> {
    let mut found: Vec<Vec<&Joint>> = Vec::new();
    walk(tree, tree.root, Vec::new(), &mut found);
    let mut candidates: Vec<ChainCandidate> = found
        .iter()
        .filter(|chain| !chain.is_empty())
        .map(|chain| {
            let used = &chain[chain.len().saturating_sub(MAX_JOINTS)..];
            let first = used[0];
            let path = tree.path(&first.parent);
            let is_at_root = path.iter().all(|joint| !joint.is_moving());
            ChainCandidate {
                base: (!is_at_root).then(|| first.parent.clone()),
                tip: outermost(tree, &used[used.len() - 1].child),
                joints: used.iter().map(|joint| joint.name.clone()).collect(),
            }
        })
        .collect();
    candidates.sort_by_key(|candidate| std::cmp::Reverse(candidate.joints.len()));
    candidates
}

/// Follows `chain` beyond the moving body of `link`, and begins new chains where it ends.
fn walk<'a>(
    tree: &Tree<'a>,
    link: &'a Link,
    chain: Vec<&'a Joint>,
    found: &mut Vec<Vec<&'a Joint>>,
) {
    let next = moving_joints(tree, link);
    let length = |joint: &&Joint| if joint.is_revolute() { reach(tree, joint) } else { 0 };
    let mut lengths: Vec<usize> = next.iter().map(length).collect();
    let longest = (0..next.len()).max_by_key(|&i| (lengths[i], std::cmp::Reverse(i)));
    lengths.sort_unstable();
    let on = match (longest, &lengths[..]) {
        (Some(i), [.., second, first]) => (*first >= 3 && *first >= second + 2).then_some(i),
        (Some(i), [first]) => (*first > 0).then_some(i),
        _ => None,
    };
    for (i, joint) in next.iter().enumerate() {
        let child = tree.link(&joint.child).expect("checked in new");
        match (joint.is_revolute(), on == Some(i)) {
            (true, true) => walk(tree, child, [&chain[..], &[joint]].concat(), found),
            (true, false) => walk(tree, child, vec![joint], found),
            (false, _) => walk(tree, child, Vec::new(), found),
        }
    }
    if on.is_none() {
        found.push(chain);
    }
}

/// The moving joints on the body of `link`, through its fixed ones.
fn moving_joints<'a>(tree: &Tree<'a>, link: &'a Link) -> Vec<&'a Joint> {
    let mut joints = Vec::new();
    let mut links = vec![link];
    while let Some(link) = links.pop() {
        for joint in tree.joints_of(link) {
            match joint.is_moving() {
                true => joints.push(joint),
                false => links.push(tree.link(&joint.child).expect("checked in new")),
            }
        }
    }
    joints.sort_by_key(|joint| joint.line);
    joints
}

/// Revolute joints in a row from `joint` on, along the longest way.
fn reach(tree: &Tree, joint: &Joint) -> usize {
    let child = tree.link(&joint.child).expect("checked in new");
    let next = moving_joints(tree, child);
    let beyond = next.iter().filter(|joint| joint.is_revolute()).map(|joint| reach(tree, joint));
    1 + beyond.max().unwrap_or(0)
}

/// Words in the names of links that carry tools, the more telling first.
const TOOL_WORDS: [&str; 8] =
    ["pan", "tcp", "tool", "end_effector", "ee_", "flange", "hand", "gripper"];
const SENSOR_WORDS: [&str; 6] = ["camera", "optical", "sensor", "imu", "laser", "ft_"];

/// The link furthest out on the body of `link`, one made for tools if its name says so.
fn outermost(tree: &Tree, link: &str) -> String {
    let mut links = vec![(0, tree.link(link).expect("the joint's child"))];
    let mut next = 0;
    while let Some(&(depth, link)) = links.get(next) {
        for joint in tree.joints_of(link).filter(|joint| !joint.is_moving()) {
            links.push((depth + 1, tree.link(&joint.child).expect("checked in new")));
        }
        next += 1;
    }
    let rank = |(depth, link): &(i32, &Link)| {
        let name = link.name.to_lowercase();
        let has = |words: &[&str]| words.iter().position(|word| name.contains(word));
        let tool = has(&TOOL_WORDS).map_or(0, |i| TOOL_WORDS.len() - i);
        (has(&SENSOR_WORDS).is_none(), name == "pan", tool, *depth)
    };
    let best = links.iter().rev().max_by_key(|link| rank(link));
    best.expect("the link itself").1.name.clone()
}
