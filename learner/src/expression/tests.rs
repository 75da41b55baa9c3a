//! What texts mean, how they are refused, and that nothing else happens.

use std::f64::consts::{E, PI};

use rand::{Rng, RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

use super::*;
use Kind::{Number, Truth};

mod formulas;

const MEASURES: [(&str, Kind); 5] = [
    ("apex_m", Number),
    ("flip_angle_rad", Number),
    ("höhe_m", Number),
    ("caught", Truth),
    ("dropped", Truth),
];
const VALUES: [f64; 5] = [0.25, 2.5, -3.0, 1.0, 0.0];

fn number(text: &str) -> f64 {
    let expression = Expression::parse(text, &MEASURES, Number).unwrap_or_else(|e| panic!("{e}"));
    expression.number(&VALUES).unwrap_or_else(|e| panic!("{e}"))
}

#[test]
fn summands_have_their_text_and_add_up() {
    let text = "2*apex_m - (exp(höhe_m) - 1) + if(caught,\n  1, 0)";
    let expression = Expression::parse(text, &MEASURES, Number).unwrap();
    let summands = expression.summands(&VALUES);
    let texts: Vec<&str> = summands.iter().map(|summand| summand.0.as_str()).collect();
    assert_eq!(texts, ["2*apex_m", "−exp(höhe_m)", "1", "if(caught, 1, 0)"]);
    let sum: f64 = summands.iter().map(|summand| summand.1).sum();
    assert!((sum - expression.number(&VALUES).unwrap()).abs() < 1e-15);
    let one = Expression::parse("apex_m*2", &MEASURES, Number).unwrap();
    assert_eq!(one.summands(&VALUES).len(), 1);
    let none = Expression::parse("apex_m + ln(höhe_m)", &MEASURES, Number).unwrap();
    assert!(none.summands(&VALUES).is_empty(), "the second has no value");
}

fn truth(text: &str) -> bool {
    let expression = Expression::parse(text, &MEASURES, Truth).unwrap_or_else(|e| panic!("{e}"));
    expression.truth(&VALUES).unwrap_or_else(|e| panic!("{e}"))
}

fn refused(text: &str, kind: Kind) -> ParseError {
    Expression::parse(text, &MEASURES, kind).err().unwrap_or_else(|| panic!("{text} was parsed"))
}

fn stopped(text: &str, values: &[f64; 5]) -> EvalError {
    let expression = Expression::parse(text, &MEASURES, Number).unwrap_or_else(|e| panic!("{e}"));
    expression.number(values).expect_err(text)
}

/// The message without the text and the list of measures, as `message (line 1, column 1)`.
fn first_line(error: impl fmt::Display) -> String {
    error.to_string().lines().next().unwrap().to_string()
}

#[test]
fn numbers_follow_the_usual_precedence() {
    let cases = [
        ("1/2", 0.5),
        ("1 - 2 - 3", -4.0),
        ("8/4/2", 1.0),
        ("8/4*2", 4.0),
        ("1 + 2*3", 7.0),
        ("(1 + 2)*3", 9.0),
        ("-2^2", -4.0),
        ("(-2)^2", 4.0),
        ("2^3^2", 512.0),
        ("2^-1", 0.5),
        ("2*-3", -6.0),
        ("2^-1^2*8", 4.0),
        ("--3", 3.0),
        ("1 - -1", 2.0),
        ("-2*3 + 10", 4.0),
        (".5 + 2. + 1e-1 + 1E+1", 0.5 + 2.0 + 1e-1 + 1e1),
        ("0.1 + 0.2 + 0.3", 0.1 + 0.2 + 0.3),
        ("0.1 + (0.2 + 0.3)", 0.1 + (0.2 + 0.3)),
        ("min(3, 2) + max(3, 2)*10", 32.0),
        ("clamp(5, 0, 1) + clamp(-5, 0, 1) + clamp(0.5, 0, 1)", 1.5),
        ("clamp(5, 2, 2)", 2.0),
        ("abs(-2) + floor(-0.5)", 1.0),
        ("exp(1) - e", E.exp() - E.exp() + 1f64.exp() - E),
        ("ln(2)*sqrt(3)", 2f64.ln() * 3f64.sqrt()),
        ("sin(1)/cos(pi)", 1f64.sin() / PI.cos()),
        ("apex_m*flip_angle_rad - höhe_m", 0.25 * 2.5 + 3.0),
        ("if(caught, 1, 2) + if(dropped, 10, 20)", 21.0),
        ("if(apex_m > 0 and not dropped, apex_m, -1)", 0.25),
    ];
    for (text, value) in cases {
        assert_eq!(number(text).to_bits(), value.to_bits(), "{text} is {}", number(text));
    }
}

#[test]
fn truth_values_follow_the_usual_precedence() {
    let cases = [
        ("caught", true),
        ("caught and flip_angle_rad > 2.5", false),
        ("caught and flip_angle_rad >= 2.5", true),
        ("true or true and false", true),
        ("(true or true) and false", false),
        ("not false and false", false),
        ("not (false and false)", true),
        ("not 1 < 2", false),
        ("not not true", true),
        ("1 + 1 == 2", true),
        ("1 + 1 != 2", false),
        ("2 <= 1 or 1 < 1", false),
        ("1 <= 1 and 1 >= 1 and not 1 > 1", true),
        ("caught == not dropped", true),
        ("caught != (apex_m < 0)", true),
        ("if(dropped, caught, dropped)", false),
        ("-1 < 0", true),
    ];
    for (text, value) in cases {
        assert_eq!(truth(text), value, "{text}");
    }
}

#[test]
fn only_what_decides_is_evaluated() {
    assert_eq!(number("if(dropped, 1/(apex_m - 0.25), 2)"), 2.0);
    assert_eq!(number("if(caught, 2, ln(höhe_m))"), 2.0);
    assert_eq!(number("if(false, 1/0, 2)"), 2.0);
    assert_eq!(number("1 + if(true, apex_m, 1/0)"), 1.25);
    assert!(!truth("dropped and 1/(apex_m - 0.25) > 0"));
    assert!(truth("caught or 1/(apex_m - 0.25) > 0"));
    let unread = [f64::NAN, 2.5, -3.0, 0.0, 0.0];
    let reward = Expression::parse("if(caught, apex_m, 0)", &MEASURES, Number).unwrap();
    assert_eq!(reward.number(&unread), Ok(0.0), "the measure that is no number is not read");
}

#[test]
fn space_and_lines_do_not_matter() {
    assert_eq!(number(" \n\t1\r\n+ \u{a0}min (\n 2 , 3 )\n"), 3.0);
    assert_eq!(number("1+min(2,3)"), 3.0);
}

#[test]
fn an_error_shows_the_text_what_is_wrong_and_the_measures() {
    let error = refused("1.5*min(apex, 0.55)", Number);
    let message = "\
there is no measure `apex`; did you mean `apex_m`? (line 1, column 9)
  1.5*min(apex, 0.55)
          ^^^^
measures: apex_m, flip_angle_rad, höhe_m, caught (truth value), dropped (truth value)";
    assert_eq!(error.to_string(), message);
    let error = Expression::parse("apex", &[], Number).unwrap_err();
    assert!(error.to_string().ends_with("\n  apex\n  ^^^^\nthere are no measures"), "{error}");
}

#[test]
fn lines_and_columns_count_characters() {
    let error = refused("höhe_m\r\n\t+ höhe_m*größe + 1\n+ 2", Number);
    let message = "\
there is no measure `größe` (line 2, column 11)
   + höhe_m*größe + 1
            ^^^^^
measures:";
    assert!(error.to_string().starts_with(message), "{error}");
    assert_eq!((error.place.line_and_column(), error.place.part()), ((2, 11), "größe"));
}

#[test]
fn a_text_that_is_no_expression_is_refused_where_it_stops_to_be_one() {
    let operand = "expected a number, a measure, a function or `(`, found";
    let cases = [
        ("", format!("{operand} the end (line 1, column 1)")),
        (" \n ", format!("{operand} the end (line 1, column 1)")),
        ("1 +\n", format!("{operand} the end (line 1, column 4)")),
        ("1 + * 2", format!("{operand} `*` (line 1, column 5)")),
        ("1 + and", format!("{operand} `and` (line 1, column 5)")),
        ("1 + )", format!("{operand} `)` (line 1, column 5)")),
        ("+1", format!("{operand} `+` (line 1, column 1)")),
        ("1 2", "expected an operator, found `2` (line 1, column 3)".into()),
        ("2pi", "expected an operator, found `pi` (line 1, column 2)".into()),
        ("1.2.3", "expected an operator, found `.3` (line 1, column 4)".into()),
        ("1)", "expected an operator, found `)` (line 1, column 2)".into()),
        ("(1", "expected an operator or `)`, found the end (line 1, column 3)".into()),
        ("(1, 2)", "expected an operator or `)`, found `,` (line 1, column 3)".into()),
        ("min(1, 2", "expected an operator, `,` or `)`, found the end (line 1, column 9)".into()),
        ("2**3", "expected an operator, found `**`; write `^` (line 1, column 2)".into()),
        ("1 = 1", "expected an operator, found `=`; write `==` (line 1, column 3)".into()),
        ("true && true", "expected an operator, found `&&`; write `and` (line 1, column 6)".into()),
        ("!true", format!("{operand} `!`; write `not` (line 1, column 1)")),
        (
            "1 if caught else 0",
            "expected an operator, found `if`; write `if(condition, a, b)` (line 1, column 3)"
                .into(),
        ),
        ("1 € 2", "expected an operator, found `€` (line 1, column 3)".into()),
        ("1 \u{1b}[2J", "expected an operator, found `\\u{1b}` (line 1, column 3)".into()),
        (
            "0 < apex_m < 1",
            "comparisons do not chain: write `a < b and b < c` (line 1, column 12)".into(),
        ),
    ];
    for (text, message) in cases {
        let error = refused(text, Number);
        assert_eq!(first_line(&error), message);
        assert!(!error.to_string().contains('\u{1b}'), "a terminal is left alone");
    }
}

#[test]
fn names_that_do_not_exist_are_refused() {
    let cases = [
        ("Caught", "there is no measure `Caught`; did you mean `caught`?"),
        ("flip_angle", "there is no measure `flip_angle`; did you mean `flip_angle_rad`?"),
        ("quux", "there is no measure `quux`"),
        ("min + 1", "`min` is a function: write `min(…)`"),
        ("mix(1, 2)", "there is no function `mix`; did you mean `min`?"),
        ("apex_m(1)", "there is no function `apex_m`"),
        ("min(1)", "`min` takes 2 arguments, not 1"),
        ("exp(1, 2)", "`exp` takes 1 argument, not 2"),
    ];
    for (text, message) in cases {
        assert_eq!(refused(text, Number).fault.to_string(), message);
    }
    let error = Expression::parse("1 + e", &[("e", Number)], Number).unwrap_err();
    assert_eq!(error.fault.to_string(), "`e` is a constant and a measure: rename the measure");
}

#[test]
fn an_operand_of_the_wrong_kind_is_refused_and_pointed_at() {
    let cases = [
        ("1 + caught", Number, "the right operand of `+` is a truth value, not a number", "caught"),
        ("(apex_m < 1) * 2", Number, "the left operand of `*` is a truth value", "(apex_m < 1)"),
        ("-true", Number, "the operand of `-` is a truth value", "true"),
        ("min(1, 1 > 2)", Number, "argument 2 of `min` is a truth value", "1 > 2"),
        ("caught and apex_m", Truth, "the right operand of `and` is a number", "apex_m"),
        ("not 1 + 2", Truth, "the operand of `not` is a number, not a truth value", "1 + 2"),
        ("caught == 1", Truth, "the right operand of `==` is a number, not a truth value", "1"),
        ("1 != caught", Truth, "the right operand of `!=` is a truth value", "caught"),
        ("caught < 1", Truth, "the left operand of `<` is a truth value, not a number", "caught"),
        ("if(1, 2, 3)", Number, "argument 1 of `if` is a number, not a truth value", "1"),
        ("if(caught, 2, true)", Number, "argument 3 of `if` is a truth value", "true"),
        ("caught", Number, "this is a truth value, not a number; `if(condition, 1, 0)`", "caught"),
        (" 1 + 1 ", Truth, "this is a number, not a truth value; compare it", "1 + 1"),
    ];
    for (text, kind, message, part) in cases {
        let error = refused(text, kind);
        assert!(error.to_string().starts_with(message), "{error}");
        assert_eq!(error.place.part(), part, "{text}");
    }
}

#[test]
fn what_no_measure_can_change_is_checked_at_once() {
    for (text, message) in [
        ("apex_m + 1/(2 - 2)", "division by zero (line 1, column 11)"),
        ("exp(1000)*apex_m", "the value is inf (line 1, column 1)"),
        ("if(1/0 > 1, 2, 3)", "division by zero (line 1, column 5)"),
        ("1e999", "the value is inf (line 1, column 1)"),
        ("sqrt(-1)", "the value is NaN (line 1, column 1)"),
    ] {
        assert_eq!(first_line(refused(text, Number)), message);
    }
}

#[test]
fn an_evaluation_that_stops_says_where_and_with_which_values() {
    let error = stopped("1 +\n  apex_m/(höhe_m + 3) + if(caught, 0, apex_m)", &VALUES);
    let message = "\
`/`: division by zero (line 2, column 9)
    apex_m/(höhe_m + 3) + if(caught, 0, apex_m)
          ^
with apex_m = 0.25, höhe_m = -3.0, caught = 1.0";
    assert_eq!(error.to_string(), message);
    let with = |i: usize, value| std::array::from_fn(|j| if i == j { value } else { VALUES[j] });
    let cases = [
        ("exp(apex_m)", with(0, 1e3), "`exp`: the value is inf (line 1, column 1)"),
        ("1 + ln(apex_m)", with(0, 0.0), "`ln`: the value is -inf (line 1, column 5)"),
        ("(-2)^apex_m", VALUES, "`^`: the value is NaN (line 1, column 5)"),
        ("1 - apex_m", with(0, f64::NAN), "`apex_m`: the value is NaN (line 1, column 5)"),
        ("min(apex_m, 1)", with(0, f64::INFINITY), "`apex_m`: the value is inf (line 1, column 5)"),
        ("apex_m/flip_angle_rad", with(1, -0.0), "`/`: division by zero (line 1, column 7)"),
        (
            "if(caught, 1, 0)",
            with(3, 0.5),
            "`caught`: the value is 0.5, neither 0 (false) nor 1 (true) (line 1, column 4)",
        ),
        (
            "clamp(apex_m, 1, höhe_m)",
            VALUES,
            "`clamp`: the lower bound 1.0 is above the upper bound -3.0 (line 1, column 1)",
        ),
    ];
    for (text, values, message) in cases {
        assert_eq!(first_line(stopped(text, &values)), message);
    }
}

#[test]
fn long_and_deep_texts_are_refused() {
    let (open, close) = ("(".repeat(100_000), ")".repeat(100_000));
    for text in [format!("{open}1{close}"), open, "-".repeat(100_000) + "1"] {
        assert!(
            matches!(refused(&text, Number).fault, ParseFault::TooLong { bytes } if bytes >= 100_000)
        );
    }
    let powers = ["2"; 2000].join("^");
    let sum = ["1"; 2000].join("+");
    let calls = "abs(".repeat(800) + "1" + &")".repeat(800);
    let nots = "not ".repeat(1000) + "true";
    for text in ["(".repeat(4000), "-".repeat(4000), powers, sum, calls, nots] {
        assert_eq!(refused(&text, Number).fault, ParseFault::TooDeep);
    }
    let nested = |n: usize| "(".repeat(n) + "1" + &")".repeat(n);
    assert_eq!(number(&nested(MAX_DEPTH - 1)), 1.0);
    assert_eq!(refused(&nested(MAX_DEPTH), Number).place.line_and_column(), (1, MAX_DEPTH + 1));
    let sum = |n: usize| vec!["1"; n].join("+");
    assert_eq!(number(&sum(MAX_DEPTH)), MAX_DEPTH as f64);
    assert_eq!(refused(&sum(MAX_DEPTH + 1), Number).fault, ParseFault::TooDeep);
    assert_eq!(number(&["(1)"; MAX_DEPTH].join("+")), MAX_DEPTH as f64, "beside is not below");
    let spaces = " ".repeat(MAX_BYTES - 1);
    assert_eq!(number(&format!("1{spaces}")), 1.0);
    assert_eq!(refused(&format!("1 {spaces}"), Number).fault, ParseFault::TooLong { bytes: 4097 });
}

const OPERANDS: [&str; 14] = [
    "1",
    "0",
    "2.5",
    ".5",
    "1e999",
    "apex_m",
    "höhe_m",
    "caught",
    "pi",
    "min(apex_m, 2)",
    "ln(",
    "if(caught,",
    "(",
    "-",
];
const OPERATORS: [&str; 12] = ["+", "-", "*", "/", "^", "<", "==", " and ", " or ", ")", ",", "\n"];

/// Any characters, printable ones, or what is nearly an expression.
fn random_text(rng: &mut ChaCha8Rng) -> String {
    let length = rng.random_range(0..12);
    let kind = rng.random_range(0..6);
    let mut piece = |i: usize| match kind {
        0 => String::from(rng.random::<char>()),
        1 => String::from(char::from(rng.random_range(b' '..=b'~'))),
        _ if i.is_multiple_of(2) => OPERANDS[rng.random_range(0..OPERANDS.len())].into(),
        _ => OPERATORS[rng.random_range(0..OPERATORS.len())].into(),
    };
    (0..length).map(&mut piece).collect()
}

#[test]
fn any_text_gives_a_finite_value_or_an_error() {
    let mut rng = ChaCha8Rng::seed_from_u64(16);
    let special = [0.0, -0.0, 1.0, -1e308, 5e-324, f64::NAN, f64::INFINITY];
    let mut parsed = 0;
    for _ in 0..50_000 {
        let text = random_text(&mut rng);
        let values: [f64; 5] = std::array::from_fn(|_| special[rng.next_u32() as usize % 7]);
        let value = |text: &str| match Expression::parse(text, &MEASURES, Number) {
            Ok(expression) => Some(expression.number(&values)),
            Err(error) => {
                assert!(error.to_string().contains(&error.fault.to_string()));
                None
            }
        };
        let Some(result) = value(&text) else { continue };
        parsed += 1;
        let again = value(&format!("({text})")).expect("parentheses change nothing");
        match (result, again) {
            (Ok(a), Ok(b)) => assert!(a.is_finite() && a.to_bits() == b.to_bits(), "{text}"),
            (Err(a), Err(b)) => assert_eq!(a.fault.to_string(), b.fault.to_string(), "{text}"),
            (a, b) => panic!("{text}: {a:?} and {b:?}"),
        }
    }
    assert!(parsed > 2000, "only {parsed} texts were expressions");
}

#[test]
fn goes_to_another_thread() {
    fn is_send<T: Send + Sync + Clone + fmt::Debug>() {}
    is_send::<Expression>();
    is_send::<ParseError>();
    is_send::<EvalError>();
}
