//! `skillet demo`: demonstrations from recordings, and for sessions.

use std::io::ErrorKind;

use anyhow::{Context, Result, bail};
use learner::Demonstration;
use physics::arm::{ArmModel, kinematics};

use crate::Verdict;
use crate::cli::demo::{AddArgs, DemoArgs, DemoVerb, ImportArgs};
use crate::config::Config;
use crate::demo::{self, Effort, Options, Summary};
use crate::output::{print, print_json, write};
use crate::session_folder::SessionFolder;
use crate::stderr::say;
use crate::{fields, holding, people, robots, setup};

pub fn run(args: &DemoArgs) -> Result<Verdict> {
    match &args.verb {
        DemoVerb::Import(args) => import(args),
        DemoVerb::Add(args) => add(args),
    }
}

/// Adds a demonstration that the session's arm can follow.
fn add(args: &AddArgs) -> Result<Verdict> {
    let folder = SessionFolder::open(&args.session)?;
    let config = Config::load(Some(&folder.config_path()))?;
    let file = args.file.display().to_string();
    if !config.has_arm() {
        bail!("{}: its task has no arm and takes no demonstration", args.session.display());
    }
    let text = std::fs::read_to_string(&args.file)
        .with_context(|| format!("{file}: cannot read the demonstration; check the path"))?;
    let demonstration = Demonstration::parse(&file, &text)?;
    let model = setup::arm(&config)?;
    setup::check_followed(&config, &model, &demonstration)?;
    setup::check_as_long(&demonstration, &setup::demonstrations(&config)?[0])?;
    let answer = people::show(&folder, &args.file, text)?;
    if args.json {
        print_json(&answer.json())?;
    } else {
        print(&format!("{file}: {}\n", answer.sentence()))?;
    }
    Ok(Verdict::Done)
}

fn import(args: &ImportArgs) -> Result<Verdict> {
    let (out, is_taken) = (args.out.display(), args.out.exists() && !args.force);
    if is_taken {
        bail!("{out}: already exists: choose another name, or overwrite it with --force");
    }
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
    let bytes = match (std::fs::read(&args.file), robots::demonstration(&args.file)) {
        (Err(error), Some(text)) if error.kind() == ErrorKind::NotFound => text.into(),
        (bytes, _) => {
            bytes.with_context(|| format!("{file}: cannot read the recording; check the path"))?
        }
    };
    let q0 = config.plant.start_posture();
    let options = Options {
        rate_hz: args.rate_hz,
        smooth_s: args.smooth_s,
        start_s: args.start,
        end_s: args.end,
        slow: args.slow,
        at_start: args.at_start.then(|| kinematics::tip_pose(&model, &q0)),
        columns: args.columns.clone(),
        orientation: config.learner.orientation,
    };
    let imported = demo::import(&file, &bytes, &model, &options)?;
    imported.warnings.iter().for_each(|warning| say(&format!("warning: {warning}")));

    let csv = imported.csv();
    let demonstration = Demonstration::parse(&args.out.display().to_string(), &csv)?;
    let effort = setup::check_demonstration(&config, &model, &demonstration)
        .and_then(|()| Effort::of(&model, &q0, &demonstration));
    let too_fast = effort.as_ref().ok().filter(|effort| !effort.is_within_limits()).map(|effort| {
        let slow = slow_enough(&file, &bytes, &config, &model, &options, effort);
        let as_recorded_s = demonstration.duration_s() / options.slow;
        let remedy = setup::too_long(&config, as_recorded_s, slow).unwrap_or_else(|| {
            format!(
                "convert it with --slow {slow}, slow enough for its limits; --smooth-s takes noise out of a \
                 recording"
            )
        });
        effort.excess(demonstration.file(), &remedy)
    });
    let misfit = effort.as_ref().err().or(too_fast.as_ref());
    write(&args.out, &csv)?;
    let summary = Summary {
        out: &args.out,
        imported: &imported,
        demonstration: &demonstration,
        effort: effort.as_ref().ok(),
        misfit,
    };
    if args.json {
        print_json(&fields::short(summary.json()))?;
    } else {
        print(&summary.text())?;
    }
    Ok(if misfit.is_none() { Verdict::Done } else { Verdict::Negative })
}

/// A factor for --slow with which the arm can follow. Samples of a slower movement show more of it, so
/// each factor is tried, as long as the movement is not too slow to be a demonstration.
fn slow_enough(
    file: &str,
    bytes: &[u8],
    config: &Config,
    model: &ArmModel,
    options: &Options,
    effort: &Effort,
) -> f64 {
    let mut options = options.clone();
    let mut slower = effort.slower();
    for _ in 0..10 {
        // One decimal is enough to type.
        options.slow = (10.0 * options.slow * slower).ceil() / 10.0;
        let effort = demo::import(file, bytes, model, &options).and_then(|imported| {
            let demonstration = Demonstration::parse(file, &imported.csv())?;
            Effort::of(model, &config.plant.start_posture(), &demonstration)
        });
        match effort {
            Ok(effort) if !effort.is_within_limits() => slower = effort.slower(),
            _ => break,
        }
    }
    options.slow
}
