//! `skillet convert`: a recording, or a trial run again, as a ROS 2 bag.

use std::path::{Path, PathBuf};

use anyhow::{Result, bail};
use serde_json::json;

use super::replay::{Again, chosen};
use super::stored::open;
use crate::Verdict;
use crate::cli::convert::ConvertArgs;
use crate::config::Config;
use crate::fields;
use crate::output::{print, print_json};
use crate::record::messages::{Measures, Outcome, Policy, Trial};
use crate::ros2::bag::{Bag, Contents};
use crate::ros2::conversion::Conversion;
use crate::ros2::recording;
use crate::ros2::robot::{Robot, Scope};
use crate::session_folder::SessionFolder;
use crate::setup;

pub fn run(args: &ConvertArgs) -> Result<Verdict> {
    let is_session = args.input.is_dir();
    let (bag, is_same) = if is_session { session(args)? } else { (recording(args)?, true) };
    let (seconds, n_messages) =
        (fields::seconds(bag.duration_ns), bag.messages.values().sum::<u64>());
    if args.json {
        let mut object = json!({
            "bag": bag.folder, "duration_s": seconds, "messages": n_messages, "topics": bag.messages,
            "bytes": bag.bytes,
        });
        if is_session {
            object["identical"] = is_same.into();
        }
        print_json(&object)?;
    } else {
        let differs = if is_same { "" } else { ", DIFFERENT from the stored trial" };
        let megabytes = bag.bytes as f64 * 1e-6;
        let folder = bag.folder.display();
        print(&format!(
            "{folder}\n{seconds:.1} s, {n_messages} messages, {megabytes:.1} MB{differs}\n"
        ))?;
    }
    Ok(if is_same { Verdict::Done } else { Verdict::Negative })
}

fn recording(args: &ConvertArgs) -> Result<Contents> {
    let path = &args.input;
    if !path.exists() {
        bail!("{}: no such recording or session; check the path", path.display());
    }
    if path.extension().is_none_or(|extension| extension != "mcap") {
        bail!(
            "{}: neither a session folder nor a recording NAME.mcap; a recording still called .mcap.part is \
             being written, or is completed by the next `skillet record` into its folder",
            path.display()
        );
    }
    if args.trial.is_some() {
        bail!("--trial needs a session, but {} is a recording", path.display());
    }
    let stem = path.file_stem().unwrap_or_default().to_string_lossy();
    let beside = || path.with_file_name(format!("{stem}-ros2"));
    recording::convert(path, &args.out.clone().unwrap_or_else(beside), args.force)
}

/// Runs a trial again and converts it; says also whether it came out as stored.
fn session(args: &ConvertArgs) -> Result<(Contents, bool)> {
    let folder = SessionFolder::open(&args.input)?;
    let config = Config::load(Some(&folder.config_path()))?;
    let store = open(folder.dir(), &folder.database())?;
    let trials = store.trials()?;
    let trial = chosen(&args.input, &store, &trials, args.trial)?;
    let inside = || folder.dir().join(format!("trial-{}-ros2", trial.rollout));
    let out: PathBuf = args.out.clone().unwrap_or_else(inside);
    let mut conversion = begin(&config, &out, args.force)?;
    let replayed = Again::of(&store, &config)?.replay(trial)?;

    let policy = &replayed.policy;
    let mut at_ns = 0;
    conversion.policy(&Policy::from(policy), at_ns)?;
    let scope = Scope { n_learnt: policy.task_dim as usize, has_object: true };
    for (i, record) in replayed.records.iter().enumerate() {
        at_ns = i as u64 * replayed.period_ns;
        conversion.tick(record, scope, at_ns)?;
    }
    conversion.outcome(&Outcome::from(&replayed.header(trial)), at_ns)?;
    let told = Trial {
        session: policy.session,
        rollout: trial.rollout,
        policy_digest: policy.digest,
        reward: trial.reward,
        success: trial.success,
        set_aside: trial.set_aside,
        fault: trial.fault,
    };
    conversion.trial(&told, at_ns)?;
    conversion.measures(&Measures::of(&told, &trial.measures), at_ns)?;
    Ok((conversion.finish()?, replayed.is_same(trial)))
}

fn begin(config: &Config, out: &Path, force: bool) -> Result<Conversion<Bag>> {
    let urdf = config.has_arm().then(|| setup::arm_text(config)).transpose()?;
    let robot = urdf.map(|urdf| Robot::new(config, urdf)).transpose()?;
    Conversion::to_bag(out, force, robot)
}
