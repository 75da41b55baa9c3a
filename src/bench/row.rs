//! One line of a bench: a distribution with three significant digits.

use std::time::Duration;

use hdrhistogram::Histogram;
use serde_json::{Value, json};

/// Longest time that is told from longer ones, ns.
const MAX_NS: u64 = 100_000_000_000;

pub struct Row {
    /// Rows of one group share a figure.
    pub group: String,
    pub name: String,
    pub scenario: String,
    pub unit: &'static str,
    /// Deadlines missed, where there are deadlines.
    pub misses: Option<u64>,
    /// Value of one count of the histogram, in `unit`.
    scale: f64,
    histogram: Histogram<u64>,
}

impl Row {
    fn new(group: &str, name: &str, scenario: &str, unit: &'static str, scale: f64) -> Row {
        Row {
            group: group.into(),
            name: name.into(),
            scenario: scenario.into(),
            unit,
            misses: None,
            scale,
            histogram: Histogram::new_with_bounds(1, MAX_NS, 3).expect("bounds are valid"),
        }
    }

    /// Times, recorded in ns.
    pub fn time(group: &str, name: &str, scenario: &str) -> Row {
        Row::new(group, name, scenario, "us", 1e-3)
    }

    /// Times of `calls` calls at once, recorded in ns; values are the mean of one call.
    pub fn batch(group: &str, name: &str, scenario: &str, calls: usize) -> Row {
        Row::new(group, name, scenario, "us", 1e-3 / calls as f64)
    }

    /// With deadlines, or answers, that may be missed.
    pub fn with_misses(self) -> Row {
        Row { misses: Some(0), ..self }
    }

    /// Values of another unit, told apart by a thousandth.
    pub fn value(group: &str, name: &str, scenario: &str, unit: &'static str) -> Row {
        Row::new(group, name, scenario, unit, 1e-3)
    }

    /// Adds a time, of a whole batch if the row is one.
    pub fn add_time(&mut self, time: Duration) {
        self.histogram.saturating_record(time.as_nanos() as u64);
    }

    /// Adds a time that occurred so often.
    pub fn add_times(&mut self, time: Duration, times: u64) {
        self.histogram.saturating_record_n(time.as_nanos() as u64, times);
    }

    /// Adds a value in the row's unit.
    pub fn add(&mut self, value: f64) {
        self.histogram.saturating_record((value / self.scale).round() as u64);
    }

    pub fn is_time(&self) -> bool {
        self.unit == "us"
    }

    pub fn n(&self) -> u64 {
        self.histogram.len()
    }

    /// The value that a share of the values does not exceed.
    pub fn quantile(&self, share: f64) -> f64 {
        self.histogram.value_at_quantile(share) as f64 * self.scale
    }

    pub fn max(&self) -> f64 {
        self.histogram.max() as f64 * self.scale
    }

    /// Every value that occurred and how often, from the smallest.
    pub fn counts(&self) -> impl Iterator<Item = (f64, u64)> {
        self.histogram
            .iter_recorded()
            .map(|at| (at.value_iterated_to() as f64 * self.scale, at.count_at_value()))
    }

    pub fn to_json(&self) -> Value {
        json!({
            "name": self.name,
            "scenario": self.scenario,
            "unit": self.unit,
            "n": self.n(),
            "p50": self.quantile(0.5),
            "p99": self.quantile(0.99),
            "p999": self.quantile(0.999),
            "max": self.max(),
            "misses": self.misses,
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn keeps_three_digits_whatever_the_unit() {
        let near = |found: f64, expected: f64| (found / expected - 1.0).abs() < 2e-3;
        let mut time = Row::time("g", "n", "s");
        for us in 1..=1000 {
            time.add_time(Duration::from_micros(us));
        }
        assert!(near(time.quantile(0.5), 500.0) && near(time.quantile(0.999), 999.0));
        assert!(near(time.max(), 1000.0));

        let mut batch = Row::batch("g", "n", "s", 100);
        batch.add_time(Duration::from_nanos(1234));
        assert!(near(batch.max(), 0.01234));

        let mut rate = Row::value("g", "n", "s", "1/s");
        rate.add(12.3);
        assert!(near(rate.max(), 12.3));
        assert_eq!(rate.counts().map(|(_, n)| n).sum::<u64>(), 1);
    }
}
