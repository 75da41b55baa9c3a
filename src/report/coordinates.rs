//! Task coordinates over time, learnt against initial: the movements behind the paper's Fig. 4.

use learner::Demonstration;
use learner::path::PathRow;
use nalgebra::Isometry3;

use super::ReportData;
use super::stiffness::mark_events;
use crate::draw::figure::{Figure, Row, THIRD};
use crate::draw::plot::{Axis, Entry, Key, Plot};
use crate::draw::svg::Panel;

const LEGEND: [Entry; 3] = [
    (Key::Line, "learnt", "learnt"),
    (Key::Line, "initial", "first rollout"),
    (Key::Line, "attractor", "attractor"),
];
const SHOWN: Entry = (Key::Line, "shown", "demonstration");

/// What it is of whom, what it shows of a row, and of the attractor where there is one.
struct Coordinate {
    of: fn(&ReportData) -> String,
    value: fn(&PathRow) -> f32,
    attractor: Option<fn(&PathRow) -> f32>,
    /// What it is in a pose that was demonstrated.
    shown: Option<fn(&Isometry3<f64>) -> f64>,
}

const FORWARD: Coordinate = Coordinate {
    of: |data| format!("forward position of the {}, m", data.tip),
    value: |row| row.pan_position[0],
    attractor: Some(|row| row.attractor[0]),
    shown: Some(|pose| pose.translation.x),
};

/// The last one is that of the object; without one it is [`FORWARD`].
const COORDINATES: [Coordinate; 3] = [
    Coordinate {
        of: |data| format!("height of the {}, m", data.tip),
        value: |row| row.pan_position[2],
        attractor: Some(|row| row.attractor[2]),
        shown: Some(|pose| pose.translation.z),
    },
    Coordinate {
        of: |data| format!("pitch of the {}, ° (nose down > 0)", data.tip),
        value: |row| row.pan_rotation[0].to_degrees(),
        attractor: Some(|row| row.attractor[3].to_degrees()),
        shown: Some(|pose| pose.rotation.scaled_axis().y.to_degrees()),
    },
    Coordinate {
        of: |data| format!("height of the {}, m", data.object),
        value: |row| row.object_position[2],
        attractor: None,
        shown: None,
    },
];

pub fn figure(data: &ReportData) -> Figure {
    let rows = if data.film.path.len() < 2 {
        Err(format!("the session holds no path of rollout {}.", data.learnt_rollout))
    } else {
        let [height, pitch, object] = &COORDINATES;
        let third = if data.object.is_empty() { &FORWARD } else { object };
        let panels = [height, pitch, third].map(|coordinate| draw(data, coordinate));
        Ok(vec![Row::Thirds(panels.into())])
    };
    let initial = if data.initial_path.len() < 2 {
        " The session holds no path of the first rollout."
    } else {
        ""
    };
    Figure {
        stem: "coordinates",
        title: "Learnt against demonstrated",
        caption: format!(
            "Rollout {} against the demonstration and the first rollout, which imitates it. The {} \
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
    let learnt = curve(&data.film.path, coordinate.value);
    let attractor = coordinate.attractor.map_or(Vec::new(), |value| curve(&data.film.path, value));
    let shown: Vec<Vec<(f64, f64)>> = match coordinate.shown {
        Some(value) => data.demonstrations.iter().map(|shown| demonstrated(shown, value)).collect(),
        None => Vec::new(),
    };
    let all = || initial.iter().chain(&learnt).chain(&attractor).chain(shown.iter().flatten());
    let x = Axis::exactly("time, s", all().map(|point| point.0));
    let label = (coordinate.of)(data);
    let y = Axis::rounded(&label, all().map(|point| point.1));
    let alt = format!("{label} over time, learnt and initial policy");
    let n_lines = if coordinate.attractor.is_some() { 3 } else { 2 };
    let mut legend = LEGEND[..n_lines].to_vec();
    legend.extend((!shown.is_empty()).then_some(SHOWN));
    let mut plot = Plot::new((THIRD, 260.0), &alt, x, y, &legend);
    mark_events(&mut plot, &data.learnt_measures, ["", ""]);
    shown.into_iter().for_each(|curve| plot.curve(curve, "shown"));
    plot.curve(initial, "initial");
    plot.curve(attractor, "attractor");
    plot.curve(learnt, "learnt");
    plot.panel
}

/// A coordinate of a demonstration over its time, s.
fn demonstrated(shown: &Demonstration, value: fn(&Isometry3<f64>) -> f64) -> Vec<(f64, f64)> {
    let path = shown.path();
    path.iter().enumerate().map(|(i, pose)| (i as f64 * shown.period_s(), value(pose))).collect()
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
        assert!(figure.svg().is_some() && figure.caption.contains("no path of the first"));
    }
}
