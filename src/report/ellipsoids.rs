//! Stiffness along the learnt path: ellipses of Σ hᵢ(t) Kᵢ in the side plane, where the pan was.

use learner::activation;
use learner::path::PathRow;
use nalgebra::{Matrix2, Vector2};
use shm_types::policy::PolicyMsg;

use super::attractors::{X, Z, colour, equal_scale};
use super::stiffness::times;
use super::{ReportData, time};
use crate::draw::figure::{Figure, Row};
use crate::draw::plot::{Axis, Entry, Key, Plot};
use crate::draw::svg::{Anchor, Panel};

/// Longest semi-axis, and least distance between two centres, px.
const LONGEST: f64 = 30.0;
const APART: f64 = 19.0;
/// Ellipses at most, and points of each.
const AT_MOST: usize = 24;
const POINTS: usize = 48;

/// Changes of a stiffness that nobody would see, as a share.
const SAME: f64 = 0.02;

const LEGEND: [Entry; 2] =
    [(Key::Line, "learnt", "path"), (Key::Dot, "dot success", "release, crossing")];

pub fn figure(data: &ReportData) -> Figure {
    let rows = if let Some(reason) = data.without_springs() {
        Err(reason)
    } else if !varies(&data.learnt) {
        Err("the stiffness of the policy is the same all the time.".into())
    } else if data.film.path.len() < 2 {
        Err(format!("the session holds no path of rollout {}.", data.learnt_rollout))
    } else {
        Ok(vec![Row::Half(draw(data))])
    };
    Figure {
        stem: "ellipsoids",
        title: "Stiffness along the path",
        caption: format!(
            "Side view; both axes have the same scale. Each ellipse is the stiffness \
             Σ<sub>i</sub> h<sub>i</sub>(t) K<sub>i</sub> in the plane at one moment, drawn at the position \
             of the {tip}: the accelerations caused by displacements of equal length in all \
             directions; longer is stiffer. Blue is the start, yellow the end.",
            tip = data.tip
        ),
        rows,
    }
}

/// The x–z block of Σ hᵢ(t) Kᵢ, s⁻².
pub fn stiffness(policy: &PolicyMsg, t_s: f64) -> Matrix2<f64> {
    let k = activation::stiffness(policy, t_s);
    Matrix2::new(k[(X, X)], k[(X, Z)], k[(Z, X)], k[(Z, Z)])
}

/// The springs are not the same all the time: some entry of K changes by more than [`SAME`] of the largest.
pub fn varies(policy: &PolicyMsg) -> bool {
    if policy.components().is_empty() {
        return false;
    }
    let all: Vec<_> = times(policy).map(|t_s| activation::stiffness(policy, t_s)).collect();
    let largest = all.iter().map(|k| k.amax()).fold(0.0, f64::max);
    all.iter().any(|k| (k - &all[0]).amax() > SAME * largest)
}

/// Where the pan was in the side plane, m.
fn place(row: &PathRow) -> (f64, f64) {
    (row.pan_position[X].into(), row.pan_position[Z].into())
}

/// Rows during the execution whose places on the drawing are apart from those before.
fn moments(
    path: &[PathRow],
    duration_s: f64,
    at: impl Fn(&PathRow) -> (f64, f64),
) -> Vec<&PathRow> {
    let executed = path.iter().filter(|row| f64::from(row.t_s) <= duration_s);
    let mut moments: Vec<&PathRow> = Vec::new();
    for row in executed {
        let (x, y) = at(row);
        let is_apart = |other: &&PathRow| {
            let (other_x, other_y) = at(other);
            (x - other_x).hypot(y - other_y) >= APART
        };
        // The path crosses itself: only the last few say what is too dense.
        if moments.iter().rev().take(2).all(is_apart) {
            moments.push(row);
        }
    }
    let stride = moments.len().div_ceil(AT_MOST).max(1);
    moments.into_iter().step_by(stride).collect()
}

fn draw(data: &ReportData) -> Panel {
    let (policy, path) = (&data.learnt, &data.film.path);
    let x = Axis::exactly("x (forward), m", path.iter().map(|row| place(row).0));
    let z = Axis::exactly("z (up), m", path.iter().map(|row| place(row).1));
    let (x, z, area) = equal_scale(x, z);
    let alt =
        format!("ellipses of the stiffness along the path of the {}, from the side", data.tip);
    let mut plot = Plot::new(Plot::outer_size(area, &LEGEND), &alt, x, z, &LEGEND);
    let at = |row: &PathRow| plot.at(place(row).0, place(row).1);
    let moments = moments(path, policy.duration_s, at);
    let drawn: Vec<(Matrix2<f64>, (f64, f64))> = moments
        .iter()
        .map(|row| (stiffness(policy, f64::from(row.t_s)), at(row)))
        .filter(|(k, _)| k.iter().all(|entry| entry.is_finite()))
        .collect();
    let largest = drawn.iter().map(|(k, _)| k.norm()).fold(1e-9, f64::max);
    let scale = LONGEST / largest;
    plot.clipped(|panel| {
        for (i, (k, centre)) in drawn.iter().enumerate() {
            let class = format!("ellipse {}", colour(i, drawn.len()));
            panel.polygon(ellipse(&(k * scale), *centre), &class);
        }
    });
    plot.curve(path.iter().map(place), "learnt");
    let measures = &data.learnt_measures;
    for t_s in [time(measures, "release_time_s"), time(measures, "crossing_time_s")] {
        if let Some(row) = path.iter().find(|row| t_s > 0.0 && f64::from(row.t_s) >= t_s) {
            let (x, z) = place(row);
            plot.dot(x, z, 3.5, "dot success");
        }
    }
    draw_scale(&mut plot, largest, scale);
    plot.panel
}

/// {K u, |u| = 1} about `centre`, px, for K in px; z points up.
fn ellipse(k: &Matrix2<f64>, centre: (f64, f64)) -> Vec<(f64, f64)> {
    let point = |i: usize| {
        let (sin, cos) = (i as f64 / POINTS as f64 * std::f64::consts::TAU).sin_cos();
        let d = k * Vector2::new(cos, sin);
        (centre.0 + d.x, centre.1 - d.y)
    };
    (0..POINTS).map(point).collect()
}

/// A semi-axis of a round stiffness, at the upper right.
fn draw_scale(plot: &mut Plot, largest: f64, scale: f64) {
    let power = 10_f64.powf(largest.log10().floor());
    let round = [5.0, 2.0, 1.0].into_iter().map(|factor| factor * power);
    let value = round.into_iter().find(|value| *value <= largest).unwrap_or(largest);
    let right = plot.panel.width - 12.0;
    let label = format!("{value:.0} s⁻²");
    plot.panel.text((right, 13.0), Anchor::End, "tick", &label);
    let end = right - 7.0 * label.chars().count() as f64 - 6.0;
    plot.panel.line((end - value * scale, 8.5), (end, 8.5), "scale");
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::report::sample;

    #[test]
    fn semi_axes_are_the_eigenvalues() {
        let points = ellipse(&Matrix2::new(3.0, 0.0, 0.0, 1.0), (10.0, 20.0));
        let (widest, highest) =
            points.iter().fold((0.0_f64, 0.0_f64), |(w, h), p| (w.max(p.0), h.max(20.0 - p.1)));
        assert!((widest - 13.0).abs() < 1e-9 && (highest - 1.0).abs() < 1e-9);
        // Stiff along x = z: to the right on the drawing means up.
        let tilted = ellipse(&Matrix2::new(2.0, 1.0, 1.0, 2.0), (0.0, 0.0));
        let rightmost = tilted.iter().max_by(|a, b| a.0.total_cmp(&b.0)).expect("it has points");
        assert!(rightmost.1 < 0.0, "{rightmost:?}");
    }

    #[test]
    fn ellipses_lie_on_the_path_and_are_neither_few_nor_crowded() {
        let data = sample::session(3);
        let svg = figure(&data).svg().expect("there is a path");
        let n = svg.matches("class=\"ellipse").count();
        assert!((5..=AT_MOST).contains(&n), "{n}");
    }

    #[test]
    fn springs_that_never_change_have_no_figure() {
        let mut data = sample::session(3);
        assert!(varies(&data.learnt) && !varies(&data.initial));
        data.learnt = data.initial;
        assert!(figure(&data).rows.is_err_and(|reason| reason.contains("the same all the time")));
    }

    #[test]
    fn stiffness_is_the_sum_of_what_is_active() {
        let data = sample::session(3);
        let k = stiffness(&data.initial, 0.3);
        assert!((k[(0, 0)] - 200.0).abs() < 1e-9 && k[(0, 1)].abs() < 1e-9, "the start is even");
    }
}
