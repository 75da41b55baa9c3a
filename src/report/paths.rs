//! What the arm carries and the object, from the side: the first rollout and the learnt one.

use learner::path::PathRow;

use super::ReportData;
use super::attractors::{X, Z, equal_scale};
use crate::draw::figure::{Figure, Row};
use crate::draw::plot::{Axis, Entry, Key, Plot};
use crate::draw::svg::Panel;

pub fn figure(data: &ReportData) -> Figure {
    let rows = match data.film.path.len() {
        0 | 1 => Err(format!("the session holds no path of rollout {}.", data.learnt_rollout)),
        _ => Ok(vec![Row::Half(draw(data))]),
    };
    let (tip, object, rollout) = (data.tip, data.object, data.learnt_rollout);
    let lines = match object {
        "" => format!("Solid: the {tip} in rollout {rollout}; grey: the {tip}"),
        _ => format!(
            "Solid: the {tip}; dashed: the {object} in rollout {rollout}; grey: the {object}"
        ),
    };
    Figure {
        stem: "paths",
        title: "Movement from the side",
        caption: format!(
            "Side view; both axes have the same scale. {lines} in the first rollout, which imitates the \
             demonstration. Dots mark the end of the learnt rollout."
        ),
        rows,
    }
}

const LEGEND: [Entry; 3] = [
    (Key::Line, "learnt", "tip"),
    (Key::Line, "attractor", "object"),
    (Key::Line, "initial", "object, first rollout"),
];
/// Where nothing but the tip is tracked.
const TIP_LEGEND: [Entry; 2] = [LEGEND[0], (Key::Line, "initial", "tip, first rollout")];

fn draw(data: &ReportData) -> Panel {
    let place = |position: [f32; 3]| (f64::from(position[X]), f64::from(position[Z]));
    let objects = |path: &[PathRow]| -> Vec<(f64, f64)> {
        path.iter().map(|row| place(row.object_position)).collect()
    };
    let (first, object) = (objects(&data.initial_path), objects(&data.film.path));
    let tip: Vec<_> = data.film.path.iter().map(|row| place(row.pan_position)).collect();
    let all = || [&first, &tip, &object].into_iter().flatten();
    let x = Axis::exactly("x (forward), m", all().map(|point| point.0));
    let z = Axis::exactly("z (up), m", all().map(|point| point.1));
    let (x, z, area) = equal_scale(x, z);
    let alt = format!("paths of {} and {} from the side", data.tip, data.followed());
    let legend = if data.object.is_empty() { &TIP_LEGEND[..] } else { &LEGEND };
    let mut plot = Plot::new(Plot::outer_size(area, legend), &alt, x, z, legend);
    plot.curve(first, "initial");
    plot.curve(object.iter().copied(), "attractor");
    plot.curve(tip.iter().copied(), "learnt");
    for end in [tip.last(), object.last()].into_iter().flatten() {
        plot.dot(end.0, end.1, 4.0, "dot success");
    }
    plot.panel
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::report::sample;

    #[test]
    fn both_paths_and_the_first_one_are_drawn() {
        let mut data = sample::session(5);
        let svg = figure(&data).svg().unwrap();
        assert!(svg.matches("line initial").count() >= 1, "{svg}");
        assert_eq!(svg.matches("dot success").count(), 2);
        data.film.path.clear();
        assert!(figure(&data).svg().is_none());
    }
}
