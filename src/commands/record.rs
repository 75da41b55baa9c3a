//! `skillet record`: a running cell at full rate, as MCAP; through a bridge at the rate of the bridge.

use std::path::{Path, PathBuf};
use std::sync::atomic::Ordering;
use std::time::{Duration, Instant, SystemTime, UNIX_EPOCH};

use anyhow::{Result, bail};
use indicatif::ProgressStyle;
use serde_json::json;

use crate::Verdict;
use crate::bar::bar;
use crate::cell::NamedCell;
use crate::cli::record::RecordArgs;
use crate::output::{print, print_json};
use crate::record;
use crate::record::file::recover_left;
use crate::record::recorder::{Limits, Recorder};
use crate::record::watcher::{Watcher, pause};
use crate::signals::{Who, stop_flag};
use crate::stderr::say;

/// How long a controller is waited for.
const OPEN: Duration = Duration::from_secs(2);
const NEWCOMER: Duration = Duration::from_millis(200);
const SAY: Duration = Duration::from_secs(1);

pub fn run(args: &RecordArgs) -> Result<Verdict> {
    let named = NamedCell::of(&args.cell)?;
    let (cell, config) = (&named.cell, named.config());
    let path = match &args.out {
        Some(path) => path.clone(),
        None => PathBuf::from(format!("{}.mcap", cell.name())),
    };
    if path.extension().is_none_or(|extension| extension != "mcap") {
        bail!("{}: the recording must be named NAME.mcap", path.display());
    }
    let dir = path.parent().filter(|dir| !dir.as_os_str().is_empty()).unwrap_or(Path::new("."));
    std::fs::create_dir_all(dir)?;
    for recovered in recover_left(dir)? {
        say(&format!("skillet: repaired {}, whose recorder had died", recovered.display()));
    }
    let stop = stop_flag(Who::Tool)?;
    let period = Duration::from_nanos(config.controller.period_ns());
    let mut watcher = Watcher::open(cell, period, OPEN)?;
    let mut scribe = record::scribe(config)?;
    let now = SystemTime::now().duration_since(UNIX_EPOCH).unwrap_or_default();
    scribe.set_now(now.as_nanos() as u64);
    let max_bytes = args.max_mb.get() * 1_000_000;
    let limits = Limits { max_bytes, by_rollout: args.by_rollout, object_always: false };
    let mut recorder = Recorder::new(scribe, &path, limits, record::attachments(config)?)?;

    // The policy in the loop is told to newcomers ten times a second: it shall be known before the ticks.
    std::thread::sleep(NEWCOMER);
    let bar = bar(None).with_style(ProgressStyle::with_template("{spinner} {msg}")?);
    let (start, mut said) = (Instant::now(), Instant::now());
    let is_over = || {
        let elapsed = start.elapsed().as_secs_f64();
        stop.load(Ordering::Relaxed) || args.duration_s.is_some_and(|limit| elapsed >= limit)
    };
    while !is_over() {
        let round = Instant::now();
        while let Some(seen) = watcher.next()? {
            recorder.write(seen)?;
        }
        recorder.keep()?;
        if said.elapsed() >= SAY {
            said = Instant::now();
            bar.set_message(line(&watcher, recorder.bytes(), start.elapsed()));
            bar.tick();
        }
        pause(round);
    }
    bar.finish_and_clear();
    let (bytes, elapsed) = (recorder.bytes(), start.elapsed());
    let files = recorder.finish()?;
    if args.json {
        let bridged = watcher.bridged.as_ref();
        print_json(&json!({
            "files": files, "duration_s": elapsed.as_secs_f64(), "ticks_seen": watcher.ticks,
            "ticks_lost": bridged.is_none().then_some(watcher.lost), "bytes": bytes,
            "via": bridged.map(|bridged| &bridged.host),
            "telemetry_hz": bridged.map(|bridged| bridged.hz),
        }))?;
    } else {
        for file in &files {
            print(&format!("{}\n", file.display()))?;
        }
        print(&format!("{}\n", line(&watcher, bytes, elapsed)))?;
    }
    Ok(Verdict::Done)
}

fn line(watcher: &Watcher, bytes: u64, elapsed: Duration) -> String {
    let (megabytes, seconds) = (bytes as f64 * 1e-6, elapsed.as_secs_f64());
    let lost = match (&watcher.bridged, watcher.lost) {
        (Some(bridged), _) => bridged.sentence(),
        (None, 0) => "none lost".to_string(),
        (None, lost) => format!("{lost} lost"),
    };
    let per_minute = megabytes / seconds * 60.0;
    format!(
        "{seconds:.0} s, {} ticks, {lost}, {megabytes:.1} MB ({per_minute:.1} MB a minute)",
        watcher.ticks
    )
}
