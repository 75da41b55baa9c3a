//! How the controller's loop kept its time: wake-up latency and duration of a tick.

use rt_controller::Pace;
use rt_controller::disk::timing_file::{Bins, LoopTiming};

use crate::draw::distribution::{Distribution, panel};
use crate::draw::figure::{Figure, Row};
use crate::draw::plot::fixed;

const SHARES: [(f64, &str); 3] = [(0.5, "p50"), (0.99, "p99"), (0.999, "p99.9")];

/// The figures of a session's loops, one loop per pace, or the reason why there are none.
pub fn figures(loops: &Result<Vec<LoopTiming>, String>) -> [Figure; 2] {
    let paced: Result<Vec<&LoopTiming>, String> = match loops {
        Err(missing) => Err(missing.clone()),
        Ok(loops) => Ok(loops.iter().filter(|timing| timing.pace == Pace::Realtime).collect()),
    };
    let wakeup = paced.and_then(|loops| match loops.is_empty() {
        true => Err("not measured; rerun with `--pace realtime`.".into()),
        false => Ok(rows("wake-up", &loops, |timing| &timing.wakeup)),
    });
    let tick = loops.as_ref().map_err(Clone::clone);
    let tick = tick.map(|loops| rows("tick", &loops.iter().collect::<Vec<_>>(), |t| &t.tick));
    [
        Figure {
            stem: "wakeup",
            title: "Wake-up latency",
            caption: "Time from each deadline until the loop runs; both axes are logarithmic. A \
                      deadline is missed when the loop is a whole period late."
                .into(),
            rows: wakeup,
        },
        Figure {
            stem: "tick",
            title: "Duration of a tick",
            caption: "Time from the measurement to the torque, without the simulation; both axes are \
                      logarithmic. Covers all runs of the session whose controller ended cleanly. At \
                      full speed only a sample of ticks is counted; the loop never waits for the \
                      recorder."
                .into(),
            rows: tick,
        },
    ]
}

fn rows(what: &str, loops: &[&LoopTiming], bins: fn(&LoopTiming) -> &Bins) -> Vec<Row> {
    let distribution = |timing: &&LoopTiming| Distribution {
        label: pace_name(timing.pace).into(),
        counts: bins(timing).iter().map(|(upper_ns, n)| (*upper_ns as f64 * 1e-3, *n)).collect(),
    };
    let distributions: Vec<Distribution> = loops.iter().map(distribution).collect();
    let lines: String = loops.iter().map(|timing| line(timing, bins(timing))).collect();
    let head: String =
        SHARES.iter().map(|(_, name)| format!("<th scope=\"col\">{name}</th>")).collect();
    let table = format!(
        "<div class=\"scroll\">\n<table class=\"numbers\">\n<tr><th scope=\"col\">{what}, µs</th>\
         {head}<th scope=\"col\">max</th><th scope=\"col\">ticks</th>\
         <th scope=\"col\">missed</th></tr>\n{lines}</table>\n</div>\n"
    );
    vec![Row::Half(panel(what, &distributions)), Row::Numbers(table)]
}

fn line(timing: &LoopTiming, bins: &Bins) -> String {
    let us = |ns: u64| fixed(ns as f64 * 1e-3, 1);
    let quantiles: String = SHARES
        .iter()
        .map(|(share, _)| format!("<td>{}</td>", us(quantile(bins, *share))))
        .collect();
    let missed = match timing.pace {
        Pace::Realtime => timing.missed_deadlines.to_string(),
        Pace::Max | Pace::Plant => "–".into(),
    };
    format!(
        "<tr><th scope=\"row\">{}</th>{quantiles}<td>{}</td><td>{}</td><td>{missed}</td></tr>\n",
        pace_name(timing.pace),
        us(bins.last().map_or(0, |bin| bin.0)),
        timing.ticks,
    )
}

fn pace_name(pace: Pace) -> &'static str {
    match pace {
        Pace::Realtime => "in real time",
        Pace::Max => "at full speed",
        Pace::Plant => "by the plant",
    }
}

/// Upper end of the bin below which a share of the values lies, ns.
fn quantile(bins: &Bins, share: f64) -> u64 {
    let total: f64 = bins.iter().map(|(_, n)| *n as f64).sum();
    let mut below = 0.0;
    let reached = bins.iter().find(|(_, n)| {
        below += *n as f64;
        below >= share * total
    });
    reached.or(bins.last()).map_or(0, |bin| bin.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn timing(pace: Pace) -> LoopTiming {
        let wakeup =
            if pace == Pace::Realtime { vec![(50_000, 99), (1_200_000, 1)] } else { vec![] };
        LoopTiming { pace, ticks: 100, missed_deadlines: 1, wakeup, tick: vec![(1800, 100)] }
    }

    #[test]
    fn both_histograms_of_a_loop_in_real_time() {
        let [wakeup, tick] = figures(&Ok(vec![timing(Pace::Realtime)]));
        assert!(
            wakeup.html(1).contains("<td>50.0</td><td>50.0</td><td>1200.0</td><td>1200.0</td>")
        );
        assert!(tick.html(2).contains("<td>1.8</td>") && tick.svg().is_some());
    }

    #[test]
    fn says_why_there_is_no_wake_up_at_full_speed() {
        let [wakeup, tick] = figures(&Ok(vec![timing(Pace::Max)]));
        assert!(wakeup.rows.is_err_and(|reason| reason.contains("not measured; rerun")));
        assert!(tick.svg().is_some());
    }

    #[test]
    fn names_a_damaged_file_in_place_of_both() {
        for figure in figures(&Err("timing.json: it is damaged: line 1".into())) {
            let reason = figure.rows.err().unwrap_or_default();
            assert!(reason.contains("timing.json: it is damaged"), "{}", figure.stem);
        }
    }

    #[test]
    fn quantiles_are_of_the_values_and_none_of_nothing() {
        assert_eq!(quantile(&vec![(10, 1), (20, 2), (30, 1)], 0.5), 20);
        assert_eq!(quantile(&vec![], 0.5), 0);
    }
}
