//! The flip in motion: pan and pancake from the side, moved along the recorded path by key frames
//! of a stylesheet. No script; where nothing moves, the pose at the apex is shown.
//!
//! With the pan moves an ellipse of the stiffness of that moment: small is soft.
//!
//! Both bodies move as rigid figures: the turn is that about the viewing axis, as if nothing
//! rolled towards the viewer. `strip.rs` shows the true projection.

use std::f64::consts::{FRAC_PI_2, TAU};
use std::fmt::Write;

use learner::path::PathRow;
use nalgebra::{Matrix2, Vector3};

use super::ellipsoids::stiffness;
use super::side_view::{View, draw_pan, draw_pancake, orientation};
use super::strip::finite;
use super::{ReportData, time};
use crate::draw::figure::{Figure, HALF, Row};
use crate::draw::svg::{Anchor, Panel, short};

/// Largest height of the view, px, and the height of the time line below it.
const HEIGHT: f64 = 400.0;
const TIME_LINE: f64 = 40.0;
/// Width of the longest name on the time line, px.
const NAME: f64 = 60.0;
/// How many times slower than it was.
const SLOWER: f64 = 3.0;
/// Longest semi-axis of the stiffness's ellipse, px.
const STIFFEST: f64 = 46.0;
/// Rest at the end, s of the animation.
const REST_S: f64 = 1.2;
/// Rows of the path per key frame; between frames everything moves evenly.
const STRIDE: usize = 2;

/// A rigid motion in the drawing: px, and degrees clockwise.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Pose {
    x: f64,
    y: f64,
    turn: f64,
}

impl Pose {
    fn attribute(&self) -> String {
        format!("translate({} {}) rotate({})", short(self.x), short(self.y), short(self.turn))
    }

    fn css(&self) -> String {
        let (x, y, turn) = (short(self.x), short(self.y), short(self.turn));
        format!("translate({x}px,{y}px) rotate({turn}deg)")
    }
}

/// The unit circle becomes {K u, |u| = 1}, K in px, where the pan is; z points up, y of the drawing down.
fn ellipse(pan: &Pose, k: &Matrix2<f64>) -> String {
    let [a, b, c, d] = [k[(0, 0)], -k[(1, 0)], -k[(0, 1)], k[(1, 1)]].map(short);
    format!("matrix({a},{b},{c},{d},{},{})", short(pan.x), short(pan.y))
}

/// K of the policy in each frame, scaled to [`STIFFEST`]; nothing where one is not finite.
fn ellipses(data: &ReportData, frames: &[PathRow], pan: &[Pose]) -> Option<Vec<String>> {
    let k = frames.iter().map(|row| stiffness(&data.learnt, f64::from(row.t_s)));
    let k: Vec<Matrix2<f64>> = k.collect();
    let largest = k.iter().map(|k| k.norm()).fold(0.0, f64::max);
    if !largest.is_finite() || largest <= 0.0 || k.iter().any(|k| !k.norm().is_finite()) {
        return None;
    }
    let scale = STIFFEST / largest;
    Some(pan.iter().zip(k).map(|(pan, k)| ellipse(pan, &(k * scale))).collect())
}

pub fn figure(data: &ReportData) -> Figure {
    let path = finite(&data.learnt_path);
    let frames: Vec<PathRow> = frames(&path);
    let rows = if frames.len() < 2 {
        Err(format!("the session holds no path of rollout {}.", data.learnt_rollout))
    } else {
        Ok(vec![Row::Moving(draw(data, &path, &frames))])
    };
    Figure {
        stem: "motion",
        title: "The flip in motion",
        caption: format!(
            "Rollout {}, slowed down {SLOWER:.0} times. Dotted: the path of the pancake. Around the \
             pan: the arm's stiffness at that moment; larger is stiffer. The bodies are shown \
             turning about the viewing axis only.",
            data.learnt_rollout
        ),
        rows,
    }
}

/// Every [`STRIDE`]th row, by rising times, with the last one.
fn frames(path: &[PathRow]) -> Vec<PathRow> {
    let mut frames: Vec<PathRow> = Vec::new();
    for (k, row) in path.iter().enumerate() {
        let is_later = frames.last().is_none_or(|last| row.t_s > last.t_s);
        if is_later && (k % STRIDE == 0 || k + 1 == path.len()) {
            frames.push(*row);
        }
    }
    frames
}

fn pan_pose(view: &View, row: &PathRow) -> Pose {
    let (x, y) = view.at(&Vector3::from(row.pan_position.map(f64::from)));
    // A turn about +y, which points away from the viewer, is clockwise.
    Pose { x, y, turn: f64::from(row.pan_rotation[0]).to_degrees() }
}

/// The pancake's poses, its turn without jumps.
fn pancake_poses(view: &View, frames: &[PathRow]) -> Vec<Pose> {
    let mut last = 0.0;
    let pose = |row: &PathRow| {
        let (x, y) = view.at(&Vector3::from(row.object_position.map(f64::from)));
        let normal = orientation(row) * Vector3::z();
        let angle = FRAC_PI_2 - normal.z.atan2(normal.x);
        let turns = ((last - angle) / TAU).round();
        last = angle + turns * TAU;
        Pose { x, y, turn: last.to_degrees() }
    };
    frames.iter().map(pose).collect()
}

/// The share of the animation at which a time of the path is shown, %.
struct Course {
    start_s: f64,
    duration_s: f64,
}

impl Course {
    fn of(frames: &[PathRow]) -> Course {
        let [start_s, end_s] =
            [&frames[0], &frames[frames.len() - 1]].map(|row| f64::from(row.t_s));
        Course { start_s, duration_s: end_s - start_s }
    }

    fn animation_s(&self) -> f64 {
        SLOWER * self.duration_s + REST_S
    }

    fn percent(&self, t_s: f64) -> f64 {
        100.0 * SLOWER * (t_s - self.start_s) / self.animation_s()
    }

    fn key_frames(&self, name: &str, frames: &[PathRow], transforms: &[String]) -> String {
        let mut css = format!("@keyframes {name}{{");
        for (row, transform) in frames.iter().zip(transforms) {
            let percent = self.percent(f64::from(row.t_s));
            write!(css, "{percent:.2}%{{transform:{transform}}}").expect("a String takes all");
        }
        let last = transforms.last().map(String::as_str).unwrap_or_default();
        css + &format!("100%{{transform:{last}}}}}\n")
    }
}

fn draw(data: &ReportData, path: &[PathRow], frames: &[PathRow]) -> Panel {
    let view = View::within(path, (HALF, HEIGHT));
    let (width, height) = (view.width(), view.height());
    let course = Course::of(frames);
    let pan: Vec<Pose> = frames.iter().map(|row| pan_pose(&view, row)).collect();
    let pancake = pancake_poses(&view, frames);
    let across = |t_s: f64| 8.0 + (width - 16.0) * (t_s - course.start_s) / course.duration_s;
    let line_y = height + 14.0;
    let clock: Vec<Pose> =
        frames.iter().map(|row| Pose { x: across(row.t_s.into()), y: line_y, turn: 0.0 }).collect();
    let apex = (0..frames.len())
        .max_by(|a, b| frames[*a].object_position[2].total_cmp(&frames[*b].object_position[2]))
        .unwrap_or(0);

    let alt =
        format!("animation of rollout {}: pan and pancake from the side", data.learnt_rollout);
    let mut panel = Panel::new(width, height + TIME_LINE, alt);
    let ellipses = ellipses(data, frames, &pan);
    let css = |poses: &[Pose]| poses.iter().map(Pose::css).collect::<Vec<String>>();
    let mut motions = vec![
        ("pan-motion", css(&pan)),
        ("pancake-motion", css(&pancake)),
        ("clock-motion", css(&clock)),
    ];
    motions.extend(ellipses.clone().map(|ellipses| ("stiffness-motion", ellipses)));
    panel.style(&rules(&course, frames, &motions, frames[apex].t_s.into()));
    // A view whose origin is that of the body: the body at rest, in px about its own frame.
    let body = View { x: (0.0, 0.0), z: (0.0, 0.0), scale: view.scale };
    let at_rest = PathRow {
        pan_position: [0.0; 3],
        pan_rotation: [0.0; 3],
        object_position: [0.0; 3],
        object_quaternion: [1.0, 0.0, 0.0, 0.0],
        ..frames[0]
    };
    panel.clipped((0.0, 0.0), (width, height), |panel| {
        let flown = |row: &PathRow| view.at(&Vector3::from(row.object_position.map(f64::from)));
        panel.path(path.iter().map(flown), "trail");
        if let Some(ellipses) = &ellipses {
            panel.group("moving stiffness-motion", &ellipses[apex], |panel| {
                panel.circle((0.0, 0.0), 1.0, "stiffness");
            });
        }
        panel.group("moving pan-motion", &pan[apex].attribute(), |panel| {
            draw_pan(panel, &body, &at_rest);
        });
        panel.group("moving pancake-motion", &pancake[apex].attribute(), |panel| {
            draw_pancake(panel, &body, &at_rest);
        });
    });
    panel.polygon([(0.0, 0.0), (width, 0.0), (width, height), (0.0, height)], "frame");
    panel.line((8.0, line_y), (width - 8.0, line_y), "axis");
    let measures = &data.learnt_measures;
    for (t_s, name) in [
        (time(measures, "release_time_s"), "release"),
        (time(measures, "crossing_time_s"), "crossing"),
    ] {
        if t_s > course.start_s && t_s <= course.start_s + course.duration_s {
            let x = across(t_s);
            panel.line((x, line_y - 5.0), (x, line_y + 5.0), "axis");
            // Away from each other: they may be close.
            let is_before = name == "release" || x + NAME > width;
            let (anchor, shift) =
                if is_before { (Anchor::End, 4.0) } else { (Anchor::Start, -4.0) };
            panel.text((x + shift, line_y + 19.0), anchor, "tick", name);
        }
    }
    panel.group("moving clock-motion", &clock[apex].attribute(), |panel| {
        panel.circle((0.0, 0.0), 5.0, "dot success");
    });
    panel
}

/// Key frames, and who follows them; on paper nothing moves, and where motion is not wanted it
/// waits at the apex for the switch.
fn rules(
    course: &Course,
    frames: &[PathRow],
    motions: &[(&str, Vec<String>)],
    apex_s: f64,
) -> String {
    let duration = course.animation_s();
    let before_apex = duration * course.percent(apex_s) / 100.0;
    let mut css = String::new();
    for (name, transforms) in motions {
        css += &course.key_frames(name, frames, transforms);
        writeln!(
            css,
            "@media screen{{.{name}{{animation:{name} {duration:.2}s linear infinite}}}}"
        )
        .expect("a String takes all");
    }
    css + &format!(
        "@media (prefers-reduced-motion:reduce){{.moving{{animation-play-state:paused!important;\
         animation-delay:-{before_apex:.2}s!important}}}}\n"
    )
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::report::sample;

    /// Percent, x, y and turn of every key frame.
    fn parse(css: &str) -> Vec<[f64; 4]> {
        let frame = |part: &str| {
            let numbers: Vec<f64> = part
                .split(|c: char| !(c.is_ascii_digit() || c == '.' || c == '-'))
                .filter_map(|number| number.parse().ok())
                .collect();
            numbers.try_into().expect("percent, x, y, turn")
        };
        let inner = css.split_once('{').expect("a name").1;
        inner.split('}').filter(|part| part.contains("transform")).map(frame).collect()
    }

    #[test]
    fn key_frames_follow_the_path() {
        let data = sample::session(5);
        let frames = frames(&data.learnt_path);
        let view = View::within(&data.learnt_path, (HALF, HEIGHT));
        let course = Course::of(&frames);
        let poses: Vec<String> = pancake_poses(&view, &frames).iter().map(Pose::css).collect();
        let css = course.key_frames("pancake", &frames, &poses);
        let found = parse(&css);
        assert_eq!(found.len(), frames.len() + 1, "and the rest at the end");
        for ([percent, x, y, _], row) in found.iter().zip(&frames) {
            let expected = view.at(&Vector3::from(row.object_position.map(f64::from)));
            assert!((x - expected.0).abs() < 0.06 && (y - expected.1).abs() < 0.06);
            assert!((percent - course.percent(row.t_s.into())).abs() < 0.006);
        }
        assert!(found.windows(2).all(|pair| pair[0][0] < pair[1][0]), "times rise");
        // Half a turn, nose up, and no jump on the way.
        let turned = found[found.len() - 1][3] - found[0][3];
        assert!((100.0..260.0).contains(&turned.abs()), "{turned}");
        assert!(found.windows(2).all(|pair| (pair[1][3] - pair[0][3]).abs() < 60.0));
    }

    #[test]
    fn the_pan_turns_clockwise_when_its_nose_goes_down() {
        let mut row = sample::session(1).learnt_path[0];
        row.pan_rotation[0] = 0.5;
        let view = View { x: (0.0, 1.0), z: (0.0, 1.0), scale: 100.0 };
        assert!((pan_pose(&view, &row).turn - 28.65).abs() < 0.01);
    }

    #[test]
    fn the_ellipse_is_wide_where_the_arm_is_stiff() {
        let pan = Pose { x: 100.0, y: 50.0, turn: 20.0 };
        // Stiff along x = z, which is to the right and up: the corner (1, −1) of the drawing grows.
        let k = Matrix2::new(2.0, 1.0, 1.0, 2.0);
        assert_eq!(ellipse(&pan, &k), "matrix(2,-1,-1,2,100,50)");
        let data = sample::session(5);
        let frames = frames(&data.learnt_path);
        let pans = vec![pan; frames.len()];
        let ellipses = ellipses(&data, &frames, &pans).unwrap();
        let height = |text: &String| text.split(',').nth(3).unwrap().parse::<f64>().unwrap();
        let heights: Vec<f64> = ellipses.iter().map(height).collect();
        let (min, max) = heights.iter().fold((f64::MAX, 0.0), |(a, b), h| (h.min(a), h.max(b)));
        assert!(max <= STIFFEST && min < 0.5 * max, "soft at the catch: {min} to {max}");
    }

    #[test]
    fn moves_without_a_script_and_not_on_paper() {
        let html = figure(&sample::session(5)).html(1);
        assert!(!html.contains("<script") && html.contains("prefers-reduced-motion"));
        assert!(html.contains("@media screen{.pan-motion{animation:pan-motion "));
        assert!(html.contains("type=\"checkbox\"") && html.contains("Pause"));
    }

    #[test]
    fn a_path_of_one_moment_does_not_move() {
        let mut data = sample::session(5);
        data.learnt_path.truncate(1);
        assert!(figure(&data).rows.is_err());
        data.learnt_path = vec![data.learnt_path[0]; 9];
        assert!(figure(&data).rows.is_err());
    }
}
