//! Task coordinates over time, learnt against initial: the movements behind the paper's Fig. 4.

use learner::path::PathRow;

use super::ReportData;
use super::stiffness::mark_events;
use crate::draw::figure::{Figure, Row, THIRD};
use crate::draw::plot::{Axis, Entry, Key, Plot};
use crate::draw::svg::Panel;

const LEGEND: [Entry; 3] = [
    (Key::Line, "learnt", "learnt"),
    (Key::Line, "initial", "initial"),
    (Key::Line, "attractor", "attractor"),
];

/// What it is of whom, what it shows of a row, and of the attractor where there is one.
struct Coordinate {
    of: fn(&ReportData) -> String,
    value: fn(&PathRow) -> f32,
    attractor: Option<fn(&PathRow) -> f32>,
}

const COORDINATES: [Coordinate; 3] = [
    Coordinate {
        of: |data| format!("height of the {}, m", data.tip),
        value: |row| row.pan_position[2],
        attractor: Some(|row| row.attractor[2]),
    },
    Coordinate {
        of: |data| format!("pitch of the {}, ° (nose down > 0)", data.tip),
        value: |row| row.pan_rotation[0].to_degrees(),
        attractor: Some(|row| row.attractor[3].to_degrees()),
    },
    Coordinate {
        of: |data| format!("height of the {}, m", data.object),
        value: |row| row.object_position[2],
        attractor: None,
    },
];

pub fn figure(data: &ReportData) -> Figure {
    let rows = if data.learnt_path.len() < 2 {
        Err(format!("the session holds no path of rollout {}.", data.learnt_rollout))
    } else {
        let panels = COORDINATES.iter().map(|coordinate| draw(data, coordinate)).collect();
        Ok(vec![Row::Thirds(panels)])
    };
    let initial = if data.initial_path.len() < 2 {
        " The session holds no path of the initial policy."
    } else {
        ""
    };
    Figure {
        stem: "coordinates",
        title: "Movement over time",
        caption: format!(
            "Rollout {} against the initial policy, which imitates the demonstration. The {} \
             lags behind its attractor like a mass on a spring, most where the springs are \
             soft. Dotted lines: {} of the learnt rollout.{initial}",
            data.learnt_rollout,
            data.tip,
            if data.is_toss() { "release and crossing" } else { "crossing, where there is one," }
        ),
        rows,
    }
}

fn draw(data: &ReportData, coordinate: &Coordinate) -> Panel {
    let curve = |path: &[PathRow], value: fn(&PathRow) -> f32| -> Vec<(f64, f64)> {
        path.iter().map(|row| (f64::from(row.t_s), f64::from(value(row)))).collect()
    };
    let initial = curve(&data.initial_path, coordinate.value);
    let learnt = curve(&data.learnt_path, coordinate.value);
    let attractor =
        coordinate.attractor.map_or(Vec::new(), |value| curve(&data.learnt_path, value));
    let all = || initial.iter().chain(&learnt).chain(&attractor);
    let x = Axis::exactly("time, s", all().map(|point| point.0));
    let label = (coordinate.of)(data);
    let y = Axis::rounded(&label, all().map(|point| point.1));
    let alt = format!("{label} over time, learnt and initial policy");
    let legend = if coordinate.attractor.is_some() { &LEGEND[..] } else { &LEGEND[..2] };
    let mut plot = Plot::new((THIRD, 250.0), &alt, x, y, legend);
    mark_events(&mut plot, &data.learnt_measures, ["", ""]);
    plot.curve(initial, "initial");
    plot.curve(attractor, "attractor");
    plot.curve(learnt, "learnt");
    plot.panel
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::report::sample;

    #[test]
    fn leaves_out_the_initial_path_when_there_is_none_and_says_so() {
        let mut data = sample::session(3);
        data.initial_path.clear();
        let figure = figure(&data);
        assert!(figure.svg().is_some() && figure.caption.contains("no path of the initial"));
    }
}
