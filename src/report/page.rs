//! The page: verdict, summary, figures, terms, and at the end every number behind them.

use super::{Pictures, ReportData, summary};
use crate::draw::figure::Figure;
use crate::draw::style;
use crate::draw::svg::escape;

const ARM: &str = "A robot arm improves a compliant movement, its path and its stiffness together, \
                   by trial and error; after Calinon, Kormushev and Caldwell, <i>Compliant skills \
                   acquisition and multi-optima policy search with EM-based reinforcement \
                   learning</i>.";
const PLANE: &str = "A policy is two numbers; the search looks for every good one (Sec. 4.2 of \
                     Calinon, Kormushev and Caldwell, <i>Compliant skills acquisition and \
                     multi-optima policy search with EM-based reinforcement learning</i>).";

const ACTION: &str = "A policy is a few numbers; the search improves them by trial and error, as Calinon, \
                      Kormushev and Caldwell do in <i>Compliant skills acquisition and multi-optima \
                      policy search with EM-based reinforcement learning</i>.";

const TERMS: &str = "<b>Terms.</b> A <i>rollout</i> is one execution of a policy. The \
    <i>policy</i> is a sequence of attractors, each with a stiffness; they act one after another \
    and pull the pan along. <i>Release</i> is the moment the pancake leaves the pan, \
    <i>apex</i> its highest rise above its start, <i>crossing</i> the moment it falls back to \
    Δ<sub>h</sub> above the pan, where flip angle and distance are measured. The <i>flip angle</i> \
    is the angle between the pancake's normals at the start and at the crossing: 180° is half a turn. The \
    <i>lateral miss</i> is the distance between the two centres in the plane of the pan. In a <i>caught \
    flip</i> the pancake lies in the pan upside down at the end.";

pub fn html(data: &ReportData, figures: &[Figure]) -> String {
    let task = escape(&data.task);
    let figures: String = (1..).zip(figures).map(|(n, figure)| figure.html(n)).collect();
    let (heading, about, verdict, terms) = match &data.pictures {
        Pictures::Toss => ("Learning to flip", ARM, summary::verdict(data), TERMS),
        Pictures::Plane(_) => ("Searching for solutions", PLANE, summary::solutions(data), ""),
        Pictures::Plain if data.is_action() => {
            ("Searching for solutions", ACTION, summary::verdict(data), "")
        }
        Pictures::Plain => ("Learning", ARM, summary::verdict(data), ""),
    };
    let terms =
        if terms.is_empty() { String::new() } else { format!("<p class=\"terms\">{terms}</p>\n") };
    format!(
        "<!DOCTYPE html>\n<html lang=\"en\">\n<head>\n<meta charset=\"utf-8\">\n\
         <meta name=\"viewport\" content=\"width=device-width, initial-scale=1\">\n\
         <title>{task}: session {session}</title>\n<style>\n{style}</style>\n</head>\n<body>\n\
         <header>\n<h1>{heading}: {task}</h1>\n\
         <p class=\"kicker\">Session {session}. {about}</p>\n\
         <p class=\"verdict\">{verdict}</p>\n</header>\n{tables}\
         <main>\n{figures}</main>\n{terms}{details}</body>\n</html>\n",
        session = escape(&data.session),
        style = style::page(),
        tables = summary::tables(data),
        details = details(data),
    )
}

/// What is folded away: every rollout and the configuration.
fn details(data: &ReportData) -> String {
    let configuration = escape(&data.config_toml);
    let mut details = String::new();
    if !data.trials.is_empty() {
        details = format!(
            "<details>\n<summary>All rollouts in numbers</summary>\n<div class=\"scroll\">\n{}\
             </div>\n</details>\n",
            summary::trials(data)
        );
    }
    details
        + &format!(
            "<details>\n<summary>Configuration in effect</summary>\n<pre>{configuration}</pre>\n\
             </details>\n"
        )
}
