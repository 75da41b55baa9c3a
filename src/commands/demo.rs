//! `skillet demo`: demonstrations from recordings.

use anyhow::{Context, Result, bail};
use learner::Demonstration;
use physics::arm::kinematics;

use crate::Verdict;
use crate::cli::demo::{DemoArgs, DemoVerb, ImportArgs};
use crate::config::Config;
use crate::demo::{self, Effort, Options, Summary};
use crate::output::{print, print_json, write_new};
use crate::setup;

pub fn run(args: &DemoArgs) -> Result<Verdict> {
    match &args.verb {
        DemoVerb::Import(args) => import(args),
    }
}

fn import(args: &ImportArgs) -> Result<Verdict> {
    let config = Config::load(args.config.as_deref())?;
    if !config.has_arm() {
        bail!(
            "task.name is '{}', which has no arm and no demonstration: use a configuration of the \
             task pancake",
            config.task.name
        );
    }
    let model = setup::arm(&config)?;
    let file = args.file.display().to_string();
    let bytes = std::fs::read(&args.file)
        .with_context(|| format!("{file}: cannot read the recording; check the path"))?;
    let q0 = config.plant.start_posture();
    let options = Options {
        rate_hz: args.rate_hz,
        smooth_s: args.smooth_s,
        start_s: args.start,
        end_s: args.end,
        slow: args.slow,
        at_start: args.at_start.then(|| kinematics::tip_pose(&model, &q0)),
        columns: args.columns.clone(),
    };
    let imported = demo::import(&file, &bytes, &model, &options)?;
    imported.warnings.iter().for_each(|warning| eprintln!("warning: {warning}"));

    let csv = imported.csv();
    let demonstration = Demonstration::parse(&args.out.display().to_string(), &csv)?;
    let effort = setup::check_demonstration(&config, &model, &demonstration)
        .and_then(|()| Effort::of(&model, &q0, &demonstration));
    let misfit = match &effort {
        Ok(effort) => effort.excess(demonstration.file()),
        Err(_) => None,
    };
    let misfit = effort.as_ref().err().or(misfit.as_ref());
    write_new(&args.out, &csv)?;
    let summary = Summary {
        out: &args.out,
        imported: &imported,
        demonstration: &demonstration,
        effort: effort.as_ref().ok(),
        misfit,
    };
    if args.json {
        print_json(&summary.json())?;
    } else {
        print(&summary.text())?;
    }
    Ok(if misfit.is_none() { Verdict::Done } else { Verdict::Negative })
}
