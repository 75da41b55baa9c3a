//! Fig. 1: the letters 'ds' as a weighted sum of linear systems, Eq. (2), driven by the state and by time.

use std::f64::consts::{PI, TAU};

use anyhow::Result;
use imitation::Recording;
use imitation::gmm::GmmOptions;
use imitation::regression::{Map, Regression};
use nalgebra::{DMatrix, DVector, Matrix4, Vector2, Vector4};
use rand::RngExt;
use search::Mode;
use search::normals::stream;

use crate::draw::figure::{Figure, Row, THIRD};
use crate::draw::map::draw_mode;
use crate::draw::plot::{Axis, Key, Plot};

/// Places along the two letters, written in one stroke, cm.
const STROKE: [[f64; 2]; 19] = [
    [1.35, 1.85],
    [0.90, 2.00],
    [0.45, 1.60],
    [0.30, 0.95],
    [0.60, 0.30],
    [1.15, 0.25],
    [1.65, 0.75],
    [1.85, 1.60],
    [1.98, 2.60],
    [2.15, 3.40],
    [2.60, 3.60],
    [3.15, 3.25],
    [3.35, 2.75],
    [3.15, 2.40],
    [2.85, 1.95],
    [3.10, 1.45],
    [3.45, 0.95],
    [3.30, 0.40],
    [2.75, 0.20],
];
const N_DEMONSTRATIONS: usize = 4;
const PERIOD_S: f64 = 0.01;
const DURATION_S: f64 = 2.0;
/// Components of the state-driven mixture and of the time-driven one.
const COMPONENTS: (usize, usize) = (10, 10);
/// Narrow Gaussians make a field of the state rough between the demonstrations.
const REGULARIZATION: f64 = 4e-3;
/// Amplitude of what differs from one demonstration to the next, cm.
const SPREAD: f64 = 0.06;
/// When the hand is pushed, as a share of the time, and how far to the left, cm.
const PUSHED_AT: f64 = 0.45;
const PUSH: f64 = 0.2;

pub fn figure(seed: u64) -> Result<Figure> {
    let recordings: Vec<Recording> =
        (0..N_DEMONSTRATIONS as u64).map(|k| demonstration(seed, k)).collect::<Result<_>>()?;
    let options = GmmOptions { regularization: REGULARIZATION, ..GmmOptions::default() };
    let fit = |map, k| Regression::fit(&recordings, map, k, &options, seed);
    let by_state = fit(Map::PositionToVelocity, COMPONENTS.0)?;
    let by_time = fit(Map::TimeToVelocity, COMPONENTS.1)?;
    let panels = vec![
        mixture_panel(&recordings, &by_state),
        panel(&recordings, Map::PositionToVelocity, &by_state, "driven by the state"),
        panel(&recordings, Map::TimeToVelocity, &by_time, "driven by time"),
    ];
    let (state, time) = COMPONENTS;
    Ok(Figure {
        stem: "fig1",
        title: "A movement as a weighted sum of linear systems",
        caption: format!(
            "Four demonstrations of the letters 'ds' (seed {seed}) and what Eq. (2) makes of them. Left: the \
             Gaussians in the plane that weight the {state} systems of the middle panel, at one and two standard \
             deviations. Middle: ẋ = Σ hᵢ(x) [Aᵢ x + bᵢ], a field; right: ẋ = Σ hᵢ(t) [aᵢ t + bᵢ], with \
             {time} systems, whose field is the same everywhere at one time. Without a push both write the letters \
             (blue). Pushed by {PUSH} cm to the left on the way up (red), the field goes on from where it finds the hand; \
             time goes on as if nothing had happened, and the rest is displaced. This field has no certificate of \
             stability: far from the demonstrations it may lead anywhere, and a controller refuses it."
        ),
        rows: Ok(vec![Row::Thirds(panels)]),
    })
}

/// The stroke at an uneven pace, with smooth deviations of its own.
fn demonstration(seed: u64, number: u64) -> Result<Recording> {
    let mut rng = stream(seed, number);
    let waves: Vec<[f64; 3]> = (1..=3)
        .map(|k| {
            let amplitude = SPREAD / f64::from(k);
            [
                rng.random_range(-amplitude..amplitude),
                rng.random_range(-amplitude..amplitude),
                rng.random_range(0.0..TAU),
            ]
        })
        .collect();
    let n = (DURATION_S / PERIOD_S).round() as usize + 1;
    let points = DMatrix::from_fn(2, n, |c, k| {
        let u = k as f64 / (n - 1) as f64;
        // Starts and ends slowly.
        let share = 0.5 * u + 0.5 * u * u * (3.0 - 2.0 * u);
        let wave =
            |(k, wave): (usize, &[f64; 3])| wave[c] * ((k + 1) as f64 * PI * u + wave[2]).sin();
        along(share)[c] + waves.iter().enumerate().map(wave).sum::<f64>()
    });
    Ok(Recording::new(format!("ds {number}"), PERIOD_S, points)?)
}

/// Catmull-Rom through the places of the stroke, at a share of its sections.
fn along(share: f64) -> Vector2<f64> {
    let at = |i: isize| Vector2::from(STROKE[i.clamp(0, STROKE.len() as isize - 1) as usize]);
    let u = share.clamp(0.0, 1.0) * (STROKE.len() - 1) as f64;
    let i = (u.floor() as isize).min(STROKE.len() as isize - 2);
    let basis = Matrix4::new(
        0.0, 1.0, 0.0, 0.0, -0.5, 0.0, 0.5, 0.0, 1.0, -2.5, 2.0, -0.5, -0.5, 1.5, -1.5, 0.5,
    );
    let v = u - i as f64;
    let weights = basis.transpose() * Vector4::new(1.0, v, v * v, v * v * v);
    (0..4).map(|k| at(i - 1 + k as isize) * weights[k]).sum()
}

fn axes() -> (Axis<'static>, Axis<'static>) {
    (Axis { label: "x₁, cm", min: -0.5, max: 4.5 }, Axis { label: "x₂, cm", min: -0.5, max: 4.5 })
}

fn plot(
    name: &str,
    recordings: &[Recording],
    legend: &[(Key, &'static str, &'static str)],
) -> Plot {
    let (x, y) = axes();
    let mut plot = Plot::new((THIRD, 350.0), name, x, y, legend);
    for recording in recordings {
        plot.curve(recording.points.column_iter().map(|point| (point[0], point[1])), "initial");
    }
    plot
}

fn mixture_panel(recordings: &[Recording], regression: &Regression) -> crate::draw::svg::Panel {
    let legend = [(Key::Line, "initial", "demonstrations"), (Key::Line, "learnt", "Gaussians")];
    let mut plot = plot("demonstrations and Gaussians", recordings, &legend);
    let systems = &regression.systems;
    for ((prior, mean), covariance) in
        systems.priors.iter().zip(&systems.centers).zip(&systems.covariances)
    {
        let mode = Mode { prior: *prior, mean: mean.clone(), covariance: covariance.clone() };
        draw_mode(&mut plot, &mode, "learnt");
    }
    plot.panel
}

fn panel(
    recordings: &[Recording],
    map: Map,
    regression: &Regression,
    name: &str,
) -> crate::draw::svg::Panel {
    let legend = [(Key::Line, "learnt", "reproduction"), (Key::Line, "best", "pushed")];
    let mut plot = plot(name, recordings, &legend);
    if map == Map::PositionToVelocity {
        arrows(&mut plot, regression);
    }
    let start = recordings[0].points.column(0).clone_owned();
    let whole = map.reproduce(regression, &start, DURATION_S, PERIOD_S);
    plot.curve(whole.column_iter().map(|point| (point[0], point[1])), "learnt");
    let pushed = pushed(map, regression, &whole);
    let (low, high) = (-0.5, 4.5);
    let inside =
        pushed.iter().copied().take_while(|p| p.0 > low && p.0 < high && p.1 > low && p.1 < high);
    plot.curve(inside, "best");
    plot.dot(start[0], start[1], 4.0, "dot start");
    plot.panel
}

/// What follows a push to the left.
fn pushed(map: Map, regression: &Regression, whole: &DMatrix<f64>) -> Vec<(f64, f64)> {
    let from = (PUSHED_AT * whole.ncols() as f64) as usize;
    let mut x = whole.column(from) - DVector::from_vec(vec![PUSH, 0.0]);
    let mut path = vec![(x[0], x[1])];
    for k in from..whole.ncols() {
        let t = DVector::from_element(1, k as f64 * PERIOD_S);
        let velocity = regression.output(if map == Map::PositionToVelocity { &x } else { &t });
        x += velocity * PERIOD_S;
        path.push((x[0], x[1]));
    }
    path
}

/// The field's direction on a grid.
fn arrows(plot: &mut Plot, regression: &Regression) {
    const LENGTH: f64 = 0.22;
    for (i, j) in (0..17).flat_map(|i| (0..17).map(move |j| (i, j))) {
        let at = Vector2::new(-0.3 + 0.29 * f64::from(i), -0.3 + 0.29 * f64::from(j));
        let velocity = regression.output(&DVector::from_column_slice(at.as_slice()));
        let way = Vector2::new(velocity[0], velocity[1]);
        if way.norm() > 1e-9 {
            let to = at + way.normalize() * LENGTH;
            plot.curve([(at.x, at.y), (to.x, to.y)], "axis");
            plot.dot(to.x, to.y, 1.4, "dot start");
        }
    }
}
