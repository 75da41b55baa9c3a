//! One cell of a recording: a number, nothing, or a list of numbers.

/// How a file writes one half: 0.5 or 0,5.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum DecimalMark {
    Point,
    Comma,
}

/// `text` without spaces and without quotes that a reader left around it.
pub fn bare(text: &str) -> &str {
    let text = text.trim();
    for quote in ['"', '\''] {
        if let Some(inner) = text.strip_prefix(quote).and_then(|rest| rest.strip_suffix(quote)) {
            return inner.trim();
        }
    }
    text
}

/// A finite number.
pub fn number(text: &str, mark: DecimalMark) -> Option<f64> {
    let text = bare(text);
    let number: f64 = match mark {
        DecimalMark::Point => text.parse().ok()?,
        DecimalMark::Comma => {
            // A comma stands between digits, and a point beside it would be of thousands.
            let (_, fraction) = text.split_once(',').unwrap_or((text, "0"));
            if text.contains('.') || !fraction.starts_with(|c: char| c.is_ascii_digit()) {
                return None;
            }
            text.replacen(',', ".", 1).parse().ok()?
        }
    };
    Some(number).filter(|number| number.is_finite())
}

/// What recorders write where they have no value.
pub fn is_missing(text: &str) -> bool {
    let word = bare(text).to_ascii_lowercase();
    matches!(
        word.as_str(),
        "" | "nan"
            | "+nan"
            | "-nan"
            | "-nan(ind)"
            | "na"
            | "n/a"
            | "#n/a"
            | "null"
            | "none"
            | "<na>"
    )
}

/// The items of `[0.1, 0.2]`, `(0.1, 0.2)` or `[0.1 0.2]`.
pub fn list(text: &str) -> Option<Vec<&str>> {
    let text = bare(text);
    let inner = (text.strip_prefix('[').and_then(|rest| rest.strip_suffix(']')))
        .or_else(|| text.strip_prefix('(').and_then(|rest| rest.strip_suffix(')')))?;
    let inner = inner.trim().trim_end_matches(',');
    let separator = if inner.contains(';') { ';' } else { ',' };
    let items: Vec<&str> = match inner.contains(separator) {
        true => inner.split(separator).map(str::trim).collect(),
        false => inner.split_whitespace().collect(),
    };
    (!items.is_empty()).then_some(items)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_follow_the_decimal_mark() {
        for (text, point, comma) in [
            ("0.5", Some(0.5), None),
            ("0,5", None, Some(0.5)),
            (" -1e-3 ", Some(-1e-3), Some(-1e-3)),
            ("-1,5E2", None, Some(-150.0)),
            ("\"7\"", Some(7.0), Some(7.0)),
            ("0,", None, None),
            ("1.234,5", None, None),
            ("1,234,5", None, None),
            ("nan", None, None),
            ("inf", None, None),
            ("", None, None),
        ] {
            assert_eq!(number(text, DecimalMark::Point), point, "{text}");
            assert_eq!(number(text, DecimalMark::Comma), comma, "{text}");
        }
    }

    #[test]
    fn lists_and_gaps_are_told_from_words() {
        assert_eq!(list("[0.1, 0.2]"), Some(vec!["0.1", "0.2"]));
        assert_eq!(list("(1,)"), Some(vec!["1"]));
        assert_eq!(list("[ 0.1  0.2\n 0.3]"), Some(vec!["0.1", "0.2", "0.3"]));
        assert_eq!(list("[0,1; 0,2]"), Some(vec!["0,1", "0,2"]));
        assert_eq!((list("0.1"), list("[]")), (None, None));
        assert!(["", " NaN ", "null", "-nan"].iter().all(|text| is_missing(text)));
        assert!(!["inf", "two", "0"].iter().any(|text| is_missing(text)));
    }
}
