//! Activations hᵢ(t) over the execution, Eq. (2): which attractor acts when.

use learner::activation::policy_activations;
use shm_types::policy::PolicyMsg;

use super::ReportData;
use super::attractors::colour;
use super::stiffness::{mark_events, times};
use crate::draw::figure::{Figure, Row};
use crate::draw::plot::{Axis, Plot};
use crate::draw::svg::{Anchor, Panel};

pub fn figure(data: &ReportData) -> Figure {
    let rows = if let Some(reason) = data.without_springs() {
        Err(reason)
    } else {
        Ok(vec![Row::wide(|width| draw(data, width))])
    };
    Figure {
        stem: "activations",
        title: "Activations of the attractors",
        caption:
            "Weights h<sub>i</sub>(t) of Eq. (2), which sum to one. Each peak is labelled with \
                  its attractor's number. Colours match the figure of the attractors."
                .to_owned(),
        rows,
    }
}

/// hᵢ over time, s, for every attractor i.
fn curves(policy: &PolicyMsg) -> Vec<Vec<(f64, f64)>> {
    let mut curves = vec![Vec::new(); policy.components().len()];
    for t_s in times(policy) {
        for (curve, h) in curves.iter_mut().zip(policy_activations(policy, t_s)) {
            curve.push((t_s, h));
        }
    }
    curves
}

fn draw(data: &ReportData, width: f64) -> Panel {
    let curves = curves(&data.learnt);
    let x_axis = Axis::exactly("time, s", [0.0, data.learnt.duration_s]);
    // Room at the top, for the numbers.
    let y_axis = Axis { label: "activation", min: 0.0, max: 1.15 };
    let alt = format!("activations of {} attractors over time", curves.len());
    let mut plot = Plot::new((width, 220.0), &alt, x_axis, y_axis, &[]);
    mark_events(&mut plot, &data.learnt_measures, ["", ""]);
    let n = curves.len();
    for (i, curve) in curves.into_iter().enumerate() {
        let highest = curve.iter().copied().reduce(|a, b| if b.1 > a.1 { b } else { a });
        plot.curve(curve, &format!("activation {}", colour(i, n)));
        if let Some((t_s, h)) = highest {
            let (x, y) = plot.at(t_s, h);
            // Beside the axes, not on them.
            let x = x.clamp(plot.at(x_axis.min, h).0 + 8.0, plot.at(x_axis.max, h).0 - 8.0);
            plot.panel.text((x, y - 6.0), Anchor::Middle, "tick halo", &(i + 1).to_string());
        }
    }
    plot.panel
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::report::sample;

    #[test]
    fn every_attractor_has_its_curve_and_they_sum_to_one() {
        let data = sample::session(3);
        let curves = curves(&data.learnt);
        for k in 0..curves[0].len() {
            assert!((curves.iter().map(|curve| curve[k].1).sum::<f64>() - 1.0).abs() < 1e-12);
        }
        let svg = figure(&data).svg().expect("there is a policy");
        assert_eq!(svg.matches("class=\"line activation").count(), curves.len());
    }
}
