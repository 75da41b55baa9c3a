//! The session in one sentence and two tables.

use shm_types::measures::Measures;

use super::{Pictures, ReportData, TrialRow, time};
use crate::draw::plot::fixed;
use crate::draw::svg::escape;

/// Rollouts at the end that show what the session has come to.
const RECENT: usize = 20;

/// The trial with the highest reward.
pub fn best(trials: &[TrialRow]) -> Option<&TrialRow> {
    let finite = trials.iter().filter(|trial| trial.reward.is_finite());
    finite.reduce(|best, trial| if trial.reward > best.reward { trial } else { best })
}

/// For example "First caught flip at rollout 23; 14 of the last 20 rollouts succeed; best reward
/// 1.31 (rollout 87)."
pub fn verdict(data: &ReportData) -> String {
    let trials = &data.trials;
    let Some(best) = best(trials) else {
        return "No rollout has been recorded yet.".to_owned();
    };
    let Some(success) = data.success else { return solutions(data) };
    let best = format!("best reward {} (rollout {})", fixed(best.reward, 2), best.rollout);
    let Some(first) = trials.iter().find(|trial| trial.success) else {
        return format!("No {success} in {}; {best}.", rollouts(trials.len()));
    };
    let recent = recent(trials);
    let hits = successes(recent);
    let which = if recent.len() < trials.len() { "the last " } else { "" };
    let succeed = if hits == 1 { "succeeds" } else { "succeed" };
    format!(
        "First {success} at rollout {}; {hits} of {which}{} {succeed}{}; {best}{}.",
        first.rollout,
        rollouts(recent.len()),
        means(recent),
        solutions_found(data.modes.len())
    )
}

/// Worth a word where there are several.
fn solutions_found(n: usize) -> String {
    if n > 1 { format!("; {n} solutions") } else { String::new() }
}

/// The verdict where nothing counts as a success: "2 solutions after 200 rollouts; best reward 0.981
/// (rollout 154)."
pub fn solutions(data: &ReportData) -> String {
    let Some(best) = best(&data.trials) else {
        return "No rollout has been recorded yet.".into();
    };
    let solutions = match data.modes.len() {
        0 => "No solution yet".into(),
        1 => "One solution".into(),
        n => format!("{n} solutions"),
    };
    format!(
        "{solutions} after {}; best reward {} (rollout {}).",
        rollouts(data.trials.len()),
        fixed(best.reward, 3),
        best.rollout
    )
}

/// How many of the trials executed the mean instead of a draw, in words.
fn means(trials: &[TrialRow]) -> String {
    let means = || trials.iter().filter(|trial| trial.is_mean);
    match means().count() {
        0 => String::new(),
        n => {
            let successes = means().filter(|trial| trial.success).count();
            format!(" ({n} of them executed the mean, {successes} succeeded)")
        }
    }
}

pub fn recent(trials: &[TrialRow]) -> &[TrialRow] {
    &trials[trials.len().saturating_sub(RECENT)..]
}

pub fn successes(trials: &[TrialRow]) -> usize {
    trials.iter().filter(|trial| trial.success).count()
}

fn rollouts(n: usize) -> String {
    if n == 1 { "1 rollout".to_owned() } else { format!("{n} rollouts") }
}

/// The session, the shown rollout, and where both come from.
pub fn tables(data: &ReportData) -> String {
    let (session, trial) = (session_rows(data), trial_rows(data));
    let success = data.success.filter(|_| data.trials.iter().any(|trial| trial.success));
    let caption = match success {
        Some(success) => format!("Best {success}: rollout {}", data.learnt_rollout),
        None => format!("Best rollout: {}", data.learnt_rollout),
    };
    let mut tables = table("Session", &session);
    if !trial.is_empty() && data.plane().is_none() {
        tables += &table(&caption, &trial);
    }
    format!("<div class=\"tables\">\n{tables}{}</div>\n", data.origin.table())
}

fn session_rows(data: &ReportData) -> Vec<(String, String)> {
    let trials = &data.trials;
    let with = |name| trials.iter().filter(|trial| trial.measures.has(name)).count();
    let faults = trials.iter().filter(|trial| trial.fault != 0).count();
    let row = |name: &str, value: String| (name.to_owned(), value);
    let mut rows =
        vec![row("seed", data.seed.to_string()), row("rollouts", trials.len().to_string())];
    match data.pictures {
        Pictures::Toss => {
            rows.push(row(data.successes(), successes(trials).to_string()));
            rows.push(row("dropped pancakes", with("dropped").to_string()));
        }
        _ if data.success.is_some() => {
            rows.push(row("successes", successes(trials).to_string()));
        }
        _ => {}
    }
    let exploits = with("exploit");
    if exploits > 0 {
        rows.push(row("discarded as contact exploits", exploits.to_string()));
    }
    rows.push(row("rollouts with a fault", faults.to_string()));
    rows.extend(data.notes.iter().cloned());
    rows
}

/// The measures of the best trial that exist.
fn trial_rows(data: &ReportData) -> Vec<(String, String)> {
    let trial = data.trials.iter().find(|trial| trial.rollout == data.learnt_rollout);
    let Some(trial) = trial else { return Vec::new() };
    let mut rows = vec![("reward".to_owned(), fixed(trial.reward, 3))];
    if data.is_toss() {
        rows.extend(toss_rows(&data.learnt_measures));
    } else {
        let finite = data.learnt_measures.iter().filter(|measure| measure.value.is_finite());
        rows.extend(finite.map(|measure| (measure.name.to_owned(), measure.text())));
    }
    rows
}

/// Name of a measure, what it is called, what it is multiplied by, decimals and unit.
type Shown = (&'static str, &'static str, f64, usize, &'static str);

pub const DEGREES: f64 = 180.0 / std::f64::consts::PI;
const AT_RELEASE: [Shown; 3] = [
    ("release_time_s", "release at", 1.0, 2, " s"),
    ("release_speed_m_s", "release speed", 1.0, 2, " m/s"),
    ("release_spin_rad_s", "release spin", 1.0, 1, " rad/s"),
];
const AT_CROSSING: [Shown; 6] = [
    ("crossing_time_s", "crossing at", 1.0, 2, " s"),
    ("flip_angle_rad", "flip angle", DEGREES, 0, "°"),
    ("distance_m", "distance between pan and pancake", 100.0, 1, " cm"),
    ("lateral_m", "lateral miss", 100.0, 1, " cm"),
    ("final_lateral_m", "final offset in the pan", 100.0, 1, " cm"),
    ("bounce_s", "bouncing", 1e3, 0, " ms"),
];

/// The rows of a toss, in order of time.
fn toss_rows(measures: &Measures) -> Vec<(String, String)> {
    let mut rows = Vec::new();
    let mut add = |shown: &[Shown]| {
        for (name, called, factor, decimals, unit) in shown {
            if let Some(value) = measures.get(name).filter(|value| value.is_finite()) {
                let value = format!("{}{unit}", fixed(value * factor, *decimals));
                rows.push(((*called).to_owned(), value));
            }
        }
    };
    add(&[("apex_m", "apex above the start", 1.0, 2, " m")]);
    if time(measures, "release_time_s") > 0.0 {
        add(&AT_RELEASE);
    }
    if time(measures, "crossing_time_s") > 0.0 {
        add(&AT_CROSSING);
    }
    add(&[("clipped_share", "ticks with a clipped torque", 100.0, 1, " %")]);
    rows
}

pub fn table(caption: &str, rows: &[(String, String)]) -> String {
    let rows: String = rows
        .iter()
        .map(|(name, value)| {
            format!("<tr><th scope=\"row\">{}</th><td>{}</td></tr>\n", escape(name), escape(value))
        })
        .collect();
    format!("<table>\n<caption>{}</caption>\n{rows}</table>\n", escape(caption))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::report::sample;

    #[test]
    fn the_verdict_counts_the_last_twenty() {
        let mut data = sample::session(30);
        for (i, trial) in data.trials.iter_mut().enumerate() {
            trial.success = i >= 8 && i % 2 == 0;
            trial.reward = if i == 25 { 1.307 } else { 0.5 };
        }
        assert_eq!(
            verdict(&data),
            "First caught flip at rollout 9; 10 of the last 20 rollouts succeed; best reward 1.31 \
             (rollout 26); 2 solutions."
        );
    }

    #[test]
    fn the_verdict_of_short_sessions() {
        let mut data = sample::session(1);
        (data.trials[0].success, data.trials[0].reward) = (true, 1.0);
        data.modes.clear();
        assert_eq!(
            verdict(&data),
            "First caught flip at rollout 1; 1 of 1 rollout succeeds; best reward 1.00 (rollout 1)."
        );
        data.trials[0].success = false;
        assert_eq!(verdict(&data), "No caught flip in 1 rollout; best reward 1.00 (rollout 1).");
        data.trials.clear();
        assert_eq!(verdict(&data), "No rollout has been recorded yet.");
    }

    #[test]
    fn shows_no_number_that_was_not_measured() {
        let mut data = sample::session(3);
        data.learnt_measures = sample::measures(&[]);
        assert!(trial_rows(&data).iter().all(|(name, _)| !name.contains("flip angle")));
    }
}
