//! A figure: rows of panels with a caption, as part of the page and as a file of its own.

use super::style;
use super::svg::{Anchor, Panel, escape};

/// Width of a figure on a wide page, and of its panels, px.
pub const WIDE: f64 = 1000.0;
pub const NARROW: f64 = 400.0;
pub const HALF: f64 = 440.0;
pub const THIRD: f64 = 320.0;
pub const FRAME: f64 = 118.0;

/// Stops what moves in the figure `stem`, and where motion is not wanted starts it; the stylesheet does the rest.
fn switch(stem: &str) -> String {
    format!(
        "<input type=\"checkbox\" id=\"switch-{stem}\">\n<label for=\"switch-{stem}\">\
         <span class=\"stop\">Pause</span><span class=\"start\">Play</span></label>\n"
    )
}

/// Panels side by side; on a narrow page they wrap.
pub enum Row {
    /// The same panel drawn for a wide and for a narrow page.
    Wide { wide: Panel, narrow: Panel },
    /// Small multiples, three in a row.
    Thirds(Vec<Panel>),
    /// A film strip, eight in a row.
    Frames(Vec<Panel>),
    /// One panel in a column of its own, beside the caption or another such figure.
    Half(Panel),
    /// Panels that move, with one switch to stop them: a single one in a column of its own, several side by side.
    Moving(Vec<Panel>),
    /// HTML below the drawings: a table of the numbers in them.
    Numbers(String),
}

/// Rows of three panels.
pub fn thirds(mut panels: Vec<Panel>) -> Vec<Row> {
    let mut rows = Vec::new();
    while !panels.is_empty() {
        let rest = panels.split_off(panels.len().min(3));
        rows.push(Row::Thirds(std::mem::replace(&mut panels, rest)));
    }
    rows
}

pub struct Figure {
    /// Name of its file.
    pub stem: &'static str,
    pub title: &'static str,
    /// HTML; what comes from the session in it is escaped.
    pub caption: String,
    /// The drawing, or why there is none.
    pub rows: Result<Vec<Row>, String>,
}

impl Row {
    /// One panel for each width of the page.
    pub fn wide(draw: impl Fn(f64) -> Panel) -> Row {
        Row::Wide { wide: draw(WIDE), narrow: draw(NARROW) }
    }

    /// The panels on a wide page and the gap between them.
    fn panels(&self) -> (&[Panel], f64) {
        match self {
            Row::Wide { wide, .. } => (std::slice::from_ref(wide), 0.0),
            Row::Thirds(panels) | Row::Moving(panels) => (panels, 20.0),
            Row::Frames(panels) => (panels, 8.0),
            Row::Half(panel) => (std::slice::from_ref(panel), 0.0),
            Row::Numbers(_) => (&[], 0.0),
        }
    }

    /// It fills one column of a page of two.
    fn is_half(&self) -> bool {
        match self {
            Row::Half(_) => true,
            Row::Moving(panels) => panels.len() == 1,
            _ => false,
        }
    }

    fn html(&self, stem: &str) -> String {
        let row =
            |class: &str, content: &str| format!("<div class=\"row{class}\">\n{content}</div>\n");
        let panels = || self.panels().0.iter().map(Panel::inline).collect::<String>();
        match self {
            Row::Wide { wide, narrow } => {
                row(" wide", &wide.inline()) + &row(" narrow", &narrow.inline())
            }
            Row::Thirds(_) => row(" thirds", &panels()),
            Row::Frames(_) => row(" frames", &panels()),
            Row::Half(_) => row("", &panels()),
            Row::Moving(moving) if moving.len() == 1 => row(" player", &(switch(stem) + &panels())),
            Row::Moving(_) => row(" player", &(switch(stem) + &row(" thirds", &panels()))),
            Row::Numbers(table) => table.clone(),
        }
    }

    /// Places the panels from `top` downwards; returns the drawing and where it ends.
    fn placed(&self, top: f64) -> (String, f64, f64) {
        let (panels, gap) = self.panels();
        let (mut x, mut y, mut row_height, mut right) = (0.0, top, 0.0, 0.0_f64);
        let mut drawing = String::new();
        for panel in panels {
            if x > 0.0 && x + panel.width > WIDE + 1.0 {
                (x, y, row_height) = (0.0, y + row_height + 12.0, 0.0);
            }
            drawing += &panel.placed((x, y));
            right = right.max(x + panel.width);
            x += panel.width + gap;
            row_height = panel.height.max(row_height);
        }
        (drawing, right, y + row_height)
    }
}

impl Figure {
    /// As section `number` of the page, with a link to its file; nothing where there is no drawing.
    pub fn html(&self, number: usize) -> String {
        let Figure { stem, title, caption, rows } = self;
        let Ok(rows) = rows else { return String::new() };
        let drawing: String = rows.iter().map(|row| row.html(stem)).collect();
        let class = if rows.iter().any(Row::is_half) { " class=\"half\"" } else { "" };
        format!(
            "<section id=\"{stem}\"{class}>\n<h2>{title}</h2>\n<figure>\n\
             <div class=\"drawing\">\n{drawing}</div>\n\
             <figcaption><b>Figure {number}.</b> {caption} \
             <a class=\"file\" href=\"{stem}.svg\">SVG</a></figcaption>\n</figure>\n</section>\n"
        )
    }

    /// As a stand-alone SVG file, if there is a drawing.
    pub fn svg(&self) -> Option<String> {
        let rows = self.rows.as_ref().ok()?;
        const MARGIN: f64 = 16.0;
        let (mut drawing, mut width, mut y) = (String::new(), 0.0_f64, 34.0);
        let mut alts: Vec<&str> = Vec::new();
        for row in rows {
            let panels = row.panels().0;
            if panels.is_empty() {
                continue;
            }
            alts.extend(panels.iter().map(|panel| panel.alt.as_str()));
            let (part, right, end) = row.placed(y);
            drawing += &part;
            width = width.max(right);
            y = end + 12.0;
        }
        let mut title = Panel::new(0.0, 0.0, "");
        title.text((2.0, 15.0), Anchor::Start, "title", self.title);
        let (full_width, full_height) = (width + 2.0 * MARGIN, y + 2.0 * MARGIN);
        Some(format!(
            "<svg xmlns=\"http://www.w3.org/2000/svg\" width=\"{full_width:.0}\" \
             height=\"{full_height:.0}\" viewBox=\"-{MARGIN} -{MARGIN} {full_width:.1} \
             {full_height:.1}\" role=\"img\">\n<title>{name}</title>\n<desc>{alts}</desc>\n<style>\n{style}</style>\n\
             <rect class=\"page\" x=\"-{MARGIN}\" y=\"-{MARGIN}\" width=\"100%\" \
             height=\"100%\"/>\n{title}{drawing}</svg>\n",
            name = escape(self.title),
            alts = escape(&alts.join("; ")),
            style = style::figure(),
            title = title.placed((0.0, 0.0)),
        ))
    }
}
