//! The typed tree of an expression, and its value.

use std::ops::Range;

use super::Kind::{self, Number, Truth};
use super::error::EvalFault;

#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Op {
    Number(f64),
    Truth(bool),
    /// Index among the measures.
    Measure(usize),
    If,
    Or,
    And,
    Not,
    Less,
    AtMost,
    Greater,
    AtLeast,
    Equal,
    Unequal,
    Add,
    Subtract,
    Multiply,
    Divide,
    Negate,
    Power,
    Min,
    Max,
    Clamp,
    Abs,
    Floor,
    Exp,
    Ln,
    Sqrt,
    Sin,
    Cos,
}

#[derive(Clone, Debug)]
pub(super) struct Node {
    pub op: Op,
    pub operands: Vec<Node>,
    pub kind: Kind,
    /// 1 and the height of the highest operand.
    pub height: usize,
    /// Bytes of the text: all of it, and its operator or name.
    pub span: Range<usize>,
    pub mark: Range<usize>,
}

/// Where an evaluation stopped, and why.
pub(super) struct Stop {
    pub mark: Range<usize>,
    pub fault: EvalFault,
}

impl Op {
    /// The kind of the result; else the first operand that does not fit, and the kind it should
    /// have. Measures have the kind of their unit and are not asked for here.
    pub fn kind(self, operands: &[Node]) -> Result<Kind, (usize, Kind)> {
        let wanted = |i: usize| match self {
            Op::And | Op::Or | Op::Not => Truth,
            Op::If if i == 0 => Truth,
            Op::If => operands[1].kind,
            Op::Equal | Op::Unequal => operands[0].kind,
            _ => Number,
        };
        if let Some(i) = (0..operands.len()).find(|&i| operands[i].kind != wanted(i)) {
            return Err((i, wanted(i)));
        }
        Ok(match self {
            Op::Truth(_) | Op::And | Op::Or | Op::Not => Truth,
            Op::Less | Op::AtMost | Op::Greater | Op::AtLeast | Op::Equal | Op::Unequal => Truth,
            Op::If => operands[1].kind,
            _ => Number,
        })
    }

    fn is_lazy(self) -> bool {
        matches!(self, Op::If | Op::And | Op::Or)
    }
}

impl Node {
    /// The value, finite; truth values are 0 and 1. Kinds were checked when the node was made.
    pub fn value(&self, values: &[f64]) -> Result<f64, Stop> {
        let operand = |i: usize| self.operands[i].value(values);
        let holds = |i: usize| Ok(operand(i)? != 0.0);
        let value = match self.op {
            Op::Number(number) => number,
            Op::Truth(truth) => f64::from(truth),
            Op::Measure(i) if self.kind == Truth && values[i] != 0.0 && values[i] != 1.0 => {
                return Err(self.stop(EvalFault::NoTruthValue { value: values[i] }));
            }
            Op::Measure(i) => values[i],
            Op::If => operand(if holds(0)? { 1 } else { 2 })?,
            Op::Or => f64::from(holds(0)? || holds(1)?),
            Op::And => f64::from(holds(0)? && holds(1)?),
            Op::Not => f64::from(!holds(0)?),
            Op::Less => f64::from(operand(0)? < operand(1)?),
            Op::AtMost => f64::from(operand(0)? <= operand(1)?),
            Op::Greater => f64::from(operand(0)? > operand(1)?),
            Op::AtLeast => f64::from(operand(0)? >= operand(1)?),
            Op::Equal => f64::from(operand(0)? == operand(1)?),
            Op::Unequal => f64::from(operand(0)? != operand(1)?),
            Op::Add => operand(0)? + operand(1)?,
            Op::Subtract => operand(0)? - operand(1)?,
            Op::Multiply => operand(0)? * operand(1)?,
            Op::Divide => match (operand(0)?, operand(1)?) {
                (_, 0.0) => return Err(self.stop(EvalFault::DivisionByZero)),
                (a, b) => a / b,
            },
            Op::Negate => -operand(0)?,
            Op::Power => operand(0)?.powf(operand(1)?),
            Op::Min => operand(0)?.min(operand(1)?),
            Op::Max => operand(0)?.max(operand(1)?),
            Op::Clamp => match (operand(0)?, operand(1)?, operand(2)?) {
                (_, low, high) if low > high => {
                    return Err(self.stop(EvalFault::Bounds { low, high }));
                }
                (x, low, high) => x.clamp(low, high),
            },
            Op::Abs => operand(0)?.abs(),
            Op::Floor => operand(0)?.floor(),
            Op::Exp => operand(0)?.exp(),
            Op::Ln => operand(0)?.ln(),
            Op::Sqrt => operand(0)?.sqrt(),
            Op::Sin => operand(0)?.sin(),
            Op::Cos => operand(0)?.cos(),
        };
        if value.is_finite() { Ok(value) } else { Err(self.stop(EvalFault::NotFinite { value })) }
    }

    fn stop(&self, fault: EvalFault) -> Stop {
        Stop { mark: self.mark.clone(), fault }
    }

    /// Evaluates what no measure can change, so that `1/0` is found before anything runs. Parts that
    /// may never be evaluated are left alone. Says whether no measure occurs.
    pub fn check_constants(&self) -> Result<bool, Stop> {
        let always = if self.op.is_lazy() { &self.operands[..1] } else { &self.operands[..] };
        let mut constant = !self.op.is_lazy() && !matches!(self.op, Op::Measure(_));
        for operand in always {
            constant &= operand.check_constants()?;
        }
        if constant {
            self.value(&[])?;
        }
        Ok(constant)
    }

    /// The nodes that this one is the sum of, each with its sign.
    pub fn summands<'a>(&'a self, sign: f64, found: &mut Vec<(f64, &'a Node)>) {
        match self.op {
            Op::Add | Op::Subtract => {
                self.operands[0].summands(sign, found);
                let second = if self.op == Op::Add { sign } else { -sign };
                self.operands[1].summands(second, found);
            }
            _ => found.push((sign, self)),
        }
    }

    /// Calls `see` with this node and all below it, in the order of the text.
    pub fn visit(&self, see: &mut impl FnMut(&Node)) {
        see(self);
        self.operands.iter().for_each(|operand| operand.visit(see));
    }
}
