//! Expressions over measures: the reward and the success that a configuration writes as text.
//!
//! ```
//! use learner::expression::{Expression, Kind};
//!
//! let measures = [("apex_m", Kind::Number), ("caught", Kind::Truth)];
//! let text = "1.5*min(apex_m, 0.55) + if(caught, 1, 0)";
//! let reward = Expression::parse(text, &measures, Kind::Number)?;
//! assert_eq!(reward.number(&[0.4, 1.0])?, 1.5 * 0.4 + 1.0);
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
//!
//! There are numbers (f64, `1/2` is 0.5) and truth values. From the loosest to the tightest:
//!
//! | operators | take | give |
//! |---|---|---|
//! | `or`, then `and`, then `not` | truth values | a truth value |
//! | `<` `<=` `>` `>=` | numbers | a truth value |
//! | `==` `!=` | two of one kind | a truth value |
//! | `+` `-`, then `*` `/`, then `-x`, then `^` | numbers | a number |
//!
//! `^` is the power and groups from the right (`-x^2` is `-(x^2)`, `2^3^2` is `2^(3^2)`), the
//! others group from the left; comparisons do not chain. Functions: `min(a, b)`, `max(a, b)`,
//! `clamp(x, low, high)`, `abs`, `floor`, `exp`, `ln`, `sqrt`, `sin`, `cos`, and
//! `if(condition, a, b)`. Constants: `pi`, `e`, `true`, `false`. Text may have several lines.
//!
//! Only what decides is evaluated: one branch of `if`, and the right side of `and` and `or` only
//! where the left one leaves it open. Everything else is evaluated as Rust evaluates the same
//! formula (`x.min(y)`, `x.powf(y)`, `x.exp()`, …), to the last bit. Every part that is evaluated
//! must be finite; the first that is not stops the evaluation.

mod error;
mod parse;
mod tree;

use std::fmt;

pub use error::{EvalError, EvalFault, MAX_BYTES, MAX_DEPTH, ParseError, ParseFault};

use error::Place;
use tree::{Node, Op};

/// What an expression, or a measure, is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Kind {
    Number,
    /// As a measure: 0 is false, 1 is true.
    Truth,
}

impl fmt::Display for Kind {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Kind::Number => "number",
            Kind::Truth => "truth value",
        })
    }
}

/// A parsed text. Its value is a pure function of the measures.
#[derive(Clone, Debug)]
pub struct Expression {
    text: String,
    root: Node,
    /// Names of all measures, in the order of the values.
    measures: Vec<String>,
}

impl Expression {
    /// Parses `text` over `measures`, names with their kinds; the result must be of `kind`.
    ///
    /// A part without measures that has no value, as `1/0`, is an error already here, unless it
    /// stands where it may never be evaluated.
    pub fn parse(
        text: &str,
        measures: &[(&str, Kind)],
        kind: Kind,
    ) -> Result<Expression, ParseError> {
        let root = parse::parse(text, measures, kind)?;
        let measures = measures.iter().map(|(name, _)| name.to_string()).collect();
        Ok(Expression { text: text.to_string(), root, measures })
    }

    /// The value of an expression of kind `Number`: finite. `values` stand in the order of the
    /// measures.
    ///
    /// # Panics
    /// If the expression is of the other kind, or there are not as many values as measures.
    pub fn number(&self, values: &[f64]) -> Result<f64, EvalError> {
        assert_eq!(self.root.kind, Kind::Number, "{}", self.text);
        self.value(values)
    }

    /// The value of an expression of kind `Truth`, otherwise as [`Expression::number`].
    pub fn truth(&self, values: &[f64]) -> Result<bool, EvalError> {
        assert_eq!(self.root.kind, Kind::Truth, "{}", self.text);
        Ok(self.value(values)? != 0.0)
    }

    /// What an expression of kind `Number` is the sum of: text and value of each summand, in order, a subtracted one
    /// with a minus before it. Nothing where one has no value.
    pub fn summands(&self, values: &[f64]) -> Vec<(String, f64)> {
        let mut summands = Vec::new();
        self.root.summands(1.0, &mut summands);
        let valued = summands.into_iter().map(|(sign, node)| {
            let text =
                self.text[node.span.clone()].split_whitespace().collect::<Vec<_>>().join(" ");
            let text = if sign < 0.0 { format!("−{text}") } else { text };
            node.value(values).ok().map(|value| (text, sign * value))
        });
        valued.collect::<Option<_>>().unwrap_or_default()
    }

    pub fn n_measures(&self) -> usize {
        self.measures.len()
    }

    /// Names of the measures that it speaks of.
    pub fn occurring(&self) -> Vec<&str> {
        self.indices().into_iter().map(|i| self.measures[i].as_str()).collect()
    }

    fn indices(&self) -> Vec<usize> {
        let mut occurring = Vec::new();
        self.root.visit(&mut |node| {
            if let Op::Measure(i) = node.op
                && !occurring.contains(&i)
            {
                occurring.push(i);
            }
        });
        occurring
    }

    /// The text as it was written.
    pub fn text(&self) -> &str {
        &self.text
    }

    fn value(&self, values: &[f64]) -> Result<f64, EvalError> {
        assert_eq!(values.len(), self.measures.len(), "one value a measure");
        self.root.value(values).map_err(|stop| {
            let value = |i: usize| (self.measures[i].clone(), values[i]);
            let place = Place::new(&self.text, stop.mark);
            let measures = self.indices().into_iter().map(value).collect();
            EvalError { fault: stop.fault, place, measures }
        })
    }
}

#[cfg(test)]
mod tests;
