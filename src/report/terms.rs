//! What the reward is made of, over the rollouts: one panel a term, all with the same scale.

use super::reward::{WINDOW, running_mean};
use super::{ReportData, TrialRow};
use crate::draw::figure::{Figure, THIRD, thirds};
use crate::draw::plot::{Axis, Plot};
use crate::draw::svg::Panel;

/// Terms that have a panel; the others are in the numbers.
const MOST: usize = 9;
/// Longest name of a term, characters.
const NAME: usize = 38;

/// A summand of the reward, one value a trial.
pub struct Term {
    pub name: String,
    pub values: Vec<f64>,
}

pub fn figure(data: &ReportData) -> Figure {
    let terms = &data.terms[..data.terms.len().min(MOST)];
    let values = || terms.iter().flat_map(|term| term.values.iter().copied());
    let range = Axis::rounded("", values().chain([0.0]));
    let rows = match terms.is_empty() {
        true => Err("the reward of this session is not a sum of terms.".to_owned()),
        false => Ok(thirds(terms.iter().map(|term| draw(data, term, range)).collect())),
    };
    let filled = data.success.map(|_| format!(" Filled: {}.", data.successes()));
    let filled = filled.unwrap_or_default();
    let more = match data.terms.len().saturating_sub(MOST) {
        0 => String::new(),
        n => format!(" {n} more terms are not drawn."),
    };
    Figure {
        stem: "terms",
        title: "What the reward is made of",
        caption: format!(
            "The reward of a rollout is the sum of these terms, weighted as in the configuration; \
             all panels have the same scale. Line: mean of the last 10 rollouts.{filled}{more}"
        ),
        rows,
    }
}

fn draw(data: &ReportData, term: &Term, range: Axis<'_>) -> Panel {
    let trials = &data.trials;
    let name = match term.name.char_indices().nth(NAME) {
        Some((end, _)) => format!("{}…", &term.name[..end]),
        None => term.name.clone(),
    };
    let name = name.replace('-', "−");
    let x = Axis::rollouts(trials.iter().map(|trial| trial.rollout));
    let y = Axis { label: &name, ..range };
    let alt = format!("{} over {} rollouts", term.name, trials.len());
    let mut plot = Plot::new((THIRD, 210.0), &alt, x, y, &[]);
    let points = || trials.iter().zip(term.values.iter().copied());
    // Successes last, so that they lie on top.
    for success in [false, true] {
        let chosen = points().filter(|(trial, _): &(&TrialRow, f64)| trial.success == success);
        let class = if success { "dot success" } else { "dot failure" };
        chosen.for_each(|(trial, value)| plot.dot(trial.rollout as f64, value, 2.2, class));
    }
    let means = running_mean(term.values.iter().copied());
    let rollouts = trials.iter().map(|trial| trial.rollout as f64);
    plot.curve(rollouts.zip(means).skip(WINDOW - 1), "mean");
    plot.panel
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::report::sample;

    #[test]
    fn every_term_has_its_panel_with_a_point_for_each_rollout() {
        let data = sample::session(30);
        let svg = figure(&data).svg().unwrap();
        for term in &data.terms {
            assert!(svg.contains(&format!(">{}</text>", term.name)), "{}", term.name);
        }
        assert_eq!(svg.matches("<circle").count(), 30 * data.terms.len());
    }

    #[test]
    fn a_long_term_is_cut_and_no_term_is_no_figure() {
        let mut data = sample::session(30);
        data.terms[0].name = "ä".repeat(60);
        assert!(figure(&data).svg().unwrap().contains(&format!(">{}…</text>", "ä".repeat(NAME))));
        data.terms.clear();
        assert!(figure(&data).rows.is_err());
    }
}
