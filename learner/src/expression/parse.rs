//! Text → typed tree, by precedence climbing over tokens.

use std::ops::Range;

use winnow::ascii::{digit0, digit1};
use winnow::combinator::{alt, opt, terminated};
use winnow::error::EmptyError;
use winnow::prelude::*;
use winnow::stream::LocatingSlice;
use winnow::token::{any, one_of, take_while};

use super::Kind;
use super::error::{MAX_BYTES, MAX_DEPTH, ParseError, ParseFault, Place};
use super::tree::{Node, Op};

/// Operators between two operands, with their precedence: the higher, the tighter.
const INFIX: [(&str, Op, u8); 13] = [
    ("or", Op::Or, 1),
    ("and", Op::And, 2),
    ("<=", Op::AtMost, COMPARISON),
    (">=", Op::AtLeast, COMPARISON),
    ("==", Op::Equal, COMPARISON),
    ("!=", Op::Unequal, COMPARISON),
    ("<", Op::Less, COMPARISON),
    (">", Op::Greater, COMPARISON),
    ("+", Op::Add, 5),
    ("-", Op::Subtract, 5),
    ("*", Op::Multiply, 6),
    ("/", Op::Divide, 6),
    ("^", Op::Power, POWER),
];
const NOT: u8 = 3;
const COMPARISON: u8 = 4;
const NEGATE: u8 = 7;
const POWER: u8 = 8;

const FUNCTIONS: [(&str, Op, usize); 11] = [
    ("if", Op::If, 3),
    ("min", Op::Min, 2),
    ("max", Op::Max, 2),
    ("clamp", Op::Clamp, 3),
    ("abs", Op::Abs, 1),
    ("floor", Op::Floor, 1),
    ("exp", Op::Exp, 1),
    ("ln", Op::Ln, 1),
    ("sqrt", Op::Sqrt, 1),
    ("sin", Op::Sin, 1),
    ("cos", Op::Cos, 1),
];

const CONSTANTS: [(&str, Op); 4] = [
    ("pi", Op::Number(std::f64::consts::PI)),
    ("e", Op::Number(std::f64::consts::E)),
    ("true", Op::Truth(true)),
    ("false", Op::Truth(false)),
];

/// What other languages write, and what is written here.
const FOREIGN: [(&str, &str); 9] = [
    ("**", "^"),
    ("&&", "and"),
    ("||", "or"),
    ("=", "=="),
    ("!", "not"),
    ("&", "and"),
    ("|", "or"),
    ("?", "if(condition, a, b)"),
    ("if", "if(condition, a, b)"),
];

/// Parses all of `text`; the result is of `kind`.
pub(super) fn parse(text: &str, measures: &[(&str, Kind)], kind: Kind) -> Result<Node, ParseError> {
    let mut reader = Reader { input: LocatingSlice::new(text), text, measures, depth: 0 };
    reader.whole(kind).map_err(|Fault { at, fault }| ParseError {
        fault,
        place: Place::new(text, at),
        measures: measures.iter().map(|(name, kind)| (name.to_string(), *kind)).collect(),
    })
}

type Input<'a> = LocatingSlice<&'a str>;

struct Fault {
    at: Range<usize>,
    fault: ParseFault,
}

struct Reader<'a> {
    input: Input<'a>,
    text: &'a str,
    measures: &'a [(&'a str, Kind)],
    /// Calls of [`Reader::expression`] under way.
    depth: usize,
}

impl<'a> Reader<'a> {
    fn whole(&mut self, kind: Kind) -> Result<Node, Fault> {
        if self.text.len() > MAX_BYTES {
            let fault = ParseFault::TooLong { bytes: self.text.len() };
            return Err(Fault { at: 0..0, fault });
        }
        self.token(space);
        let root = self.expression(0)?;
        if !self.input.is_empty() {
            return Err(self.expected("an operator"));
        }
        if root.kind != kind {
            let fault = ParseFault::Kind { what: "this".into(), found: root.kind, wanted: kind };
            return Err(Fault { at: root.span, fault });
        }
        let constants = root.check_constants();
        constants.map_err(|stop| Fault { at: stop.mark, fault: stop.fault.into() })?;
        Ok(root)
    }

    /// Everything from here on that binds at least as tightly as `floor`.
    fn expression(&mut self, floor: u8) -> Result<Node, Fault> {
        self.depth += 1;
        if self.depth > MAX_DEPTH {
            return Err(Fault { at: self.next(), fault: ParseFault::TooDeep });
        }
        let mut left = self.operand()?;
        let mut last = POWER;
        while let Some(((_, op, precedence), mark)) = self.token(infix(floor)) {
            if precedence == COMPARISON && last == COMPARISON {
                return Err(Fault { at: mark, fault: ParseFault::Chained });
            }
            last = precedence;
            // What binds as tightly groups from the left, powers from the right.
            let right = self.expression(if op == Op::Power { POWER } else { precedence + 1 })?;
            let span = left.span.start..right.span.end;
            left = self.node(op, mark, span, vec![left, right])?;
        }
        self.depth -= 1;
        Ok(left)
    }

    fn operand(&mut self) -> Result<Node, Fault> {
        if let Some((number, at)) = self.token(number) {
            return self.leaf(Op::Number(number), at);
        }
        if let Some((_, at)) = self.token('(') {
            let inner = self.expression(0)?;
            let close = self.token(')').ok_or_else(|| self.expected("an operator or `)`"))?;
            return Ok(Node { span: at.start..close.1.end, ..inner });
        }
        if let Some((_, at)) = self.token('-') {
            return self.prefix(Op::Negate, at, NEGATE);
        }
        match self.token(word.verify(|word: &str| word != "and" && word != "or")) {
            Some(("not", at)) => self.prefix(Op::Not, at, NOT),
            Some((name, at)) if self.token('(').is_some() => self.call(name, at),
            Some((name, at)) => self.name(name, at),
            None => Err(self.expected("a number, a measure, a function or `(`")),
        }
    }

    fn prefix(&mut self, op: Op, mark: Range<usize>, floor: u8) -> Result<Node, Fault> {
        let operand = self.expression(floor)?;
        let span = mark.start..operand.span.end;
        self.node(op, mark, span, vec![operand])
    }

    /// What follows `name(`.
    fn call(&mut self, name: &str, mark: Range<usize>) -> Result<Node, Fault> {
        let Some((_, op, takes)) = FUNCTIONS.into_iter().find(|function| function.0 == name) else {
            let nearest = nearest(name, FUNCTIONS.map(|function| function.0));
            let fault = ParseFault::UnknownFunction { name: name.into(), nearest };
            return Err(Fault { at: mark, fault });
        };
        let mut operands = vec![self.expression(0)?];
        while self.token(',').is_some() {
            operands.push(self.expression(0)?);
        }
        let close = self.token(')').ok_or_else(|| self.expected("an operator, `,` or `)`"))?;
        let span = mark.start..close.1.end;
        if operands.len() != takes {
            let fault =
                ParseFault::Arguments { function: name.into(), takes, found: operands.len() };
            return Err(Fault { at: span, fault });
        }
        self.node(op, mark, span, operands)
    }

    /// A measure or a constant.
    fn name(&self, name: &str, at: Range<usize>) -> Result<Node, Fault> {
        let measure = self.measures.iter().position(|measure| measure.0 == name);
        let constant = CONSTANTS.into_iter().find(|constant| constant.0 == name);
        match (measure, constant) {
            (Some(i), None) => {
                let leaf = self.leaf(Op::Measure(i), at)?;
                Ok(Node { kind: self.measures[i].1, ..leaf })
            }
            (None, Some((_, op))) => self.leaf(op, at),
            (Some(_), Some(_)) => {
                Err(Fault { at, fault: ParseFault::Ambiguous { name: name.into() } })
            }
            (None, None) => Err(Fault { at, fault: self.unknown(name) }),
        }
    }

    fn unknown(&self, name: &str) -> ParseFault {
        if FUNCTIONS.iter().any(|function| function.0 == name) {
            return ParseFault::NoArguments { function: name.into() };
        }
        let measures = self.measures.iter().map(|measure| measure.0);
        let names = measures.chain(CONSTANTS.map(|constant| constant.0));
        ParseFault::UnknownName { name: name.into(), nearest: nearest(name, names) }
    }

    fn leaf(&self, op: Op, at: Range<usize>) -> Result<Node, Fault> {
        self.node(op, at.clone(), at, Vec::new())
    }

    fn node(
        &self,
        op: Op,
        mark: Range<usize>,
        span: Range<usize>,
        operands: Vec<Node>,
    ) -> Result<Node, Fault> {
        let kind = op.kind(&operands).map_err(|(i, wanted)| {
            let operator = &self.text[mark.clone()];
            let is_function = FUNCTIONS.iter().any(|function| function.0 == operator);
            let which = match (is_function, operands.len(), i) {
                (true, ..) => format!("argument {} of `{operator}`", i + 1),
                (false, 1, _) => format!("the operand of `{operator}`"),
                (false, _, 0) => format!("the left operand of `{operator}`"),
                (false, ..) => format!("the right operand of `{operator}`"),
            };
            let fault = ParseFault::Kind { what: which, found: operands[i].kind, wanted };
            Fault { at: operands[i].span.clone(), fault }
        })?;
        let height = 1 + operands.iter().map(|operand| operand.height).max().unwrap_or(0);
        if height > MAX_DEPTH {
            return Err(Fault { at: mark, fault: ParseFault::TooDeep });
        }
        Ok(Node { op, operands, kind, height, span, mark })
    }

    /// The next token, if it is one that `parser` reads, and its place. The space after it is
    /// skipped.
    fn token<T>(
        &mut self,
        parser: impl Parser<Input<'a>, T, EmptyError>,
    ) -> Option<(T, Range<usize>)> {
        opt(terminated(parser.with_span(), space)).parse_next(&mut self.input).ok().flatten()
    }

    /// The place of whatever comes next.
    fn next(&self) -> Range<usize> {
        let foreign = alt(FOREIGN.map(|(foreign, _)| foreign));
        let token = alt((word, number.take(), foreign, any.take()));
        let next = token.span().parse_next(&mut self.input.clone());
        let end = self.text.trim_end().len();
        next.unwrap_or(end..end)
    }

    fn expected(&self, expected: &'static str) -> Fault {
        let at = self.next();
        let found = self.text[at.clone()].to_string();
        let instead = FOREIGN.into_iter().find(|(foreign, _)| *foreign == found);
        let instead = instead.map(|(_, instead)| instead);
        Fault { at, fault: ParseFault::Syntax { expected, found, instead } }
    }
}

fn space(input: &mut Input<'_>) -> Result<(), EmptyError> {
    take_while(0.., char::is_whitespace).void().parse_next(input)
}

fn word<'a>(input: &mut Input<'a>) -> Result<&'a str, EmptyError> {
    let start = one_of(|c: char| c.is_alphabetic() || c == '_');
    (start, take_while(0.., |c: char| c.is_alphanumeric() || c == '_')).take().parse_next(input)
}

/// `2`, `0.5`, `.5`, `2.`, `1e-3`: the nearest f64.
fn number(input: &mut Input<'_>) -> Result<f64, EmptyError> {
    let mantissa = alt(((digit1, opt(('.', digit0))).void(), ('.', digit1).void()));
    let exponent = (one_of(['e', 'E']), opt(one_of(['+', '-'])), digit1);
    (mantissa, opt(exponent)).take().parse_to().parse_next(input)
}

/// An operator between two operands that binds at least as tightly as `floor`.
fn infix<'a>(floor: u8) -> impl Parser<Input<'a>, (&'static str, Op, u8), EmptyError> {
    let symbol = alt(["<=", ">=", "==", "!=", "<", ">", "+", "-", "**", "*", "/", "^"]);
    alt((word, symbol))
        .verify_map(move |text| INFIX.into_iter().find(|infix| infix.0 == text && infix.2 >= floor))
}

/// The name that is most likely meant, if one is near enough.
fn nearest<'a>(name: &str, names: impl IntoIterator<Item = &'a str>) -> Option<String> {
    let near = names.into_iter().map(|other| (strsim::jaro_winkler(name, other), other));
    let (_, nearest) =
        near.filter(|(likeness, _)| *likeness > 0.8).max_by(|a, b| a.0.total_cmp(&b.0))?;
    Some(nearest.to_string())
}
