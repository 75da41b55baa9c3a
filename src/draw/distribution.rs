//! Distributions of times: how often each occurred, both axes logarithmic.

use super::figure::HALF as WIDTH;
use super::plot::{ROW, legend_places};
use super::svg::{Anchor, Panel};

const HEIGHT: f64 = 262.0;
const LEFT: f64 = 46.0;
const RIGHT: f64 = 14.0;
const BOTTOM: f64 = 26.0;
/// Title and name of the count axis, above the legend and below it.
const TOP: f64 = 44.0;
/// Bins a decade.
const BINS: f64 = 24.0;
/// Where the count axis begins: below one, so that a single value is seen.
const FEWEST: f64 = 0.6;
const CLASSES: [&str; 6] = ["learnt", "best", "mean", "top", "bottom", "initial"];

/// A logarithmic axis from data to pixels.
#[derive(Clone, Copy)]
struct Scale {
    from: (f64, f64),
    to: (f64, f64),
}

impl Scale {
    fn at(&self, value: f64) -> f64 {
        let share = (value / self.from.0).log10() / (self.from.1 / self.from.0).log10();
        self.to.0 + share * (self.to.1 - self.to.0)
    }
}

/// Times, µs, with their counts, by rising times.
pub struct Distribution {
    pub label: String,
    pub counts: Vec<(f64, u64)>,
}

/// One outline a distribution; those beyond the sixth are left out.
pub fn panel(title: &str, rows: &[Distribution]) -> Panel {
    let rows = &rows[..rows.len().min(CLASSES.len())];
    let binned: Vec<Vec<(i32, u64)>> = rows.iter().map(|row| bins(&row.counts)).collect();
    let all = || binned.iter().flatten();
    let first = all().map(|(bin, _)| *bin).min().unwrap_or(0);
    let last = all().map(|(bin, _)| *bin).max().unwrap_or(0).max(first + BINS as i32 / 4);
    let most = all().map(|(_, n)| *n).max().unwrap_or(1) as f64;

    let places = legend_places(rows.iter().map(|row| row.label.as_str()), WIDTH);
    let top = TOP + ROW * places.last().map_or(0, |(_, row)| row + 1) as f64;
    let height = HEIGHT + top - TOP;
    let mut panel = Panel::new(WIDTH, height, format!("{title}: distribution of the times"));
    panel.text((2.0, 15.0), Anchor::Start, "title", title);
    for ((Distribution { label, .. }, class), (x, row)) in rows.iter().zip(CLASSES).zip(places) {
        let y = 15.0 + ROW * (row + 1) as f64;
        panel.line((x, y - 4.0), (x + 20.0, y - 4.0), class);
        panel.text((x + 26.0, y), Anchor::Start, "tick", label);
    }
    let bottom = height - BOTTOM;
    let x = Scale { from: (edge(first - 1), edge(last + 2)), to: (LEFT, WIDTH - RIGHT) };
    let y = Scale { from: (FEWEST, 1.5 * most), to: (bottom, top) };
    axes(&mut panel, x, y);
    for (bins, class) in binned.iter().zip(CLASSES) {
        panel.path(outline(bins, x, y), class);
    }
    panel
}

/// Smallest time of a bin, µs.
fn edge(bin: i32) -> f64 {
    10_f64.powf(f64::from(bin) / BINS)
}

/// Bins that are not empty, in order.
fn bins(counts: &[(f64, u64)]) -> Vec<(i32, u64)> {
    let mut bins: Vec<(i32, u64)> = Vec::new();
    for &(value, n) in counts {
        let bin = (value.max(1e-6).log10() * BINS).floor() as i32;
        match bins.last_mut() {
            Some((last, count)) if *last == bin => *count += n,
            _ => bins.push((bin, n)),
        }
    }
    bins
}

/// Steps over the bins, down to the axis where there is nothing.
fn outline(bins: &[(i32, u64)], x: Scale, y: Scale) -> Vec<(f64, f64)> {
    let mut points = Vec::new();
    let mut end = None;
    for &(bin, n) in bins {
        let (left, right) = (x.at(edge(bin)), x.at(edge(bin + 1)));
        if end != Some(bin) {
            if let Some(end) = end {
                points.push((x.at(edge(end)), y.to.0));
                points.push((f64::NAN, f64::NAN));
            }
            points.push((left, y.to.0));
        }
        let at = y.at(n as f64);
        points.extend([(left, at), (right, at)]);
        end = Some(bin + 1);
    }
    if let Some(end) = end {
        points.push((x.at(edge(end)), y.to.0));
    }
    points
}

fn axes(panel: &mut Panel, x: Scale, y: Scale) {
    let ((left, right), (bottom, top)) = (x.to, y.to);
    for power in 0..12 {
        let n = 10_f64.powi(power);
        if n > y.from.1 {
            break;
        }
        panel.line((left, y.at(n)), (right, y.at(n)), "grid");
        let label = match power {
            0..3 => format!("{n}"),
            3..6 => format!("{}k", n / 1e3),
            _ => format!("{}M", n / 1e6),
        };
        panel.text((left - 7.0, y.at(n) + 4.5), Anchor::End, "tick", &label);
    }
    let decades = (x.from.1 / x.from.0).log10();
    let factors: &[f64] = if decades < 2.5 { &[1.0, 2.0, 5.0] } else { &[1.0] };
    for power in -6..9 {
        for factor in factors {
            let us = factor * 10_f64.powi(power);
            if us < x.from.0 || us > x.from.1 {
                continue;
            }
            panel.line((x.at(us), top), (x.at(us), bottom), "grid");
            panel.line((x.at(us), bottom), (x.at(us), bottom + 5.0), "axis");
            panel.text((x.at(us), bottom + 19.0), Anchor::Middle, "tick", &time(us));
        }
    }
    panel.line((left, bottom), (right, bottom), "axis");
    panel.text((2.0, top - 10.0), Anchor::Start, "tick", "count");
}

/// A round time with the unit that suits it.
fn time(us: f64) -> String {
    match us {
        us if us < 0.9 => format!("{:.0} ns", us * 1e3),
        us if us < 900.0 => format!("{us:.0} µs"),
        us if us < 9e5 => format!("{:.0} ms", us * 1e-3),
        us => format!("{:.0} s", us * 1e-6),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_value_is_in_a_bin_and_an_empty_distribution_draws_nothing() {
        let distribution = |counts: &[(f64, u64)]| Distribution {
            label: "A <figure>".into(),
            counts: counts.to_vec(),
        };
        let some = distribution(&[(1.0, 2), (2.0, 1), (900.0, 1), (40_000.0, 1)]);
        let bins = bins(&some.counts);
        assert_eq!(bins.iter().map(|(_, n)| n).sum::<u64>(), 5);
        assert_eq!(bins[0].1, 2);
        let svg = panel("times", &[some, distribution(&[])]).inline();
        assert!(!svg.contains("NaN") && !svg.contains("inf") && svg.contains("A &lt;figure&gt;"));
        assert!(!panel("nothing", &[distribution(&[])]).inline().contains("NaN"));
    }

    #[test]
    fn times_carry_the_unit_that_suits_them() {
        assert_eq!(
            [0.05, 1.0, 200.0, 1e3, 2e6].map(time),
            ["50 ns", "1 µs", "200 µs", "1 ms", "2 s"]
        );
    }
}
