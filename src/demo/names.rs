//! Names of columns → words and a unit: `Joint_1 (deg)`, `/arm/joint1/position`, `time/s`, `x_mm`.

use super::cell::bare;

/// Names of a unit, and SI units in one of it.
pub type Units = &'static [(&'static [&'static str], f64)];

pub const TIME: Units = &[
    (&["s", "sec", "secs", "second", "seconds"], 1.0),
    (&["ms", "msec", "msecs", "millis", "millisecond", "milliseconds"], 1e-3),
    (&["us", "µs", "μs", "usec", "usecs", "micros", "microsecond", "microseconds"], 1e-6),
    (&["ns", "nsec", "nsecs", "nanosec", "nanos", "nanosecond", "nanoseconds"], 1e-9),
];
pub const LENGTH: Units = &[
    (&["m", "meter", "meters", "metre", "metres"], 1.0),
    (&["cm", "centimeter", "centimeters", "centimetre", "centimetres"], 1e-2),
    (&["mm", "millimeter", "millimeters", "millimetre", "millimetres"], 1e-3),
];
pub const ANGLE: Units = &[
    (&["rad", "rads", "radian", "radians"], 1.0),
    (&["deg", "degs", "degree", "degrees", "°"], std::f64::consts::PI / 180.0),
];
/// Components of a quaternion.
pub const NONE: Units = &[];

/// Symbol and scale of the unit called `name`.
pub fn unit(units: Units, name: &str) -> Option<(&'static str, f64)> {
    let (names, scale) = units.iter().find(|(names, _)| names.contains(&name))?;
    Some((names[0], *scale))
}

fn is_unit(word: &str) -> bool {
    [TIME, LENGTH, ANGLE].into_iter().any(|units| unit(units, word).is_some())
}

/// A column's name, taken apart.
#[derive(Clone, Debug, PartialEq)]
pub struct Name {
    /// Lower-case words and numbers, without the unit.
    pub words: Vec<String>,
    pub unit: Option<String>,
}

impl Name {
    pub fn parse(text: &str) -> Name {
        let text = bare(text).trim_start_matches('\u{feff}');
        if let Some((name, inside)) = bracketed(text) {
            let unit = inside.to_lowercase();
            return Name { words: words(name), unit: (!unit.is_empty()).then_some(unit) };
        }
        let mut words = words(text);
        let Some(at) = unit_place(&words) else { return Name { words, unit: None } };
        let unit = words.remove(at);
        // "time in ms"
        if words.len() > 1 && words[at - 1] == "in" {
            words.remove(at - 1);
        }
        Name { words, unit: Some(unit) }
    }
}

/// Where among the words of a name its unit stands: at its end, or before the number of a joint.
fn unit_place(words: &[String]) -> Option<usize> {
    let last = words.len().checked_sub(1).filter(|last| *last > 0)?;
    if is_unit(&words[last]) {
        return Some(last);
    }
    let before = last - 1;
    let is_numbered = words[last].bytes().all(|byte| byte.is_ascii_digit());
    (is_numbered && before > 0 && unit(ANGLE, &words[before]).is_some()).then_some(before)
}

/// `name [unit]` and its kind; an index or an axis in brackets is no unit.
fn bracketed(text: &str) -> Option<(&str, &str)> {
    let open = match text.chars().last()? {
        ']' => '[',
        ')' => '(',
        '}' => '{',
        _ => return None,
    };
    let at = text.rfind(open)?;
    let inside = text[at + 1..text.len() - 1].trim();
    let is_index = !inside.is_empty() && inside.bytes().all(|byte| byte.is_ascii_digit());
    let is_axis = matches!(inside.to_ascii_lowercase().as_str(), "x" | "y" | "z" | "w");
    (at > 0 && !is_index && !is_axis).then_some((text[..at].trim(), inside))
}

/// Words of a name: what stands between marks, at changes of case, and beside numbers.
pub fn words(text: &str) -> Vec<String> {
    #[derive(PartialEq)]
    enum Kind {
        Lower,
        Upper,
        Digit,
    }
    let (mut words, mut last) = (Vec::<String>::new(), None);
    for c in text.chars() {
        let kind = match c {
            _ if c.is_ascii_digit() => Some(Kind::Digit),
            // One word with what follows, µs as well as µS.
            _ if c.is_uppercase() || matches!(c, 'µ' | 'μ') => Some(Kind::Upper),
            _ if c.is_alphanumeric() || c == '°' => Some(Kind::Lower),
            _ => None,
        };
        if let Some(kind) = &kind {
            let goes_on = match (&last, kind) {
                (Some(Kind::Upper), Kind::Lower) => true,
                (Some(last), kind) => last == kind,
                (None, _) => false,
            };
            match words.last_mut().filter(|_| goes_on) {
                Some(word) => word.extend(c.to_lowercase()),
                None => words.push(c.to_lowercase().collect()),
            }
        }
        last = kind;
    }
    words
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_come_apart() {
        for (text, words, unit) in [
            ("t_s", "t", Some("s")),
            ("T_S", "t", Some("s")),
            ("t [s]", "t", Some("s")),
            ("time/s", "time", Some("s")),
            ("Time in ms", "time", Some("ms")),
            ("timestamp_µs", "timestamp", Some("µs")),
            ("TIMESTAMP_µS", "timestamp", Some("µs")),
            ("__time", "time", None),
            ("x_mm", "x", Some("mm")),
            ("X", "x", None),
            ("q1 (deg)", "q 1", Some("deg")),
            ("q1_rad", "q 1", Some("rad")),
            ("Q_deg_1", "q 1", Some("deg")),
            ("q[0]", "q 0", None),
            ("q[0] [rad]", "q 0", Some("rad")),
            ("state.q_d[3]", "state q d 3", None),
            ("actual_q_0", "actual q 0", None),
            ("actual_TCP_pose_2", "actual tcp pose 2", None),
            ("/joint_states/panda_joint1/position", "joint states panda joint 1 position", None),
            ("field.header.stamp", "field header stamp", None),
            ("header.stamp.nanosec", "header stamp", Some("nanosec")),
            ("jointAngle1°", "joint angle 1", Some("°")),
            ("position(x)", "position x", None),
            ("p_RS_R_x [m]", "p rs r x", Some("m")),
            ("q_RS_w []", "q rs w", None),
            ("x [inch]", "x", Some("inch")),
            ("s", "s", None),
            ("", "", None),
        ] {
            let name = Name::parse(text);
            assert_eq!(
                (name.words.join(" ").as_str(), name.unit.as_deref()),
                (words, unit),
                "{text}"
            );
        }
    }
}
