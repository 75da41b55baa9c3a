//! Reward over the rollouts: the paper's Fig. 3, centre.

use super::{ReportData, TrialRow};
use crate::draw::figure::{Figure, HALF, Row};
use crate::draw::plot::{Axis, Entry, Key, Plot};
use crate::draw::svg::Panel;

/// Rollouts in a running mean.
pub const WINDOW: usize = 10;

const BEST: Entry = (Key::Line, "best", "best so far");
const MEAN: Entry = (Key::Line, "mean", "mean of the last 10");
const LEGEND: [Entry; 4] =
    [(Key::Dot, "dot success", "success"), (Key::Dot, "dot failure", "no success"), BEST, MEAN];
const FLIP_LEGEND: [Entry; 4] = [
    (Key::Dot, "dot success", "caught flip"),
    (Key::Dot, "dot failure", "no caught flip"),
    BEST,
    MEAN,
];
/// For a task that knows no success.
const PLAIN_LEGEND: [Entry; 3] = [(Key::Dot, "dot failure", "trial"), BEST, MEAN];

pub fn figure(data: &ReportData) -> Figure {
    let rows = if data.trials.is_empty() {
        Err("the session has no rollout yet.".to_owned())
    } else {
        let (legend, height) = match (data.success, data.counts_flips()) {
            (None, _) => (&PLAIN_LEGEND[..], 300.0),
            (Some(_), true) => (&FLIP_LEGEND[..], 262.0),
            (Some(_), false) => (&LEGEND[..], 262.0),
        };
        let mut rows = vec![Row::Half(draw(data, legend, (HALF, height)))];
        if data.success.is_some() {
            rows.push(Row::Half(draw_successes(data, (HALF, 122.0))));
        }
        Ok(rows)
    };
    let caption = match (data.success, data.counts_flips()) {
        (None, _) => "One point per rollout.",
        (Some(_), true) => {
            "One point per rollout, filled where the pancake was flipped and caught. Below: the \
             share of caught flips among the last 10 rollouts."
        }
        (Some(_), false) => {
            "One point per rollout, filled where it was a success. Below: the share of successes \
             among the last 10 rollouts."
        }
    };
    Figure { stem: "reward", title: "Learning curve", caption: caption.to_owned(), rows }
}

fn draw(data: &ReportData, legend: &[Entry], size: (f64, f64)) -> Panel {
    let trials = &data.trials;
    let rollouts = || trials.iter().map(|trial| trial.rollout as f64);
    let rewards = || trials.iter().map(|trial| trial.reward);
    let x = Axis::rollouts(trials.iter().map(|trial| trial.rollout));
    let range = Axis::exactly("reward", rewards().chain([0.0]));
    // Some room at the top, for the name of the first success.
    let y = Axis::rounded("reward", [range.min, range.max + 0.1 * (range.max - range.min)]);
    let successes = trials.iter().filter(|trial| trial.success).count();
    let alt = format!("Reward of {} rollouts, {successes} successful", trials.len());
    let mut plot = Plot::new(size, &alt, x, y, legend);

    let best = best_so_far(trials);
    plot.curve(steps(&rollouts().zip(best).collect::<Vec<_>>()), "best");
    plot.curve(rollouts().zip(running_mean(rewards())).skip(WINDOW - 1), "mean");
    let first = trials.iter().find(|trial| trial.success);
    if let Some((success, first)) = data.success.zip(first) {
        let name = format!("first {success}: {}", first.rollout);
        plot.event(first.rollout as f64, 0, &name);
    }
    for trial in trials {
        let class = if trial.success { "dot success" } else { "dot failure" };
        plot.dot(trial.rollout as f64, trial.reward, 2.8, class);
    }
    plot.panel
}

fn draw_successes(data: &ReportData, size: (f64, f64)) -> Panel {
    let trials = &data.trials;
    let successes = data.successes();
    let label = format!("{successes} among the last 10, %");
    let x = Axis::rollouts(trials.iter().map(|trial| trial.rollout));
    let y = Axis { label: &label, min: 0.0, max: 100.0 };
    let alt = format!("share of {successes} among the last 10 rollouts");
    let mut plot = Plot::new(size, &alt, x, y, &[]);
    let rollouts = trials.iter().map(|trial| trial.rollout as f64);
    let caught = trials.iter().map(|trial| if trial.success { 100.0 } else { 0.0 });
    plot.curve(rollouts.zip(running_mean(caught)).skip(WINDOW - 1), "learnt");
    plot.panel
}

/// Highest reward up to and including each rollout.
fn best_so_far(trials: &[TrialRow]) -> Vec<f64> {
    let best = |best: &mut f64, trial: &TrialRow| {
        *best = best.max(trial.reward);
        Some(*best)
    };
    trials.iter().scan(f64::NEG_INFINITY, best).collect()
}

/// Mean of each value and the [`WINDOW`] − 1 before it, as far as there are any.
pub fn running_mean(values: impl Iterator<Item = f64>) -> Vec<f64> {
    let values: Vec<f64> = values.collect();
    (1..=values.len())
        .map(|end| {
            let window = &values[end.saturating_sub(WINDOW)..end];
            window.iter().sum::<f64>() / window.len() as f64
        })
        .collect()
}

/// The corners of a line that keeps each value until the next point.
pub fn steps(points: &[(f64, f64)]) -> Vec<(f64, f64)> {
    let mut corners = Vec::with_capacity(2 * points.len());
    for pair in points.windows(2) {
        corners.extend([pair[0], (pair[1].0, pair[0].1)]);
    }
    corners.extend(points.last());
    corners
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::report::sample;

    #[test]
    fn best_and_mean_follow_the_rewards() {
        let mut trials = sample::session(12).trials;
        for (i, trial) in trials.iter_mut().enumerate() {
            trial.reward = [1.0, 3.0, 2.0, 5.0][i % 4];
        }
        assert_eq!(best_so_far(&trials)[..5], [1.0, 3.0, 3.0, 5.0, 5.0]);
        let means = running_mean(trials.iter().map(|trial| trial.reward));
        assert_eq!(means[..2], [1.0, 2.0]);
        assert_eq!(means[11], (2.0 + 5.0 + 11.0 + 11.0 - 3.0 + 0.0) / 10.0 + 0.3);
    }

    #[test]
    fn draws_one_point_per_rollout() {
        let data = sample::session(40);
        let svg = draw(&data, &LEGEND, (HALF, 300.0)).inline();
        let points = svg.matches("dot success").count() + svg.matches("dot failure").count();
        assert_eq!(points, 40 + 2, "forty points and two in the legend");
    }

    #[test]
    fn steps_are_level_between_points() {
        assert_eq!(steps(&[(1.0, 5.0), (2.0, 7.0)]), [(1.0, 5.0), (2.0, 5.0), (2.0, 7.0)]);
        assert_eq!(steps(&[]), []);
    }
}
