//! `skillet demo`: demonstrations from recordings.

use anyhow::{Context, Result, bail};
use learner::Demonstration;

use crate::Verdict;
use crate::cli::demo::{DemoArgs, DemoVerb, ImportArgs};
use crate::config::Config;
use crate::demo::{self, Options, Summary};
use crate::output::{print, print_json, write_new};
use crate::{holding, setup};

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
    holding::check_start(&config, &model)?;
    let file = args.file.display().to_string();
    let text = std::fs::read_to_string(&args.file)
        .with_context(|| format!("{file}: cannot read the recording; check the path"))?;
    let options = Options {
        rate_hz: args.rate_hz,
        smooth_s: args.smooth_s,
        start_s: args.start,
        end_s: args.end,
    };
    let imported = demo::import(&file, &text, &model, &options)?;
    imported.warnings.iter().for_each(|warning| eprintln!("warning: {warning}"));

    let csv = imported.csv();
    let demonstration = Demonstration::parse(&args.out.display().to_string(), &csv)?;
    let fit = setup::check_demonstration(&config, &model, &demonstration);
    write_new(&args.out, &csv)?;
    let summary = Summary {
        out: &args.out,
        imported: &imported,
        demonstration: &demonstration,
        misfit: fit.as_ref().err(),
    };
    if args.json {
        print_json(&summary.json())?;
    } else {
        print(&summary.text())?;
    }
    Ok(if fit.is_ok() { Verdict::Done } else { Verdict::Negative })
}
