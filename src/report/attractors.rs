//! Attractors, their springs and the path of the pan, seen from the side: the paper's Fig. 2.

use learner::activation::policy_activations;
use learner::path::PathRow;
use nalgebra::{Matrix2, Vector2};
use shm_types::policy::{Component, PolicyMsg};

use super::ReportData;
use super::stiffness::times;
use crate::draw::figure::{Figure, Row};
use crate::draw::plot::{Axis, Entry, Key, Plot};
use crate::draw::svg::{Anchor, Panel};

/// Indices of the forward and the vertical coordinate.
pub const X: usize = 0;
pub const Z: usize = 2;
/// A spring of this stiffness in every direction has an ellipse of this radius.
const REFERENCE_STIFFNESS: f64 = 200.0;
const REFERENCE_RADIUS_M: f64 = 0.02;
/// Classes that colour the attractors in order.
const N_COLOURS: usize = 8;
/// Largest area between the axes, px.
const AREA: (f64, f64) = (384.0, 420.0);

const LEGEND: [Entry; 6] = [
    (Key::Line, "learnt", "learnt"),
    (Key::Line, "attractor", "path of the attractor"),
    (Key::Dot, "o3", "attractor"),
    (Key::Line, "initial", "first rollout"),
    (Key::Dot, "dot start", "its attractors"),
    (Key::Line, "shown", "demonstration"),
];

pub fn figure(data: &ReportData) -> Figure {
    let rows = if let Some(reason) = data.without_springs() {
        Err(reason)
    } else {
        Ok(vec![Row::Half(draw(data))])
    };
    let mut missing = String::new();
    for (path, name) in [(&data.film.path, "learnt"), (&data.initial_path, "initial")] {
        if path.is_empty() {
            missing += &format!(" The session holds no path of the {name} policy.");
        }
    }
    Figure {
        stem: "attractors",
        title: "Attractors and path",
        caption: format!(
            "Side view; both axes have the same scale. The attractors μ<sub>i</sub> are numbered in \
             the order of their activation; the springs pull the {} towards their weighted mean \
             Σ<sub>i</sub> h<sub>i</sub> μ<sub>i</sub> (dashed), which it need not reach. Each \
             ellipse connects displacements of equal spring energy: wide where the spring is \
             compliant, and a circle of {:.0}&#8239;mm radius where it has \
             {REFERENCE_STIFFNESS:.0}&#8239;s⁻² in every direction. Grey: the \
             first rollout, which imitates the demonstration.{missing}",
            data.tip,
            REFERENCE_RADIUS_M * 1e3
        ),
        rows,
    }
}

fn draw(data: &ReportData) -> Panel {
    let pan = |path: &[PathRow]| -> Vec<(f64, f64)> {
        path.iter().map(|row| (row.pan_position[X].into(), row.pan_position[Z].into())).collect()
    };
    let centres = |policy: &PolicyMsg| -> Vec<(f64, f64)> {
        policy.components().iter().map(|component| position(&component.attractor)).collect()
    };
    let (initial, learnt) = (pan(&data.initial_path), pan(&data.film.path));
    let shown: Vec<Vec<(f64, f64)>> = data
        .demonstrations
        .iter()
        .map(|shown| {
            shown.path().iter().map(|pose| (pose.translation.x, pose.translation.z)).collect()
        })
        .collect();
    let (starts, attractors) = (centres(&data.initial), centres(&data.learnt));
    let all = || [&initial, &learnt, &starts, &attractors].into_iter().chain(&shown).flatten();
    let x = Axis::exactly("x (forward), m", all().map(|point| point.0));
    let z = Axis::exactly("z (up), m", all().map(|point| point.1));
    let (x, z, area) = equal_scale(x, z);
    let (n, tip) = (attractors.len(), data.tip);
    let alt = format!("{n} attractors and the path of the {tip} from the side");
    let mut plot = Plot::new(Plot::outer_size(area, &LEGEND), &alt, x, z, &LEGEND);

    let outlines = ellipses(&data.learnt, &plot);
    plot.clipped(|panel| {
        for (i, outline) in outlines.into_iter().enumerate() {
            let class = format!("ellipse {}", colour(i, attractors.len()));
            panel.polygon(outline, &class);
        }
    });
    shown.into_iter().for_each(|curve| plot.curve(curve, "shown"));
    plot.curve(initial, "initial");
    starts.iter().for_each(|start| plot.dot(start.0, start.1, 3.0, "dot start"));
    plot.curve(attractor_path(&data.learnt), "attractor");
    plot.curve(learnt, "learnt");
    let pixels: Vec<_> = attractors.iter().map(|at| plot.at(at.0, at.1)).collect();
    for (i, (at, label)) in pixels.iter().zip(label_places(&pixels)).enumerate() {
        plot.panel.circle(*at, 4.5, colour(i, attractors.len()).as_str());
        let baseline = (label.0, label.1 + 4.5);
        plot.panel.text(baseline, Anchor::Middle, "text halo", &(i + 1).to_string());
    }
    plot.panel
}

fn position(coordinates: &[f64]) -> (f64, f64) {
    (coordinates[X], coordinates[Z])
}

/// Class of the i-th of n attractors.
pub fn colour(i: usize, n: usize) -> String {
    let last = n.saturating_sub(1).max(1);
    format!("o{}", (i * (N_COLOURS - 1) + last / 2) / last)
}

/// Σ hᵢ μᵢ over the execution.
fn attractor_path(policy: &PolicyMsg) -> Vec<(f64, f64)> {
    times(policy)
        .map(|t_s| {
            let h = policy_activations(policy, t_s);
            h.iter().zip(policy.components()).fold((0.0, 0.0), |sum, (h, component)| {
                let (x, z) = position(&component.attractor);
                (sum.0 + h * x, sum.1 + h * z)
            })
        })
        .collect()
}

/// Both axes with a margin, the shorter one widened towards the longer; and the area, px,
/// that gives them the same scale.
pub fn equal_scale<'a>(x: Axis<'a>, z: Axis<'a>) -> (Axis<'a>, Axis<'a>, (f64, f64)) {
    let longer = (x.max - x.min).max(z.max - z.min).max(0.05);
    let widened = |axis: Axis<'a>, share: f64| {
        let half = 0.5 * ((axis.max - axis.min) + 0.16 * longer).max(share * longer);
        let middle = 0.5 * (axis.min + axis.max);
        Axis { min: middle - half, max: middle + half, ..axis }
    };
    let (x, z) = (widened(x, 0.8), widened(z, 0.5));
    let scale = (AREA.0 / (x.max - x.min)).min(AREA.1 / (z.max - z.min));
    let area = ((x.max - x.min) * scale, (z.max - z.min) * scale);
    (x, z, area)
}

/// The outline of each spring's ellipse around its attractor, px.
fn ellipses(policy: &PolicyMsg, plot: &Plot) -> Vec<Vec<(f64, f64)>> {
    let outline = |component: &Component| {
        let (x, z) = position(&component.attractor);
        ellipse(component).into_iter().map(|d| plot.at(x + d.x, z + d.y)).collect()
    };
    policy.components().iter().map(outline).collect()
}

/// Displacements d in the x–z plane with dᵀ K d = K₀ r₀²: d = √(K₀ r₀²) K^(−1/2) u, |u| = 1.
fn ellipse(component: &Component) -> Vec<Vector2<f64>> {
    let k = |row, column| component.stiffness_at(row, column);
    let eigen = Matrix2::new(k(X, X), k(X, Z), k(X, Z), k(Z, Z)).symmetric_eigen();
    // A stiffness that is not positive has no ellipse; the points are then not finite.
    let radii = eigen.eigenvalues.map(|value| (REFERENCE_STIFFNESS / value).sqrt());
    (0..48)
        .map(|step| {
            let (sin, cos) = (std::f64::consts::TAU * f64::from(step) / 48.0).sin_cos();
            let along = Vector2::new(radii[0] * cos, radii[1] * sin) * REFERENCE_RADIUS_M;
            eigen.eigenvectors * along
        })
        .collect()
}

/// A place for the number of each point: of eight directions the one farthest from all points and
/// from the numbers placed before.
pub fn label_places(points: &[(f64, f64)]) -> Vec<(f64, f64)> {
    let mut places: Vec<(f64, f64)> = Vec::with_capacity(points.len());
    for (i, (x, y)) in points.iter().enumerate() {
        let others = points.iter().enumerate().filter(|(j, _)| *j != i).map(|(_, point)| point);
        let taken: Vec<_> = others.chain(&places).copied().collect();
        let room = |at: &(f64, f64)| {
            taken.iter().map(|p| (p.0 - at.0).hypot(p.1 - at.1)).fold(f64::MAX, f64::min).min(40.0)
        };
        let around = (0..8).map(|k| {
            let (sin, cos) = (std::f64::consts::FRAC_PI_4 * f64::from(k)).sin_cos();
            (x + 13.0 * cos, y + 13.0 * sin)
        });
        let best = around.max_by(|a, b| room(a).total_cmp(&room(b)));
        places.push(best.unwrap_or((*x, *y)));
    }
    places
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::report::sample;
    use shm_types::policy::packed_index;

    #[test]
    fn draws_and_numbers_every_attractor() {
        let data = sample::session(3);
        let svg = figure(&data).svg().expect("there is a policy");
        let n = data.learnt.components().len();
        assert_eq!(svg.matches("class=\"ellipse").count(), n);
        assert_eq!(svg.matches("text halo\"").count(), n);
        for i in 1..=n {
            assert!(svg.contains(&format!(">{i}</text>")), "number {i}");
        }
    }

    #[test]
    fn both_axes_have_the_same_scale() {
        let (x, z) = (Axis::exactly("x", [0.7, 0.72]), Axis::exactly("z", [0.6, 1.0]));
        let (x, z, area) = equal_scale(x, z);
        assert!((area.0 / (x.max - x.min) - area.1 / (z.max - z.min)).abs() < 1e-9);
        assert!(area.0 <= AREA.0 + 1e-9 && area.1 <= AREA.1 + 1e-9);
    }

    #[test]
    fn ellipse_holds_displacements_of_equal_energy() {
        let mut component = Component::ZERO;
        for (row, column, value) in [(0, 0, 300.0), (1, 1, 50.0), (2, 2, 90.0), (2, 0, -60.0)] {
            component.stiffness[packed_index(row, column)] = value;
        }
        for d in ellipse(&component) {
            let energy = 300.0 * d.x * d.x + 90.0 * d.y * d.y - 120.0 * d.x * d.y;
            assert!((energy - 200.0 * 0.02 * 0.02).abs() < 1e-12);
        }
    }

    #[test]
    fn colours_cover_the_order_from_first_to_last() {
        assert_eq!((colour(0, 8), colour(7, 8)), ("o0".to_owned(), "o7".to_owned()));
        assert_eq!((colour(0, 1), colour(15, 16)), ("o0".to_owned(), "o7".to_owned()));
    }
}
