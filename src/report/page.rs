//! The page: verdict, figures, tables, terms, and at the end every number behind them.

use super::{Pictures, ReportData, origin, summary, trials};
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
    Δ<sub>h</sub> = 10&#8239;cm above the pan, where flip angle and distance are measured. The <i>flip angle</i> \
    is the angle between the pancake's normals at the start and at the crossing: 180° is half a turn. The \
    <i>lateral miss</i> is the distance between the two centres in the plane of the pan. In a <i>caught \
    flip</i> the pancake lies in the pan upside down at the end.";

pub fn html(data: &ReportData, figures: &[Figure]) -> String {
    let task = escape(&data.task);
    let shown = figures.iter().filter(|figure| figure.rows.is_ok());
    let sections: String = (1..).zip(shown).map(|(n, figure)| figure.html(n)).collect();
    let (heading, about, verdict, terms) = match &data.pictures {
        Pictures::Toss => ("Learning to flip", ARM, summary::verdict(data), TERMS),
        Pictures::Plane(_) => ("Searching for solutions", PLANE, summary::verdict(data), ""),
        Pictures::Plain if data.is_action() => {
            ("Searching for solutions", ACTION, summary::verdict(data), "")
        }
        Pictures::Plain => ("Learning", ARM, summary::verdict(data), ""),
    };
    let terms = match terms {
        "" => String::new(),
        terms => format!("<p class=\"terms\">{terms}</p>\n"),
    };
    let body = format!(
        "<header>\n<h1>{heading}: {task}</h1>\n<p class=\"kicker\">{kicker}</p>\n\
         <p class=\"verdict\">{verdict}</p>\n</header>\n<main>\n{sections}</main>\n{missing}\
         <section>\n<h2>Numbers</h2>\n{tables}{files}</section>\n\
         <p class=\"terms\">{about}</p>\n{terms}{details}",
        kicker = escape(&kicker(data)),
        missing = missing(figures),
        tables = summary::tables(data),
        files = origin::files(&data.files),
        details = details(data),
    );
    document(&format!("{}: session {}", data.task, data.session), &body)
}

/// A page without a script, with the stylesheet in it.
pub fn document(title: &str, body: &str) -> String {
    format!(
        "<!DOCTYPE html>\n<html lang=\"en\">\n<head>\n<meta charset=\"utf-8\">\n\
         <meta name=\"viewport\" content=\"width=device-width, initial-scale=1\">\n\
         <link rel=\"icon\" href=\"data:,\">\n\
         <title>{title}</title>\n<style>\n{style}</style>\n</head>\n<body>\n{body}</body>\n\
         </html>\n",
        title = escape(title),
        style = style::page(),
    )
}

/// What tells this session from others.
fn kicker(data: &ReportData) -> String {
    let day = data.origin.day().map(str::to_owned);
    let parts = [
        Some(format!("Session {}", data.session)),
        Some(format!("seed {}", data.seed)),
        day,
        data.origin.program(),
    ];
    parts.into_iter().flatten().collect::<Vec<_>>().join(" · ")
}

/// Figures that the data does not allow, by reason.
fn missing(figures: &[Figure]) -> String {
    let mut reasons: Vec<(&str, Vec<&str>)> = Vec::new();
    for figure in figures {
        let Err(reason) = &figure.rows else { continue };
        match reasons.iter_mut().find(|entry| entry.0 == reason.as_str()) {
            Some((_, titles)) => titles.push(figure.title),
            None => reasons.push((reason, vec![figure.title])),
        }
    }
    if reasons.is_empty() {
        return String::new();
    }
    let line = |(reason, titles): &(&str, Vec<&str>)| {
        format!("<li>{}: {}</li>\n", titles.join(", "), with_code(&escape(reason)))
    };
    let lines: String = reasons.iter().map(line).collect();
    format!("<section class=\"missing\">\n<h2>Not shown</h2>\n<ul>\n{lines}</ul>\n</section>\n")
}

/// What stands between two backticks as code.
fn with_code(text: &str) -> String {
    let parts = text.split('`').enumerate().map(|(i, part)| match i % 2 {
        1 => format!("<code>{part}</code>"),
        _ => part.to_owned(),
    });
    parts.collect()
}

/// What is folded away: every rollout and the configuration.
fn details(data: &ReportData) -> String {
    let configuration = escape(&data.config_toml);
    let mut details = String::new();
    if !data.trials.is_empty() {
        details = format!(
            "<details>\n<summary>All rollouts in numbers</summary>\n<div class=\"scroll\">\n{}\
             </div>\n</details>\n",
            trials::table(data)
        );
    }
    details
        + &format!(
            "<details>\n<summary>Configuration in effect</summary>\n<pre>{configuration}</pre>\n\
             </details>\n"
        )
}
