//! The rows of a bench as cells of text, for the terminal and for the page.

use super::Row;

/// Names of the columns, and each row's cells: text first, then numbers.
pub fn table(rows: &[Row]) -> ([&'static str; 9], Vec<[String; 9]>) {
    let head = ["name", "scenario", "unit", "n", "p50", "p99", "p99.9", "max", "misses"];
    let cells = |row: &Row| {
        [
            row.name.clone(),
            row.scenario.clone(),
            // Times are in us for programs, and in µs for people.
            if row.is_time() { "µs".into() } else { row.unit.into() },
            row.n().to_string(),
            significant(row.quantile(0.5)),
            significant(row.quantile(0.99)),
            significant(row.quantile(0.999)),
            significant(row.max()),
            row.misses.map_or("–".into(), |misses| misses.to_string()),
        ]
    };
    (head, rows.iter().map(cells).collect())
}

/// Three significant digits, without exponent.
fn significant(value: f64) -> String {
    if value <= 0.0 {
        return "0".into();
    }
    let decimals = (2.0 - value.log10().floor()).clamp(0.0, 6.0) as usize;
    format!("{value:.decimals$}")
}

#[cfg(test)]
mod tests {
    use super::significant;

    #[test]
    fn numbers_have_three_digits() {
        let found = [0.0, 0.01234, 1.0, 56.78, 123.4, 98765.0].map(significant);
        assert_eq!(found, ["0", "0.0123", "1.00", "56.8", "123", "98765"]);
    }
}
