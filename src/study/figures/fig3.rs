//! Fig. 3, right: stiffness over time, of the selected policies of many seeds.

use anyhow::Result;

use crate::draw::figure::{Figure, Row, THIRD};
use crate::draw::plot::{Axis, Entry, Key, Plot};
use crate::draw::svg::Panel;
use crate::study::compliance::{self, Curve};

/// Seeds that are learnt.
const SEEDS: u64 = 20;

/// Coordinates that are drawn.
const COORDINATES: [(usize, &str); 3] =
    [(2, "vertical stiffness, s⁻²"), (0, "stiffness in x, s⁻²"), (3, "stiffness in pitch, s⁻²")];
const LEGEND: [Entry; 2] =
    [(Key::Line, "learnt", "learnt: median, quartiles"), (Key::Line, "initial", "initial")];

pub fn figure(first_seed: u64) -> Result<Figure> {
    let answers = compliance::answers(first_seed..first_seed + SEEDS)?;
    let panels = COORDINATES.map(|(coordinate, label)| {
        let curves = answers.iter().map(|answer| answer.curve(coordinate)).collect();
        panel(curves, answers[0].initial(coordinate), label)
    });
    Ok(Figure {
        stem: "fig3",
        title: "Stiff for the throw, soft for the catch",
        caption: format!(
            "Diagonal entries of the stiffness Σ<sub>i</sub> h<sub>i</sub>(t) K<sub>i</sub> over the \
             movement, of the policies that the seeds {first_seed} to {} have come to after 100 \
             rollouts. The pancake is released at 0.6 to 0.7 s and falls back at 1.0 to 1.2 s.",
            first_seed + SEEDS - 1
        ),
        rows: Ok(vec![Row::Thirds(panels.into())]),
    })
}

fn panel(curves: Vec<Curve>, initial: Curve, label: &'static str) -> Panel {
    let [low, middle, high] = [0.25, 0.5, 0.75].map(|share| quantile(&curves, share));
    let x = Axis::exactly("time, s", middle.iter().map(|point| point.0));
    let top = high.iter().chain(&initial).map(|point| 1.1 * point.1);
    let y = Axis::rounded(label, top.chain([0.0]));
    let mut plot = Plot::new((THIRD, 230.0), label, x, y, &LEGEND);
    let outline = low.iter().chain(high.iter().rev()).map(|(t_s, k)| plot.at(*t_s, *k));
    let outline: Vec<(f64, f64)> = outline.collect();
    plot.panel.polygon(outline, "band");
    plot.curve(initial, "initial");
    plot.curve(middle, "learnt");
    plot.panel
}

/// The quantile of all curves at each time.
fn quantile(curves: &[Curve], share: f64) -> Curve {
    let at = |k: usize| {
        let mut values: Vec<f64> = curves.iter().map(|curve| curve[k].1).collect();
        values.sort_by(f64::total_cmp);
        (curves[0][k].0, values[(share * (values.len() - 1) as f64).round() as usize])
    };
    (0..curves[0].len()).map(at).collect()
}
