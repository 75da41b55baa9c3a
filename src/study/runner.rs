//! Runs the seeds of a study on all cores; every finished seed is on disk and never run again.

use std::fs::{File, OpenOptions};
use std::io::{BufRead, BufReader, Write};
use std::path::{Path, PathBuf};
use std::sync::Mutex;
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};

use anyhow::{Context, Result, bail};
use indicatif::{ProgressBar, ProgressStyle};
use serde::{Deserialize, Serialize};

use super::sample::Sample;
use crate::bar::bar;

/// One line of the file of results.
#[derive(Serialize, Deserialize)]
struct SeedLine {
    study: String,
    /// Version of the study: results of another version are not mixed in.
    version: u32,
    seed: u64,
    samples: Vec<Sample>,
}

/// What to run.
pub struct Plan<'a> {
    pub study: &'a str,
    pub version: u32,
    pub seeds: std::ops::Range<u64>,
    pub threads: usize,
    /// One JSON line a seed.
    pub results: PathBuf,
    pub run_seed: &'a (dyn Fn(u64) -> Result<Vec<Sample>> + Sync),
}

/// The samples of all seeds in the order of the seeds; `None` when stopped before the last.
pub fn run(plan: &Plan, stop: &AtomicBool) -> Result<Option<Vec<Sample>>> {
    let mut done = read(plan)?;
    let missing: Vec<u64> =
        plan.seeds.clone().filter(|seed| !done.iter().any(|line| line.seed == *seed)).collect();
    let file = OpenOptions::new()
        .create(true)
        .append(true)
        .open(&plan.results)
        .with_context(|| format!("{}: cannot write the results", plan.results.display()))?;
    let shared = Mutex::new((file, Vec::new(), None));
    let next = AtomicUsize::new(0);
    let total = plan.seeds.end - plan.seeds.start;
    let progress = progress(plan.study, total, total - missing.len() as u64);

    let work = || {
        while let Some(&seed) = missing.get(next.fetch_add(1, Ordering::Relaxed)) {
            if stop.load(Ordering::Relaxed) {
                return;
            }
            let result = (plan.run_seed)(seed).and_then(|samples| {
                let (study, version) = (plan.study.to_string(), plan.version);
                let line = SeedLine { study, version, seed, samples };
                let text = format!("{}\n", serde_json::to_string(&line)?);
                Ok((line, text))
            });
            let mut shared = shared.lock().expect("no thread panics with it");
            let written = result.and_then(|(line, text)| {
                shared.0.write_all(text.as_bytes()).context("writing the results")?;
                Ok(line)
            });
            match written {
                Ok(line) => shared.1.push(line),
                Err(error) => {
                    shared.2 = Some(error.context(format!("seed {seed}")));
                    stop.store(true, Ordering::Relaxed);
                }
            }
            progress.inc(1);
        }
    };
    std::thread::scope(|scope| {
        (0..plan.threads.max(1)).for_each(|_| drop(scope.spawn(work)));
    });
    progress.finish_and_clear();
    let (_, fresh, error) = shared.into_inner().expect("no thread panics with it");
    if let Some(error) = error {
        return Err(error);
    }
    done.extend(fresh);
    if (done.len() as u64) < total {
        return Ok(None);
    }
    done.sort_by_key(|line| line.seed);
    Ok(Some(done.into_iter().flat_map(|line| line.samples).collect()))
}

/// The seeds of the plan that are in its file already. A torn last line is run again.
fn read(plan: &Plan) -> Result<Vec<SeedLine>> {
    let Ok(file) = File::open(&plan.results) else { return Ok(Vec::new()) };
    let mut lines: Vec<SeedLine> = Vec::new();
    for text in BufReader::new(file).lines() {
        let text = text.with_context(|| plan.results.display().to_string())?;
        let Ok(line) = serde_json::from_str::<SeedLine>(&text) else { continue };
        if line.study != plan.study || line.version != plan.version {
            bail!(
                "{}: holds results of study {} version {}, not {} version {}: choose another \
                 folder with --out, or delete the file",
                plan.results.display(),
                line.study,
                line.version,
                plan.study,
                plan.version
            );
        }
        let known = lines.iter().any(|other| other.seed == line.seed);
        if plan.seeds.contains(&line.seed) && !known {
            lines.push(line);
        }
    }
    repair(&plan.results)?;
    Ok(lines)
}

/// Ends a torn last line, so that the next one begins at a line of its own.
fn repair(path: &Path) -> Result<()> {
    let text = std::fs::read(path)?;
    if text.last().is_some_and(|byte| *byte != b'\n') {
        OpenOptions::new().append(true).open(path)?.write_all(b"\n")?;
    }
    Ok(())
}

fn progress(study: &str, total: u64, done: u64) -> ProgressBar {
    let template = "{prefix} {bar:30} {pos}/{len} seeds, {eta} left";
    let style = ProgressStyle::with_template(template).expect("the template is valid");
    let bar = bar(Some(total)).with_style(style).with_prefix(study.to_string());
    bar.set_position(done);
    bar
}

#[cfg(test)]
mod tests {
    use super::*;

    fn plan<'a>(
        results: PathBuf,
        run_seed: &'a (dyn Fn(u64) -> Result<Vec<Sample>> + Sync),
    ) -> Plan<'a> {
        Plan { study: "test", version: 1, seeds: 5..9, threads: 2, results, run_seed }
    }

    #[test]
    fn runs_each_seed_once_and_resumes_behind_a_torn_line() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("test.jsonl");
        let stop = AtomicBool::new(false);
        let runs = AtomicUsize::new(0);
        let count = |seed: u64| {
            runs.fetch_add(1, Ordering::Relaxed);
            Ok(vec![Sample::mean("m", "seed", seed as f64)])
        };
        let first = run(&plan(path.clone(), &count), &stop).unwrap().unwrap();
        assert_eq!(first.iter().map(|s| s.value).collect::<Vec<_>>(), [5.0, 6.0, 7.0, 8.0]);

        let text = std::fs::read_to_string(&path).unwrap();
        std::fs::write(&path, &text[..text.len() - 10]).unwrap();
        assert_eq!(run(&plan(path.clone(), &count), &stop).unwrap().unwrap(), first);
        assert_eq!(runs.load(Ordering::Relaxed), 5);

        let other = Plan { version: 2, ..plan(path, &count) };
        assert!(run(&other, &stop).unwrap_err().to_string().contains("version 1"));
    }

    #[test]
    fn a_seed_that_fails_is_named() {
        let dir = tempfile::tempdir().unwrap();
        let fail = |_| bail!("it broke");
        let plan = plan(dir.path().join("test.jsonl"), &fail);
        let error = run(&plan, &AtomicBool::new(false)).unwrap_err();
        assert!(format!("{error:#}").contains("seed "), "{error:#}");
    }
}
