//! Motion without a script: rigid motions as key frames of a stylesheet, no more of them than a reader could tell.

use std::fmt::Write;

use super::svg::short;

/// How far a figure may be from where it was, between two key frames: px, degrees, and shares of a length.
const TOLERANCE_PX: f64 = 0.25;
const TOLERANCE_DEG: f64 = 0.3;
const TOLERANCE_SHARE: f64 = 0.006;

/// A place in the drawing, px; a turn clockwise, degrees; a stretch along the turned x axis.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Pose {
    pub x: f64,
    pub y: f64,
    pub turn: f64,
    pub stretch: f64,
}

impl Pose {
    pub fn at((x, y): (f64, f64)) -> Pose {
        Pose { x, y, turn: 0.0, stretch: 1.0 }
    }

    pub fn turned(self, degrees: f64) -> Pose {
        Pose { turn: degrees, ..self }
    }

    fn text(&self, px: &str, deg: &str, comma: &str) -> String {
        let (x, y) = (short(self.x), short(self.y));
        let mut text = format!("translate({x}{px}{comma}{y}{px})");
        if self.turn != 0.0 {
            write!(text, " rotate({}{deg})", short(self.turn)).expect("a String takes all");
        }
        if (self.stretch - 1.0).abs() > 1e-3 {
            write!(text, " scale({:.3}{comma}1)", self.stretch).expect("a String takes all");
        }
        text
    }

    /// As an attribute of SVG.
    pub fn attribute(&self) -> String {
        self.text("", "", " ")
    }

    fn css(&self) -> String {
        self.text("px", "deg", ",")
    }

    fn numbers(&self) -> Vec<f64> {
        vec![
            self.x / TOLERANCE_PX,
            self.y / TOLERANCE_PX,
            self.turn / TOLERANCE_DEG,
            self.stretch / TOLERANCE_SHARE,
        ]
    }
}

/// A linear map of the plane and a shift, px: a, b, c, d, e, f of `matrix()`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Matrix(pub [f64; 6]);

impl Matrix {
    fn text(&self) -> String {
        format!("matrix({})", self.0.map(short).join(","))
    }
}

/// How something moves, one pose a moment.
#[derive(Clone, Debug, PartialEq)]
pub enum Track {
    Poses(Vec<Pose>),
    Matrices(Vec<Matrix>),
}

impl Track {
    /// As an attribute of SVG.
    pub fn attribute(&self, moment: usize) -> String {
        match self {
            Track::Poses(poses) => poses[moment].attribute(),
            Track::Matrices(matrices) => matrices[moment].text(),
        }
    }

    fn css(&self, moment: usize) -> String {
        match self {
            Track::Poses(poses) => poses[moment].css(),
            Track::Matrices(matrices) => matrices[moment].text(),
        }
    }

    /// In units of what a reader could tell.
    fn numbers(&self, moment: usize) -> Vec<f64> {
        match self {
            Track::Poses(poses) => poses[moment].numbers(),
            Track::Matrices(matrices) => matrices[moment].0.map(|x| x / TOLERANCE_PX).into(),
        }
    }

    fn len(&self) -> usize {
        match self {
            Track::Poses(poses) => poses.len(),
            Track::Matrices(matrices) => matrices.len(),
        }
    }

    /// The moments between which even motion is near enough, the first and the last among them
    /// (Ramer, Douglas and Peucker).
    fn moments(&self, times: &[f64]) -> Vec<usize> {
        let numbers: Vec<Vec<f64>> = (0..self.len()).map(|i| self.numbers(i)).collect();
        let mut kept = vec![0];
        let mut open = vec![(0, self.len() - 1)];
        while let Some((from, to)) = open.pop() {
            let error = |i: usize| {
                let share = (times[i] - times[from]) / (times[to] - times[from]);
                let pairs = numbers[from].iter().zip(&numbers[to]).zip(&numbers[i]);
                pairs.map(|((a, b), x)| (a + share * (b - a) - x).abs()).fold(0.0, f64::max)
            };
            let worst = (from + 1..to).max_by(|a, b| error(*a).total_cmp(&error(*b)));
            match worst.filter(|i| error(*i) > 1.0) {
                // Later parts wait below earlier ones, so that moments come in order.
                Some(i) => open.extend([(i, to), (from, i)]),
                None => kept.push(to),
            }
        }
        kept
    }
}

/// When what is shown, and for how long the end stays.
pub struct Course {
    /// s, rising.
    times: Vec<f64>,
    /// How many times slower than it was.
    slower: f64,
    rest_s: f64,
}

impl Course {
    /// The course over `times`, at least two.
    pub fn new(times: Vec<f64>, slower: f64, rest_s: f64) -> Course {
        Course { times, slower, rest_s }
    }

    fn animation_s(&self) -> f64 {
        self.slower * (self.times[self.times.len() - 1] - self.times[0]) + self.rest_s
    }

    fn percent(&self, moment: usize) -> f64 {
        100.0 * self.slower * (self.times[moment] - self.times[0]) / self.animation_s()
    }

    /// The rules for everything of class `name`; nothing for what stands still.
    pub fn rules(&self, name: &str, track: &Track) -> String {
        let moments = track.moments(&self.times);
        let first = track.css(0);
        if moments.iter().all(|moment| track.css(*moment) == first) {
            return String::new();
        }
        let mut css = format!("@keyframes {name}{{");
        for moment in &moments {
            let percent = self.percent(*moment);
            write!(css, "{percent:.2}%{{transform:{}}}", track.css(*moment))
                .expect("a String takes all");
        }
        let last = track.css(track.len() - 1);
        css + &format!(
            "100%{{transform:{last}}}}}\n\
             @media screen{{.{name}{{animation:{name} {:.2}s linear infinite}}}}\n",
            self.animation_s()
        )
    }

    /// Where motion is not wanted, what has one of the classes waits at `moment` for the switch.
    pub fn waits(&self, class: &str, moment: usize) -> String {
        let before = self.animation_s() * self.percent(moment) / 100.0;
        format!(
            "@media (prefers-reduced-motion:reduce){{.{class}{{animation-play-state:paused!important;\
             animation-delay:-{before:.2}s!important}}}}\n"
        )
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn poses(n: usize, pose: impl Fn(f64) -> Pose) -> (Vec<f64>, Track) {
        let times: Vec<f64> = (0..n).map(|i| i as f64 * 0.02).collect();
        let poses = times.iter().map(|t| pose(*t)).collect();
        (times, Track::Poses(poses))
    }

    #[test]
    fn even_motion_needs_two_moments_and_uneven_motion_what_a_reader_could_tell() {
        let (times, even) = poses(50, |t| Pose::at((100.0 * t, 3.0)).turned(40.0 * t));
        assert_eq!(even.moments(&times), [0, 49]);

        let thrown = |t: f64| Pose::at((5.0 * t, 300.0 * t - 100.0 * t * t));
        let (times, track) = poses(50, thrown);
        let moments = track.moments(&times);
        assert!(moments.len() < 30 && moments.is_sorted(), "{moments:?}");
        for pair in moments.windows(2) {
            for i in pair[0]..pair[1] {
                let share = (times[i] - times[pair[0]]) / (times[pair[1]] - times[pair[0]]);
                let [a, b] = [pair[0], pair[1]].map(|i| thrown(times[i]).y);
                assert!((a + share * (b - a) - thrown(times[i]).y).abs() <= TOLERANCE_PX + 1e-9);
            }
        }
    }

    #[test]
    fn what_stands_still_has_no_key_frames() {
        let (times, track) = poses(20, |_| Pose::at((7.0, 8.0)));
        let course = Course::new(times, 3.0, 1.0);
        assert_eq!(course.rules("base", &track), "");
        assert_eq!(track.attribute(3), "translate(7 8)");
    }

    #[test]
    fn key_frames_end_before_the_rest() {
        let (times, track) = poses(51, |t| Pose { stretch: 1.0 - 0.1 * t, ..Pose::at((t, 0.0)) });
        let css = Course::new(times, 2.0, 2.0).rules("bar", &track);
        // One second, twice as slow, and two seconds of rest.
        assert!(css.contains("50.00%{transform:translate(1px,0px) scale(0.900,1)}100%{"), "{css}");
        assert!(css.contains("@media screen{.bar{animation:bar 4.00s linear infinite}}"), "{css}");
    }
}
