//! A plant that is the clock. It is held softly where it is, within its limits, and never pushed.

use std::time::{Duration, Instant};

use super::Bench;
use super::line::{Line, q};
use anyhow::Result;

/// What a joint may move while it is held, rad.
const STILL: f64 = 0.05;
/// Samples left without an answer.
const SILENCE: u64 = 5;
/// By which share the median time between samples may miss the period.
const PERIOD: f64 = 0.05;

pub fn check(bench: &mut Bench, mut line: Line) -> Result<()> {
    let start = q(&line.state);
    let (mut gaps, mut steps, begun) = (0, Vec::new(), Instant::now());
    for _ in 0..bench.samples {
        line.answer(&bench.hold(&start, &line.state))?;
        let (before, now) = (line.state, line.sample()?);
        line.state = now;
        if now.seq <= before.seq || now.t_ns <= before.t_ns {
            let detail = format!(
                "after sample {} at {} ns came {} at {} ns",
                before.seq, before.t_ns, now.seq, now.t_ns
            );
            bench.note("numbers and time", false, detail);
            return Ok(());
        }
        gaps += now.seq - before.seq - 1;
        steps.push(now.t_ns - before.t_ns);
    }
    let wall = begun.elapsed().as_secs_f64();
    bench.note("numbers and time", true, format!("{} samples, {gaps} missing", bench.samples));
    steps.sort_unstable();
    let (p50, p99) = (steps[steps.len() / 2], steps[steps.len() * 99 / 100]);
    let is_on_time = (p50 as f64 / bench.period_ns as f64 - 1.0).abs() < PERIOD;
    let rate = bench.samples as f64 / wall;
    let detail = format!(
        "{:.1} µs (p50), {:.1} µs (p99) by its clock; {rate:.0} per second by ours",
        p50 as f64 / 1e3,
        p99 as f64 / 1e3
    );
    bench.note("period", is_on_time, detail);
    let moved = (q(&line.state) - start).amax();
    bench.note(
        "holding",
        moved < STILL,
        format!("it moved by {moved:.4} rad, held softly by the model"),
    );
    silence(bench, &mut line)
}

/// Answers nothing for some samples: the plant goes on, holds itself and counts.
fn silence(bench: &mut Bench, line: &mut Line) -> Result<()> {
    let (start, unanswered) = (q(&line.state), line.state.n_unanswered);
    for _ in 0..SILENCE {
        line.state = line.sample()?;
    }
    for _ in 0..bench.samples.min(500) {
        line.answer(&bench.hold(&start, &line.state))?;
        line.state = line.sample()?;
    }
    let counted = line.state.n_unanswered - unanswered;
    let detail = format!("{counted} of {SILENCE} samples without a reply counted");
    bench.note("a missing answer", counted >= SILENCE, detail);
    let moved = (q(&line.state) - start).amax();
    bench.note("it holds itself", moved < STILL, format!("it moved by {moved:.4} rad meanwhile"));
    // A message that is late: it comes after the next sample.
    let late = line.state.seq;
    line.state = line.sample()?;
    line.answer_to(late, &bench.hold(&start, &line.state))?;
    let came = line.within(Duration::from_secs(1))?.is_some();
    bench.note("a late answer", came, "it goes on");
    Ok(())
}
