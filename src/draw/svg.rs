//! A small SVG writer: panels made of shapes that get their colours from the stylesheet.
//!
//! ```text
//! let mut panel = Panel::new(320.0, 200.0, "what a reader who cannot see it should know");
//! panel.path([(0.0, 0.0), (10.0, 20.0)], "learnt");
//! panel.text((5.0, 15.0), Anchor::Start, "text", "release");
//! ```

use std::fmt::Write;

/// A drawing and its size in user units, which are pixels at its natural size.
pub struct Panel {
    pub width: f64,
    pub height: f64,
    /// What it shows, for readers who cannot see it.
    pub alt: String,
    body: String,
}

/// Which point of a text lies at its position.
#[derive(Clone, Copy)]
pub enum Anchor {
    Start,
    Middle,
    End,
}

impl Panel {
    pub fn new(width: f64, height: f64, alt: impl Into<String>) -> Panel {
        Panel { width, height, alt: alt.into(), body: String::new() }
    }

    fn write(&mut self, element: std::fmt::Arguments) {
        self.body.write_fmt(element).expect("writing to a String cannot fail");
        self.body.push('\n');
    }

    pub fn line(&mut self, a: (f64, f64), b: (f64, f64), class: &str) {
        self.path([a, b], class);
    }

    /// An open line through `points`; it is interrupted where a point is not finite.
    pub fn path(&mut self, points: impl IntoIterator<Item = (f64, f64)>, class: &str) {
        let d = path_data(points);
        if !d.is_empty() {
            self.write(format_args!(r#"<path class="line {class}" d="{d}"/>"#));
        }
    }

    /// A line of a width that is part of the drawing, px.
    pub fn thick_line(&mut self, a: (f64, f64), b: (f64, f64), width: f64, class: &str) {
        let (d, width) = (path_data([a, b]), short(width));
        if !d.is_empty() {
            self.write(format_args!(
                r#"<path class="line {class}" style="stroke-width:{width}px" d="{d}"/>"#
            ));
        }
    }

    /// A closed, filled outline.
    pub fn polygon(&mut self, points: impl IntoIterator<Item = (f64, f64)>, class: &str) {
        let d = path_data(points);
        if !d.is_empty() {
            self.write(format_args!(r#"<path class="{class}" d="{d}Z"/>"#));
        }
    }

    pub fn circle(&mut self, (x, y): (f64, f64), radius: f64, class: &str) {
        if x.is_finite() && y.is_finite() && radius.is_finite() {
            let (x, y, r) = (short(x), short(y), short(radius));
            self.write(format_args!(r#"<circle class="{class}" cx="{x}" cy="{y}" r="{r}"/>"#));
        }
    }

    /// `text` is plain text; it is escaped here.
    pub fn text(&mut self, (x, y): (f64, f64), anchor: Anchor, class: &str, text: &str) {
        let anchor = match anchor {
            Anchor::Start => "start",
            Anchor::Middle => "middle",
            Anchor::End => "end",
        };
        let (x, y, text) = (short(x), short(y), escape(text));
        self.write(format_args!(
            r#"<text class="{class}" x="{x}" y="{y}" text-anchor="{anchor}">{text}</text>"#
        ));
    }

    /// Everything `draw` adds is cut off outside the rectangle; coordinates stay the panel's.
    pub fn clipped(
        &mut self,
        (x, y): (f64, f64),
        (width, height): (f64, f64),
        draw: impl FnOnce(&mut Panel),
    ) {
        let [x, y, width, height] = [x, y, width, height].map(short);
        self.write(format_args!(
            r#"<svg x="{x}" y="{y}" width="{width}" height="{height}" viewBox="{x} {y} {width} {height}">"#
        ));
        draw(self);
        self.write(format_args!("</svg>"));
    }

    /// Everything `draw` adds is moved as a whole, by the transform and by what rules say of `class`.
    pub fn group(&mut self, class: &str, transform: &str, draw: impl FnOnce(&mut Panel)) {
        self.write(format_args!(r#"<g class="{class}" transform="{transform}">"#));
        draw(self);
        self.write(format_args!("</g>"));
    }

    /// Rules of this drawing alone.
    pub fn style(&mut self, css: &str) {
        self.write(format_args!("<style>\n{css}</style>"));
    }

    /// As an element of an HTML page, which provides the stylesheet.
    pub fn inline(&self) -> String {
        let (width, height) = (short(self.width), short(self.height));
        format!(
            "<svg viewBox=\"0 0 {width} {height}\" role=\"img\" aria-label=\"{alt}\" \
             style=\"max-width:{max}px\">\n{body}</svg>\n",
            alt = escape(&self.alt),
            max = short(self.width * 1.36),
            body = self.body,
        )
    }

    /// As a part of another drawing, its corner at (x, y).
    pub fn placed(&self, (x, y): (f64, f64)) -> String {
        let (x, y) = (short(x), short(y));
        format!("<g transform=\"translate({x} {y})\">\n{body}</g>\n", body = self.body)
    }
}

fn path_data(points: impl IntoIterator<Item = (f64, f64)>) -> String {
    let mut d = String::new();
    let mut command = 'M';
    for (x, y) in points {
        if x.is_finite() && y.is_finite() {
            let _ = write!(d, "{command}{} {}", short(x), short(y));
            command = 'L';
        } else {
            command = 'M';
        }
    }
    d
}

/// A coordinate to a tenth of a pixel, without needless zeros; far away instead of not finite.
pub fn short(value: f64) -> String {
    let value = if value.is_nan() { 0.0 } else { value.clamp(-1e5, 1e5) };
    let tenths = (value * 10.0).round() / 10.0;
    format!("{}", tenths + 0.0)
}

/// Plain text as XML or HTML text, also within attributes. Control characters, which XML cannot
/// hold, become U+FFFD.
pub fn escape(text: &str) -> String {
    let mut escaped = String::with_capacity(text.len());
    for c in text.chars() {
        match c {
            '&' => escaped.push_str("&amp;"),
            '<' => escaped.push_str("&lt;"),
            '>' => escaped.push_str("&gt;"),
            '"' => escaped.push_str("&quot;"),
            '\'' => escaped.push_str("&#39;"),
            '\n' | '\t' => escaped.push(c),
            c if c.is_control() || matches!(c, '\u{fffe}' | '\u{ffff}') => escaped.push('\u{fffd}'),
            c => escaped.push(c),
        }
    }
    escaped
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn escapes_what_xml_cannot_hold() {
        assert_eq!(
            escape("a<b & \"c\" 'd'\u{7}"),
            "a&lt;b &amp; &quot;c&quot; &#39;d&#39;\u{fffd}"
        );
        let mut panel = Panel::new(10.0, 10.0, "<script>");
        panel.text((1.0, 2.0), Anchor::Start, "text", "x < y");
        assert!(panel.inline().contains("x &lt; y") && !panel.inline().contains("<script>"));
    }

    #[test]
    fn interrupts_a_line_where_a_point_is_not_finite() {
        let points = [(0.0, 0.0), (1.0, 1.25), (f64::NAN, 2.0), (3.0, 3.0)];
        assert_eq!(path_data(points), "M0 0L1 1.3M3 3");
        assert_eq!(path_data([(f64::INFINITY, 0.0)]), "");
    }

    #[test]
    fn coordinates_are_short_and_finite() {
        assert_eq!([0.04, -0.04, 12.34, f64::NAN].map(short), ["0", "0", "12.3", "0"]);
        assert_eq!(short(f64::INFINITY), "100000");
    }
}
