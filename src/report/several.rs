//! Several sessions: learning curves with bands over the seeds, one curve for each kind of session.

use super::TrialRow;
use super::origin::Origin;
use super::reward::{WINDOW, running_mean};
use crate::draw::figure::{Figure, HALF, Row};
use crate::draw::plot::{Axis, Entry, Key, Plot};
use crate::draw::svg::Panel;

/// One session among several.
pub struct Session {
    pub name: String,
    pub task: String,
    pub seed: u64,
    /// Its configuration as text, without what differs between repetitions.
    pub settings: String,
    /// What a success is called, where there is any.
    pub success: Option<&'static str>,
    pub trials: Vec<TrialRow>,
    pub origin: Origin,
    /// From this page to its own.
    pub page: Option<String>,
}

/// Names and colours of the kinds.
const KINDS: [(&str, &str); 6] = [
    ("A", "learnt"),
    ("B", "best"),
    ("C", "mean"),
    ("D", "bottom"),
    ("E", "top"),
    ("F", "initial"),
];

/// Sessions that differ in their seeds alone.
pub struct Kind<'a> {
    pub name: &'static str,
    class: &'static str,
    pub sessions: Vec<&'a Session>,
}

impl Kind<'_> {
    /// Rollouts that every session has.
    fn n_rollouts(&self) -> usize {
        self.sessions.iter().map(|session| session.trials.len()).min().unwrap_or(0)
    }

    /// Quartiles over the sessions of a quantity's running mean, a row for each rollout of all.
    fn quartiles(&self, value: fn(&TrialRow) -> f64) -> Vec<[f64; 3]> {
        let curves: Vec<Vec<f64>> =
            self.sessions.iter().map(|s| running_mean(s.trials.iter().map(value))).collect();
        let at = |i: usize| {
            let mut values: Vec<f64> = curves.iter().map(|curve| curve[i]).collect();
            values.sort_by(f64::total_cmp);
            [0.25, 0.5, 0.75].map(|share| quantile(&values, share))
        };
        (WINDOW.min(self.n_rollouts()).saturating_sub(1)..self.n_rollouts()).map(at).collect()
    }
}

/// Between the two values next to it, in proportion.
pub fn quantile(sorted: &[f64], share: f64) -> f64 {
    let at = share * (sorted.len() - 1) as f64;
    let (low, high) = (at.floor() as usize, at.ceil() as usize);
    sorted[low] + (at - low as f64) * (sorted[high] - sorted[low])
}

/// By task and settings, in the order in which the sessions were named; the last name takes all others.
pub fn kinds(sessions: &[Session]) -> Vec<Kind<'_>> {
    let mut kinds: Vec<Kind> = Vec::new();
    for session in sessions {
        let same = |kind: &&mut Kind<'_>| {
            let first = kind.sessions[0];
            first.task == session.task && first.settings == session.settings
        };
        if let Some(kind) = kinds.iter_mut().find(same) {
            kind.sessions.push(session);
        } else if let Some((name, class)) = KINDS.get(kinds.len()).copied() {
            kinds.push(Kind { name, class, sessions: vec![session] });
        } else if let Some(last) = kinds.last_mut() {
            last.sessions.push(session);
        }
    }
    kinds
}

/// Both curves; sessions without a rollout have none.
pub fn figures(sessions: &[Session]) -> Vec<Figure> {
    let kinds = kinds(sessions);
    let reward = |trial: &TrialRow| trial.reward;
    let success = |trial: &TrialRow| if trial.success { 100.0 } else { 0.0 };
    vec![
        figure(
            &kinds,
            "rewards",
            "Reward over the rollouts",
            "reward, mean of the last 10",
            reward,
        ),
        figure(
            &kinds,
            "successes",
            "Successes over the rollouts",
            "successes among the last 10, %",
            success,
        ),
    ]
}

fn figure(
    kinds: &[Kind<'_>],
    stem: &'static str,
    title: &'static str,
    label: &'static str,
    value: fn(&TrialRow) -> f64,
) -> Figure {
    let curves: Vec<(&Kind<'_>, Vec<[f64; 3]>)> =
        kinds.iter().map(|kind| (kind, kind.quartiles(value))).collect();
    let is_success = stem == "successes";
    let rows = match curves.iter().all(|(_, curve)| curve.is_empty()) {
        true => Err("no session has a rollout yet.".to_owned()),
        false if is_success && kinds.iter().all(|kind| kind.sessions[0].success.is_none()) => {
            Err("these tasks have no success, only a reward.".to_owned())
        }
        false => Ok(vec![Row::Half(draw(&curves, label, is_success, (HALF, 300.0)))]),
    };
    let names = kinds.iter().map(|kind| {
        let n = kind.sessions.len();
        format!("{}: {n} session{}", kind.name, if n == 1 { "" } else { "s" })
    });
    let names: Vec<String> = names.collect();
    let names = if kinds.len() > 1 { format!(" {}.", names.join("; ")) } else { String::new() };
    Figure {
        stem,
        title,
        caption: format!(
            "Line: median over the sessions. Band: from the first to the third quartile. Each \
             curve ends with the shortest of its sessions.{names}"
        ),
        rows,
    }
}

fn draw(
    curves: &[(&Kind<'_>, Vec<[f64; 3]>)],
    label: &str,
    is_share: bool,
    size: (f64, f64),
) -> Panel {
    let longest = curves.iter().map(|(kind, _)| kind.n_rollouts() as u64).max();
    let x = Axis::rollouts(longest);
    let values = curves.iter().flat_map(|(_, curve)| curve.iter().flatten().copied());
    let y = match is_share {
        true => Axis { label, min: 0.0, max: 100.0 },
        false => Axis::rounded(label, values.chain([0.0])),
    };
    let legend: Vec<Entry> =
        curves.iter().map(|(kind, _)| (Key::Line, kind.class, kind.name)).collect();
    let legend = if legend.len() > 1 { &legend[..] } else { &[] };
    let alt = format!("{label} over the rollouts, {} kinds of sessions", curves.len());
    let mut plot = Plot::new(size, &alt, x, y, legend);
    let points = |(kind, curve): &(&Kind<'_>, Vec<[f64; 3]>), k: usize| -> Vec<(f64, f64)> {
        let first = kind.n_rollouts() - curve.len() + 1;
        curve.iter().enumerate().map(|(i, row)| ((first + i) as f64, row[k])).collect()
    };
    for curve in curves {
        let (low, high) = (points(curve, 0), points(curve, 2));
        let outline = low.into_iter().chain(high.into_iter().rev());
        let outline: Vec<(f64, f64)> = outline.map(|(x, y)| plot.at(x, y)).collect();
        plot.panel.polygon(outline, &format!("band {}", curve.0.class));
    }
    for curve in curves {
        plot.curve(points(curve, 1), curve.0.class);
    }
    plot.panel
}

#[cfg(test)]
pub mod tests {
    use super::*;
    use crate::report::sample;

    pub fn session(seed: u64, settings: &str, n: u64) -> Session {
        let data = sample::session(n);
        Session {
            name: format!("s{seed}"),
            task: data.task,
            seed,
            settings: settings.into(),
            success: data.success,
            trials: data.trials,
            origin: data.origin,
            page: Some("../a b/index.html".into()),
        }
    }

    #[test]
    fn sessions_that_differ_in_their_seeds_share_a_curve_with_a_band() {
        let sessions =
            [session(1, "a = 1\n", 40), session(2, "a = 1\n", 30), session(3, "a = 2\n", 40)];
        let svg = figures(&sessions)[0].svg().unwrap();
        assert_eq!(svg.matches("class=\"band ").count(), 2);
        assert_eq!(kinds(&sessions)[0].n_rollouts(), 30, "that of the shorter one");
    }

    #[test]
    fn quartiles_are_those_of_the_sessions() {
        assert_eq!(quantile(&[1.0, 2.0, 4.0], 0.5), 2.0);
        assert_eq!(quantile(&[1.0, 2.0], 0.25), 1.25);
        let mut sessions = [session(1, "", 12), session(2, "", 12)];
        for (k, session) in sessions.iter_mut().enumerate() {
            session.trials.iter_mut().for_each(|trial| trial.reward = k as f64);
        }
        let kind = &kinds(&sessions)[0];
        assert_eq!(kind.quartiles(|trial| trial.reward), [[0.25, 0.5, 0.75]; 3]);
    }

    #[test]
    fn a_short_session_has_a_curve() {
        let sessions = [session(1, "", 3)];
        let svgs = figures(&sessions).into_iter().map(|figure| figure.svg());
        assert!(svgs.into_iter().all(|svg| svg.is_some_and(|svg| !svg.contains("NaN"))));
    }
}
