//! `skillet soak`: a long run under kills, swaps and observers.

use std::path::Path;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;

use anyhow::{Context, Result};
use serde_json::Value;

use crate::Verdict;
use crate::cli::soak::SoakArgs;
use crate::output::{print, print_json};
use crate::signals::{Who, stop_flag};
use crate::soak::net::{self, NetPlan, Weather};
use crate::soak::{self, Plan};
use crate::stderr::say;

/// Default duration of a soak without --kills, min.
const MINUTES: f64 = 2.0;

pub fn run(args: &SoakArgs) -> Result<Verdict> {
    let stop = stop_flag(Who::Tool)?;
    if let Some(hosts) = args.hosts {
        net::check(hosts.into(), args.cells.into())?;
    }
    let scratch = || std::env::temp_dir().join(format!("skillet-soak-{}", std::process::id()));
    let dir = args.out.clone().unwrap_or_else(scratch);
    std::fs::create_dir_all(&dir)
        .with_context(|| format!("{}: cannot create the folder", dir.display()))?;
    // Services get its path from another working directory.
    let dir = std::path::absolute(&dir).context("finding the folder")?;
    let minutes = args.minutes.or(args.kills.is_none().then_some(MINUTES));
    if let Some(hosts) = args.hosts {
        let summary = net::run(&net_plan(args, hosts, &dir), &stop)?;
        let said = if args.json { Said::Json(summary.json()) } else { Said::Text(summary.text()) };
        return end(args, &dir, said, summary.is_good(), &stop);
    }
    let plan = Plan {
        time: minutes.map(|minutes| Duration::from_secs_f64(60.0 * minutes)),
        kills: args.kills,
        rollouts: args.rollouts.get(),
        seed: args.seed,
        pace: args.pace,
        dir: dir.clone(),
    };
    let summary = soak::run(&plan, &stop)?;
    let said = if args.json { Said::Json(summary.json()) } else { Said::Text(summary.text()) };
    end(args, &dir, said, summary.is_good(), &stop)
}

/// What was found, as it was asked for.
enum Said {
    Json(Value),
    Text(String),
}

fn net_plan(args: &SoakArgs, hosts: u8, dir: &Path) -> NetPlan {
    NetPlan {
        time: Duration::from_secs_f64(60.0 * args.minutes.unwrap_or(MINUTES)),
        hosts: hosts.into(),
        cells: args.cells.into(),
        weather: Weather {
            delay: Duration::from_millis(args.delay_ms.into()),
            loss: args.loss,
            duplicate: args.duplicate,
            reorder: args.reorder,
        },
        rollouts: args.rollouts.get(),
        seed: args.seed,
        pace: args.pace,
        dir: dir.to_path_buf(),
    }
}

fn end(
    args: &SoakArgs,
    dir: &Path,
    said: Said,
    is_good: bool,
    stop: &AtomicBool,
) -> Result<Verdict> {
    match said {
        Said::Json(value) => print_json(&value)?,
        Said::Text(text) => print(&text)?,
    }
    if !is_good {
        say(&format!("sessions and logs are in {}", dir.display()));
        return Ok(Verdict::Negative);
    }
    if args.out.is_none() {
        // What stays behind of a scratch folder harms nobody.
        let _ = std::fs::remove_dir_all(dir);
    }
    Ok(if stop.load(Ordering::Relaxed) { Verdict::Negative } else { Verdict::Done })
}
