//! Fig. 8: table skittles, where the number of solutions depends on where the skittle stands.

use anyhow::Result;
use nalgebra::{DVector, Vector2};
use physics::skittles::{BOX, TARGETS};
use search::Method;

use crate::draw::figure::{Figure, Row, THIRD};
use crate::draw::map::{Map, draw_mode};
use crate::draw::plot::Axis;
use crate::draw::svg::Panel;
use crate::study::run::Run;
use crate::study::skittles;
use crate::study::world::Task;

const TRIALS: u64 = 200;

pub fn figure(seed: u64) -> Result<Figure> {
    let mut landscapes = Vec::new();
    let mut results = Vec::new();
    for (index, name) in [
        "α̇ rad/s, skittle at (0.3, 1.4)",
        "α̇ rad/s, skittle at (1.2, 0)",
        "α̇ rad/s, skittle at (0.8, 0.8)",
    ]
    .into_iter()
    .enumerate()
    {
        landscapes.push(panel(index, name, None));
        let run = Run::on(Task::Skittles(index), Method::Regions, seed, TRIALS)?;
        results.push(panel(index, name, Some(&run)));
    }
    Ok(Figure {
        stem: "fig8",
        title: "Table skittles: one solution or two",
        caption: format!(
            "Seed {seed}. Above: reward exp(−3 d) over release angle and angular velocity, for three \
             places of the skittle. Below: the {TRIALS} trials of the search (open dots) and the \
             solution regions it reports, centre and covariance of the good trials in each."
        ),
        rows: Ok(vec![Row::Thirds(landscapes), Row::Thirds(results)]),
    })
}

fn panel(index: usize, name: &'static str, run: Option<&Run>) -> Panel {
    let reward = |theta: &Vector2<f64>| {
        skittles::reward(TARGETS[index], &DVector::from_column_slice(theta.as_slice()))
    };
    let map = Map {
        x: Axis { label: "α rad", min: BOX.0[0], max: BOX.1[0] },
        y: Axis { label: name, min: BOX.0[1], max: BOX.1[1] },
        reward: &reward,
        max: 1.0,
    };
    let mut plot = map.draw((THIRD, 300.0), name, &[]);
    if let Some(run) = run {
        for trial in &run.trials {
            plot.dot(trial.theta[0], trial.theta[1], 1.8, "dot failure");
        }
        for mode in run.modes.last().into_iter().flatten() {
            draw_mode(&mut plot, mode, "best");
        }
    }
    plot.panel
}
