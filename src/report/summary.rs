//! The session in one sentence and two tables.

use std::f64::consts::PI;

use shm_types::episode::{OUTCOME_DROPPED, OUTCOME_EXPLOIT, OutcomeMsg};

use super::{ReportData, TrialRow};
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
pub fn verdict(trials: &[TrialRow]) -> String {
    let Some(best) = best(trials) else {
        return "No rollout has been recorded yet.".to_owned();
    };
    let best = format!("best reward {} (rollout {})", fixed(best.reward, 2), best.rollout);
    let Some(first) = trials.iter().find(|trial| trial.success) else {
        return format!("No caught flip in {}; {best}.", rollouts(trials.len()));
    };
    let recent = recent(trials);
    let hits = successes(recent);
    let which = if recent.len() < trials.len() { "the last " } else { "" };
    let succeed = if hits == 1 { "succeeds" } else { "succeed" };
    format!(
        "First caught flip at rollout {}; {hits} of {which}{} {succeed}; {best}.",
        first.rollout,
        rollouts(recent.len())
    )
}

/// The same of a task without an arm: "2 solutions after 200 rollouts; best reward 0.981
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

fn recent(trials: &[TrialRow]) -> &[TrialRow] {
    &trials[trials.len().saturating_sub(RECENT)..]
}

fn successes(trials: &[TrialRow]) -> usize {
    trials.iter().filter(|trial| trial.success).count()
}

fn rollouts(n: usize) -> String {
    if n == 1 { "1 rollout".to_owned() } else { format!("{n} rollouts") }
}

/// Both tables; of a task without an arm the session's alone.
pub fn tables(data: &ReportData) -> String {
    let (session, trial) = (session_rows(data), trial_rows(data));
    let caption = if data.trials.iter().any(|trial| trial.success) {
        format!("Best caught flip: rollout {}", data.learnt_rollout)
    } else {
        format!("Best rollout: {}", data.learnt_rollout)
    };
    let mut tables = table("Session", &session);
    if !trial.is_empty() && data.plane.is_none() {
        tables += &table(&caption, &trial);
    }
    format!("<div class=\"tables\">\n{tables}</div>\n")
}

fn session_rows(data: &ReportData) -> Vec<(String, String)> {
    let trials = &data.trials;
    let with = |flag| trials.iter().filter(|trial| trial.outcome.has(flag)).count();
    let faults = trials.iter().filter(|trial| trial.fault != 0).count();
    let row = |name: &str, value: String| (name.to_owned(), value);
    let mut rows =
        vec![row("seed", data.seed.to_string()), row("rollouts", trials.len().to_string())];
    if data.plane.is_none() {
        rows.push(row("caught flips", successes(trials).to_string()));
        rows.push(row("dropped pancakes", with(OUTCOME_DROPPED).to_string()));
    }
    let exploits = with(OUTCOME_EXPLOIT);
    if exploits > 0 {
        rows.push(row("discarded as contact exploits", exploits.to_string()));
    }
    rows.push(row("rollouts with a fault", faults.to_string()));
    rows.extend(data.notes.iter().cloned());
    rows
}

/// What the world measured of the best trial; nothing that was not measured.
fn trial_rows(data: &ReportData) -> Vec<(String, String)> {
    let OutcomeMsg {
        release_time_s,
        release_speed_m_s,
        release_spin_rad_s,
        apex_m,
        crossing_time_s,
        flip_angle_rad,
        distance_m,
        lateral_m,
        final_lateral_m,
        bounce_s,
        clipped_share,
        ..
    } = data.learnt_outcome;
    let trial = data.trials.iter().find(|trial| trial.rollout == data.learnt_rollout);
    let mut rows = Vec::new();
    let mut add = |name: &str, value: f64, decimals, unit: &str| {
        if value.is_finite() {
            rows.push((name.to_owned(), format!("{}{unit}", fixed(value, decimals))));
        }
    };
    if let Some(trial) = trial {
        add("reward", trial.reward, 3, "");
        add("apex above the start", apex_m, 2, " m");
    }
    if release_time_s > 0.0 {
        add("release at", release_time_s, 2, " s");
        add("release speed", release_speed_m_s, 2, " m/s");
        add("release spin", release_spin_rad_s, 1, " rad/s");
    }
    if crossing_time_s > 0.0 {
        add("crossing at", crossing_time_s, 2, " s");
        add("flip angle", flip_angle_rad * 180.0 / PI, 0, "°");
        add("distance of pan and pancake", distance_m * 100.0, 1, " cm");
        add("lateral miss", lateral_m * 100.0, 1, " cm");
        add("final offset in the pan", final_lateral_m * 100.0, 1, " cm");
        add("bouncing", bounce_s * 1e3, 0, " ms");
    }
    if trial.is_some() {
        add("ticks with a clipped torque", clipped_share * 100.0, 1, " %");
    }
    rows
}

fn table(caption: &str, rows: &[(String, String)]) -> String {
    let rows: String = rows
        .iter()
        .map(|(name, value)| {
            format!("<tr><th scope=\"row\">{}</th><td>{}</td></tr>\n", escape(name), escape(value))
        })
        .collect();
    format!("<table>\n<caption>{}</caption>\n{rows}</table>\n", escape(caption))
}

/// Every rollout with the numbers behind the figures.
pub fn trials(data: &ReportData) -> String {
    const FLIPS: [&str; 9] = [
        "rollout",
        "reward",
        "caught",
        "release, m/s",
        "spin, rad/s",
        "apex, m",
        "flip, °",
        "miss, cm",
        "fault",
    ];
    let (head, row): (Vec<&str>, fn(&TrialRow) -> String) = match &data.plane {
        None => (FLIPS.to_vec(), trial_row),
        Some(plane) => (vec!["rollout", "reward", plane.x.label, plane.y.label], action_row),
    };
    let head: String = head.iter().map(|name| format!("<th scope=\"col\">{name}</th>")).collect();
    let rows: String = data.trials.iter().map(row).collect();
    format!("<table class=\"trials\">\n<tr>{head}</tr>\n{rows}</table>\n")
}

fn action_row(trial: &TrialRow) -> String {
    let numbers = std::iter::once(&trial.reward).chain(trial.theta.iter().take(2));
    let cells: String = numbers.map(|value| format!("<td>{}</td>", fixed(*value, 3))).collect();
    format!("<tr><td>{}</td>{cells}</tr>\n", trial.rollout)
}

fn trial_row(trial: &TrialRow) -> String {
    let outcome = &trial.outcome;
    let measured = |is_measured: bool, value: f64, decimals| {
        if is_measured && value.is_finite() { fixed(value, decimals) } else { "–".to_owned() }
    };
    let (released, crossed) = (outcome.release_time_s > 0.0, outcome.crossing_time_s > 0.0);
    let cells = [
        trial.rollout.to_string(),
        measured(true, trial.reward, 3),
        if trial.success { "yes" } else { "no" }.to_owned(),
        measured(released, outcome.release_speed_m_s, 2),
        measured(released, outcome.release_spin_rad_s, 1),
        measured(true, outcome.apex_m, 2),
        measured(crossed, outcome.flip_angle_rad.to_degrees(), 0),
        measured(crossed, outcome.lateral_m * 100.0, 1),
        if trial.fault == 0 { "–".to_owned() } else { trial.fault.to_string() },
    ];
    let cells: String = cells.iter().map(|cell| format!("<td>{cell}</td>")).collect();
    format!("<tr>{cells}</tr>\n")
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::report::sample;

    #[test]
    fn the_verdict_counts_the_last_twenty() {
        let mut trials = sample::session(30).trials;
        for (i, trial) in trials.iter_mut().enumerate() {
            trial.success = i >= 8 && i % 2 == 0;
            trial.reward = if i == 25 { 1.307 } else { 0.5 };
        }
        assert_eq!(
            verdict(&trials),
            "First caught flip at rollout 9; 10 of the last 20 rollouts succeed; best reward 1.31 \
             (rollout 26)."
        );
    }

    #[test]
    fn the_verdict_of_short_sessions() {
        let mut trials = sample::session(1).trials;
        (trials[0].success, trials[0].reward) = (true, 1.0);
        assert_eq!(
            verdict(&trials),
            "First caught flip at rollout 1; 1 of 1 rollout succeeds; best reward 1.00 (rollout 1)."
        );
        trials[0].success = false;
        assert_eq!(verdict(&trials), "No caught flip in 1 rollout; best reward 1.00 (rollout 1).");
        assert_eq!(verdict(&[]), "No rollout has been recorded yet.");
    }

    #[test]
    fn shows_no_number_that_was_not_measured() {
        let mut data = sample::session(3);
        data.learnt_outcome = OutcomeMsg::ZERO;
        assert!(trial_rows(&data).iter().all(|(name, _)| !name.contains("flip angle")));
        data.trials[1].outcome = OutcomeMsg::ZERO;
        assert!(trial_row(&data.trials[1]).contains("<td>–</td>"));
    }
}
