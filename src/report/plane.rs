//! The plane of two policy parameters: the true reward, the trials, the solutions found.

use nalgebra::Vector2;
use search::Mode;

use super::modes::{LEGEND, ModeRow, NO_MODES, draw_modes, table};
use super::{ReportData, TrialRow};
use crate::draw::figure::{Figure, HALF, Row};
use crate::draw::map::Map;
use crate::draw::plot::{Axis, Key};
use crate::draw::svg::Panel;

/// The reward of every policy of a plane.
pub type Reward = Box<dyn Fn(&Vector2<f64>) -> f64>;

/// A task with two policy parameters and no arm.
pub struct Plane {
    pub x: Axis<'static>,
    pub y: Axis<'static>,
    /// What the world gives for each policy: for the reader, the search never sees it.
    pub reward: Reward,
    pub max: f64,
}

pub fn figure(data: &ReportData, plane: &Plane) -> Figure {
    let rows = if data.trials.is_empty() {
        Err("the session has no rollout yet.".to_owned())
    } else {
        let numbers = match data.modes.is_empty() {
            true => Row::Numbers(format!("<p class=\"missing\">Modes: {NO_MODES}</p>\n")),
            false => table(&data.modes),
        };
        Ok(vec![Row::Half(draw(plane, &data.trials, &data.modes)), numbers])
    };
    Figure {
        stem: "solutions",
        title: "Solutions in the plane of the policy parameters",
        caption:
            "Shades: reward of every policy, unknown to the search. Open dots: trials. Ellipses: \
                  the modes found, at one standard deviation around their policies."
                .into(),
        rows,
    }
}

fn draw(plane: &Plane, trials: &[TrialRow], modes: &[ModeRow]) -> Panel {
    let map = Map { x: plane.x, y: plane.y, reward: &plane.reward, max: plane.max };
    let alt = format!("{} trials and {} modes", trials.len(), modes.len());
    let legend = [(Key::Dot, "dot failure", "trial"), LEGEND[0], LEGEND[1]];
    let mut plot = map.draw((HALF, 420.0), &alt, &legend);
    for trial in trials.iter().filter(|trial| trial.theta.len() == 2) {
        let (x, y) = (trial.theta[0], trial.theta[1]);
        let inside =
            (plane.x.min..=plane.x.max).contains(&x) && (plane.y.min..=plane.y.max).contains(&y);
        if inside {
            plot.dot(x, y, 2.2, "dot failure");
        }
    }
    let flat = modes.iter().filter(|row| row.mode.mean.len() == 2);
    let modes: Vec<(Mode, &ModeRow)> = flat.map(|row| (row.mode.clone(), row)).collect();
    draw_modes(&mut plot, &modes);
    plot.panel
}
