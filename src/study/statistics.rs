//! From the numbers of many seeds to rows with 95 % intervals.

use serde::Serialize;

use super::sample::{Sample, Statistic};

/// 97.5 % quantile of the normal distribution.
const Z: f64 = 1.959964;

/// One line of a study's table.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Row {
    pub method: String,
    pub metric: String,
    /// `None` when it never happened in half of the seeds.
    pub value: Option<f64>,
    pub low95: Option<f64>,
    pub high95: Option<f64>,
    /// Extremes over all seeds.
    pub min: Option<f64>,
    pub max: Option<f64>,
}

/// One row a (method, metric), in the order in which they first appear.
pub fn rows(samples: &[Sample]) -> Vec<Row> {
    let mut groups: Vec<(&Sample, Vec<f64>)> = Vec::new();
    for sample in samples {
        let same = |(first, _): &&mut (&Sample, Vec<f64>)| {
            first.method == sample.method && first.metric == sample.metric
        };
        match groups.iter_mut().find(same) {
            Some((_, values)) => values.push(sample.value),
            None => groups.push((sample, vec![sample.value])),
        }
    }
    let finite = |value: f64| Some(value).filter(|value| value.is_finite());
    let row = |(first, values): (&Sample, Vec<f64>)| {
        let min = finite(values.iter().copied().fold(f64::INFINITY, f64::min));
        let max = finite(values.iter().copied().fold(f64::NEG_INFINITY, f64::max));
        let [value, low95, high95] = match first.statistic {
            Statistic::Rate => wilson(&values),
            Statistic::Mean => mean(&values),
            Statistic::Median => median(values),
        }
        .map(finite);
        let (method, metric) = (first.method.clone(), first.metric.clone());
        Row { method, metric, value, low95, high95, min, max }
    };
    groups.into_iter().map(row).collect()
}

/// Share and Wilson's score interval.
fn wilson(values: &[f64]) -> [f64; 3] {
    let n = values.len() as f64;
    let p = values.iter().sum::<f64>() / n;
    let scale = 1.0 / (1.0 + Z * Z / n);
    let centre = scale * (p + Z * Z / (2.0 * n));
    let half = scale * Z * (p * (1.0 - p) / n + Z * Z / (4.0 * n * n)).sqrt();
    [p, (centre - half).max(0.0), (centre + half).min(1.0)]
}

/// Mean and 1.96 standard errors to both sides.
fn mean(values: &[f64]) -> [f64; 3] {
    let n = values.len() as f64;
    let mean = values.iter().sum::<f64>() / n;
    let variance = values.iter().map(|v| (v - mean).powi(2)).sum::<f64>() / (n - 1.0).max(1.0);
    let half = Z * (variance / n).sqrt();
    [mean, mean - half, mean + half]
}

/// Median and the order statistics whose ranks enclose it with 95 %.
fn median(mut values: Vec<f64>) -> [f64; 3] {
    values.sort_by(f64::total_cmp);
    let n = values.len();
    let middle = if n % 2 == 1 { values[n / 2] } else { 0.5 * (values[n / 2 - 1] + values[n / 2]) };
    let half = 0.5 * Z * (n as f64).sqrt();
    let low = (0.5 * n as f64 - half).floor().max(0.0) as usize;
    let high = ((0.5 * n as f64 + half).ceil() as usize).min(n - 1);
    [middle, values[low], values[high]]
}

#[cfg(test)]
mod tests {
    use super::*;

    fn close(found: [f64; 3], expected: [f64; 3]) {
        for (found, expected) in found.iter().zip(expected) {
            assert!((found - expected).abs() < 5e-4, "{found} instead of {expected}");
        }
    }

    #[test]
    fn intervals_match_published_values() {
        // Wilson's interval of 8 of 10 and of 10 of 10.
        let eight: Vec<f64> = (0..10).map(|i| f64::from(i < 8)).collect();
        close(wilson(&eight), [0.8, 0.4902, 0.9433]);
        close(wilson(&[1.0; 10]), [1.0, 0.7225, 1.0]);
        close(mean(&[1.0, 2.0, 3.0]), [2.0, 2.0 - 1.1316, 2.0 + 1.1316]);
        close(median((1..=100).map(f64::from).collect()), [50.5, 41.0, 61.0]);
    }

    #[test]
    fn what_happens_in_fewer_than_half_of_the_seeds_has_no_median() {
        let first = [3.0, f64::INFINITY, f64::INFINITY];
        let samples: Vec<Sample> =
            first.iter().map(|value| Sample::median("m", "first success", *value)).collect();
        let table = rows(&samples);
        assert_eq!((table.len(), table[0].value, table[0].low95), (1, None, Some(3.0)));
        assert_eq!((table[0].min, table[0].max), (Some(3.0), None), "one seed never had it");
    }
}
