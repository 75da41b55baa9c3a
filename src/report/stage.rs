//! A rollout in motion, seen from the side: the arm, what it carries and the object, moved along the recorded path
//! by key frames of a stylesheet. No script; where nothing moves, the highest moment of the object is shown.
//!
//! Links are drawn where they were. Tip and object move as rigid figures: the turn is that about the viewing axis,
//! as if nothing rolled towards the viewer. `strip.rs` shows the true projection.

use std::f64::consts::{FRAC_PI_2, TAU};

use learner::path::PathRow;
use nalgebra::{Matrix2, Vector3};
use shm_types::policy::PolicyMsg;

use super::bodies::{by_depth, draw_ground, draw_object, draw_tip, has_string, reach};
use super::ellipsoids::stiffness;
use super::film::{Film, Links, object, tip};
use super::side_view::{View, orientation};
use super::{ReportData, time};
use crate::draw::svg::{Anchor, Panel};
use crate::draw::track::{Course, Matrix, Pose, Track};

/// Height of the time line below the view, px.
const TIME_LINE: f64 = 36.0;
/// Width of the longest name on the time line, px.
const NAME: f64 = 60.0;
/// How many times slower than it was.
pub const SLOWER: f64 = 3.0;
/// Longest semi-axis of the stiffness's ellipse, px.
const STIFFEST: f64 = 42.0;
/// Rest at the end, s of the animation.
const REST_S: f64 = 1.2;
/// Rows of the path per moment; between moments everything moves evenly.
const STRIDE: usize = 2;
/// Width of the line around a link, px.
const EDGE: f64 = 1.1;

/// What moves in a panel, each motion once.
struct Stage {
    /// Begins the names of its key frames: there may be several in a page.
    prefix: String,
    /// The moment that is shown where nothing moves.
    rest: usize,
    tracks: Vec<Track>,
}

impl Stage {
    fn put(&mut self, panel: &mut Panel, track: &Track, draw: impl FnOnce(&mut Panel)) {
        let known = self.tracks.iter().position(|other| other == track);
        let k = known.unwrap_or_else(|| {
            self.tracks.push(track.clone());
            self.tracks.len() - 1
        });
        let class = format!("moving {p} {p}{k}", p = self.prefix);
        panel.group(&class, &track.attribute(self.rest), draw);
    }

    fn rules(&self, course: &Course) -> String {
        let name = |k| format!("{}{k}", self.prefix);
        let rules = self.tracks.iter().enumerate().map(|(k, track)| course.rules(&name(k), track));
        rules.collect::<String>() + &course.waits(&self.prefix, self.rest)
    }
}

/// A film in a panel of `size` px, the time line included, with the springs of `policy` where they vary. `None` where
/// nothing moves.
pub fn moving(
    data: &ReportData,
    film: &Film,
    policy: Option<&PolicyMsg>,
    size: (f64, f64),
    prefix: &str,
) -> Option<Panel> {
    let whole = film.finite();
    let film = whole.thinned(STRIDE);
    if film.path.len() < 2 {
        return None;
    }
    let radii = data.look.as_ref().map_or(&[][..], |look| &look.radii);
    let inner = (size.0, size.1 - TIME_LINE);
    let view = View::within(&film.path, &reach(&film.arm, radii), inner);
    let highest = |a: &usize, b: &usize| {
        film.path[*a].object_position[2].total_cmp(&film.path[*b].object_position[2])
    };
    let rest = (0..film.path.len()).max_by(highest).unwrap_or(0);
    let times: Vec<f64> = film.path.iter().map(|row| f64::from(row.t_s)).collect();
    let course = Course::new(times, SLOWER, REST_S);
    let mut stage = Stage { prefix: prefix.into(), rest, tracks: Vec::new() };

    let bodies = match data.object {
        "" => data.tip.to_owned(),
        object => format!("{} and {object}", data.tip),
    };
    let alt = format!("animation of rollout {}: arm, {bodies} from the side", film.rollout);
    let mut panel = Panel::new(view.width(), view.height() + TIME_LINE, alt);
    let pans: Vec<Pose> = film.path.iter().map(|row| tip_pose(&view, row)).collect();
    panel.clipped((0.0, 0.0), (view.width(), view.height()), |panel| {
        draw_ground(panel, &view);
        panel.path(whole.path.iter().map(|row| view.at(&object(row))), "trail");
        put_arm(&mut stage, panel, &view, &film.arm, radii);
        if let Some(ellipses) = policy.and_then(|policy| ellipses(policy, &film.path, &pans)) {
            let track = Track::Matrices(ellipses);
            stage.put(panel, &track, |panel| panel.circle((0.0, 0.0), 1.0, "stiffness"));
        }
        put_bodies(&mut stage, panel, &view, data, &film, &pans);
    });
    let corners = [(0.0, 0.0), (view.width(), 0.0), (view.width(), view.height())];
    panel.polygon(corners.into_iter().chain([(0.0, view.height())]), "frame");
    put_time_line(&mut stage, &mut panel, &view, data, &film);
    panel.style(&stage.rules(&course));
    Some(panel)
}

fn tip_pose(view: &View, row: &PathRow) -> Pose {
    // A turn about +y, which points away from the viewer, is clockwise.
    Pose::at(view.at(&tip(row))).turned(f64::from(row.pan_rotation[0]).to_degrees())
}

/// The object's poses, its turn without jumps.
fn object_poses(view: &View, path: &[PathRow]) -> Vec<Pose> {
    let mut last = 0.0;
    let pose = |row: &PathRow| {
        let normal = orientation(row) * Vector3::z();
        let angle = FRAC_PI_2 - normal.z.atan2(normal.x);
        let turns = ((last - angle) / TAU).round();
        last = angle + turns * TAU;
        Pose::at(view.at(&object(row))).turned(last.to_degrees())
    };
    path.iter().map(pose).collect()
}

/// A line of length `length`, px, between two points that move; its turn without jumps.
fn bar(ends: &[[(f64, f64); 2]], length: f64) -> Track {
    let mut last = 0.0;
    let pose = |[a, b]: &[(f64, f64); 2]| {
        let (x, y) = (b.0 - a.0, b.1 - a.1);
        let angle = y.atan2(x);
        let turns = ((last - angle) / TAU).round();
        last = angle + turns * TAU;
        Pose { stretch: x.hypot(y) / length, ..Pose::at(*a).turned(last.to_degrees()) }
    };
    Track::Poses(ends.iter().map(pose).collect())
}

/// Every capsule as two discs and what is between them, on a slightly larger one.
fn put_arm(stage: &mut Stage, panel: &mut Panel, view: &View, arm: &[Links], radii: &[f64]) {
    let Some(shown) = arm.get(stage.rest) else { return };
    for i in by_depth(shown).into_iter().filter(|i| *i < radii.len()) {
        let ends: Vec<[(f64, f64); 2]> =
            arm.iter().map(|links| links[i].map(|end| view.at(&end))).collect();
        let lengths = ends.iter().map(|[a, b]| (a.0 - b.0).hypot(a.1 - b.1));
        let length = lengths.fold(0.0, f64::max);
        let track = |end: usize| Track::Poses(ends.iter().map(|e| Pose::at(e[end])).collect());
        let (from, to, between) = (track(0), track(1), bar(&ends, length.max(0.5)));
        let radius = radii[i] * view.scale;
        for (radius, class) in [(radius, "edge"), ((radius - EDGE).max(0.5), "link")] {
            stage.put(panel, &from, |panel| panel.circle((0.0, 0.0), radius, class));
            if length < 0.5 {
                continue;
            }
            stage.put(panel, &between, |panel| {
                let (top, bottom) = (-radius, radius);
                panel.polygon([(0.0, top), (length, top), (length, bottom), (0.0, bottom)], class);
            });
            stage.put(panel, &to, |panel| panel.circle((0.0, 0.0), radius, class));
        }
    }
}

/// What the arm carries, the string, and the object.
fn put_bodies(
    stage: &mut Stage,
    panel: &mut Panel,
    view: &View,
    data: &ReportData,
    film: &Film,
    pans: &[Pose],
) {
    // A view whose origin is that of the body: the body at rest, in px about its own frame.
    let body = View { x: (0.0, 0.0), z: (0.0, 0.0), scale: view.scale };
    let at_rest = PathRow {
        pan_position: [0.0; 3],
        pan_rotation: [0.0; 3],
        object_position: [0.0; 3],
        object_quaternion: [1.0, 0.0, 0.0, 0.0],
        ..film.path[0]
    };
    stage.put(panel, &Track::Poses(pans.into()), |panel| draw_tip(panel, &body, &at_rest, data));
    if has_string(data.look.as_ref()) {
        let ends: Vec<[(f64, f64); 2]> =
            film.path.iter().map(|row| [view.at(&tip(row)), view.at(&object(row))]).collect();
        let length = ends.iter().map(|[a, b]| (a.0 - b.0).hypot(a.1 - b.1)).fold(0.5, f64::max);
        stage.put(panel, &bar(&ends, length), |panel| {
            panel.line((0.0, 0.0), (length, 0.0), "string");
        });
    }
    let objects = Track::Poses(object_poses(view, &film.path));
    stage.put(panel, &objects, |panel| draw_object(panel, &body, &at_rest, data));
}

fn put_time_line(
    stage: &mut Stage,
    panel: &mut Panel,
    view: &View,
    data: &ReportData,
    film: &Film,
) {
    let (width, y) = (view.width(), view.height() + 13.0);
    let [start, end] = [0, film.path.len() - 1].map(|row| f64::from(film.path[row].t_s));
    let across = |t_s: f64| 8.0 + (width - 16.0) * (t_s - start) / (end - start);
    panel.line((8.0, y), (width - 8.0, y), "axis");
    let trial = data.trials.iter().find(|trial| trial.rollout == film.rollout);
    let measures = trial.map_or(&data.learnt_measures, |trial| &trial.measures);
    for name in ["release", "crossing"] {
        let t_s = time(measures, &format!("{name}_time_s"));
        if t_s > start && t_s <= end {
            let x = across(t_s);
            panel.line((x, y - 5.0), (x, y + 5.0), "axis");
            // Away from each other: they may be close.
            let is_before = name == "release" || x + NAME > width;
            let (anchor, shift) =
                if is_before { (Anchor::End, 4.0) } else { (Anchor::Start, -4.0) };
            panel.text((x + shift, y + 18.0), anchor, "tick", name);
        }
    }
    let clock = film.path.iter().map(|row| Pose::at((across(row.t_s.into()), y))).collect();
    stage.put(panel, &Track::Poses(clock), |panel| {
        panel.circle((0.0, 0.0), 4.5, "dot success");
    });
}

/// The unit circle becomes {K u, |u| = 1}, K in px, where the tip is; z points up, y of the drawing down.
fn ellipse(pan: &Pose, k: &Matrix2<f64>) -> Matrix {
    Matrix([k[(0, 0)], -k[(1, 0)], -k[(0, 1)], k[(1, 1)], pan.x, pan.y])
}

/// K of the policy at each moment, scaled to [`STIFFEST`]; nothing where one is not finite.
fn ellipses(policy: &PolicyMsg, path: &[PathRow], pan: &[Pose]) -> Option<Vec<Matrix>> {
    let k = path.iter().map(|row| stiffness(policy, f64::from(row.t_s)));
    let k: Vec<Matrix2<f64>> = k.collect();
    let largest = k.iter().map(|k| k.norm()).fold(0.0, f64::max);
    if !largest.is_finite() || largest <= 0.0 || k.iter().any(|k| !k.norm().is_finite()) {
        return None;
    }
    let scale = STIFFEST / largest;
    Some(pan.iter().zip(k).map(|(pan, k)| ellipse(pan, &(k * scale))).collect())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::report::sample;

    #[test]
    fn the_object_turns_half_way_round_without_a_jump() {
        let data = sample::session(5);
        let film = data.film.thinned(STRIDE);
        let view = View::within(&film.path, &[], (440.0, 400.0));
        let poses = object_poses(&view, &film.path);
        let turned = poses[poses.len() - 1].turn - poses[0].turn;
        assert!((100.0..260.0).contains(&turned.abs()), "{turned}");
        assert!(poses.windows(2).all(|pair| (pair[1].turn - pair[0].turn).abs() < 60.0));
    }

    #[test]
    fn the_pan_turns_clockwise_when_its_nose_goes_down() {
        let mut row = sample::session(1).film.path[0];
        row.pan_rotation[0] = 0.5;
        let view = View { x: (0.0, 1.0), z: (0.0, 1.0), scale: 100.0 };
        assert!((tip_pose(&view, &row).turn - 28.65).abs() < 0.01);
    }

    #[test]
    fn the_ellipse_is_wide_where_the_arm_is_stiff() {
        let pan = Pose::at((100.0, 50.0)).turned(20.0);
        // Stiff along x = z, which is to the right and up: the corner (1, −1) of the drawing grows.
        let k = Matrix2::new(2.0, 1.0, 1.0, 2.0);
        assert_eq!(ellipse(&pan, &k), Matrix([2.0, -1.0, -1.0, 2.0, 100.0, 50.0]));
        let data = sample::session(5);
        let pans = vec![pan; data.film.path.len()];
        let ellipses = ellipses(&data.learnt, &data.film.path, &pans).unwrap();
        let heights = ellipses.iter().map(|matrix| matrix.0[3]);
        let (min, max) = heights.fold((f64::MAX, 0.0), |(a, b), h| (h.min(a), h.max(b)));
        assert!(max <= STIFFEST && min < 0.5 * max, "soft at the catch: {min} to {max}");
    }

    #[test]
    fn a_link_keeps_its_ends_where_they_were() {
        let ends = [[(0.0, 0.0), (3.0, 4.0)], [(1.0, 0.0), (1.0, -10.0)]];
        let Track::Poses(poses) = bar(&ends, 10.0) else { panic!("poses") };
        for ([_, end], pose) in ends.iter().zip(poses) {
            let (sin, cos) = pose.turn.to_radians().sin_cos();
            let reached = (pose.x + 10.0 * pose.stretch * cos, pose.y + 10.0 * pose.stretch * sin);
            assert!((reached.0 - end.0).hypot(reached.1 - end.1) < 1e-9);
        }
    }
}
