//! The selected policy in other worlds: one line for each thing that differs, from less to more.

use super::ReportData;
use crate::draw::figure::{Figure, HALF, Row};
use crate::draw::plot::fixed;
use crate::draw::svg::{Anchor, Panel, escape};

/// A policy in worlds it was not learnt in.
pub struct Robustness {
    /// Which policy it is, in words.
    pub policy: String,
    /// In the world of the session.
    pub as_learnt: Attempt,
    pub circumstances: Vec<Circumstance>,
}

/// Something that differs from the world of the session.
pub struct Circumstance {
    pub name: &'static str,
    pub unit: &'static str,
    /// By rising values.
    pub attempts: Vec<Attempt>,
}

/// One rollout.
pub struct Attempt {
    /// What it was instead, or by which factor.
    pub value: f64,
    pub success: bool,
    pub reward: f64,
}

/// Height of a line, px, and where its points begin and end.
const LINE: f64 = 78.0;
const LEFT: f64 = 34.0;
const RIGHT: f64 = HALF - 34.0;

pub fn figure(data: &ReportData) -> Figure {
    let caption = match &data.robustness {
        Err(_) => String::new(),
        Ok(robustness) => {
            let attempts = || robustness.circumstances.iter().flat_map(|c| &c.attempts);
            let successes = attempts().filter(|attempt| attempt.success).count();
            format!(
                "One rollout of {}, in each of {} worlds that differ in one thing from that of the session, in the \
                 middle. Filled: {} ({successes} of {}). Below each point: what differs, and the \
                 reward.",
                escape(&robustness.policy),
                attempts().count(),
                data.successes(),
                attempts().count(),
            )
        }
    };
    Figure {
        stem: "robustness",
        title: "Robustness of the selected policy",
        caption,
        rows: data.robustness.as_ref().map_err(Clone::clone).map(|r| vec![Row::Half(draw(r))]),
    }
}

fn draw(robustness: &Robustness) -> Panel {
    let n = robustness.circumstances.len();
    let alt = format!("outcome of {n} times a few rollouts in other worlds");
    let mut panel = Panel::new(HALF, LINE * n as f64, alt);
    for (i, circumstance) in robustness.circumstances.iter().enumerate() {
        let y = LINE * i as f64;
        panel.text((2.0, y + 13.0), Anchor::Start, "text", circumstance.name);
        let middle = circumstance.attempts.len() / 2;
        let (before, after) = circumstance.attempts.split_at(middle);
        let as_learnt = std::iter::once((&robustness.as_learnt, "as learnt".to_owned()));
        let name = |attempt: &Attempt| match circumstance.unit {
            "×" => format!("× {}", attempt.value),
            unit if attempt.value > 0.0 => format!("+{} {unit}", attempt.value),
            unit => format!("{} {unit}", fixed(attempt.value, 0)),
        };
        let named =
            |attempts: &'_ [Attempt]| -> Vec<String> { attempts.iter().map(name).collect() };
        let all: Vec<(&Attempt, String)> = before
            .iter()
            .zip(named(before))
            .chain(as_learnt)
            .chain(after.iter().zip(named(after)))
            .collect();
        let step = (RIGHT - LEFT) / (all.len() - 1).max(1) as f64;
        panel.line((LEFT, y + 26.0), (RIGHT, y + 26.0), "grid");
        for (k, (attempt, name)) in all.into_iter().enumerate() {
            let x = LEFT + step * k as f64;
            let class = if attempt.success { "dot success" } else { "dot failure" };
            panel.circle((x, y + 26.0), 5.0, class);
            panel.text((x, y + 46.0), Anchor::Middle, "tick", &name);
            let reward = fixed(attempt.reward, 2);
            panel.text((x, y + 61.0), Anchor::Middle, "text", &reward);
        }
    }
    panel
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::report::sample;

    #[test]
    fn every_attempt_is_a_point_with_what_differs() {
        let data = sample::session(5);
        let figure = figure(&data);
        let svg = figure.svg().unwrap();
        assert_eq!(svg.matches("<circle").count(), 2 * 5);
        for text in ["× 0.5", "× 2", "as learnt", "−1 cm", "+1 cm", "0.20", "1.20"] {
            assert!(svg.contains(&format!(">{text}</text>")), "{text}: {svg}");
        }
        assert!(figure.caption.contains("(6 of 8)"), "{}", figure.caption);
    }
}
