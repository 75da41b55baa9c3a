//! The page of a task without an arm: verdict, modes, figures, and the configuration.

use super::figure::Figure;
use super::plane::{ModeRow, Plane};
use super::plot::fixed;
use super::svg::escape;
use super::{ReportData, style, summary};

pub fn html(data: &ReportData, plane: &Plane, figures: &[Figure]) -> String {
    let figures: String = (1..).zip(figures).map(|(n, figure)| figure.html(n)).collect();
    format!(
        "<!DOCTYPE html>\n<html lang=\"en\">\n<head>\n<meta charset=\"utf-8\">\n\
         <meta name=\"viewport\" content=\"width=device-width, initial-scale=1\">\n\
         <title>{task}: session {session}</title>\n<style>\n{style}</style>\n</head>\n<body>\n\
         <header>\n<h1>Searching for solutions: {task}</h1>\n\
         <p class=\"kicker\">Session {session}, seed {seed}. A policy is two numbers; the search \
         looks for every good one (Sec. 4.2 of Calinon, Kormushev and Caldwell).</p>\n\
         <p class=\"verdict\">{verdict}</p>\n</header>\n{modes}{figures}\
         <details>\n<summary>Configuration in effect</summary>\n<pre>{configuration}</pre>\n\
         </details>\n</body>\n</html>\n",
        task = escape(&data.task),
        session = escape(&data.session),
        seed = data.seed,
        style = style::page(),
        verdict = verdict(data, plane),
        modes = modes(&plane.modes),
        configuration = escape(&data.config_toml),
    )
}

fn verdict(data: &ReportData, plane: &Plane) -> String {
    let Some(best) = summary::best(&data.trials) else {
        return "No rollout has been recorded yet.".into();
    };
    let solutions = match plane.modes.len() {
        1 => "One solution".to_string(),
        n => format!("{n} solutions"),
    };
    format!(
        "{solutions} after {} rollouts; best reward {} (rollout {}).",
        data.trials.len(),
        fixed(best.reward, 3),
        best.rollout
    )
}

fn modes(rows: &[ModeRow]) -> String {
    let number = |value: Option<f64>| value.map_or("–".into(), |value| fixed(value, 4));
    let row = |row: &ModeRow| {
        let policy: Vec<String> = row.mode.mean.iter().map(|value| fixed(*value, 3)).collect();
        format!(
            "<tr><td>{}</td><td>{}</td><td>{}</td><td>{}</td><td>{}</td><td>{}</td></tr>\n",
            row.number,
            policy.join(", "),
            fixed(row.mode.prior, 3),
            number(row.best.map(|(_, reward)| reward)),
            number(row.tolerance),
            row.remark
        )
    };
    let rows: String = rows.iter().map(row).collect();
    format!(
        "<div class=\"scroll\">\n<table>\n<tr><th>mode</th><th>policy</th><th>prior</th>\
         <th>best reward</th><th>tolerance</th><th></th></tr>\n{rows}</table>\n</div>\n\
         <p class=\"terms\">Tolerance: expected reward when the policy is executed with noise, the \
         same for every mode.</p>\n"
    )
}
