//! Side view of pan and pancake: looking along +y, x to the right, z up. Positive pitch, a turn
//! about +y, lowers the pan's nose.

#![allow(non_snake_case)] // monogram notation: p_WP, R_WO

use std::f64::consts::TAU;

use learner::path::PathRow;
use nalgebra::{Quaternion, Rotation3, UnitQuaternion, Vector3};

use crate::draw::svg::Panel;

/// Pan: radius, length and outward tilt of the rim, distance of the wrist along −x. m, rad.
pub const PAN_RADIUS: f64 = 0.13;
const RIM_LENGTH: f64 = 0.025;
const RIM_TILT: f64 = 30.0 * std::f64::consts::PI / 180.0;
const WRIST: f64 = 0.30;
/// Pancake: radius and thickness; length of its drawn normal. m.
const PANCAKE_RADIUS: f64 = 0.08;
const PANCAKE_THICKNESS: f64 = 0.01;
const NORMAL: f64 = 0.055;
/// Around what is shown, m.
const MARGIN: f64 = 0.03;
/// Points of a circle.
const CIRCLE: usize = 32;

/// Part of the x–z plane that a frame shows, m, and pixels per metre.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct View {
    pub x: (f64, f64),
    pub z: (f64, f64),
    pub scale: f64,
}

impl View {
    /// Shows the whole path at `width` px, within limits around its start: a pancake thrown away
    /// must not shrink the rest to nothing.
    pub fn of(path: &[PathRow], width: f64) -> View {
        let start = path.first().map_or([0.0; 3], |row| row.pan_position.map(f64::from));
        let mut x = (start[0] - 0.20, start[0] + 0.18);
        let mut z = (start[2] - 0.12, start[2] + 0.25);
        for row in path {
            let (pan, object) =
                (row.pan_position.map(f64::from), row.object_position.map(f64::from));
            x = (x.0.min(pan[0] - 0.20), x.1.max(pan[0] + 0.16).max(object[0] + 0.09));
            z = (z.0.min(pan[2] - 0.12), z.1.max(pan[2] + 0.12).max(object[2] + 0.10));
        }
        let x = (x.0.max(start[0] - 0.45), x.1.min(start[0] + 0.45));
        let z = (z.0.max(start[2] - 0.45), z.1.min(start[2] + 1.30));
        View { x, z, scale: width / (x.1 - x.0) }
    }

    /// Shows the path, and of `others` what is not below the ground, within a frame of `width` × `height` px.
    pub fn within(path: &[PathRow], others: &[Vector3<f64>], (width, height): (f64, f64)) -> View {
        let View { mut x, mut z, .. } = View::of(path, width);
        for p in others {
            x = (x.0.min(p.x - MARGIN), x.1.max(p.x + MARGIN));
            z = (z.0.min(p.z.max(0.0) - MARGIN), z.1.max(p.z + MARGIN));
        }
        let scale = (width / (x.1 - x.0)).min(height / (z.1 - z.0));
        // What the frame is too wide for is shown on both sides.
        let more = 0.5 * (width / scale - (x.1 - x.0));
        View { x: (x.0 - more, x.1 + more), z, scale }
    }

    pub fn width(&self) -> f64 {
        (self.x.1 - self.x.0) * self.scale
    }

    pub fn height(&self) -> f64 {
        (self.z.1 - self.z.0) * self.scale
    }

    /// Pixels of a point in the world.
    pub fn at(&self, p_W: &Vector3<f64>) -> (f64, f64) {
        ((p_W.x - self.x.0) * self.scale, (self.z.1 - p_W.z) * self.scale)
    }
}

/// The object's orientation R_WO; the identity if the row holds none.
pub fn orientation(row: &PathRow) -> UnitQuaternion<f64> {
    let [w, i, j, k] = row.object_quaternion.map(f64::from);
    UnitQuaternion::try_new(Quaternion::new(w, i, j, k), 1e-6).unwrap_or_default()
}

/// The pan's middle section and its handle.
pub fn draw_pan(panel: &mut Panel, view: &View, row: &PathRow) {
    let [pitch, roll, yaw] = row.pan_rotation.map(f64::from);
    let R_WP = Rotation3::new(Vector3::new(roll, pitch, yaw));
    let p_WP = Vector3::from(row.pan_position.map(f64::from));
    let at = |x: f64, z: f64| view.at(&(p_WP + R_WP * Vector3::new(x, 0.0, z)));
    let (out, up) = (RIM_LENGTH * RIM_TILT.sin(), RIM_LENGTH * RIM_TILT.cos());
    panel.line(at(-PAN_RADIUS - 0.5 * out, 0.5 * up), at(-WRIST, 0.0), "handle");
    let section = [
        at(-PAN_RADIUS - out, up),
        at(-PAN_RADIUS, 0.0),
        at(PAN_RADIUS, 0.0),
        at(PAN_RADIUS + out, up),
    ];
    panel.path(section, "pan");
}

/// The pancake as two slabs, its original top and bottom, and the normal of the top.
pub fn draw_pancake(panel: &mut Panel, view: &View, row: &PathRow) {
    let p_WO = Vector3::from(row.object_position.map(f64::from));
    let R_WO = orientation(row);
    let normal = R_WO * Vector3::z();
    let outline = |z: f64| -> Vec<(f64, f64)> {
        let circle = (0..CIRCLE).map(|k| {
            let (sin, cos) = (TAU * k as f64 / CIRCLE as f64).sin_cos();
            view.at(&(p_WO + R_WO * Vector3::new(PANCAKE_RADIUS * cos, PANCAKE_RADIUS * sin, z)))
        });
        circle.collect()
    };
    let half = PANCAKE_THICKNESS / 2.0;
    let top = ([outline(half), outline(0.0)].concat(), "pancake top");
    let bottom = ([outline(-half), outline(0.0)].concat(), "pancake bottom");
    // The viewer is at −y: what faces it is drawn last.
    let slabs = if normal.y < 0.0 { [bottom, top] } else { [top, bottom] };
    for (points, class) in slabs {
        panel.polygon(convex_hull(points), class);
    }
    let tip = view.at(&(p_WO + NORMAL * normal));
    panel.line(view.at(&(p_WO + half * normal)), tip, "normal");
    panel.circle(tip, 2.2, "normal-tip");
}

/// The convex hull (Andrew's monotone chain); empty if a point is not finite.
pub fn convex_hull(mut points: Vec<(f64, f64)>) -> Vec<(f64, f64)> {
    if points.iter().any(|(x, y)| !x.is_finite() || !y.is_finite()) {
        return Vec::new();
    }
    points.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.total_cmp(&b.1)));
    let half = |points: &mut dyn Iterator<Item = &(f64, f64)>| {
        let mut chain: Vec<(f64, f64)> = Vec::new();
        for &c in points {
            while let [.., a, b] = chain[..]
                && (b.0 - a.0) * (c.1 - a.1) - (b.1 - a.1) * (c.0 - a.0) <= 1e-9
            {
                chain.pop();
            }
            chain.push(c);
        }
        chain.pop();
        chain
    };
    let mut hull = half(&mut points.iter());
    hull.extend(half(&mut points.iter().rev()));
    hull
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::report::sample;

    /// The picture draws the default world; its numbers are constants of the drawing.
    #[test]
    fn draws_pan_and_pancake_as_the_world_has_them() {
        let world = physics::pancake::PancakeConfig::default();
        assert_eq!((PAN_RADIUS, RIM_LENGTH), (world.pan_radius, world.rim_height));
        assert!((RIM_TILT - world.rim_tilt).abs() < 1e-12);
        assert_eq!(PANCAKE_RADIUS, world.pancake_radius);
        assert_eq!(PANCAKE_THICKNESS, world.pancake_thickness);
    }

    #[test]
    fn a_view_fills_its_frame() {
        let path = sample::session(1).film.path;
        let base = [Vector3::new(0.0, 0.0, 0.0), Vector3::new(0.0, 0.0, -0.1)];
        let view = View::within(&path, &base, (440.0, 300.0));
        assert!((view.width() - 440.0).abs() < 1e-9 && view.height() < 300.0 + 1e-9);
        assert!(view.x.0 < 0.0 && view.z.0 < 0.0, "the base is in view");
        assert!(view.z.0 > -0.1, "what is below the ground is not");
    }

    #[test]
    fn positive_pitch_lowers_the_nose() {
        let view = View { x: (0.0, 1.0), z: (0.0, 1.0), scale: 100.0 };
        let mut row = sample::session(1).film.path[0];
        (row.pan_position, row.pan_rotation) = ([0.5, 0.0, 0.5], [0.5, 0.0, 0.0]);
        let mut panel = Panel::new(100.0, 100.0, "");
        draw_pan(&mut panel, &view, &row);
        // The nose is at x = 0.5 + 0.13 cos 0.5, z = 0.5 − 0.13 sin 0.5; pixels count downwards.
        assert!(panel.inline().contains("L61.4 56.2"), "{}", panel.inline());
    }

    #[test]
    fn hull_keeps_the_corners_only() {
        let square = vec![(0.0, 0.0), (1.0, 0.0), (0.5, 0.5), (1.0, 1.0), (0.0, 1.0)];
        assert_eq!(convex_hull(square), [(0.0, 0.0), (1.0, 0.0), (1.0, 1.0), (0.0, 1.0)]);
        assert_eq!(convex_hull(vec![(0.0, f64::NAN)]), []);
    }

    #[test]
    fn a_pancake_thrown_away_does_not_shrink_the_view() {
        let mut path = sample::session(1).film.path;
        let last = path.len() - 1;
        path[last].object_position = [9.0, 0.0, -50.0];
        let view = View::of(&path, 120.0);
        assert!(view.x.1 - view.x.0 <= 0.9 && view.z.1 - view.z.0 <= 1.75);
    }
}
