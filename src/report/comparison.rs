//! The page of several sessions: curves, a table, and what differs between them.

use super::page::document;
use super::several::{Kind, Session, kinds, quantile};
use super::summary;
use crate::draw::figure::Figure;
use crate::draw::plot::fixed;
use crate::draw::svg::escape;

/// Lines of a configuration that tell a kind of session from the others, at most.
const DIFFERENCES: usize = 4;

/// The page of all of them.
pub fn html(sessions: &[Session], figures: &[Figure]) -> String {
    let kinds = kinds(sessions);
    let shown = figures.iter().filter(|figure| figure.rows.is_ok());
    let sections: String = (1..).zip(shown).map(|(n, figure)| figure.html(n)).collect();
    let tasks = kinds.iter().map(|kind| kind.sessions[0].task.as_str());
    let mut tasks: Vec<&str> = tasks.collect();
    tasks.dedup();
    let body = format!(
        "<header>\n<h1>{n} sessions: {tasks}</h1>\n{verdict}</header>\n<main>\n{sections}</main>\n\
         <section>\n<h2>Sessions</h2>\n{table}</section>\n<section>\n<h2>What differs</h2>\n\
         {differences}</section>\n",
        n = sessions.len(),
        tasks = escape(&tasks.join(", ")),
        verdict = verdicts(&kinds),
        table = table(&kinds),
        differences = differences(&kinds),
    );
    document(&format!("{} sessions", sessions.len()), &body)
}

/// For example "A: 5 of 5 sessions with a hit, the first time at rollout 12 to 31 (median 17); successes among the
/// last 20 rollouts: 16 to 20 (median 19)."
fn verdicts(kinds: &[Kind<'_>]) -> String {
    let verdict = |kind: &Kind<'_>| {
        let name = if kinds.len() > 1 { format!("{}: ", kind.name) } else { String::new() };
        format!("<p class=\"verdict\">{name}{}.</p>\n", achieved(&kind.sessions))
    };
    kinds.iter().map(verdict).collect()
}

/// What sessions of one kind came to, in words.
fn achieved(sessions: &[&Session]) -> String {
    let count = |n: usize| format!("{n} session{}", if n == 1 { "" } else { "s" });
    let Some(success) = sessions[0].success else {
        let best = sessions.iter().filter_map(|s| summary::best(&s.trials));
        let best = Spread::of(best.map(|trial| trial.reward));
        let best = best.map_or(String::new(), |best| format!(", best reward {}", best.text(2)));
        return count(sessions.len()) + &best;
    };
    let firsts: Vec<u64> = sessions.iter().filter_map(|s| first_success(s)).collect();
    let when = Spread::of(firsts.iter().map(|n| *n as f64));
    let when =
        when.map_or(String::new(), |when| format!(", the first time at rollout {}", when.text(0)));
    let recent = sessions.iter().map(|s| summary::recent(&s.trials));
    let recent = Spread::of(recent.map(|trials| summary::successes(trials) as f64));
    let last = sessions.iter().map(|s| summary::recent(&s.trials).len()).min().unwrap_or(0);
    let recent = recent.filter(|_| last > 0).map_or(String::new(), |recent| {
        format!("; successes among the last {last} rollouts: {}", recent.text(0))
    });
    let n = firsts.len();
    format!("{n} of {} with a {success}{when}{recent}", count(sessions.len()))
}

/// Values of several sessions, the smallest first.
struct Spread(Vec<f64>);

impl Spread {
    fn of(values: impl Iterator<Item = f64>) -> Option<Spread> {
        let mut values: Vec<f64> = values.collect();
        values.sort_by(f64::total_cmp);
        (!values.is_empty()).then_some(Spread(values))
    }

    /// For example "12 to 31 (median 17)".
    fn text(&self, decimals: usize) -> String {
        let [first, last] = [self.0[0], self.0[self.0.len() - 1]].map(|v| fixed(v, decimals));
        if first == last {
            return first;
        }
        // A median of whole numbers may lie between two.
        let median = quantile(&self.0, 0.5);
        let more = usize::from(decimals == 0 && median.fract() != 0.0);
        format!("{first} to {last} (median {})", fixed(median, decimals + more))
    }
}

fn first_success(session: &Session) -> Option<u64> {
    session.trials.iter().find(|trial| trial.success).map(|trial| trial.rollout)
}

fn table(kinds: &[Kind<'_>]) -> String {
    const HEAD: [&str; 9] = [
        "",
        "session",
        "seed",
        "rollouts",
        "first success",
        "of the last 20",
        "best reward",
        "learnt",
        "program",
    ];
    let row = |kind: &Kind<'_>, session: &Session| {
        let name = escape(&session.name);
        let name = match &session.page {
            Some(page) => format!("<a href=\"{}\">{name}</a>", escape(page)),
            None => name,
        };
        let best = summary::best(&session.trials);
        let cells = [
            if kinds.len() > 1 { kind.name.to_owned() } else { String::new() },
            name,
            session.seed.to_string(),
            session.trials.len().to_string(),
            first_success(session).map_or("–".into(), |n| n.to_string()),
            summary::successes(summary::recent(&session.trials)).to_string(),
            best.map_or("–".into(), |trial| {
                format!("{} ({})", fixed(trial.reward, 2), trial.rollout)
            }),
            session.origin.day().unwrap_or("–").to_owned(),
            escape(&session.origin.program().unwrap_or("–".into())),
        ];
        let cells: String = cells.iter().map(|cell| format!("<td>{cell}</td>")).collect();
        format!("<tr>{cells}</tr>\n")
    };
    let head: String = HEAD.iter().map(|name| format!("<th scope=\"col\">{name}</th>")).collect();
    let rows = kinds.iter().flat_map(|kind| kind.sessions.iter().map(|s| row(kind, s)));
    let rows: String = rows.collect();
    format!(
        "<div class=\"scroll\">\n<table class=\"numbers\">\n<tr>{head}</tr>\n{rows}</table>\n</div>\n"
    )
}

/// Lines of each kind's configuration that not all kinds have.
fn differences(kinds: &[Kind<'_>]) -> String {
    if kinds.len() < 2 {
        return "<p>Only the seed: all sessions have one configuration.</p>\n".into();
    }
    let has = |kind: &Kind<'_>, line: &str| kind.sessions[0].settings.lines().any(|l| l == line);
    let item = |kind: &Kind<'_>| {
        let own = kind.sessions[0].settings.lines().filter(|line| {
            !line.trim().is_empty() && !line.starts_with('[') && !kinds.iter().all(|k| has(k, line))
        });
        let own: Vec<&str> = own.collect();
        let shown: Vec<String> = own
            .iter()
            .take(DIFFERENCES)
            .map(|line| format!("<code>{}</code>", escape(line)))
            .collect();
        let more = match own.len().saturating_sub(DIFFERENCES) {
            0 => String::new(),
            n => format!(" and {n} more"),
        };
        let shown = if shown.is_empty() { "nothing of its own".into() } else { shown.join(", ") };
        format!("<li>{}: {shown}{more}</li>\n", kind.name)
    };
    let items: String = kinds.iter().map(item).collect();
    format!("<ul>\n{items}</ul>\n")
}

#[cfg(test)]
mod tests {
    use super::super::several::figures;
    use super::super::several::tests::session;
    use super::*;

    #[test]
    fn the_page_names_every_session_and_what_differs() {
        let sessions = [
            session(1, "a = 1\n", 40),
            session(2, "a = 1\n", 30),
            session(3, "a = 2\nb = 3\n", 40),
        ];
        let page = html(&sessions, &figures(&sessions));
        assert!(page.contains("A: 2 sessions; B: 1 session."), "{page}");
        assert!(page.contains("<li>B: <code>a = 2</code>, <code>b = 3</code></li>"), "{page}");
        assert!(page.contains("<a href=\"../a b/index.html\">s3</a>"), "{page}");
        let same = html(&sessions[..2], &figures(&sessions[..2]));
        assert!(same.contains("Only the seed"));
    }

    #[test]
    fn sessions_without_a_rollout_have_a_page() {
        let sessions = [session(1, "", 0), session(2, "", 0)];
        let figures = figures(&sessions);
        assert!(figures.iter().all(|figure| figure.rows.is_err()));
        assert!(html(&sessions, &figures).contains("0 of 2 sessions"));
    }
}
