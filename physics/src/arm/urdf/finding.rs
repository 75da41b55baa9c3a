//! What is wrong with a URDF, where, and what to write instead: all of it at once.

use std::fmt;
use std::path::PathBuf;

use crate::arm::MAX_JOINTS;

/// One fault that keeps a URDF from being an arm we can compute with.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum UrdfFault {
    /// The text is not well-formed XML.
    #[error("not readable as XML: {0}; correct it, or export the file again")]
    Xml(String),
    /// XML, but of another kind.
    #[error("the root element is <{root}>, not <robot>; {advice}")]
    NotUrdf { root: String, advice: &'static str },
    /// A source of xacro, which is to be expanded first.
    #[error("this is xacro, which makes URDF; run `xacro {{file}} > arm.urdf` and use arm.urdf")]
    Xacro,
    /// A required attribute or element is missing.
    #[error("{place} has no {what}; add it")]
    Missing { place: String, what: &'static str },
    /// An attribute is not the numbers it should be.
    #[error("{place}: {attribute}=\"{value}\" is not {expected}; correct it")]
    NotANumber { place: String, attribute: &'static str, value: String, expected: &'static str },
    /// A number is infinite or not a number.
    #[error("{0} is not finite; replace it by a number")]
    NotFinite(String),
    /// Two links or two joints have one name.
    #[error("the name \"{0}\" is used twice; give every link and every joint its own name")]
    DuplicateName(String),
    /// A joint refers to a link that does not exist.
    #[error("joint \"{joint}\" refers to the unknown link \"{link}\"; add the link or correct it")]
    UnknownLink { joint: String, link: String },
    /// More joints than any robot has.
    #[error("the file has {0} joints, at most {max} are read; give the part with the arm", max = super::MAX_FILE_JOINTS)]
    TooLarge(usize),
    /// The links do not form one tree.
    #[error("the links do not form one tree: {0}; every link but one needs exactly one parent")]
    NotATree(String),
    /// The requested tip or base is not a link.
    #[error("there is no link \"{link}\" to be the {role}; the links are {links}")]
    NoSuchLink { role: &'static str, link: String, links: String },
    /// The base does not carry the tip.
    #[error(
        "the base \"{base}\" does not carry the tip \"{tip}\"; choose a link between {between}"
    )]
    BaseBesideTip { base: String, tip: String, between: String },
    /// Nothing moves.
    #[error("no revolute joint leads to the tip \"{0}\"; choose a tip further out")]
    NoMovingJoint(String),
    /// A joint on the chain is of a kind this arm cannot have.
    #[error(
        "joint \"{joint}\" on the chain to the tip is {kind}; write `held = {{ {key} = 0.0 }}` in \
         [plant] to hold it, {other}"
    )]
    UnsupportedJoint { joint: String, key: String, kind: String, other: String },
    /// The chain is too long.
    #[error(
        "the chain to the tip has {n} revolute joints, at most {MAX_JOINTS} are supported: {joints}; \
         write `base = \"{base}\"` in [plant] to hold the first ones, or name others in `held`"
    )]
    TooManyJoints { n: usize, joints: String, base: String },
    /// `held` names a joint that is not there or does not move.
    #[error("held names the joint \"{joint}\", which {problem}; the moving joints are {joints}")]
    CannotHold { joint: String, problem: &'static str, joints: String },
    /// `held` asks for a position beyond the limits.
    #[error("held puts joint \"{joint}\" at {position}; it moves within {lower}..={upper}")]
    HeldOutOfRange { joint: String, position: f64, lower: f64, upper: f64 },
    /// A list of the configuration has not one number a joint.
    #[error(
        "{field} has {found} numbers, the chain has {expected} joints ({joints}): give one each"
    )]
    WrongCount { field: &'static str, found: usize, expected: usize, joints: String },
    /// A number of the configuration is no limit.
    #[error("{field} holds {value} for joint \"{joint}\"; use a number greater than zero")]
    NotPositive { field: &'static str, joint: String, value: f64 },
    /// Nothing in the file says what the arm weighs.
    #[error(
        "the arm's dynamics are not given: no moving link of {links} has an <inertial>; use the \
         manufacturer's description with masses and inertias, or add them"
    )]
    NoDynamics { links: String },
    /// A moving body has a shape but no mass, or nothing resists its joint.
    #[error("link \"{link}\" {reason}; give it an <inertial> with its mass and tensor")]
    NoInertia { link: String, reason: &'static str },
    /// A mass is zero or negative.
    #[error("link \"{link}\" has mass {mass} kg; it must be greater than zero")]
    NonPositiveMass { link: String, mass: f64 },
    /// The inertia tensor cannot belong to a body.
    #[error("link \"{link}\" has an impossible inertia tensor: {reason}; correct its <inertia>")]
    ImpossibleInertia { link: String, reason: &'static str },
    /// The axis of a joint has no direction.
    #[error("joint \"{0}\" has an axis of zero or non-finite length; give <axis xyz> a direction")]
    InvalidAxis(String),
    /// A limit is missing or makes no sense.
    #[error("joint \"{joint}\": {reason}; {remedy}")]
    InvalidLimit { joint: String, reason: String, remedy: &'static str },
}

/// A fault and its place.
#[derive(Debug, Clone, PartialEq)]
pub struct Finding {
    /// Line of the element in the file, from 1; none where no single line is to blame.
    pub line: Option<u32>,
    /// What is wrong.
    pub fault: UrdfFault,
}

impl fmt::Display for Finding {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self.line {
            Some(line) => write!(f, "line {line}: {}", self.fault),
            None => write!(f, "{}", self.fault),
        }
    }
}

/// Something assumed or left out in reading a URDF that the user should know of.
#[derive(Debug, Clone, PartialEq)]
pub struct Note {
    /// Line of the first element it is about, from 1.
    pub line: Option<u32>,
    /// What was assumed, and where to say otherwise.
    pub text: String,
}

impl fmt::Display for Note {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self.line {
            Some(line) => write!(f, "line {line}: {}", self.text),
            None => write!(f, "{}", self.text),
        }
    }
}

/// Why a URDF is not an arm we can compute with: everything that was found, never nothing.
#[derive(Debug, Clone, PartialEq)]
pub struct UrdfError {
    /// In the order of the file.
    pub findings: Vec<Finding>,
}

impl fmt::Display for UrdfError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        if let [finding] = &self.findings[..] {
            return write!(f, "{finding}");
        }
        write!(f, "{} faults", self.findings.len())?;
        self.findings.iter().try_for_each(|finding| write!(f, "\n  {finding}"))
    }
}

impl std::error::Error for UrdfError {}

impl From<UrdfFault> for UrdfError {
    fn from(fault: UrdfFault) -> Self {
        UrdfError { findings: vec![Finding { line: None, fault }] }
    }
}

/// Why a URDF file could not be loaded. The text holds the cause: `source` would repeat it.
#[derive(Debug, thiserror::Error)]
pub enum UrdfFileError {
    /// The file could not be read.
    #[error("cannot read the URDF {}: {cause}; check the path", path.display())]
    Read { path: PathBuf, cause: std::io::Error },
    /// The file does not describe an arm.
    #[error("{}: {error}", path.display())]
    Invalid { path: PathBuf, error: UrdfError },
}

/// Collects what is found, so that one run names everything.
#[derive(Debug, Default)]
pub(super) struct Findings {
    faults: Vec<Finding>,
    notes: Vec<Note>,
}

impl Findings {
    pub fn fault(&mut self, line: impl Into<Option<u32>>, fault: UrdfFault) {
        self.faults.push(Finding { line: line.into(), fault });
    }

    pub fn note(&mut self, line: impl Into<Option<u32>>, text: impl Into<String>) {
        self.notes.push(Note { line: line.into(), text: text.into() });
    }

    /// One note about several elements, each with its line.
    pub fn note_all(&mut self, lines: &[u32], text: impl Into<String>) {
        let others = match lines {
            [] | [_] => String::new(),
            [_, other] => format!(" (also line {other})"),
            [_, others @ ..] => {
                let others: Vec<String> = others.iter().map(u32::to_string).collect();
                format!(" (also lines {})", others.join(", "))
            }
        };
        self.note(lines.first().copied(), text.into() + &others);
    }

    /// The error, if there is a fault so far.
    pub fn check(&mut self) -> Result<(), UrdfError> {
        if self.faults.is_empty() {
            return Ok(());
        }
        let mut findings = std::mem::take(&mut self.faults);
        findings.sort_by_key(|finding| finding.line);
        findings.dedup_by(|a, b| a.fault == b.fault);
        Err(UrdfError { findings })
    }

    pub fn into_notes(self) -> Vec<Note> {
        self.notes
    }
}
