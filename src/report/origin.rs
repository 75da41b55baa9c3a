//! Where the numbers come from: program, host, command, date, and the files beside the page.

use super::summary::table;
use crate::draw::svg::escape;
use crate::provenance::Run;

/// The runs of a session's learner, or why they are not known.
pub struct Origin {
    pub runs: Result<Vec<Run>, String>,
}

/// A file beside the page.
pub struct LinkTo {
    /// What it holds.
    pub name: String,
    /// From the page.
    pub way: String,
}

impl LinkTo {
    pub fn new(name: impl Into<String>, way: impl Into<String>) -> LinkTo {
        LinkTo { name: name.into(), way: way.into() }
    }

    fn html(&self) -> String {
        // What a path may hold and a link must not.
        let way = self.way.replace('%', "%25").replace(' ', "%20").replace('#', "%23");
        format!("<a href=\"{}\">{}</a>", escape(&way.replace('?', "%3F")), escape(&self.name))
    }
}

impl Origin {
    /// The day of the first run.
    pub fn day(&self) -> Option<&str> {
        let first = self.runs.as_ref().ok()?.first()?;
        first.started.split('T').next()
    }

    /// Version and, where it is known, commit of the last run.
    pub fn program(&self) -> Option<String> {
        let run = self.runs.as_ref().ok()?.last()?;
        Some(program(run))
    }

    /// A table of the first run, and of the others when, from where and by which command they went on.
    pub fn table(&self) -> String {
        let runs = match &self.runs {
            Ok(runs) => runs,
            Err(error) => return as_text(&[("not known".into(), error.clone())]),
        };
        let Some(first) = runs.first() else {
            let text = "the session has no provenance.json: an earlier version wrote it.";
            return as_text(&[("not known".into(), text.into())]);
        };
        let mut rows = vec![
            ("program".to_owned(), program(first)),
            ("host".into(), format!("{}: {}, Linux {}", first.host, first.cpu, first.kernel)),
            ("learnt".into(), first.started.clone()),
            ("command".into(), first.command.clone()),
        ];
        for (before, run) in runs.iter().zip(&runs[1..]) {
            let elsewhere = if run.host == before.host { "" } else { &run.host };
            let other = if program(run) == program(before) { String::new() } else { program(run) };
            let parts = [run.started.as_str(), elsewhere, &other, &run.command];
            let parts: Vec<&str> = parts.into_iter().filter(|part| !part.is_empty()).collect();
            rows.push((format!("resumed after rollout {}", run.after), parts.join("; ")));
        }
        as_text(&rows)
    }
}

/// A table of texts rather than numbers.
fn as_text(rows: &[(String, String)]) -> String {
    table("Origin", rows).replacen("<table>", "<table class=\"origin\">", 1)
}

fn program(run: &Run) -> String {
    let commit = run.commit.as_ref().map(|commit| format!(", commit {commit}"));
    format!("skillet {}{}", run.version, commit.unwrap_or_default())
}

/// A line of links.
pub fn files(files: &[LinkTo]) -> String {
    if files.is_empty() {
        return String::new();
    }
    let links: Vec<String> = files.iter().map(LinkTo::html).collect();
    format!("<p class=\"files\">Data: {}.</p>\n", links.join(", "))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn tells_every_run_and_what_it_does_not_know() {
        let run = |after, host: &str| Run { host: host.into(), after, ..Run::here(0) };
        let origin = Origin { runs: Ok(vec![run(0, "bench"), run(60, "bench"), run(90, "attic")]) };
        let table = origin.table();
        assert!(table.contains("bench: ") && table.contains("resumed after rollout 60"), "{table}");
        assert_eq!(table.matches("attic").count(), 1);
        assert!(Origin { runs: Ok(Vec::new()) }.table().contains("an earlier version wrote it"));
        assert!(Origin { runs: Err("it is damaged".into()) }.table().contains("it is damaged"));
    }

    #[test]
    fn a_link_bears_any_name_of_a_file() {
        let link = LinkTo::new("a<b", "../a b#1%.mcap").html();
        assert_eq!(link, "<a href=\"../a%20b%231%25.mcap\">a&lt;b</a>");
    }
}
