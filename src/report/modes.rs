//! What the search found: trials by reward, and modes, in a plane of the policy parameters.

use nalgebra::DVector;
use search::Mode;

use super::attractors::{colour, label_places};
use super::film::Film;
use super::principal::Principal;
use super::stage::{SLOWER, moving};
use super::{ReportData, TrialRow};
use crate::draw::figure::{Figure, HALF, Row, THIRD};
use crate::draw::map::ellipse;
use crate::draw::plot::{Axis, Entry, Key, Plot, fixed};
use crate::draw::svg::{Anchor, Panel, escape};

/// A mode and what is said of it.
pub struct ModeRow {
    pub mode: Mode,
    pub number: usize,
    pub policy_id: u64,
    pub n_trials: usize,
    /// Rollout and reward.
    pub best: Option<(u64, f64)>,
    pub tolerance: Option<f64>,
    pub is_answer: bool,
    pub forbidden: bool,
    /// Its best rollout, where there are several modes to compare.
    pub film: Option<Film>,
}

/// Shades of the rewards.
const SHADES: usize = 8;
/// Height of a line about a mode.
const LINE: f64 = 19.0;
/// Height of a mode in motion, px.
const MODE_HEIGHT: f64 = 290.0;
/// Modes of which more is said than the number.
const LISTED: usize = 8;

pub const LEGEND: [Entry; 2] =
    [(Key::Line, "learnt", "mode, 1 σ"), (Key::Dot, "dot answer", "selected policy")];

/// The trials of a task with many parameters in the plane of their principal axes.
pub fn figure(data: &ReportData) -> Figure {
    let thetas: Vec<&DVector<f64>> = data.trials.iter().map(|trial| &trial.theta).collect();
    let plane = Principal::of(&thetas);
    let mut caption = "Trials as dots (filled: successes) in the plane in which the policies of \
                       the session differ most."
        .to_owned();
    if let Some(Principal { shares: [first, second], .. }) = plane {
        let dim = thetas[0].len();
        caption = format!(
            "The trials in the plane of their first two principal axes, which explain {:.0} and \
             {:.0}&#8239;% of the variance of their {dim} parameters θ (in the scaled units of \
             the search). Filled: successes. Ellipses: the modes found, drawn at one standard \
             deviation of the search's final distribution; share is the prior.",
            100.0 * first,
            100.0 * second
        );
    }
    let rows = match (&plane, data.modes.is_empty()) {
        (None, _) => Err("the session has too few trials to span a plane.".to_owned()),
        (_, true) => Err(NO_MODES.to_owned()),
        (Some(plane), _) => Ok(vec![Row::Half(draw(data, plane)), table(&data.modes)]),
    };
    Figure { stem: "modes", title: "The modes found", caption, rows }
}

/// Every mode in motion: its best rollout.
pub fn in_motion(data: &ReportData) -> Figure {
    let panel = |row: &ModeRow| {
        let prefix = format!("mode{}-", row.number);
        let mut panel = moving(data, row.film.as_ref()?, None, (THIRD, MODE_HEIGHT), &prefix)?;
        let remark = remark(row).map_or(String::new(), |remark| format!(", {remark}"));
        let (rollout, reward) = row.best?;
        let text =
            format!("{}: rollout {rollout}, reward {}{remark}", row.number, fixed(reward, 2));
        panel.height += LINE;
        let y = panel.height - 3.0;
        panel.text((2.0, y), Anchor::Start, "text", &text);
        Some(panel)
    };
    let panels: Vec<Panel> = data.modes.iter().filter_map(panel).collect();
    let rows = match (panels.len(), data.modes.len()) {
        (0 | 1, 0 | 1) => Err("the session has fewer than two modes.".to_owned()),
        (0 | 1, _) => Err("the session holds no paths of its modes.".to_owned()),
        _ => Ok(vec![Row::Moving(panels)]),
    };
    Figure {
        stem: "modes-in-motion",
        title: "The modes in motion",
        caption: format!("The best rollout of each mode, {SLOWER:.0} times slower."),
        rows,
    }
}

/// The message shown until the learner has written the modes, which it does when it ends cleanly.
pub const NO_MODES: &str =
    "the session has no modes yet; run `skillet policy modes` to compute and store them.";

fn draw(data: &ReportData, plane: &Principal) -> Panel {
    let place = |theta: &DVector<f64>| (plane.project(theta)[0], plane.project(theta)[1]);
    let trials: Vec<(f64, f64)> = data.trials.iter().map(|trial| place(&trial.theta)).collect();
    let fits = |row: &&ModeRow| row.mode.mean.len() == plane.dim();
    let modes: Vec<(Mode, &ModeRow)> =
        data.modes.iter().filter(fits).map(|row| (plane.mode(&row.mode), row)).collect();
    let outlines = modes.iter().flat_map(|(mode, _)| ellipse(mode, 1.0));
    let all: Vec<(f64, f64)> = trials.iter().copied().chain(outlines).collect();
    let x = Axis::rounded("1st principal axis", all.iter().map(|point| point.0));
    let y = Axis::rounded("2nd principal axis", all.iter().map(|point| point.1));
    let alt = format!("{} trials and {} modes in their main plane", trials.len(), modes.len());
    let mut plot = Plot::new((HALF, 400.0), &alt, x, y, &LEGEND);
    draw_trials(&mut plot, &trials, &data.trials);
    draw_modes(&mut plot, &modes);
    plot.panel
}

/// Dots at `places`, coloured by reward, and the scale of the colours at the upper right.
fn draw_trials(plot: &mut Plot, places: &[(f64, f64)], trials: &[TrialRow]) {
    let Axis { min, max, .. } = Axis::exactly("", trials.iter().map(|trial| trial.reward));
    let shade = |reward: f64| {
        let share = (reward - min) / (max - min) * SHADES as f64;
        colour((share.max(0.0) as usize).min(SHADES - 1), SHADES)
    };
    // Successes last, so that they lie on top.
    for success in [false, true] {
        for (place, trial) in places.iter().zip(trials).filter(|(_, t)| t.success == success) {
            let open = if success { "" } else { " open" };
            plot.dot(place.0, place.1, 3.0, &format!("trial {}{open}", shade(trial.reward)));
        }
    }
    let right = plot.panel.width - 12.0;
    let high = fixed(max, 1);
    plot.panel.text((right, 13.0), Anchor::End, "tick", &high);
    let mut x = right - 7.0 * high.chars().count() as f64 - 4.0;
    for i in (0..SHADES).rev() {
        x -= 9.0;
        plot.panel.circle((x + 3.0, 8.5), 3.5, &colour(i, SHADES));
    }
    plot.panel.text((x - 6.0, 13.0), Anchor::End, "tick", &format!("reward {}", fixed(min, 1)));
}

/// Ellipse, mean and number of every mode, and below the axes a line about each. The modes are of
/// two dimensions.
pub fn draw_modes(plot: &mut Plot, modes: &[(Mode, &ModeRow)]) {
    for (mode, _) in modes {
        let outline: Vec<_> = ellipse(mode, 1.0).iter().map(|(x, y)| plot.at(*x, *y)).collect();
        plot.clipped(|panel| {
            panel.path(outline.iter().copied(), "mode-halo");
            panel.path(outline, "learnt");
        });
    }
    let pixels: Vec<_> =
        modes.iter().map(|(mode, _)| plot.at(mode.mean[0], mode.mean[1])).collect();
    for ((at, label), (_, row)) in pixels.iter().zip(label_places(&pixels)).zip(modes) {
        let (radius, class) = if row.is_answer { (5.5, "dot answer") } else { (4.5, "dot mode") };
        plot.panel.circle(*at, radius, class);
        let baseline = (label.0, label.1 + 4.5);
        plot.panel.text(baseline, Anchor::Middle, "number halo", &row.number.to_string());
    }
    for (_, row) in modes.iter().take(LISTED) {
        let best =
            row.best.map_or(String::new(), |(_, r)| format!(", best reward {}", fixed(r, 2)));
        let text = format!(
            "{}: share {:.0} %{best}{}",
            row.number,
            100.0 * row.mode.prior,
            remark(row).map_or(String::new(), |remark| format!(", {remark}"))
        );
        plot.panel.height += LINE;
        let y = plot.panel.height - 5.0;
        plot.panel.text((2.0, y), Anchor::Start, "text", &text);
    }
}

fn remark(row: &ModeRow) -> Option<&'static str> {
    match (row.is_answer, row.forbidden) {
        (true, _) => Some("selected policy"),
        (_, true) => Some("forbidden"),
        _ => None,
    }
}

/// The modes in numbers; the policy itself where it is short.
pub fn table(modes: &[ModeRow]) -> Row {
    let number = |value: Option<f64>| value.map_or("–".into(), |value| fixed(value, 3));
    let short = |row: &ModeRow| row.mode.mean.len() <= 3;
    let has_policy = modes.iter().all(short);
    let row = |row: &ModeRow| {
        let policy: Vec<String> = row.mode.mean.iter().map(|value| fixed(*value, 3)).collect();
        let policy = has_policy.then(|| format!("<td>{}</td>", policy.join(", ")));
        format!(
            "<tr><th scope=\"row\">{}</th>{}<td>{:.0}&#8239;%</td><td>{}</td><td>{}</td><td>{}</td>\
             <td>{}</td><td>{}</td></tr>\n",
            row.number,
            policy.unwrap_or_default(),
            100.0 * row.mode.prior,
            row.n_trials,
            number(row.best.map(|(_, reward)| reward)),
            row.best.map_or("–".into(), |(rollout, _)| rollout.to_string()),
            number(row.tolerance),
            escape(remark(row).unwrap_or_default())
        )
    };
    let rows: String = modes.iter().map(row).collect();
    let policy = if has_policy { "<th scope=\"col\">policy</th>" } else { "" };
    Row::Numbers(format!(
        "<div class=\"scroll\">\n<table class=\"numbers\">\n<tr><th scope=\"col\">mode</th>{policy}\
         <th scope=\"col\">share</th><th scope=\"col\">trials</th><th scope=\"col\">best</th>\
         <th scope=\"col\">rollout</th><th scope=\"col\">tolerance</th><td></td></tr>\n\
         {rows}</table>\n</div>\n<p class=\"terms\">Tolerance: expected reward when the policy is \
         executed with noise, the same for every mode.</p>\n"
    ))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::report::sample;

    #[test]
    fn marks_the_answer_and_numbers_every_mode() {
        let data = sample::session(40);
        let figure = figure(&data);
        let svg = figure.svg().expect("there are trials and modes");
        // One in the legend.
        assert_eq!(svg.matches("class=\"dot answer\"").count(), 1 + 1);
        assert_eq!(svg.matches("class=\"number halo\"").count(), data.modes.len());
        assert_eq!(svg.matches("class=\"trial ").count(), 40);
        assert!(svg.contains("1: share 70 %, best reward 1.20, selected policy"));
        assert!(figure.html(1).contains("<td>selected policy</td>"));
    }

    #[test]
    fn says_so_where_there_are_no_modes_or_too_few_trials() {
        let mut data = sample::session(40);
        data.modes.clear();
        assert!(figure(&data).rows.is_err_and(|reason| reason.contains("no modes yet")));
        assert!(figure(&sample::session(2)).rows.is_err_and(|reason| reason.contains("too few")));
    }
}
