//! What each rollout did to the pancake: the quantities of the reward (the paper's Fig. 3, left)
//! over the rollouts.

use shm_types::measures::Measures;

use super::side_view::PAN_RADIUS;
use super::{ReportData, TrialRow, time};
use crate::draw::figure::{Figure, Row, THIRD};
use crate::draw::plot::{Axis, Plot};
use crate::draw::svg::Panel;

/// A miss beyond this is drawn here, m: a pancake thrown away must not flatten the others.
const MISS_MAX_M: f64 = 0.4;

/// One panel: its axis, the value of an outcome in the axis's unit if it has one, and a level to
/// compare with.
struct Quantity {
    axis: Axis<'static>,
    value: fn(&Measures) -> Option<f64>,
    reference: Option<f64>,
}

pub fn figure(data: &ReportData) -> Figure {
    let rows = if data.trials.is_empty() {
        Err("the session has no rollout yet.".to_owned())
    } else {
        let panels = quantities(&data.trials).iter().map(|q| draw(&data.trials, q)).collect();
        Ok(vec![Row::Thirds(panels)])
    };
    Figure {
        stem: "outcomes",
        title: "Outcomes over the rollouts",
        caption: format!(
            "Filled points: {}. Dotted lines: half a turn, and the edge of the pan. A \
             short stroke on the axis marks a rollout whose pancake never crossed the height at \
             which angle and miss are measured. A miss beyond {:.0}&#8239;cm is drawn at that value.",
            data.successes(),
            MISS_MAX_M * 100.0
        ),
        rows,
    }
}

fn quantities(trials: &[TrialRow]) -> [Quantity; 3] {
    let apexes = trials.iter().filter_map(|trial| trial.measures.get("apex_m"));
    [
        Quantity {
            axis: Axis { label: "flip angle at the crossing, °", min: 0.0, max: 200.0 },
            value: |all| of_crossing(all, "flip_angle_rad").map(f64::to_degrees),
            reference: Some(180.0),
        },
        Quantity {
            axis: Axis::rounded("apex above the start, m", apexes.chain([0.0])),
            value: |all| all.get("apex_m"),
            reference: None,
        },
        Quantity {
            axis: Axis { label: "lateral miss at the crossing, cm", min: 0.0, max: 41.0 },
            value: |all| of_crossing(all, "lateral_m").map(|miss| miss.min(MISS_MAX_M) * 100.0),
            reference: Some(PAN_RADIUS * 100.0),
        },
    ]
}

/// Only where the pancake fell back through Δ_h; else there is neither angle nor distance.
fn of_crossing(measures: &Measures, name: &str) -> Option<f64> {
    measures.get(name).filter(|_| time(measures, "crossing_time_s") > 0.0)
}

fn draw(trials: &[TrialRow], quantity: &Quantity) -> Panel {
    let x = Axis::rollouts(trials.iter().map(|trial| trial.rollout));
    let alt = format!("{} over {} rollouts", quantity.axis.label, trials.len());
    let mut plot = Plot::new((THIRD, 230.0), &alt, x, quantity.axis, &[]);
    if let Some(level) = quantity.reference {
        plot.reference(level);
    }
    // Successes last, so that they lie on top.
    for success in [false, true] {
        for trial in trials.iter().filter(|trial| trial.success == success) {
            let class = if success { "dot success" } else { "dot failure" };
            match (quantity.value)(&trial.measures) {
                Some(value) => plot.dot(trial.rollout as f64, value, 2.8, class),
                None => plot.absent(trial.rollout as f64),
            }
        }
    }
    plot.panel
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::report::sample;

    #[test]
    fn marks_rollouts_without_a_crossing_instead_of_drawing_zero() {
        let mut trials = sample::session(5).trials;
        let measured = sample::measures(&[("crossing_time_s", 1.2), ("lateral_m", 0.1)]);
        trials.iter_mut().for_each(|trial| trial.measures = measured);
        trials[3].measures = sample::measures(&[]);
        let [angle, apex, miss] = quantities(&trials).map(|quantity| draw(&trials, &quantity));
        for panel in [angle, miss] {
            assert_eq!(panel.inline().matches("absent").count(), 1);
            assert_eq!(panel.inline().matches("<circle").count(), 4);
        }
        assert_eq!(apex.inline().matches("<circle").count(), 5);
    }

    #[test]
    fn draws_far_misses_at_the_edge() {
        let far = sample::measures(&[("crossing_time_s", 1.2), ("lateral_m", 7.0)]);
        assert_eq!((quantities(&[])[2].value)(&far), Some(40.0));
    }
}
