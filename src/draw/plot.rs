//! Axes: a panel with linear scales, round ticks, a legend above and marks that lie on data.

use super::svg::{Anchor, Panel};

const LEFT: f64 = 44.0;
const RIGHT: f64 = 12.0;
const BOTTOM: f64 = 40.0;
/// Height of a line of text.
pub const ROW: f64 = 19.0;
/// Mean width of a character at the font size of the figures.
const CHARACTER: f64 = 7.5;

/// What an axis shows; `label` with its unit.
#[derive(Clone, Copy)]
pub struct Axis<'a> {
    pub label: &'a str,
    pub min: f64,
    pub max: f64,
}

impl<'a> Axis<'a> {
    /// From rollout 0 to a little beyond the last.
    pub fn rollouts(rollouts: impl IntoIterator<Item = u64>) -> Axis<'a> {
        let last = rollouts.into_iter().max().unwrap_or(0).max(10) as f64;
        Axis { label: "rollout", min: 0.0, max: 1.015 * last }
    }

    /// The range of the finite `values`.
    pub fn exactly(label: &'a str, values: impl IntoIterator<Item = f64>) -> Axis<'a> {
        let finite = values.into_iter().filter(|value| value.abs() < 1e9);
        let (min, max) = finite.fold((f64::INFINITY, f64::NEG_INFINITY), |(min, max), value| {
            (min.min(value), max.max(value))
        });
        if min > max {
            return Axis { label, min: 0.0, max: 1.0 };
        }
        // A range of zero would have no scale.
        match max - min < 1e-9 {
            false => Axis { label, min, max },
            true if min.abs() < 1e-6 => Axis { label, min: 0.0, max: 1.0 },
            true => Axis { label, min: min - 0.5 * min.abs(), max: max + 0.5 * max.abs() },
        }
    }

    /// The range of the finite `values`, widened to whole ticks.
    pub fn rounded(label: &'a str, values: impl IntoIterator<Item = f64>) -> Axis<'a> {
        let Axis { min, max, .. } = Axis::exactly(label, values);
        let step = tick_step(max - min, 5.0);
        let (min, max) = ((min / step).floor() * step, (max / step).ceil() * step);
        Axis { label, min, max }
    }

    /// Round values within the axis, about `count` of them, and their decimals.
    fn ticks(&self, count: f64) -> (Vec<f64>, usize) {
        let step = tick_step(self.max - self.min, count);
        let slack = 1e-6 * step;
        let first = ((self.min - slack) / step).ceil() as i64;
        let last = ((self.max + slack) / step).floor() as i64;
        let decimals = (-step.log10().floor()).clamp(0.0, 9.0) as usize;
        ((first..=last).map(|k| k as f64 * step).collect(), decimals)
    }
}

/// 1, 2 or 5 times a power of ten, so that `range` holds about `count` steps.
fn tick_step(range: f64, count: f64) -> f64 {
    let raw = range / count;
    let power = 10_f64.powf(raw.log10().floor());
    // Neighbouring factors meet half way, in ratio.
    let factor = match raw / power {
        share if share < 2_f64.sqrt() => 1.0,
        share if share < 10_f64.sqrt() => 2.0,
        share if share < 50_f64.sqrt() => 5.0,
        _ => 10.0,
    };
    factor * power
}

/// A number with a real minus sign; never "−0".
pub fn fixed(value: f64, decimals: usize) -> String {
    let text = format!("{value:.decimals$}");
    match text.strip_prefix('-') {
        Some(digits) if digits.chars().all(|c| matches!(c, '0' | '.')) => digits.to_owned(),
        Some(digits) => format!("−{digits}"),
        None => text,
    }
}

/// Linear map from data to pixels.
#[derive(Clone, Copy)]
struct Scale {
    from: (f64, f64),
    to: (f64, f64),
}

impl Scale {
    fn at(&self, value: f64) -> f64 {
        let share = (value - self.from.0) / (self.from.1 - self.from.0);
        self.to.0 + share * (self.to.1 - self.to.0)
    }
}

/// How an entry of the legend is drawn.
#[derive(Clone, Copy)]
pub enum Key {
    Line,
    Dot,
}

/// Drawing, class, name.
pub type Entry = (Key, &'static str, &'static str);

/// A panel with axes.
pub struct Plot {
    pub panel: Panel,
    x: Scale,
    y: Scale,
}

impl Plot {
    /// Outer size of a plot whose area between the axes is `inner`.
    pub fn outer_size(inner: (f64, f64), legend: &[Entry]) -> (f64, f64) {
        let width = inner.0 + LEFT + RIGHT;
        (width, inner.1 + top(legend, width) + BOTTOM)
    }

    /// Axes, grid and legend; y's label stands above its axis, x's below at the right.
    pub fn new(size: (f64, f64), alt: &str, x: Axis, y: Axis, legend: &[Entry]) -> Plot {
        let (width, height) = size;
        let top = top(legend, width);
        let mut plot = Plot {
            panel: Panel::new(width, height, alt),
            x: Scale { from: (x.min, x.max), to: (LEFT, width - RIGHT) },
            y: Scale { from: (y.min, y.max), to: (height - BOTTOM, top) },
        };
        let (left, right, bottom) = (LEFT, width - RIGHT, height - BOTTOM);
        let (ticks, decimals) = y.ticks((bottom - top) / 45.0);
        for tick in ticks {
            let at = plot.y.at(tick);
            plot.panel.line((left, at), (right, at), "grid");
            let label = fixed(tick, decimals);
            plot.panel.text((left - 7.0, at + 4.5), Anchor::End, "tick", &label);
        }
        let (ticks, decimals) = x.ticks((right - left) / 65.0);
        for tick in ticks {
            let at = plot.x.at(tick);
            plot.panel.line((at, bottom), (at, bottom + 5.0), "axis");
            let label = fixed(tick, decimals);
            plot.panel.text((at, bottom + 18.0), Anchor::Middle, "tick", &label);
        }
        plot.panel.line((left, bottom), (right, bottom), "axis");
        plot.panel.text((right, bottom + 35.0), Anchor::End, "text", x.label);
        plot.panel.text((2.0, 13.0), Anchor::Start, "text", y.label);
        plot.legend(legend);
        plot
    }

    fn legend(&mut self, entries: &[Entry]) {
        let width = self.panel.width;
        let places = legend_places(entries.iter().map(|entry| entry.2), width);
        for (&(key, class, name), (x, row)) in entries.iter().zip(places) {
            let y = 13.0 + ROW * (row + 1) as f64;
            match key {
                Key::Line => self.panel.line((x, y - 4.0), (x + 20.0, y - 4.0), class),
                Key::Dot => self.panel.circle((x + 10.0, y - 4.5), 3.5, class),
            }
            self.panel.text((x + 26.0, y), Anchor::Start, "tick", name);
        }
    }

    /// Pixels of a point of the data.
    pub fn at(&self, x: f64, y: f64) -> (f64, f64) {
        (self.x.at(x), self.y.at(y))
    }

    pub fn curve(&mut self, points: impl IntoIterator<Item = (f64, f64)>, class: &str) {
        let (x, y) = (self.x, self.y);
        self.panel.path(points.into_iter().map(|point| (x.at(point.0), y.at(point.1))), class);
    }

    pub fn dot(&mut self, x: f64, y: f64, radius: f64, class: &str) {
        let at = self.at(x, y);
        self.panel.circle(at, radius, class);
    }

    /// A short stroke on the x axis: there is no value at `x`.
    pub fn absent(&mut self, x: f64) {
        let (at, bottom) = (self.x.at(x), self.y.to.0);
        self.panel.line((at, bottom - 7.0), (at, bottom), "absent");
    }

    /// A vertical line, if `x` lies on the axis, and its name, which may be empty, in a line of
    /// text counted from the top.
    pub fn event(&mut self, x: f64, line: usize, name: &str) {
        if !(self.x.from.0..=self.x.from.1).contains(&x) {
            return;
        }
        let (at, top) = (self.x.at(x), self.y.to.1);
        self.panel.line((at, top), (at, self.y.to.0), "event");
        let fits = at + 5.0 + CHARACTER * name.chars().count() as f64 <= self.x.to.1;
        let (shift, anchor) = if fits { (5.0, Anchor::Start) } else { (-5.0, Anchor::End) };
        let position = (at + shift, top + 11.0 + ROW * line as f64);
        if !name.is_empty() {
            self.panel.text(position, anchor, "tick halo", name);
        }
    }

    /// A horizontal line to compare with.
    pub fn reference(&mut self, y: f64) {
        let at = self.y.at(y);
        self.panel.line((self.x.to.0, at), (self.x.to.1, at), "event");
    }

    /// Everything `draw` adds is cut off at the axes.
    pub fn clipped(&mut self, draw: impl FnOnce(&mut Panel)) {
        let corner = (self.x.to.0, self.y.to.1);
        let size = (self.x.to.1 - corner.0, self.y.to.0 - corner.1);
        self.panel.clipped(corner, size, draw);
    }
}

fn top(legend: &[Entry], width: f64) -> f64 {
    let places = legend_places(legend.iter().map(|entry| entry.2), width);
    let rows = places.last().map_or(0, |(_, row)| row + 1);
    26.0 + ROW * rows as f64
}

/// Where the key of each entry begins, and its row; wrapped at `width`.
pub fn legend_places<'a>(
    names: impl IntoIterator<Item = &'a str>,
    width: f64,
) -> Vec<(f64, usize)> {
    let (mut x, mut row) = (2.0, 0);
    let place = |name: &str| {
        let needs = 26.0 + CHARACTER * name.chars().count() as f64;
        if x > 2.0 && x + needs > width {
            (x, row) = (2.0, row + 1);
        }
        let place = (x, row);
        x += needs + 14.0;
        place
    };
    names.into_iter().map(place).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ticks_are_round_and_within_the_axis() {
        let axis = Axis { label: "", min: -0.07, max: 1.43 };
        assert_eq!(axis.ticks(5.0).1, 1);
        let texts: Vec<_> = axis.ticks(5.0).0.iter().map(|tick| fixed(*tick, 1)).collect();
        assert_eq!(texts, ["0.0", "0.2", "0.4", "0.6", "0.8", "1.0", "1.2", "1.4"]);
        let rounded = Axis::rounded("", [-0.07, 1.43]);
        assert_eq!(
            [rounded.min, rounded.max].map(|value| fixed(value, 6)),
            ["−0.200000", "1.600000"]
        );
    }

    #[test]
    fn an_axis_always_has_a_range() {
        for values in [vec![], vec![f64::NAN], vec![0.0], vec![-3.0, -3.0], vec![f64::INFINITY]] {
            for axis in [Axis::exactly("", values.clone()), Axis::rounded("", values)] {
                assert!(axis.max > axis.min && axis.ticks(5.0).0.len() < 20);
            }
        }
    }

    #[test]
    fn numbers_have_a_minus_sign_and_no_negative_zero() {
        assert_eq!([fixed(-1.25, 1), fixed(-0.01, 1), fixed(2.0, 0)], ["−1.2", "0.0", "2"]);
    }

    #[test]
    fn the_legend_wraps_where_it_would_leave_the_panel() {
        let names = ["some long name", "another long name"];
        assert_eq!(legend_places(names, 1000.0).iter().map(|p| p.1).max(), Some(0));
        assert_eq!(legend_places(names, 200.0), [(2.0, 0), (2.0, 1)]);
    }
}
