//! The flip as a film strip: the paper's Fig. 4.

use std::f64::consts::FRAC_PI_2;

use learner::path::PathRow;
use nalgebra::Vector3;
use shm_types::measures::Measures;

use super::bodies::{draw_ground, draw_links};
use super::film::{Film, object};
use super::side_view::{View, draw_pan, draw_pancake, orientation};
use super::{ReportData, time};
use crate::draw::figure::{FRAME, Figure, Row};
use crate::draw::plot::fixed;
use crate::draw::svg::{Anchor, Panel};

/// Height of the text below a frame, px.
const TEXT: f64 = 40.0;
/// Height of a label above its mark, px.
const LABEL: f64 = 15.0;
/// Distance of the height marks, m.
const HEIGHT_MARK: f64 = 0.2;

/// A moment of the rollout: row of the path and its name.
type Moment = (usize, &'static str);

pub fn figure(data: &ReportData) -> Figure {
    let film = data.film.finite();
    let path = &film.path;
    let measures = &data.learnt_measures;
    let rows = if path.len() < 2 {
        Err(format!("the session holds no path of rollout {}.", data.learnt_rollout))
    } else {
        let view = View::of(path, FRAME);
        let radii = data.look.as_ref().map_or(&[][..], |look| &look.radii);
        let moments = moments(path, measures).into_iter().enumerate();
        let frames = moments.map(|(i, moment)| draw(&film, radii, &view, moment, i == 0)).collect();
        Ok(vec![Row::Frames(frames)])
    };
    let flight =
        if time(measures, "crossing_time_s") > 0.0 { "" } else { " In this rollout it never did." };
    Figure {
        stem: "flip",
        title: "The flip, moment by moment",
        caption: format!(
            "Rollout {} from the side. All frames have the same scale; heights are in m. \
             The pancake's original top is light and carries its normal V. Its \
             path is dotted, and solid up to the current moment. Crossing: it falls back to \
             Δ<sub>h</sub> = 10&#8239;cm above the pan.{flight}",
            data.learnt_rollout
        ),
        rows,
    }
}

/// The moments worth a frame, in order of time, without two frames of the same row.
fn moments(path: &[PathRow], measures: &Measures) -> Vec<Moment> {
    let last = path.len() - 1;
    let row_at = |t_s: f64| path.partition_point(|row| f64::from(row.t_s) < t_s).min(last);
    let apex = highest(path, |row| row.object_position[2]);
    let has_flown = time(measures, "release_time_s") > 0.0;
    let throw_end = if has_flown { row_at(time(measures, "release_time_s")) } else { apex.max(1) };
    let dip = highest(&path[..=throw_end], |row| -row.pan_position[2]);

    let mut moments = vec![(0, "start"), (dip, "dip"), (apex, "apex"), (last, "end")];
    if has_flown {
        // Half way in height between dip and release the pan is fastest, or nearly so.
        let [from, to] = [dip, throw_end].map(|row| path[row].pan_position[2]);
        let rising = &path[dip..=throw_end];
        let throw = dip + rising.partition_point(|row| row.pan_position[2] < 0.5 * (from + to));
        moments.extend([(throw.min(last), "throw"), (throw_end, "release")]);
        let side = path[throw_end..].iter().position(|row| tilt(&path[0], row) >= FRAC_PI_2);
        moments.extend(side.map(|row| (throw_end + row, "on edge")));
    }
    if time(measures, "crossing_time_s") > 0.0 {
        moments.push((row_at(time(measures, "crossing_time_s")), "crossing"));
    }
    // Of two names for one row the earlier in this list is kept.
    moments.sort_by_key(|moment| moment.0);
    moments.dedup_by_key(|moment| moment.0);
    moments
}

fn highest(path: &[PathRow], value: impl Fn(&PathRow) -> f32) -> usize {
    let rows = path.iter().enumerate();
    rows.max_by(|a, b| value(a.1).total_cmp(&value(b.1))).map_or(0, |(row, _)| row)
}

/// arccos(V₀·V), how far the pancake has turned over, rad.
fn tilt(first: &PathRow, row: &PathRow) -> f64 {
    let [v0, v] = [first, row].map(|row| orientation(row) * Vector3::z());
    v0.angle(&v)
}

fn draw(film: &Film, radii: &[f64], view: &View, (row, name): Moment, labelled: bool) -> Panel {
    let path = &film.path;
    let (width, height) = (view.width(), view.height());
    let time = fixed(f64::from(path[row].t_s), 2);
    let mut panel = Panel::new(
        width,
        height + TEXT,
        format!("{name}, {time} s: pan and pancake from the side"),
    );
    panel.clipped((0.0, 0.0), (width, height), |panel| {
        draw_heights(panel, view, labelled);
        draw_ground(panel, view);
        draw_links(panel, view, film.links(row), radii);
        let flown = |row: &PathRow| view.at(&object(row));
        panel.path(path.iter().map(flown), "trail");
        panel.path(path[..=row].iter().map(flown), "travelled");
        draw_pan(panel, view, &path[row]);
        draw_pancake(panel, view, &path[row]);
    });
    let corners = [(0.0, 0.0), (width, 0.0), (width, height), (0.0, height)];
    panel.polygon(corners, "frame");
    panel.text((width / 2.0, height + 16.0), Anchor::Middle, "text", name);
    panel.text((width / 2.0, height + 33.0), Anchor::Middle, "tick", &format!("{time} s"));
    panel
}

/// Height marks above the ground; the frames share them, so only one needs the numbers.
fn draw_heights(panel: &mut Panel, view: &View, labelled: bool) {
    let first = (view.z.0 / HEIGHT_MARK).ceil() as i64;
    let last = (view.z.1 / HEIGHT_MARK).floor() as i64;
    for mark in first..=last {
        let z = mark as f64 * HEIGHT_MARK;
        let y = view.at(&Vector3::new(view.x.0, 0.0, z)).1;
        panel.line((0.0, y), (view.width(), y), "grid");
        // A label whose mark is at the very top would be cut off.
        if labelled && y > LABEL {
            panel.text((4.0, y - 4.0), Anchor::Start, "tick", &fixed(z, 1));
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::report::sample;

    #[test]
    fn a_flip_has_all_its_moments_in_order() {
        let data = sample::session(5);
        let names: Vec<_> =
            moments(&data.film.path, &data.learnt_measures).iter().map(|m| m.1).collect();
        let flip = ["start", "dip", "throw", "release", "on edge", "apex", "crossing", "end"];
        assert_eq!(names.len(), 8, "{names:?}");
        assert!(flip.iter().all(|name| names.contains(name)), "{names:?}");
        assert_eq!(
            (names[0], names[3], names[6], names[7]),
            ("start", "release", "crossing", "end")
        );
    }

    #[test]
    fn a_rollout_without_flight_has_fewer_frames() {
        let data = sample::session(5);
        let moments = moments(&data.initial_path, &Measures::NONE);
        assert!((2..=4).contains(&moments.len()), "{moments:?}");
        assert!(moments.windows(2).all(|pair| pair[0].0 < pair[1].0));
    }

    #[test]
    fn rows_that_are_not_finite_are_left_out() {
        let mut data = sample::session(5);
        data.film.path[3].object_position[2] = f32::NAN;
        data.film.path[9].pan_rotation[0] = f32::INFINITY;
        assert!(figure(&data).svg().is_some_and(|svg| !svg.contains("NaN")));
    }
}
