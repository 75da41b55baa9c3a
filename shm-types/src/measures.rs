//! Measures: what is known of a rollout, as named numbers with units.
//!
//! A message of fixed size for the measures of any task. Names travel with the numbers, so that late
//! subscribers and later readers need no table of the task.

#[cfg(feature = "transport")]
use iceoryx2::prelude::ZeroCopySend;
use thiserror::Error;

/// Measures of one rollout.
pub const MAX_MEASURES: usize = 32;
/// Longest name and longest unit, bytes.
pub const NAME_LEN: usize = 32;
pub const UNIT_LEN: usize = 8;
/// The unit of a truth value: 1 or 0.
pub const TRUTH: &str = "bool";

message! {
    /// The first `n` entries are in use, the others zero.
    pub struct Measures as "skillet/Measures/1" {
        pub n: u64,
        /// UTF-8, filled up with zeros.
        pub names: [[u8; NAME_LEN]; MAX_MEASURES],
        /// `1` for a number without unit, `bool` for a truth value.
        pub units: [[u8; UNIT_LEN]; MAX_MEASURES],
        pub values: [f64; MAX_MEASURES],
    }
}

/// One of them.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Measure<'a> {
    pub name: &'a str,
    pub unit: &'a str,
    pub value: f64,
}

impl<'a> Measure<'a> {
    pub fn truth(name: &'a str, value: bool) -> Measure<'a> {
        Measure { name, unit: TRUTH, value: f64::from(u8::from(value)) }
    }
}

/// Why measures were refused.
#[derive(Clone, Debug, Error, PartialEq)]
pub enum MeasuresError {
    #[error("there are {0} measures: at most {MAX_MEASURES} fit; leave some out")]
    TooMany(u64),
    #[error(
        "the measure '{0}' needs another name: a letter or _, then letters, digits and _, at most \
         {NAME_LEN} bytes"
    )]
    Name(String),
    #[error("the measure {name} has the unit '{unit}': use 1 to {UNIT_LEN} bytes without spaces")]
    Unit { name: String, unit: String },
    #[error(
        "the plant did not send the measure {0}: send the outcome before the last sample of an \
         episode, or take {0} out of plant.measures"
    )]
    Missing(String),
    #[error("the measure {0} appears twice: give each its own name")]
    Twice(String),
    #[error("the measure {name} is {value}: it must be finite")]
    Value { name: String, value: f64 },
    #[error("the measure {name} is {value}: a truth value is 0 or 1")]
    Truth { name: String, value: f64 },
}

impl Measure<'_> {
    pub fn is_truth(&self) -> bool {
        self.unit == TRUTH
    }

    /// As people read it.
    pub fn text(&self) -> String {
        // What rounds to nothing has no sign.
        let value = if self.value.abs() < 5e-4 { 0.0 } else { self.value };
        match self.unit {
            TRUTH => if self.value != 0.0 { "yes" } else { "no" }.into(),
            // A count, such as the way that was taken.
            "1" if value.fract() == 0.0 => format!("{value:.0}"),
            "1" => format!("{value:.3}"),
            unit => format!("{value:.3} {unit}"),
        }
    }
}

impl Measures {
    pub const NONE: Measures = Measures {
        n: 0,
        names: [[0; NAME_LEN]; MAX_MEASURES],
        units: [[0; UNIT_LEN]; MAX_MEASURES],
        values: [0.0; MAX_MEASURES],
    };

    /// All of `measures`, in their order.
    pub fn of<'a>(
        measures: impl IntoIterator<Item = Measure<'a>>,
    ) -> Result<Measures, MeasuresError> {
        let mut all = Measures::NONE;
        for measure in measures {
            all.push(measure)?;
        }
        Ok(all)
    }

    /// Adds one, if it is fit to be told and there is a place.
    pub fn push(&mut self, measure: Measure<'_>) -> Result<(), MeasuresError> {
        let Measure { name, unit, value } = measure;
        let i = self.len();
        if i == MAX_MEASURES {
            return Err(MeasuresError::TooMany(self.n + 1));
        }
        check(&measure)?;
        if self.get(name).is_some() {
            return Err(MeasuresError::Twice(name.into()));
        }
        self.names[i][..name.len()].copy_from_slice(name.as_bytes());
        self.units[i][..unit.len()].copy_from_slice(unit.as_bytes());
        // Zero has one sign: a database keeps no other, and a replay is compared bit for bit.
        self.values[i] = value + 0.0;
        self.n += 1;
        Ok(())
    }

    pub fn len(&self) -> usize {
        (self.n as usize).min(MAX_MEASURES)
    }

    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    pub fn iter(&self) -> impl Iterator<Item = Measure<'_>> {
        let all = self.names.iter().zip(&self.units).zip(&self.values).take(self.len());
        all.map(|((name, unit), value)| Measure {
            name: text(name),
            unit: text(unit),
            value: *value,
        })
    }

    pub fn get(&self, name: &str) -> Option<f64> {
        self.iter().find(|measure| measure.name == name).map(|measure| measure.value)
    }

    /// A truth value that is there and true.
    pub fn has(&self, name: &str) -> bool {
        self.get(name).is_some_and(|value| value != 0.0)
    }

    /// Names with their units, in order: what a session declares.
    pub fn declared(&self) -> Vec<(String, String)> {
        self.iter().map(|measure| (measure.name.into(), measure.unit.into())).collect()
    }

    /// Checks everything a sender may have got wrong.
    pub fn validate(&self) -> Result<(), MeasuresError> {
        if self.n > MAX_MEASURES as u64 {
            return Err(MeasuresError::TooMany(self.n));
        }
        let same = Measures::of(self.iter())?;
        let is_text = |i: usize| self.names[i] == same.names[i] && self.units[i] == same.units[i];
        match (0..self.len()).find(|i| !is_text(*i)) {
            Some(i) => Err(MeasuresError::Name(String::from_utf8_lossy(&self.names[i]).into())),
            None => Ok(()),
        }
    }
}

fn check(measure: &Measure<'_>) -> Result<(), MeasuresError> {
    let Measure { name, unit, value } = *measure;
    let is_word = |c: char| c.is_ascii_alphanumeric() || c == '_';
    let starts = name.starts_with(|c: char| c.is_ascii_alphabetic() || c == '_');
    if !starts || name.len() > NAME_LEN || !name.chars().all(is_word) {
        return Err(MeasuresError::Name(name.into()));
    }
    let is_visible = |c: char| !c.is_whitespace() && !c.is_control();
    if unit.is_empty() || unit.len() > UNIT_LEN || !unit.chars().all(is_visible) {
        return Err(MeasuresError::Unit { name: name.into(), unit: unit.into() });
    }
    if !value.is_finite() {
        return Err(MeasuresError::Value { name: name.into(), value });
    }
    if unit == TRUTH && value != 0.0 && value != 1.0 {
        return Err(MeasuresError::Truth { name: name.into(), value });
    }
    Ok(())
}

/// Up to the first zero; empty where it is no text, which no check passes.
fn text(bytes: &[u8]) -> &str {
    let end = bytes.iter().position(|byte| *byte == 0).unwrap_or(bytes.len());
    std::str::from_utf8(&bytes[..end]).unwrap_or_default()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn measure(name: &str, value: f64) -> Measure<'_> {
        Measure { name, unit: "m", value }
    }

    #[test]
    fn keeps_names_units_and_values_in_order() {
        let caught = Measure { name: "caught", unit: TRUTH, value: 1.0 };
        let all = Measures::of([measure("apex_m", 0.5), caught]).unwrap();
        assert_eq!(all.validate(), Ok(()));
        assert_eq!(all.iter().nth(1), Some(caught));
        assert_eq!((all.get("apex_m"), all.get("apex")), (Some(0.5), None));
        assert!(all.has("caught") && !all.has("tossed"));
        assert_eq!(all.declared()[0], ("apex_m".to_string(), "m".to_string()));
        let texts: Vec<String> = all.iter().map(|measure| measure.text()).collect();
        assert_eq!(texts, ["0.500 m", "yes"]);
        let text = |unit, value| Measure { name: "way", unit, value }.text();
        assert_eq!([text("m", -2e-4), text("1", 3.0), text("1", 0.5)], ["0.000 m", "3", "0.500"]);
    }

    #[test]
    fn zero_has_one_sign() {
        let all = Measures::of([measure("short_m", -0.0)]).unwrap();
        assert_eq!(all.get("short_m").map(f64::to_bits), Some(0));
    }

    #[test]
    fn refuses_what_is_not_fit_to_be_told() {
        let of = |name, unit, value| Measures::of([Measure { name, unit, value }]).unwrap_err();
        let long = "n".repeat(NAME_LEN + 1);
        for name in ["", "2nd", "a b", "höhe", &long] {
            assert_eq!(of(name, "m", 0.0), MeasuresError::Name(name.into()));
        }
        for unit in ["", "rad per s", "kilometre"] {
            assert!(matches!(of("a", unit, 0.0), MeasuresError::Unit { .. }), "{unit}");
        }
        assert!(matches!(of("a", "m", f64::NAN), MeasuresError::Value { .. }));
        assert!(matches!(of("a", TRUTH, 0.5), MeasuresError::Truth { .. }));
        let twice = Measures::of([measure("a", 1.0), measure("a", 2.0)]);
        assert_eq!(twice, Err(MeasuresError::Twice("a".into())));
        let names: Vec<String> = (0..=MAX_MEASURES).map(|i| format!("m{i}")).collect();
        let many = Measures::of(names.iter().map(|name| measure(name, 0.0)));
        assert_eq!(many, Err(MeasuresError::TooMany(33)));
    }

    #[test]
    fn a_receiver_believes_none_of_it_unchecked() {
        let sound = Measures::of([measure("a", 1.0), measure("b", 2.0)]).unwrap();
        let spoil = |change: &dyn Fn(&mut Measures)| {
            let mut spoilt = sound;
            change(&mut spoilt);
            spoilt.validate()
        };
        assert_eq!(spoil(&|_| {}), Ok(()));
        assert_eq!(spoil(&|all| all.n = 40), Err(MeasuresError::TooMany(40)));
        assert_eq!(spoil(&|all| all.n = 3), Err(MeasuresError::Name(String::new())));
        assert!(spoil(&|all| all.names[1][0] = 0xff).is_err());
        assert!(spoil(&|all| all.names[1][0] = b'a').is_err(), "twice");
        assert!(spoil(&|all| all.names[0][5] = b'x').is_err(), "text after the end");
        assert!(spoil(&|all| all.values[0] = f64::INFINITY).is_err());
    }
}
