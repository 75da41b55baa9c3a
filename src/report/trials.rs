//! Every rollout with the numbers behind the figures, as a table.

use shm_types::measures::{Measure, TRUTH};

use super::summary::DEGREES;
use super::{Pictures, ReportData, TrialRow, time};
use crate::draw::plot::fixed;
use crate::draw::svg::escape;

/// Every rollout with the numbers behind the figures.
pub fn table(data: &ReportData) -> String {
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
    let (head, row): (Vec<String>, fn(&TrialRow) -> String) = match &data.pictures {
        Pictures::Toss => {
            let success = if data.counts_flips() { "caught" } else { "success" };
            let head = FLIPS.map(|name| if name == "caught" { success } else { name });
            (head.map(String::from).into(), trial_row)
        }
        Pictures::Plane(plane) => {
            let head = ["rollout", "reward", plane.x.label, plane.y.label];
            (head.map(String::from).into(), action_row)
        }
        Pictures::Plain => (measured_head(&data.trials), measured_row),
    };
    let head: String =
        head.iter().map(|name| format!("<th scope=\"col\">{}</th>", escape(name))).collect();
    let rows: String = data.trials.iter().map(row).collect();
    format!("<table class=\"trials\">\n<tr>{head}</tr>\n{rows}</table>\n")
}

fn measured_head(trials: &[TrialRow]) -> Vec<String> {
    let measured = trials.iter().find(|trial| !trial.measures.is_empty());
    let declared = measured.map_or_else(Vec::new, |trial| trial.measures.declared());
    let names = declared.into_iter().map(|(name, unit)| match unit.as_str() {
        "1" | TRUTH => name,
        unit => format!("{name}, {unit}"),
    });
    let first = ["rollout", "reward", "success", "fault"].map(String::from).into_iter();
    first.chain(names).collect()
}

fn measured_row(trial: &TrialRow) -> String {
    let fault = if trial.fault == 0 { "–".to_owned() } else { trial.fault.to_string() };
    let success = if trial.success { "yes" } else { "no" }.to_owned();
    let first = [trial.rollout.to_string(), fixed(trial.reward, 3), success, fault];
    let number = |measure: Measure<'_>| match measure.value.is_finite() {
        true if measure.is_truth() => measure.text(),
        true => fixed(measure.value, 3),
        false => "–".to_owned(),
    };
    let cells = first.into_iter().chain(trial.measures.iter().map(number));
    let cells: String = cells.map(|cell| format!("<td>{cell}</td>")).collect();
    format!("<tr>{cells}</tr>\n")
}

fn action_row(trial: &TrialRow) -> String {
    let numbers = std::iter::once(&trial.reward).chain(trial.theta.iter().take(2));
    let cells: String = numbers.map(|value| format!("<td>{}</td>", fixed(*value, 3))).collect();
    format!("<tr><td>{}</td>{cells}</tr>\n", trial.rollout)
}

fn trial_row(trial: &TrialRow) -> String {
    let of = |is_measured: bool, name, factor: f64, decimals| {
        let value = trial.measures.get(name).filter(|value| is_measured && value.is_finite());
        value.map_or("–".to_owned(), |value| fixed(value * factor, decimals))
    };
    let released = time(&trial.measures, "release_time_s") > 0.0;
    let crossed = time(&trial.measures, "crossing_time_s") > 0.0;
    let reward = if trial.reward.is_finite() { fixed(trial.reward, 3) } else { "–".to_owned() };
    let cells = [
        trial.rollout.to_string(),
        reward,
        if trial.success { "yes" } else { "no" }.to_owned(),
        of(released, "release_speed_m_s", 1.0, 2),
        of(released, "release_spin_rad_s", 1.0, 1),
        of(true, "apex_m", 1.0, 2),
        of(crossed, "flip_angle_rad", DEGREES, 0),
        of(crossed, "lateral_m", 100.0, 1),
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
    fn shows_no_number_that_was_not_measured() {
        let mut trial = sample::session(3).trials.remove(1);
        trial.measures = sample::measures(&[]);
        assert!(trial_row(&trial).contains("<td>–</td>"));
    }
}
