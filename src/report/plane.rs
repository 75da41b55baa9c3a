//! The plane of two policy parameters: the true reward, the trials, the solutions found.

use learner::search::Mode;
use nalgebra::Vector2;

use super::figure::{Figure, Row};
use super::map::{Map, draw_mode};
use super::plot::{Axis, Key};
use super::svg::Panel;

/// The reward of every policy of a plane.
pub type Reward = Box<dyn Fn(&Vector2<f64>) -> f64>;

/// A session of a task with two policy parameters and no arm.
pub struct Plane {
    pub x: Axis,
    pub y: Axis,
    /// What the world gives for each policy: for the reader, the search never sees it.
    pub reward: Reward,
    pub max: f64,
    pub trials: Vec<[f64; 2]>,
    pub modes: Vec<ModeRow>,
}

/// A mode and what is said of it.
pub struct ModeRow {
    pub mode: Mode,
    pub number: usize,
    pub best: Option<(u64, f64)>,
    pub tolerance: Option<f64>,
    pub remark: &'static str,
}

pub fn figure(plane: &Plane) -> Figure {
    Figure {
        stem: "solutions",
        title: "Solutions in the plane of the policy parameters",
        caption: "Shades: reward of every policy, which the search does not know. Open dots: the \
                  trials. Ellipses at one and two standard deviations: the modes found, their \
                  policies as filled dots."
            .into(),
        rows: Ok(vec![Row::wide(|width| draw(plane, width))]),
    }
}

fn draw(plane: &Plane, width: f64) -> Panel {
    let map = Map { x: plane.x, y: plane.y, reward: &plane.reward, max: plane.max };
    let alt = format!("{} trials and {} modes", plane.trials.len(), plane.modes.len());
    let legend = [(Key::Dot, "dot failure", "trial"), (Key::Line, "learnt", "mode")];
    let width = width.min(620.0);
    let mut plot = map.draw((width, 0.85 * width), &alt, &legend);
    for &[x, y] in &plane.trials {
        let inside =
            (plane.x.min..=plane.x.max).contains(&x) && (plane.y.min..=plane.y.max).contains(&y);
        if inside {
            plot.dot(x, y, 2.2, "dot failure");
        }
    }
    for row in &plane.modes {
        draw_mode(&mut plot, &row.mode, "learnt");
    }
    plot.panel
}
