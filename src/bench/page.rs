//! The page of a bench: host, distributions, and every number. No script and no other file.

use super::table::table;
use super::{Bench, Row, figure};
use crate::draw::style;
use crate::draw::svg::escape;
use crate::host::Host;

const RULES: &str = "\
.halves{grid-template-columns:repeat(auto-fit,minmax(min(100%,430px),1fr));gap:28px 24px}
.numbers th:nth-child(n+4),.numbers td:nth-child(n+4){text-align:right;padding-left:14px}
.host th{width:9em}
";

pub fn html(bench: &Bench, host: &Host, rows: &[Row]) -> String {
    format!(
        "<!DOCTYPE html>\n<html lang=\"en\">\n<head>\n<meta charset=\"utf-8\">\n\
         <meta name=\"viewport\" content=\"width=device-width, initial-scale=1\">\n\
         <title>bench {name}</title>\n<style>\n{style}{RULES}</style>\n</head>\n<body>\n\
         <header>\n<h1>{title}</h1>\n<p class=\"kicker\">skillet bench {name}</p>\n\
         <p>{about}</p>\n</header>\n<section>\n<h2>Distributions</h2>\n\
         <div class=\"row halves\">\n{panels}</div>\n</section>\n\
         <section>\n<h2>Numbers</h2>\n<div class=\"scroll\">\n{numbers}</div>\n</section>\n\
         <section>\n<h2>Host</h2>\n{host}</section>\n</body>\n</html>\n",
        name = bench.name,
        style = style::page(),
        title = escape(bench.title),
        about = escape(bench.about),
        panels = panels(rows),
        numbers = numbers(rows),
        host = description(host),
    )
}

/// One panel a group of times; rates and ratios have their numbers only.
fn panels(rows: &[Row]) -> String {
    let mut groups: Vec<&str> = Vec::new();
    for row in rows.iter().filter(|row| row.is_time()) {
        if !groups.contains(&row.group.as_str()) {
            groups.push(&row.group);
        }
    }
    let panel = |group: &&str| {
        let rows: Vec<&Row> = rows.iter().filter(|row| row.group == *group).collect();
        format!("<figure>\n{}</figure>\n", figure::panel(group, &rows).inline())
    };
    groups.iter().map(panel).collect()
}

fn numbers(rows: &[Row]) -> String {
    let (head, lines) = table(rows);
    let line = |cells: Vec<String>| format!("<tr>{}</tr>\n", cells.concat());
    let head = line(head.iter().map(|cell| format!("<th>{cell}</th>")).collect());
    let body: String = lines
        .iter()
        .map(|cells| line(cells.iter().map(|cell| format!("<td>{}</td>", escape(cell))).collect()))
        .collect();
    format!("<table class=\"numbers\">\n{head}{body}</table>\n")
}

fn description(host: &Host) -> String {
    let line = |(name, value): (&str, String)| {
        format!("<tr><th>{name}</th><td>{}</td></tr>\n", escape(&value))
    };
    let lines: String = host.lines().into_iter().map(line).collect();
    format!("<table class=\"host\">\n{lines}</table>\n")
}
