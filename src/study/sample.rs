//! What one seed of a study yields: named numbers of named methods.

use serde::{Deserialize, Serialize};

/// How the values of a metric over the seeds become one row.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Statistic {
    /// Share of seeds with value 1 (the others 0).
    Rate,
    Mean,
    Median,
}

/// One number of one method on one seed.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Sample {
    pub method: String,
    pub metric: String,
    pub statistic: Statistic,
    /// Infinite when it never happened (only for medians); written as null.
    #[serde(with = "never")]
    pub value: f64,
}

impl Sample {
    pub fn rate(method: &str, metric: &str, happened: bool) -> Sample {
        Sample::new(method, metric, Statistic::Rate, f64::from(happened))
    }

    pub fn mean(method: &str, metric: &str, value: f64) -> Sample {
        Sample::new(method, metric, Statistic::Mean, value)
    }

    pub fn median(method: &str, metric: &str, value: f64) -> Sample {
        Sample::new(method, metric, Statistic::Median, value)
    }

    fn new(method: &str, metric: &str, statistic: Statistic, value: f64) -> Sample {
        Sample { method: method.into(), metric: metric.into(), statistic, value }
    }
}

/// JSON knows no infinity.
mod never {
    use serde::{Deserialize, Deserializer, Serialize, Serializer};

    pub fn serialize<S: Serializer>(value: &f64, serializer: S) -> Result<S::Ok, S::Error> {
        Some(*value).filter(|value| value.is_finite()).serialize(serializer)
    }

    pub fn deserialize<'de, D: Deserializer<'de>>(deserializer: D) -> Result<f64, D::Error> {
        Ok(Option::deserialize(deserializer)?.unwrap_or(f64::INFINITY))
    }
}
