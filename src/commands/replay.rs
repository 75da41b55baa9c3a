//! `skillet replay`: a trial again, from the store alone, compared with what was stored.

use std::path::{Path, PathBuf};

use anyhow::{Context, Result, bail};
use learner::store::{Store, TrialRecord};
use physics::action::{ActionWorld, Landscape};
use physics::outcome::OutcomeConfig;
use physics::pancake::PancakePlant;
use rt_controller::run::Controlled;
use rt_controller::simulate::simulate;
use serde_json::json;
use shm_types::episode::{EpisodeHeader, MAX_RECORDS, OutcomeMsg, TickRecord};
use shm_types::policy::PolicyMsg;

use super::report::{best, open};
use crate::Verdict;
use crate::bar::bar;
use crate::cli::record::ReplayArgs;
use crate::config::Config;
use crate::output::{print, print_json};
use crate::record::recorder::Limits;
use crate::record::session::SessionRecorder;
use crate::session_folder::SessionFolder;
use crate::{record, setup};

pub fn run(args: &ReplayArgs) -> Result<Verdict> {
    let folder = SessionFolder::open(&args.session)?;
    let config = Config::load(Some(&folder.config_path()))?;
    let store = open(folder.dir(), &folder.database())?;
    let trials = store.trials()?;
    if args.all {
        return all(&store, &config, &trials, args.json);
    }
    let rollout = args.trial.unwrap_or_else(|| best(&trials));
    let trial = trials.iter().find(|trial| trial.rollout == rollout).with_context(|| {
        format!("{}: has no trial {rollout}, but 1..={}", args.session.display(), trials.len())
    })?;
    if !trial.was_executed() {
        bail!(
            "trial {rollout} was not executed: it was refused or set aside, see `skillet trials`"
        );
    }
    let replayed = replay(&store, &config, trial)?;
    let default = || folder.dir().join(format!("replay-{rollout}.mcap"));
    let path = write(&config, trial, &replayed, &args.out.clone().unwrap_or_else(default))?;
    let is_same = replayed.is_same(trial);
    if args.json {
        print_json(&json!({ "trial": rollout, "identical": is_same, "recording": path }))?;
    } else {
        let verdict = if is_same { "identical, bit for bit" } else { "DIFFERENT" };
        print(&format!("trial {rollout}: {verdict}\n{}\n", path.display()))?;
    }
    Ok(if is_same { Verdict::Done } else { Verdict::Negative })
}

fn all(store: &Store, config: &Config, trials: &[TrialRecord], as_json: bool) -> Result<Verdict> {
    let bar = bar(Some(trials.len() as u64));
    let mut different = Vec::new();
    let mut executed = 0;
    // What was not executed has nothing to be compared with.
    for trial in bar.wrap_iter(trials.iter().filter(|trial| trial.was_executed())) {
        executed += 1;
        if !replay(store, config, trial)?.is_same(trial) {
            different.push(trial.rollout);
        }
    }
    bar.finish_and_clear();
    if as_json {
        print_json(&json!({ "trials": executed, "different": different }))?;
    } else {
        print(&format!("{executed} trials replayed, {} different\n", different.len()))?;
        for rollout in &different {
            print(&format!("  trial {rollout}\n"))?;
        }
    }
    Ok(if different.is_empty() { Verdict::Done } else { Verdict::Negative })
}

/// A trial that was executed again.
struct Replayed {
    policy: PolicyMsg,
    outcome: OutcomeMsg,
    fault: u64,
    records: Vec<TickRecord>,
    period_ns: u64,
}

impl Replayed {
    fn is_same(&self, trial: &TrialRecord) -> bool {
        let bits = |outcome: &OutcomeMsg| outcome.fields().map(|(_, value)| value.to_bits());
        bits(&self.outcome) == bits(&trial.outcome)
            && self.outcome.flags == trial.outcome.flags
            && self.fault == trial.fault
            && self.records.len() as u64 == trial.n_records
    }
}

fn replay(store: &Store, config: &Config, trial: &TrialRecord) -> Result<Replayed> {
    let policy = store.policy(trial.policy_id)?.with_context(|| {
        format!("the store lacks policy {} of trial {}", trial.policy_id, trial.rollout)
    })?;
    match config.task.name.as_str() {
        "landscape" => act(&Landscape, policy),
        "skittles" => act(&config.task.skittles(), policy),
        _ => flip(config, policy),
    }
}

fn flip(config: &Config, policy: PolicyMsg) -> Result<Replayed> {
    let model = setup::arm(config)?;
    let q0 = config.plant.start_posture();
    let world = config.plant.world(config.controller.period_s());
    let mut plant = PancakePlant::new(&model, &q0, &world);
    let outcome = OutcomeConfig { pan_radius: world.pan_radius, ..OutcomeConfig::default() };
    let mut controlled = Controlled { model: &model, plant: &mut plant, q0, outcome };
    let mut records = vec![TickRecord::ZERO; MAX_RECORDS];
    let done = simulate(&mut controlled, &config.controller, &policy, &mut records)?;
    records.truncate(done.n_records);
    let period_ns = config.controller.period_ns() * config.controller.record_stride() as u64;
    let (outcome, fault) = (done.outcome, done.fault);
    Ok(Replayed { policy, outcome, fault, records, period_ns })
}

fn act(world: &impl ActionWorld, policy: PolicyMsg) -> Result<Replayed> {
    let Some((value, records)) = rt_controller::executor::action::replay(world, &policy) else {
        bail!("policy {} is not admitted any more", policy.policy_id);
    };
    let outcome = OutcomeMsg { value, ..OutcomeMsg::ZERO };
    Ok(Replayed {
        policy,
        outcome,
        fault: 0,
        records,
        period_ns: rt_controller::executor::action::PERIOD_NS,
    })
}

fn write(
    config: &Config,
    trial: &TrialRecord,
    replayed: &Replayed,
    path: &Path,
) -> Result<PathBuf> {
    let header = EpisodeHeader {
        session: replayed.policy.session,
        rollout: trial.rollout,
        policy_id: trial.policy_id,
        policy_digest: replayed.policy.digest,
        period_ns: replayed.period_ns,
        n_records: replayed.records.len() as u64,
        fault: replayed.fault,
        outcome: replayed.outcome,
        ..EpisodeHeader::default()
    };
    let limits = Limits { max_bytes: u64::MAX, by_rollout: false, object_always: true };
    let attachments = record::attachments(config)?;
    let mut recorder = SessionRecorder::new(record::scribe(config)?, path, limits, attachments)?;
    recorder.executed(&replayed.policy, &header, &replayed.records)?;
    let mut files = recorder.finish()?;
    Ok(files.swap_remove(0))
}
