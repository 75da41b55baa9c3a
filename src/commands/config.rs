//! `skillet config`: every setting with its meaning; a configuration file, checked.

use std::path::Path;

use anyhow::Result;
use serde_json::json;

use crate::Verdict;
use crate::cli::config::ConfigArgs;
use crate::config::Config;
use crate::output::{print, print_json};
use crate::settings::check::{Outcome, check};
use crate::{judging, settings, tasks};

pub fn run(args: &ConfigArgs) -> Result<Verdict> {
    match &args.check {
        Some(path) => check_file(path, args.json),
        None if args.schema => print_json(&settings::schema()).map(|()| Verdict::Done),
        None if args.markdown => print(&settings::reference()?).map(|()| Verdict::Done),
        None => show(args),
    }
}

fn show(args: &ConfigArgs) -> Result<Verdict> {
    let config = match &args.task {
        Some(task) => Config::of_task(tasks::find(task)?.name),
        None => Config::load(args.config.as_deref())?,
    };
    if config.task.judge.is_some() {
        judging::judge(&config)?;
    }
    if args.json {
        print_json(&config)?;
    } else {
        print(&settings::commented(&config)?)?;
    }
    Ok(Verdict::Done)
}

fn check_file(path: &Path, as_json: bool) -> Result<Verdict> {
    let outcomes = check(path)?;
    let is_good = outcomes.iter().all(|outcome| outcome.fault.is_none());
    if as_json {
        let findings: Vec<_> = outcomes.iter().map(Outcome::json).collect();
        print_json(&json!({ "file": path, "valid": is_good, "checks": findings }))?;
    } else {
        print(&outcomes.iter().map(Outcome::line).collect::<String>())?;
    }
    Ok(if is_good { Verdict::Done } else { Verdict::Negative })
}
