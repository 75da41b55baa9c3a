//! Stiffness over time, Σ hᵢ(t) Kᵢ: the paper's Fig. 3, right.

use learner::activation::stiffness;
use shm_types::TASK_DIM;
use shm_types::measures::Measures;
use shm_types::policy::{ACTIVATION_DECAY, Component, PolicyMsg};

use super::{ReportData, time};
use crate::draw::figure::{Figure, Row, THIRD};
use crate::draw::plot::{Axis, Entry, Key, Plot};
use crate::draw::svg::{Anchor, Panel};

/// Points per curve.
const SAMPLES: usize = 160;
/// Index of the vertical coordinate.
const Z: usize = 2;

const LEGEND: [Entry; 2] =
    [(Key::Line, "learnt", "learnt policy"), (Key::Line, "initial", "initial policy")];
const LABELS: [&str; TASK_DIM] = [
    "stiffness in x, s⁻²",
    "stiffness in y, s⁻²",
    "vertical stiffness, s⁻²",
    "stiffness in pitch, s⁻²",
    "stiffness in roll, s⁻²",
    "stiffness in yaw, s⁻²",
];

const EVENTS: &str = " Release: the pancake leaves the pan; crossing: it falls back to \
    Δ<sub>h</sub> above it.";

pub fn figure(data: &ReportData) -> Figure {
    let rows = if let Some(reason) = data.without_springs() {
        Err(reason)
    } else {
        let others = (0..(data.learnt.task_dim as usize).min(TASK_DIM)).filter(|c| *c != Z);
        let vertical = Row::wide(|width| draw(data, Z, (width, 290.0), &LEGEND));
        Ok(vec![
            vertical,
            Row::Thirds(others.map(|c| draw(data, c, (THIRD, 200.0), &[])).collect()),
        ])
    };
    Figure {
        stem: "stiffness",
        title: "Learnt stiffness",
        caption: "Diagonal entries of the stiffness Σ<sub>i</sub> h<sub>i</sub>(t) K<sub>i</sub> \
                  over the execution; its unit is s⁻² because Eq. (5) of the paper commands an \
                  acceleration. The numbers at the top mark where each attractor is most active."
            .to_owned()
            + if data.is_toss() { EVENTS } else { "" },
        rows,
    }
}

/// Σ hᵢ(t) Kᵢ, entry (c, c), over the execution of `policy`.
fn profile(policy: &PolicyMsg, c: usize) -> Vec<(f64, f64)> {
    if policy.components().is_empty() {
        return Vec::new();
    }
    times(policy).map(|t_s| (t_s, stiffness(policy, t_s)[(c, c)])).collect()
}

/// [`SAMPLES`] times over the execution of `policy`.
pub fn times(policy: &PolicyMsg) -> impl Iterator<Item = f64> + use<> {
    let duration_s = policy.duration_s;
    (0..SAMPLES).map(move |k| duration_s * k as f64 / (SAMPLES - 1) as f64)
}

fn draw(data: &ReportData, c: usize, size: (f64, f64), legend: &[Entry]) -> Panel {
    let (initial, learnt) = (profile(&data.initial, c), profile(&data.learnt, c));
    let both = || initial.iter().chain(&learnt);
    let x = Axis::exactly("time, s", both().map(|point| point.0));
    // Room at the top, for numbers and names.
    let room = if c == Z { 1.25 } else { 1.05 };
    let y = Axis::rounded(LABELS[c], both().map(|point| room * point.1).chain([0.0]));
    let alt = format!("{} of the learnt and the initial policy over time", LABELS[c]);
    let mut plot = Plot::new(size, &alt, x, y, legend);
    let names = if c == Z { ["release", "crossing"] } else { ["", ""] };
    mark_events(&mut plot, &data.learnt_measures, names);
    plot.curve(initial, "initial");
    plot.curve(learnt, "learnt");
    if c == Z {
        number_centers(&mut plot, &data.learnt, (x.min, x.max), y.max);
    }
    plot.panel
}

/// Vertical lines at release and crossing, as far as there were any.
pub fn mark_events(plot: &mut Plot, measures: &Measures, names: [&str; 2]) {
    let times = [time(measures, "release_time_s"), time(measures, "crossing_time_s")];
    for (t_s, name) in times.into_iter().zip(names) {
        if t_s > 0.0 {
            plot.event(t_s, 1, name);
        }
    }
}

/// The number of each attractor at the top, where its activation has its centre.
fn number_centers(plot: &mut Plot, policy: &PolicyMsg, (from, to): (f64, f64), top: f64) {
    for (i, component) in policy.components().iter().enumerate() {
        let t_s = center_time(policy, component);
        if (from..=to).contains(&t_s) {
            let (x, y) = plot.at(t_s, top);
            plot.panel.line((x, y), (x, y + 5.0), "axis");
            plot.panel.text((x, y + 18.0), Anchor::Middle, "tick halo", &(i + 1).to_string());
        }
    }
}

/// When the driving variable of the activations passes the centre, s.
fn center_time(policy: &PolicyMsg, component: &Component) -> f64 {
    if policy.activation == ACTIVATION_DECAY {
        -component.center.ln() / policy.decay_rate
    } else {
        component.center
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::report::sample;

    #[test]
    fn profile_is_the_weighted_sum_of_the_components() {
        let data = sample::session(3);
        let flat = profile(&data.initial, Z);
        assert!(flat.iter().all(|(_, k)| (k - 200.0).abs() < 1e-9), "the initial policy is even");
        let learnt = profile(&data.learnt, Z);
        let entries = data.learnt.components().iter().map(|component| component.stiffness_at(Z, Z));
        let (min, max) =
            entries.fold((f64::MAX, f64::MIN), |(min, max), k| (min.min(k), max.max(k)));
        assert!(learnt.iter().all(|(_, k)| (min..=max).contains(k)));
        assert_eq!(learnt.len(), SAMPLES);
    }

    #[test]
    fn centers_are_times_whatever_drives_the_activations() {
        let mut policy = sample::session(1).learnt;
        let component = Component { center: (-1.0_f64).exp(), ..policy.components[0] };
        (policy.activation, policy.decay_rate) = (ACTIVATION_DECAY, 2.0);
        assert!((center_time(&policy, &component) - 0.5).abs() < 1e-12);
    }

    #[test]
    fn shows_every_learnt_coordinate_once() {
        let svg = figure(&sample::session(3)).svg().expect("there is a policy");
        for (c, label) in LABELS.iter().enumerate() {
            assert_eq!(svg.contains(label), c < 4, "{label}");
        }
    }
}
