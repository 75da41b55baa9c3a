//! Benchmark functions with several global optima: F1 to F10 of Li, Engelbrecht and Epitropakis,
//! "Benchmark Functions for CEC'2013 Special Session and Competition on Niching Methods", 2013.

use std::f64::consts::{LN_2, PI};

/// A function to maximise over a box, and how it is judged.
pub struct Problem {
    pub name: &'static str,
    pub f: fn(&[f64]) -> f64,
    /// The box, D numbers each.
    pub min: &'static [f64],
    pub max: &'static [f64],
    /// Global optima, and their height.
    pub n_optima: usize,
    pub peak: f64,
    /// f is nowhere lower in the box: f − `lower` is a reward.
    pub lower: f64,
    /// Answers farther apart than this are different optima.
    pub radius: f64,
    /// Evaluations.
    pub budget: u64,
}

/// F1 to F10. The six-hump camel back is taken with its usual scale, as in the competition's
/// programs, not multiplied by four as in the report's text.
#[rustfmt::skip]
pub const PROBLEMS: [Problem; 10] = [
    Problem { name: "F1 five-uneven-peak trap", f: five_uneven_peaks, min: &[0.0], max: &[30.0],
        n_optima: 2, peak: 200.0, lower: 0.0, radius: 0.01, budget: 50_000 },
    Problem { name: "F2 equal maxima", f: equal_maxima, min: &[0.0], max: &[1.0],
        n_optima: 5, peak: 1.0, lower: 0.0, radius: 0.01, budget: 50_000 },
    Problem { name: "F3 uneven decreasing maxima", f: uneven_decreasing, min: &[0.0], max: &[1.0],
        n_optima: 1, peak: 1.0, lower: 0.0, radius: 0.01, budget: 50_000 },
    Problem { name: "F4 Himmelblau", f: himmelblau, min: &[-6.0; 2], max: &[6.0; 2],
        n_optima: 4, peak: 200.0, lower: -2000.0, radius: 0.01, budget: 50_000 },
    Problem { name: "F5 six-hump camel back", f: six_hump_camel, min: &[-1.9, -1.1],
        max: &[1.9, 1.1], n_optima: 2, peak: 1.031_628_453_489_877, lower: -6.0, radius: 0.5,
        budget: 50_000 },
    Problem { name: "F6 Shubert 2-D", f: shubert, min: &[-10.0; 2], max: &[10.0; 2],
        n_optima: 18, peak: 186.730_908_831_024, lower: -225.0, radius: 0.5, budget: 200_000 },
    Problem { name: "F7 Vincent 2-D", f: vincent, min: &[0.25; 2], max: &[10.0; 2],
        n_optima: 36, peak: 1.0, lower: -1.0, radius: 0.2, budget: 200_000 },
    Problem { name: "F8 Shubert 3-D", f: shubert, min: &[-10.0; 3], max: &[10.0; 3],
        n_optima: 81, peak: 2_709.093_505_572_82, lower: -3375.0, radius: 0.5, budget: 400_000 },
    Problem { name: "F9 Vincent 3-D", f: vincent, min: &[0.25; 3], max: &[10.0; 3],
        n_optima: 216, peak: 1.0, lower: -1.0, radius: 0.2, budget: 400_000 },
    Problem { name: "F10 modified Rastrigin", f: rastrigin, min: &[0.0; 2], max: &[1.0; 2],
        n_optima: 12, peak: -2.0, lower: -38.0, radius: 0.01, budget: 200_000 },
];

impl Problem {
    /// Global optima among the `answers`: those within `accuracy` of the peak's height, and farther
    /// apart than the niche radius.
    pub fn n_found(&self, answers: &[Vec<f64>], accuracy: f64) -> usize {
        let mut found: Vec<&Vec<f64>> = Vec::new();
        for answer in answers {
            let high = (self.peak - (self.f)(answer)).abs() <= accuracy;
            if high && found.iter().all(|other| distance(answer, other) > self.radius) {
                found.push(answer);
            }
        }
        found.len().min(self.n_optima)
    }
}

fn distance(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(a, b)| (a - b).powi(2)).sum::<f64>().sqrt()
}

fn five_uneven_peaks(x: &[f64]) -> f64 {
    match x[0] {
        x if x < 2.5 => 80.0 * (2.5 - x),
        x if x < 5.0 => 64.0 * (x - 2.5),
        x if x < 7.5 => 64.0 * (7.5 - x),
        x if x < 12.5 => 28.0 * (x - 7.5),
        x if x < 17.5 => 28.0 * (17.5 - x),
        x if x < 22.5 => 32.0 * (x - 17.5),
        x if x < 27.5 => 32.0 * (27.5 - x),
        x => 80.0 * (x - 27.5),
    }
}

fn equal_maxima(x: &[f64]) -> f64 {
    (5.0 * PI * x[0]).sin().powi(6)
}

fn uneven_decreasing(x: &[f64]) -> f64 {
    let envelope = (-2.0 * LN_2 * ((x[0] - 0.08) / 0.854).powi(2)).exp();
    envelope * (5.0 * PI * (x[0].powf(0.75) - 0.05)).sin().powi(6)
}

fn himmelblau(x: &[f64]) -> f64 {
    200.0 - (x[0].powi(2) + x[1] - 11.0).powi(2) - (x[0] + x[1].powi(2) - 7.0).powi(2)
}

fn six_hump_camel(x: &[f64]) -> f64 {
    let (a, b) = (x[0].powi(2), x[1].powi(2));
    -((4.0 - 2.1 * a + a * a / 3.0) * a + x[0] * x[1] + (4.0 * b - 4.0) * b)
}

fn shubert(x: &[f64]) -> f64 {
    let waves =
        |x: &f64| -> f64 { (1..=5).map(f64::from).map(|j| j * ((j + 1.0) * x + j).cos()).sum() };
    -x.iter().map(waves).product::<f64>()
}

fn vincent(x: &[f64]) -> f64 {
    x.iter().map(|x| (10.0 * x.ln()).sin()).sum::<f64>() / x.len() as f64
}

fn rastrigin(x: &[f64]) -> f64 {
    let wave = |(x, k): (&f64, f64)| 10.0 + 9.0 * (2.0 * PI * k * x).cos();
    -x.iter().zip([3.0, 4.0]).map(wave).sum::<f64>()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// One optimum of each, from the definitions or from the literature.
    #[test]
    fn optima_have_their_published_heights() {
        let vincent_x = (PI / 20.0).exp();
        let optima: [(usize, &[f64], f64); 12] = [
            (0, &[0.0], 1e-12),
            (0, &[30.0], 1e-12),
            (1, &[0.3], 1e-12),
            (2, &[0.079_699_392_688_696], 1e-6),
            (3, &[3.0, 2.0], 1e-12),
            (3, &[-2.805_118_086_953, 3.131_312_518_250], 1e-9),
            (4, &[0.089_842_01, -0.712_656_40], 1e-12),
            (5, &[-7.083_506_41, 4.858_056_88], 1e-9),
            (6, &[vincent_x, vincent_x], 1e-12),
            (7, &[-7.083_506_41, -7.083_506_41, 4.858_056_88], 1e-7),
            (8, &[vincent_x, vincent_x, vincent_x], 1e-12),
            (9, &[0.5, 0.625], 1e-9),
        ];
        for (index, x, tolerance) in optima {
            let problem = &PROBLEMS[index];
            let height = (problem.f)(x);
            assert!((height - problem.peak).abs() < tolerance, "{}: {height}", problem.name);
        }
    }

    /// No value of a fine grid is above the peak or below the bound, and the grid has as many
    /// local maxima near the peak's height as there are global optima.
    #[test]
    fn grids_agree_with_peaks_bounds_and_counts() {
        for problem in PROBLEMS.iter().filter(|problem| problem.min.len() < 3) {
            let n = if problem.min.len() == 1 { 20_000 } else { 800 };
            let coordinate = |d: usize, i: usize| {
                problem.min[d] + (problem.max[d] - problem.min[d]) * i as f64 / n as f64
            };
            let width = problem.min.len();
            let rows = if width == 1 { 0 } else { n };
            let at = |i: usize, j: usize| {
                let x = [coordinate(0, i), if width == 1 { 0.0 } else { coordinate(1, j) }];
                (problem.f)(&x[..width])
            };
            let values: Vec<Vec<f64>> =
                (0..=n).map(|i| (0..=rows).map(|j| at(i, j)).collect()).collect();
            let all = values.iter().flatten();
            let (low, high) = all.fold((f64::MAX, f64::MIN), |(l, h), v| (l.min(*v), h.max(*v)));
            assert!(low >= problem.lower && high <= problem.peak + 1e-9, "{}", problem.name);
            let near = high - 0.02 * (high - low);
            let is_peak = |i: usize, j: usize| {
                let v = values[i][j];
                let mut around = (i.saturating_sub(1)..=(i + 1).min(n))
                    .flat_map(|a| (j.saturating_sub(1)..=(j + 1).min(rows)).map(move |b| (a, b)));
                // Of equal neighbours the first counts.
                v > near
                    && around
                        .all(|(a, b)| values[a][b] < v || (values[a][b] == v && (i, j) <= (a, b)))
            };
            let n_peaks = (0..=n)
                .flat_map(|i| (0..=rows).map(move |j| (i, j)))
                .filter(|&(i, j)| is_peak(i, j));
            assert_eq!(n_peaks.count(), problem.n_optima, "{}", problem.name);
        }
    }

    #[test]
    fn answers_count_once_and_only_at_the_accuracy() {
        let himmelblau = &PROBLEMS[3];
        let answers =
            [[3.0, 2.0], [3.001, 2.0], [3.584_428, -1.848_126], [0.0, 0.0]].map(Vec::from);
        assert_eq!(himmelblau.n_found(&answers, 1e-1), 2);
        assert_eq!(himmelblau.n_found(&answers[1..2], 1e-4), 1);
        assert_eq!(himmelblau.n_found(&answers[1..2], 1e-5), 0);
        assert_eq!(himmelblau.n_found(&[], 1.0), 0);
    }
}
