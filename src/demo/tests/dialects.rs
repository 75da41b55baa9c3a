//! However a recording is written down, it imports to the same demonstration.

use std::fmt::Write;

use super::*;

/// How one file is written.
#[derive(Clone, Copy, Debug)]
struct Style {
    separator: &'static str,
    decimal_comma: bool,
    quoted: bool,
    upper: bool,
    trailing: bool,
    line_end: &'static str,
    encoding: &'static str,
    comment: &'static str,
    /// Where units stand: `_u`, ` [u]`, ` (u)`, `/u`, a row below, or nowhere.
    units: usize,
    /// Name and size of the unit, s.
    time: (&'static str, f64),
    length: (&'static str, f64),
    angle: (&'static str, f64),
    epoch: bool,
    quaternion: bool,
    time_name: &'static str,
    /// Every so many rows: an empty one, a row without values, one that repeats the last time.
    extra_rows: usize,
}

fn pick<T: Copy>(random: &mut ChaCha8Rng, from: &[T]) -> T {
    from[random.random_range(0..from.len())]
}

impl Style {
    fn random(random: &mut ChaCha8Rng) -> Style {
        let separator = pick(random, &[",", ", ", ";", "\t", "|", " ", "   "]);
        let decimal_comma = random.random_bool(0.5);
        let units = random.random_range(0..6);
        let si = units == 5;
        Style {
            separator,
            decimal_comma,
            quoted: random.random_bool(0.2) || (decimal_comma && separator.starts_with(',')),
            upper: random.random_bool(0.3),
            trailing: random.random_bool(0.2) && !separator.starts_with(' '),
            line_end: pick(random, &["\n", "\r\n", "\r"]),
            encoding: pick(random, &["utf-8", "bom", "utf-16le", "utf-16be", "utf-16", "latin-1"]),
            comment: pick(random, &["", "# by hand; 2024, µ", "// a | b", "% c"]),
            units,
            time: pick(
                random,
                &[("s", 1.0), ("ms", 1e-3), ("us", 1e-6), ("µs", 1e-6), ("ns", 1e-9)],
            ),
            length: if si {
                ("m", 1.0)
            } else {
                pick(random, &[("m", 1.0), ("cm", 1e-2), ("mm", 1e-3)])
            },
            angle: match si {
                true => ("rad", 1.0),
                false => pick(random, &[("rad", 1.0), ("deg", PI / 180.0), ("°", PI / 180.0)]),
            },
            epoch: random.random_bool(0.5),
            quaternion: random.random_bool(0.5),
            time_name: pick(random, &["t", "time", "timestamp", "Stamp"]),
            extra_rows: pick(random, &[0, 3, 10]),
        }
    }

    fn line(&self, cells: &[String]) -> String {
        let quote = |cell: &String| if self.quoted { format!("\"{cell}\"") } else { cell.clone() };
        let cells: Vec<String> = cells.iter().map(quote).collect();
        let end = if self.trailing { self.separator.trim_end_matches(' ') } else { "" };
        format!("{}{end}{}", cells.join(self.separator), self.line_end)
    }

    fn number(&self, value: String) -> String {
        if self.decimal_comma { value.replace('.', ",") } else { value }
    }

    fn name(&self, name: &str, unit: &str) -> String {
        let text = match self.units {
            _ if unit.is_empty() => name.to_string(),
            0 => format!("{name}_{unit}"),
            1 => format!("{name} [{unit}]"),
            2 => format!("{name} ({unit})"),
            3 => format!("{name}/{unit}"),
            _ => name.to_string(),
        };
        if self.upper { text.to_uppercase() } else { text }
    }

    /// The built-in demonstration, as text.
    fn text(&self) -> String {
        let columns = [
            (self.time_name, self.time.0),
            ("x", self.length.0),
            ("y", self.length.0),
            ("z", self.length.0),
        ];
        let turns: &[(&str, &str)] = match self.quaternion {
            true => &[("qw", ""), ("qx", ""), ("qy", ""), ("qz", "")],
            false => &[("pitch", self.angle.0)],
        };
        let columns: Vec<(&str, &str)> = columns.iter().chain(turns).copied().collect();
        let mut text = String::new();
        if !self.comment.is_empty() {
            write!(text, "{}{}{}", self.comment, self.line_end, self.line_end).unwrap();
        }
        text += &self
            .line(&columns.iter().map(|(name, unit)| self.name(name, unit)).collect::<Vec<_>>());
        if self.units == 4 {
            let unit = |(_, unit): &(&str, &str)| {
                if unit.is_empty() { "-".into() } else { (*unit).into() }
            };
            text += &self.line(&columns.iter().map(unit).collect::<Vec<String>>());
        }
        for (k, pose) in built_in().poses().iter().enumerate() {
            let ticks = (10_000_000 * k as i64) / (self.time.1 * 1e9).round() as i64;
            let since = if self.epoch { (1_732_800_000.0 / self.time.1) as i64 } else { 0 };
            let stamp = match self.time.0 {
                "s" => format!("{:.6}", since as f64 + 0.01 * k as f64),
                _ => format!("{}", since + ticks),
            };
            let mut values =
                vec![pose[0] / self.length.1, pose[1] / self.length.1, pose[2] / self.length.1];
            match self.quaternion {
                true => values.extend([(0.5 * pose[3]).cos(), 0.0, (0.5 * pose[3]).sin(), 0.0]),
                false => values.push(pose[3] / self.angle.1),
            }
            let mut row = vec![self.number(stamp.clone())];
            row.extend(values.iter().map(|value| self.number(format!("{value:.9}"))));
            text += &self.line(&row);
            if self.extra_rows > 0 && k % self.extra_rows == 0 {
                text += &self.line(&row);
                text += self.line_end;
                let none = if self.separator.starts_with(' ') { "nan" } else { "" };
                let mut empty = vec![none.to_string(); row.len()];
                empty[0] = self.number(stamp);
                text += &self.line(&empty);
            }
        }
        text
    }

    fn bytes(&self) -> Vec<u8> {
        let text = self.text();
        let units = || text.encode_utf16();
        match self.encoding {
            "bom" => format!("\u{feff}{text}").into_bytes(),
            "utf-16le" => units().flat_map(u16::to_le_bytes).collect(),
            "utf-16be" => units().flat_map(u16::to_be_bytes).collect(),
            "utf-16" => {
                [&b"\xff\xfe"[..], &units().flat_map(u16::to_le_bytes).collect::<Vec<_>>()].concat()
            }
            // A capital µ is not in it.
            "latin-1" => text.replace('Μ', "µ").chars().map(|c| c as u8).collect(),
            _ => text.into_bytes(),
        }
    }
}

#[test]
fn any_combination_of_dialect_unit_and_stamp_is_the_same_demonstration() {
    let (arm, mut random) = (arm(), ChaCha8Rng::seed_from_u64(25));
    for _ in 0..1500 {
        let style = Style::random(&mut random);
        let bytes = style.bytes();
        let fail = |error: String| -> ! {
            let text = String::from_utf8_lossy(&bytes);
            panic!("{error}\n{style:?}\n{}", text.chars().take(600).collect::<String>())
        };
        let imported = super::super::import("r.csv", &bytes, &arm, &AS_IT_IS);
        let imported = imported.unwrap_or_else(|error| fail(format!("{error:#}")));
        if imported.poses.len() != built_in().poses().len() {
            fail(format!("{} samples", imported.poses.len()));
        }
        let deviation = deviation(&imported.poses, 0, 6);
        if deviation > 2e-6 {
            fail(format!("deviates by {deviation}"));
        }
    }
}
