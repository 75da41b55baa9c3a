//! A plane of two policy parameters: rewards as shades, Gaussians as ellipses.

use nalgebra::Vector2;
use search::Mode;

use super::plot::{Axis, Entry, Plot};

/// Shades between no reward and the highest; classes h1 to h8.
const LEVELS: usize = 8;
/// Cells of the shading in each direction.
const CELLS: usize = 48;
/// Points of an ellipse.
const POINTS: usize = 60;

/// What a map shows: the ranges of both parameters and the reward over them.
pub struct Map<'a> {
    pub x: Axis<'a>,
    pub y: Axis<'a>,
    pub reward: &'a dyn Fn(&Vector2<f64>) -> f64,
    /// Reward of the darkest shade.
    pub max: f64,
}

impl Map<'_> {
    /// The shaded plane within axes.
    pub fn draw(&self, size: (f64, f64), alt: &str, legend: &[Entry]) -> Plot {
        let mut plot = Plot::new(size, alt, self.x, self.y, legend);
        let step = |axis: &Axis| (axis.max - axis.min) / CELLS as f64;
        let (dx, dy) = (step(&self.x), step(&self.y));
        for row in 0..CELLS {
            let y = self.y.min + row as f64 * dy;
            let level = |column: usize| {
                let x = self.x.min + (column as f64 + 0.5) * dx;
                let share = (self.reward)(&Vector2::new(x, y + 0.5 * dy)) / self.max;
                (share.clamp(0.0, 1.0) * LEVELS as f64).round() as usize
            };
            // Neighbours of one shade become one rectangle.
            let mut start = 0;
            while start < CELLS {
                let shade = level(start);
                let end = (start..CELLS).find(|c| level(*c) != shade).unwrap_or(CELLS);
                if shade > 0 {
                    let (left, right) =
                        (self.x.min + start as f64 * dx, self.x.min + end as f64 * dx);
                    let corners = [(left, y), (right, y), (right, y + dy), (left, y + dy)];
                    let corners = corners.map(|(x, y)| plot.at(x, y));
                    plot.panel.polygon(corners, &format!("heat h{shade}"));
                }
                start = end;
            }
        }
        plot
    }
}

/// One- and two-sigma ellipses and the centre of a mode, as far as they lie within the axes.
pub fn draw_mode(plot: &mut Plot, mode: &Mode, class: &str) {
    let outlines = [1.0, 2.0].map(|sigma| {
        ellipse(mode, sigma).into_iter().map(|(x, y)| plot.at(x, y)).collect::<Vec<_>>()
    });
    let centre = plot.at(mode.mean[0], mode.mean[1]);
    plot.clipped(|panel| {
        outlines.into_iter().for_each(|outline| panel.path(outline, class));
        panel.circle(centre, 3.5, "dot success");
    });
}

/// The closed ellipse at `sigma` standard deviations of a mode of two dimensions.
pub fn ellipse(mode: &Mode, sigma: f64) -> Vec<(f64, f64)> {
    let [a, b, c] = [mode.covariance[(0, 0)], mode.covariance[(1, 0)], mode.covariance[(1, 1)]];
    // Lower Cholesky factor.
    let l11 = a.max(0.0).sqrt();
    let l21 = if l11 > 0.0 { b / l11 } else { 0.0 };
    let l22 = (c - l21 * l21).max(0.0).sqrt();
    let point = |i: usize| {
        let (sin, cos) = (i as f64 / POINTS as f64 * std::f64::consts::TAU).sin_cos();
        let (x, y) = (sigma * l11 * cos, sigma * (l21 * cos + l22 * sin));
        (mode.mean[0] + x, mode.mean[1] + y)
    };
    (0..=POINTS).map(point).collect()
}
