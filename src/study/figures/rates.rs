//! A study's table as a picture: one panel a metric, one line a method, with its 95 % interval.

use crate::draw::figure::{Figure, Row as FigureRow, THIRD};
use crate::draw::plot::fixed;
use crate::draw::svg::{Anchor, Panel};
use crate::study::{Row, Table};

const LINE: f64 = 24.0;
const TOP: f64 = 34.0;
/// Mean width of a character of a method's name.
const CHARACTER: f64 = 7.6;
const RIGHT: f64 = 50.0;

/// Every metric of `table`, in its order.
pub fn figure(table: &Table, stem: &'static str, title: &'static str) -> Figure {
    let mut metrics: Vec<&str> = Vec::new();
    for row in &table.rows {
        if !metrics.contains(&row.metric.as_str()) {
            metrics.push(&row.metric);
        }
    }
    let panel = |metric: &&str| {
        let rows: Vec<&Row> = table.rows.iter().filter(|row| row.metric == *metric).collect();
        metric_panel(metric, &rows)
    };
    let panels: Vec<Panel> = metrics.iter().map(panel).collect();
    let last = table.first_seed + table.seeds - 1;
    Figure {
        stem,
        title,
        caption: format!(
            "Seeds {}–{last}. Dots: value over the seeds; lines: 95 % interval (Wilson's for \
             shares). The scale of each panel begins at zero.",
            table.first_seed
        ),
        rows: Ok(vec![FigureRow::Thirds(panels)]),
    }
}

fn metric_panel(metric: &str, rows: &[&Row]) -> Panel {
    let height = TOP + LINE * rows.len() as f64 + 8.0;
    let mut panel = Panel::new(THIRD, height, format!("{metric}, by method"));
    panel.text((2.0, 15.0), Anchor::Start, "text", metric);
    // The scale begins behind the longest name.
    let longest = rows.iter().map(|row| row.method.chars().count()).max().unwrap_or(0);
    let left = (14.0 + CHARACTER * longest as f64).min(0.65 * THIRD);
    let highest = rows.iter().filter_map(|row| row.high95.or(row.value)).fold(0.0, f64::max);
    let scale = |value: f64| left + value.max(0.0) / highest.max(1e-12) * (THIRD - left - RIGHT);
    for (i, row) in rows.iter().enumerate() {
        let y = TOP + LINE * (i as f64 + 0.5);
        panel.line((left, y), (THIRD - RIGHT, y), "grid");
        panel.text((left - 8.0, y + 4.5), Anchor::End, "tick", &row.method);
        let Some(value) = row.value else {
            panel.text((left, y + 4.5), Anchor::Start, "tick", "never");
            continue;
        };
        if let (Some(low), Some(high)) = (row.low95, row.high95) {
            panel.line((scale(low), y), (scale(high), y), "learnt");
        }
        panel.circle((scale(value), y), 4.0, "dot success");
        let decimals = if highest < 0.1 {
            3
        } else if highest <= 1.5 {
            2
        } else {
            1
        };
        let text = fixed(value, decimals);
        panel.text((THIRD - RIGHT + 9.0, y + 4.5), Anchor::Start, "tick", &text);
    }
    panel
}
