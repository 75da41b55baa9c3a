//! An expression: what is parsed has a finite value or a reason, with parentheses around it as well.
#![no_main]

use learner::expression::{Expression, Kind, MAX_BYTES};
use libfuzzer_sys::fuzz_target;

const MEASURES: [(&str, Kind); 4] = [
    ("apex_m", Kind::Number),
    ("höhe_m", Kind::Number),
    ("x", Kind::Number),
    ("caught", Kind::Truth),
];
const VALUES: [[f64; 4]; 3] =
    [[0.25, -3.0, 0.0, 1.0], [f64::MAX, 5e-324, -0.0, 0.0], [f64::NAN, f64::INFINITY, 1.0, 0.5]];

/// The bits of each value, and every error as text.
fn evaluated(text: &str, kind: Kind) -> Result<Vec<Option<u64>>, String> {
    let expression = Expression::parse(text, &MEASURES, kind).map_err(|e| e.to_string())?;
    let value = |values: &[f64; 4]| match kind {
        Kind::Number => expression.number(values),
        Kind::Truth => expression.truth(values).map(f64::from),
    };
    let bits = |values| match value(values) {
        Ok(value) => {
            assert!(value.is_finite());
            Some(value.to_bits())
        }
        Err(error) => {
            assert!(error.to_string().contains(&error.fault.to_string()));
            None
        }
    };
    Ok(VALUES.iter().map(bits).collect())
}

fuzz_target!(|text: &str| {
    for kind in [Kind::Number, Kind::Truth] {
        match evaluated(text, kind) {
            // As deep as may be, it can be no deeper.
            Ok(values) if text.len() + 2 <= MAX_BYTES => {
                match evaluated(&format!("({text})"), kind) {
                    Ok(again) => assert_eq!(again, values),
                    Err(error) => assert!(error.starts_with("nested"), "{error}"),
                }
            }
            Ok(_) => {}
            Err(error) => assert!(error.contains("measures: apex_m")),
        }
    }
});
