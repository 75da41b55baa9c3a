//! Fig. 7: one run on the landscape, its mixture along the way and its number of components.

use anyhow::Result;
use physics::landscape::{self, PEAK_VALUE};
use search::{Method, Mode};

use crate::draw::figure::{Figure, Row, THIRD};
use crate::draw::map::{Map, draw_mode};
use crate::draw::plot::{Axis, Key, Plot};
use crate::draw::svg::Panel;
use crate::study::run::Run;
use crate::study::world::Task;

/// Trials of which the mixture is shown.
const SHOWN: [usize; 6] = [5, 20, 40, 80, 140, 200];
const TRIALS: u64 = 200;

/// The run of `seed` by Algorithm 1 as printed, then by the tempered mixture.
pub fn figure(seed: u64) -> Result<Figure> {
    let mut rows = Vec::new();
    for (method, name) in [(Method::Tempered, "tempered"), (Method::Algorithm1, "as printed")] {
        let run = Run::on(Task::Landscape, method, seed, TRIALS)?;
        let snapshots: Vec<Panel> = SHOWN.iter().map(|n| snapshot(&run, *n)).collect();
        rows.push(Row::Thirds(snapshots));
        rows.push(Row::wide(|width| components(&run, name, width)));
    }
    Ok(Figure {
        stem: "fig7",
        title: "Multi-optima search on the landscape of three hills",
        caption: format!(
            "Seed {seed}. First two rows: reward (shades) over Θ₁ (right) and Θ₂ (up), trials so \
             far (open dots) and the mixture (ellipses at one and two standard deviations) after \
             the trial above each panel; below: number of components, with a line up for a split \
             and down for a merge. Then the same for Algorithm 1 with the printed thresholds."
        ),
        rows: Ok(rows),
    })
}

fn snapshot(run: &Run, n: usize) -> Panel {
    let label = match n {
        5 => "after 5 trials",
        20 => "after 20 trials",
        40 => "after 40 trials",
        80 => "after 80 trials",
        140 => "after 140 trials",
        _ => "after 200 trials",
    };
    let map = Map {
        x: Axis { label: "Θ₁", min: -1.0, max: 11.0 },
        y: Axis { label, min: -1.0, max: 11.0 },
        reward: &landscape::height,
        max: PEAK_VALUE,
    };
    let mut plot = map.draw((THIRD, 320.0), label, &[]);
    for trial in run.trials.iter().take(n) {
        let (x, y) = (trial.theta[0], trial.theta[1]);
        if (-1.0..=11.0).contains(&x) && (-1.0..=11.0).contains(&y) {
            plot.dot(x, y, 1.8, "dot failure");
        }
    }
    for mode in &run.modes[n - 1] {
        draw_mode(&mut plot, mode, "learnt");
    }
    plot.panel
}

fn components(run: &Run, name: &'static str, width: f64) -> Panel {
    let most = run.modes.iter().map(Vec::len).max().unwrap_or(1) as f64;
    let y = Axis { label: "components", min: 0.0, max: most.max(3.0) };
    let legend = [(Key::Line, "learnt", name)];
    let alt = "number of components over the trials";
    let mut plot = Plot::new((width, 190.0), alt, Axis::rollouts([TRIALS]), y, &legend);
    plot.curve(steps(&run.modes), "learnt");
    plot.panel
}

/// K after each trial, as a staircase.
fn steps(modes: &[Vec<Mode>]) -> Vec<(f64, f64)> {
    let corners = modes.iter().zip(1_u64..);
    corners
        .flat_map(|(modes, n)| [n as f64, n as f64 + 1.0].map(|x| (x, modes.len() as f64)))
        .collect()
}
