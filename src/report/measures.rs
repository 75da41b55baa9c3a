//! Every number that was measured, over the rollouts: of any task.

use shm_types::measures::TRUTH;

use super::{ReportData, TrialRow};
use crate::draw::figure::{Figure, THIRD, thirds};
use crate::draw::plot::{Axis, Plot};
use crate::draw::svg::Panel;

/// Panels of the figure; a task with more numbers shows its first ones.
const MOST: usize = 12;

pub fn figure(data: &ReportData) -> Figure {
    let names = names(&data.trials);
    let rows = if names.is_empty() {
        Err("nothing was measured yet.".to_owned())
    } else {
        Ok(thirds(names.iter().map(|(name, unit)| draw(&data.trials, name, unit)).collect()))
    };
    Figure {
        stem: "measures",
        title: "Measures over the rollouts",
        caption: format!(
            "{}A short stroke on the axis marks a rollout without this measure.",
            if data.success.is_some() { "Filled points: rollouts that succeeded. " } else { "" }
        ),
        rows,
    }
}

/// Names and units of the numbers of which there are some, the torques of the joints last: a task of one's own adds
/// its measures behind them.
fn names(trials: &[TrialRow]) -> Vec<(String, String)> {
    let measured = trials.iter().find(|trial| !trial.measures.is_empty());
    let declared = measured.map_or_else(Vec::new, |trial| trial.measures.declared());
    let numbers = declared.into_iter().filter(|(_, unit)| unit != TRUTH);
    let (torques, others): (Vec<_>, Vec<_>) =
        numbers.partition(|(name, unit)| name.starts_with("torque_") && unit == "N·m");
    others.into_iter().chain(torques).take(MOST).collect()
}

fn draw(trials: &[TrialRow], name: &str, unit: &str) -> Panel {
    let value = |trial: &TrialRow| trial.measures.get(name).filter(|value| value.is_finite());
    let label = if unit == "1" { name.to_owned() } else { format!("{name}, {unit}") };
    let x = Axis::rollouts(trials.iter().map(|trial| trial.rollout));
    let y = Axis::rounded(&label, trials.iter().filter_map(value));
    let alt = format!("{label} over {} rollouts", trials.len());
    let mut plot = Plot::new((THIRD, 230.0), &alt, x, y, &[]);
    // Successes last, so that they lie on top.
    for success in [false, true] {
        for trial in trials.iter().filter(|trial| trial.success == success) {
            let class = if success { "dot success" } else { "dot failure" };
            match value(trial) {
                Some(value) => plot.dot(trial.rollout as f64, value, 2.8, class),
                None => plot.absent(trial.rollout as f64),
            }
        }
    }
    plot.panel
}
