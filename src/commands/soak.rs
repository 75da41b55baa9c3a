//! `skillet soak`: a long run under kills, swaps and observers.

use std::sync::atomic::Ordering;
use std::time::Duration;

use anyhow::{Context, Result};

use crate::Verdict;
use crate::cli::soak::SoakArgs;
use crate::output::{print, print_json};
use crate::signals::{Who, stop_flag};
use crate::soak::{self, Plan};
use crate::stderr::say;

/// Default duration of a soak without --kills, min.
const MINUTES: f64 = 2.0;

pub fn run(args: &SoakArgs) -> Result<Verdict> {
    let stop = stop_flag(Who::Tool)?;
    let scratch = std::env::temp_dir().join(format!("skillet-soak-{}", std::process::id()));
    let dir = args.out.clone().unwrap_or_else(|| scratch.clone());
    std::fs::create_dir_all(&dir)
        .with_context(|| format!("{}: cannot create the folder", dir.display()))?;
    // Services get its path from another working directory.
    let dir = std::path::absolute(&dir).context("finding the folder")?;
    let minutes = args.minutes.or(args.kills.is_none().then_some(MINUTES));
    let plan = Plan {
        time: minutes.map(|minutes| Duration::from_secs_f64(60.0 * minutes)),
        kills: args.kills,
        rollouts: args.rollouts.get(),
        seed: args.seed,
        pace: args.pace,
        dir: dir.clone(),
    };
    let summary = soak::run(&plan, &stop)?;
    if args.json {
        print_json(&summary.json())?;
    } else {
        print(&summary.text())?;
    }
    if !summary.is_good() {
        say(&format!("sessions and logs are in {}", dir.display()));
        return Ok(Verdict::Negative);
    }
    if args.out.is_none() {
        // What stays behind of a scratch folder harms nobody.
        let _ = std::fs::remove_dir_all(&scratch);
    }
    Ok(if stop.load(Ordering::Relaxed) { Verdict::Negative } else { Verdict::Done })
}
