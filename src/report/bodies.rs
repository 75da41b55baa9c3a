//! The arm, what it carries and the object from the side.

#![allow(non_snake_case)] // monogram notation: X_WP

use std::f64::consts::TAU;

use learner::path::PathRow;
use nalgebra::{Isometry3, Point3, Translation3, UnitQuaternion, Vector3};

use super::ReportData;
use super::film::{Links, Look, object, tip};
use super::side_view::{View, convex_hull, draw_pan, draw_pancake, orientation};
use crate::draw::svg::Panel;
use crate::record::solids::Solid;

/// Width of the line around a link, px.
const EDGE: f64 = 1.1;
/// Capsules nearer than this to each other keep their order from the base outwards, m.
const DEPTH: f64 = 0.05;
/// Points of a circle.
const CIRCLE: usize = 24;

/// The capsules from the farthest to the nearest, by the side they are seen from: the viewer is at −y.
pub fn by_depth(links: &[[Vector3<f64>; 2]]) -> Vec<usize> {
    let depth = |i: &usize| ((links[*i][0].y + links[*i][1].y) / 2.0 / DEPTH).round();
    let mut order: Vec<usize> = (0..links.len()).collect();
    order.sort_by(|a, b| depth(b).total_cmp(&depth(a)));
    order
}

/// Every capsule as what is within its radius of the line between its ends, and a line around it.
pub fn draw_links(panel: &mut Panel, view: &View, links: &[[Vector3<f64>; 2]], radii: &[f64]) {
    for i in by_depth(links).into_iter().filter(|i| *i < radii.len()) {
        let [a, b] = links[i].map(|end| view.at(&end));
        let width = 2.0 * radii[i] * view.scale;
        // A line of no length has no ends to be round.
        let b = if (a.0 - b.0).hypot(a.1 - b.1) < 0.1 { (a.0 + 0.1, a.1) } else { b };
        panel.thick_line(a, b, width, "edge");
        panel.thick_line(a, b, (width - 2.0 * EDGE).max(0.5), "link");
    }
}

/// Radius of an object whose shape is not known, px.
const UNKNOWN: f64 = 5.0;

/// The ground, where it is in view.
pub fn draw_ground(panel: &mut Panel, view: &View) {
    if view.z.0 < 0.0 {
        let at = |x| view.at(&Vector3::new(x, 0.0, 0.0));
        panel.line(at(view.x.0), at(view.x.1), "ground");
    }
}

/// What the arm carries, in a row of its path.
pub fn draw_tip(panel: &mut Panel, view: &View, row: &PathRow, data: &ReportData) {
    if data.is_toss() {
        return draw_pan(panel, view, row);
    }
    let [pitch, roll, yaw] = row.pan_rotation.map(f64::from);
    let turn = UnitQuaternion::from_scaled_axis(Vector3::new(roll, pitch, yaw));
    let X_WP = Isometry3::from_parts(Translation3::from(tip(row)), turn);
    let solids = data.look.as_ref().map_or(&[][..], |look| &look.solids.tip.1);
    draw_solids(panel, view, &X_WP, solids, "carried");
}

/// The object, in a row of its path.
pub fn draw_object(panel: &mut Panel, view: &View, row: &PathRow, data: &ReportData) {
    if data.is_toss() {
        return draw_pancake(panel, view, row);
    }
    if data.object.is_empty() {
        return;
    }
    let X_WO = Isometry3::from_parts(Translation3::from(object(row)), orientation(row));
    let solids = data.look.as_ref().map_or(&[][..], |look| &look.solids.object.1);
    if solids.is_empty() {
        // Its shape is known to its plant alone.
        return panel.circle(view.at(&object(row)), UNKNOWN, "object");
    }
    draw_solids(panel, view, &X_WO, solids, "object");
}

/// Does a string lead from the tip to the object?
pub fn has_string(look: Option<&Look>) -> bool {
    look.is_some_and(|look| look.solids.has_string)
}

/// Corners of everything that a film shows of the arm, m.
pub fn reach(film: &[Links], radii: &[f64]) -> Vec<Vector3<f64>> {
    let corners = |links: &Links| -> Vec<Vector3<f64>> {
        let balls = links.iter().zip(radii).flat_map(|(ends, radius)| ends.map(|e| (e, *radius)));
        balls
            .flat_map(|(centre, radius)| {
                [-radius, radius].map(|r| centre + Vector3::new(r, 0.0, r))
            })
            .collect()
    };
    film.iter().flat_map(corners).collect()
}

fn draw_solids(
    panel: &mut Panel,
    view: &View,
    X_WB: &Isometry3<f64>,
    solids: &[Solid],
    class: &str,
) {
    for solid in solids {
        let place = |p: [f64; 3]| view.at(&(X_WB * Point3::from(p)).coords);
        match *solid {
            Solid::Ball { radius, .. } => {
                panel.circle(place([0.0; 3]), radius * view.scale, class);
            }
            Solid::Cone { bottom_radius, top_radius, height, z, .. } => {
                let discs = [(bottom_radius, z - 0.5 * height), (top_radius, z + 0.5 * height)];
                let points = discs.into_iter().flat_map(|(radius, z)| {
                    (0..CIRCLE).map(move |k| {
                        let (sin, cos) = (TAU * k as f64 / CIRCLE as f64).sin_cos();
                        [radius * cos, radius * sin, z]
                    })
                });
                panel.polygon(convex_hull(points.map(place).collect()), class);
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_farther_is_drawn_first_and_neighbours_keep_their_order() {
        let at = |y: f64| [Vector3::new(0.0, y, 0.0), Vector3::new(1.0, y, 0.0)];
        assert_eq!(by_depth(&[at(0.0), at(0.3), at(0.01), at(-0.4)]), [1, 0, 2, 3]);
    }

    #[test]
    fn a_link_is_as_thick_as_it_is() {
        let view = View { x: (0.0, 1.0), z: (0.0, 1.0), scale: 100.0 };
        let mut panel = Panel::new(100.0, 100.0, "");
        let ends = [Vector3::new(0.2, 0.0, 0.5), Vector3::new(0.8, 0.0, 0.5)];
        draw_links(&mut panel, &view, &[ends], &[0.06]);
        assert!(
            panel
                .inline()
                .contains("class=\"line edge\" style=\"stroke-width:12px\" d=\"M20 50L80 50\"")
        );
    }
}
