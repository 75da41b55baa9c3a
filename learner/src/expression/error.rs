//! Why a text is no expression, and why an expression has no value; both point into the text.

use std::fmt;
use std::ops::Range;

use thiserror::Error;

use super::Kind;

/// The longest text.
pub const MAX_BYTES: usize = 4096;
/// The deepest nesting. A sum of n terms is n deep, as it is (((a + b) + c) + …).
pub const MAX_DEPTH: usize = 200;

/// Why a text was refused.
#[derive(Clone, Debug, PartialEq, Error)]
pub enum ParseFault {
    #[error("{bytes} bytes of text: at most {MAX_BYTES}")]
    TooLong { bytes: usize },
    #[error("nested more than {MAX_DEPTH} deep; a sum of n terms counts as n")]
    TooDeep,
    /// Something else must stand here.
    #[error("expected {expected}, found {}{}", token(.found), hint(.instead))]
    Syntax { expected: &'static str, found: String, instead: Option<&'static str> },
    #[error("comparisons do not chain: write `a < b and b < c`")]
    Chained,
    /// Neither a measure nor a constant.
    #[error("there is no measure `{name}`{}", did_you_mean(.nearest))]
    UnknownName { name: String, nearest: Option<String> },
    #[error("there is no function `{name}`{}", did_you_mean(.nearest))]
    UnknownFunction { name: String, nearest: Option<String> },
    /// A measure that cannot be told from a constant.
    #[error("`{name}` is a constant and a measure: rename the measure")]
    Ambiguous { name: String },
    /// A function without its parentheses.
    #[error("`{function}` is a function: write `{function}(…)`")]
    NoArguments { function: String },
    #[error("`{function}` takes {takes} {}, not {found}", arguments(.takes))]
    Arguments { function: String, takes: usize, found: usize },
    /// An operand, or the whole, is of the wrong kind.
    #[error("{what} is a {found}, not a {wanted}{}", convert(.wanted))]
    Kind { what: String, found: Kind, wanted: Kind },
    /// A part without measures that has no value.
    #[error(transparent)]
    Constant(#[from] EvalFault),
}

/// Why an evaluation stopped.
#[derive(Clone, Copy, Debug, PartialEq, Error)]
pub enum EvalFault {
    #[error("division by zero")]
    DivisionByZero,
    /// A measure, or the result of an operator or a function.
    #[error("the value is {value}")]
    NotFinite { value: f64 },
    /// Bounds of `clamp` in the wrong order.
    #[error("the lower bound {low:?} is above the upper bound {high:?}")]
    Bounds { low: f64, high: f64 },
    /// A measure that should be one.
    #[error("the value is {value:?}, neither 0 (false) nor 1 (true)")]
    NoTruthValue { value: f64 },
}

/// A text that was refused: what is wrong, where, and which measures there are.
#[derive(Clone, Debug, PartialEq)]
pub struct ParseError {
    pub fault: ParseFault,
    pub place: Place,
    /// Names and kinds of all measures.
    pub measures: Vec<(String, Kind)>,
}

/// An evaluation that stopped: why, where, and the measures that occur in the text.
#[derive(Clone, Debug, PartialEq)]
pub struct EvalError {
    pub fault: EvalFault,
    pub place: Place,
    /// Names and values.
    pub measures: Vec<(String, f64)>,
}

/// A part of a text.
#[derive(Clone, Debug, PartialEq)]
pub struct Place {
    text: String,
    span: Range<usize>,
}

impl Place {
    pub(super) fn new(text: &str, span: Range<usize>) -> Place {
        Place { text: text.to_string(), span }
    }

    /// Line and column, counted in characters, both from 1.
    pub fn line_and_column(&self) -> (usize, usize) {
        let before = &self.text[..self.span.start];
        let column = before.chars().rev().take_while(|c| *c != '\n').count();
        (before.matches('\n').count() + 1, column + 1)
    }

    /// The operator, name or part itself.
    pub fn part(&self) -> &str {
        &self.text[self.span.clone()]
    }
}

/// Line and column, then the line itself and carets below the part that is meant.
impl fmt::Display for Place {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let (number, column) = self.line_and_column();
        let line = self.text.split('\n').nth(number - 1).unwrap_or_default();
        // Tabs would move the carets, and other control characters the cursor.
        let line: String = line.chars().map(|c| if c.is_control() { ' ' } else { c }).collect();
        let first_line = self.part().split('\n').next().unwrap_or_default();
        let carets = "^".repeat(first_line.trim_end().chars().count().max(1));
        let indent = " ".repeat(column - 1);
        write!(f, " (line {number}, column {column})\n  {}\n  {indent}{carets}", line.trim_end())
    }
}

impl fmt::Display for ParseError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}", self.fault)?;
        if !matches!(self.fault, ParseFault::TooLong { .. }) {
            write!(f, "{}", self.place)?;
        }
        let name = |(name, kind): &(String, Kind)| match kind {
            Kind::Number => name.clone(),
            Kind::Truth => format!("{name} (truth value)"),
        };
        match self.measures.iter().map(name).collect::<Vec<_>>().join(", ") {
            none if none.is_empty() => write!(f, "\nthere are no measures"),
            names => write!(f, "\nmeasures: {names}"),
        }
    }
}

impl fmt::Display for EvalError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "`{}`: {}{}", self.place.part(), self.fault, self.place)?;
        let value = |(name, value): &(String, f64)| format!("{name} = {value:?}");
        match self.measures.iter().map(value).collect::<Vec<_>>().join(", ") {
            none if none.is_empty() => Ok(()),
            values => write!(f, "\nwith {values}"),
        }
    }
}

impl std::error::Error for ParseError {}
impl std::error::Error for EvalError {}

fn token(found: &str) -> String {
    if found.is_empty() { "the end".into() } else { format!("`{}`", found.escape_debug()) }
}

fn hint(instead: &Option<&str>) -> String {
    instead.map_or_else(String::new, |instead| format!("; write `{instead}`"))
}

fn did_you_mean(nearest: &Option<String>) -> String {
    nearest.as_ref().map_or_else(String::new, |nearest| format!("; did you mean `{nearest}`?"))
}

fn arguments(takes: &usize) -> &'static str {
    if *takes == 1 { "argument" } else { "arguments" }
}

fn convert(wanted: &Kind) -> &'static str {
    match wanted {
        Kind::Number => "; `if(condition, 1, 0)` makes a number of it",
        Kind::Truth => "; compare it, as in `x > 0`",
    }
}
