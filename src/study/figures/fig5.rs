//! Fig. 5: several optima, of which a gradient finds one; a mixture finds both and their spread.

use anyhow::Result;
use nalgebra::{DVector, Vector2};
use search::{Method, Space};

use crate::draw::figure::{Figure, Row, THIRD};
use crate::draw::map::{Map, draw_mode};
use crate::draw::plot::{Axis, Key};
use crate::study::run::Run;

const START: [f64; 2] = [1.0, -2.6];
/// Height, centre and variances of the two hills: a narrow high one, a wide lower one.
const HILLS: [(f64, [f64; 2], [f64; 2]); 2] =
    [(1.0, [-1.6, 1.2], [0.25, 0.4]), (0.95, [1.9, 0.4], [1.3, 0.9])];

fn reward(theta: &Vector2<f64>) -> f64 {
    let hill = |(height, centre, variance): &(f64, [f64; 2], [f64; 2])| {
        let (dx, dy) = (theta.x - centre[0], theta.y - centre[1]);
        height * (-0.5 * (dx * dx / variance[0] + dy * dy / variance[1])).exp()
    };
    HILLS.iter().map(hill).sum()
}

pub fn figure(seed: u64) -> Result<Figure> {
    let bounds = search::Bounds::new(2, &[-4.0, -4.0], &[4.0, 4.0])?;
    let space = Space { bounds: Some(bounds), ..Space::white(DVector::from_column_slice(&START)) };
    let run = Run::new(Method::Regions, seed, space, 150, &|theta| {
        reward(&Vector2::new(theta[0], theta[1]))
    })?;
    let ascent = ascent();
    let end = *ascent.last().expect("it has a start");

    let axis = |label| Axis { label, min: -4.0, max: 4.0 };
    let map = Map { x: axis("Θ₁"), y: axis("Θ₂"), reward: &reward, max: 1.0 };
    let legend = [(Key::Line, "learnt", "modes found"), (Key::Line, "initial", "gradient ascent")];
    let mut plot = map.draw((1.5 * THIRD, 470.0), "a landscape with two optima", &legend);
    for trial in &run.trials {
        plot.dot(trial.theta[0], trial.theta[1], 1.8, "dot failure");
    }
    plot.curve(ascent, "initial");
    plot.dot(START[0], START[1], 4.0, "dot start");
    plot.dot(end.0, end.1, 4.0, "dot failure");
    for mode in run.modes.last().into_iter().flatten() {
        draw_mode(&mut plot, mode, "learnt");
    }
    Ok(Figure {
        stem: "fig5",
        title: "Several optima: a point is not the whole answer",
        caption: format!(
            "Seed {seed}, 150 trials. Shades: reward. From its start a gradient ascent ends on one \
             hill (open dot). The search reports both, the high narrow one and the lower wide one, \
             which forgives more: the ellipses show one and two standard deviations of the good \
             trials."
        ),
        rows: Ok(vec![Row::Half(plot.panel)]),
    })
}

/// Steepest ascent with a fixed step, by central differences.
fn ascent() -> Vec<(f64, f64)> {
    let mut theta = Vector2::from(START);
    let mut path = vec![(theta.x, theta.y)];
    for _ in 0..400 {
        let slope = |d: Vector2<f64>| (reward(&(theta + d)) - reward(&(theta - d))) / 2e-4;
        let gradient = Vector2::new(slope(Vector2::new(1e-4, 0.0)), slope(Vector2::new(0.0, 1e-4)));
        if gradient.norm() < 1e-3 {
            break;
        }
        theta += gradient.normalize() * 0.05_f64.min(0.2 * gradient.norm());
        path.push((theta.x, theta.y));
    }
    path
}
