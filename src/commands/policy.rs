//! `skillet policy`: the policies of a session; those of a cell are in `live`.

use std::path::Path;

use anyhow::{Context, Result, bail};
use learner::judge::Declared;
use learner::store::{Store, TrialRecord};
use serde_json::json;
use shm_types::command::{COMMAND_ALLOW, COMMAND_FORBID, COMMAND_PIN, COMMAND_UNPIN, LAST_GOOD};
use shm_types::measures::TRUTH;
use shm_types::policy::{ACTIVATION_DECAY, ACTIVATION_STATE, OUTPUT_VELOCITY, PolicyMsg};
use shm_types::policy_json;

use super::stored::open;
use super::{live, modes, repertoire};
use crate::Verdict;
use crate::cell::NamedCell;
use crate::cli::{CellArgs, ChoiceArgs, FormatArg, PolicyArgs, PolicyVerb};
use crate::fields;
use crate::output::{print, print_json};
use crate::policy_file;
use crate::session_folder::SessionFolder;

pub fn run(args: &PolicyArgs) -> Result<Verdict> {
    match &args.verb {
        PolicyVerb::List { session: Some(session), best, json, .. } => {
            list(&store(session)?, *best, *json)
        }
        PolicyVerb::List { session: None, json, cell, .. } => {
            live::list(&NamedCell::of(cell)?, *json)
        }
        PolicyVerb::Modes { session, prefer, json } => modes::list(session, *prefer, *json),
        PolicyVerb::Forbid { policy, json, cell } => match policy.as_slice() {
            [session, mode] => modes::forbid(Path::new(session), mode, *json),
            policy => live::change(&NamedCell::of(cell)?, COMMAND_FORBID, only(policy)?, *json),
        },
        PolicyVerb::Allow { policy, json, cell } => match policy.as_slice() {
            [session, mode] => modes::allow(Path::new(session), mode, *json),
            policy => live::change(&NamedCell::of(cell)?, COMMAND_ALLOW, only(policy)?, *json),
        },
        PolicyVerb::Export { from, choice, format, cell } => {
            let policy = match (Path::new(from).is_dir(), &choice.wish) {
                (true, _) => chosen(Path::new(from), choice)?,
                (false, Some(_)) => bail!("--where: {from} is not the folder of a session"),
                (false, None) => live::stored(&NamedCell::of(cell)?, from)?,
            };
            print(&match format {
                FormatArg::Json => format!("{}\n", policy_json::to_json(&policy)?),
                FormatArg::Toml => policy_file::to_toml(&policy)?,
            })?;
            Ok(Verdict::Done)
        }
        PolicyVerb::Show { policy, json, cell } => show(&one(policy, cell)?, *json),
        PolicyVerb::Import { from, id, choice, json, cell } => {
            let policy = match (from.is_dir(), id, &choice.wish) {
                (true, Some(id), _) => of_session(from, *id)?,
                (true, None, _) => chosen(from, choice)?,
                (false, _, Some(_)) => {
                    bail!("--where: {} is not the folder of a session", from.display())
                }
                (false, ..) => policy_file::read(from)?,
            };
            live::import(&NamedCell::of(cell)?, policy, *json)
        }
        PolicyVerb::Activate { id, at, json, cell } => {
            live::activate(&NamedCell::of(cell)?, id, *at, *json)
        }
        PolicyVerb::Rollback { at, json, cell } => {
            live::rollback(&NamedCell::of(cell)?, *at, *json)
        }
        PolicyVerb::Pin { json, cell } => {
            live::change(&NamedCell::of(cell)?, COMMAND_PIN, LAST_GOOD, *json)
        }
        PolicyVerb::Unpin { json, cell } => {
            live::change(&NamedCell::of(cell)?, COMMAND_UNPIN, LAST_GOOD, *json)
        }
    }
}

/// The policy of a session for a wish, else of one of its modes.
fn chosen(session: &Path, choice: &ChoiceArgs) -> Result<PolicyMsg> {
    match &choice.wish {
        Some(wish) => repertoire::answer(session, wish),
        None => modes::answer(session, choice.prefer, choice.mode),
    }
}

/// The number of a policy in a cell, when no session stands before it.
fn only(policy: &[String]) -> Result<u64> {
    live::number(policy.first().map_or("", String::as_str))
}

fn store(session: &Path) -> Result<Store> {
    let folder = SessionFolder::open(session)?;
    open(folder.dir(), &folder.database())
}

fn list(store: &Store, best: Option<usize>, as_json: bool) -> Result<Verdict> {
    let mut trials = store.trials()?;
    if let Some(n) = best {
        trials.sort_by(|a, b| b.reward.total_cmp(&a.reward).then(a.rollout.cmp(&b.rollout)));
        trials.truncate(n);
    }
    if as_json {
        let rows: Vec<_> = trials.iter().map(row).collect();
        print_json(&json!({ "policies": rows }))?;
        return Ok(Verdict::Done);
    }
    let is_action = store.meta().learner.action.is_used();
    print(&table(&trials, &store.meta().measures, is_action))?;
    Ok(Verdict::Done)
}

/// Measures that a line has room for.
const SHOWN: usize = 6;

/// One line a trial, of its measures the first ones.
fn table(trials: &[TrialRecord], measures: &Declared, is_action: bool) -> String {
    let shown = &measures[..measures.len().min(SHOWN)];
    let mut text = "policy  rollout    reward  success".to_string();
    for (name, _) in shown {
        text += &format!("  {name:>9}");
    }
    text += if is_action { "  action\n" } else { "  applied at tick\n" };
    for trial in trials {
        let success = if trial.success { "yes" } else { "no" };
        let (id, rollout, reward) = (trial.policy_id, trial.rollout, trial.reward);
        text += &format!("{id:6}  {rollout:7}  {reward:8.5}  {success:7}");
        for (name, unit) in shown {
            let value = match trial.measures.get(name) {
                Some(value) if unit == TRUTH => if value != 0.0 { "yes" } else { "no" }.into(),
                Some(value) => format!("{value:.3}"),
                None => "–".into(),
            };
            text += &format!("  {value:>0$}", name.chars().count().max(9));
        }
        let action: Vec<String> = trial.theta.iter().map(|x| format!("{x:.4}")).collect();
        let last = if is_action { action.join(" ") } else { trial.applied_tick.to_string() };
        text += &format!("  {last}\n");
    }
    text
}

fn row(trial: &TrialRecord) -> serde_json::Value {
    let measures = trial.measures.iter();
    let measures = measures.map(|one| (one.name.to_string(), fields::measure(&one)));
    json!({
        "policy_id": trial.policy_id,
        "rollout": trial.rollout,
        "reward": trial.reward,
        "success": trial.success,
        "applied_tick": trial.applied_tick,
        "fault_code": trial.fault,
        "measures": measures.collect::<std::collections::BTreeMap<_, _>>(),
    })
}

/// One policy: of a session, or of a cell.
fn one(policy: &[String], cell: &CellArgs) -> Result<PolicyMsg> {
    match policy {
        [session, id] => {
            let id = id.parse().with_context(|| format!("policy '{id}': give its number"))?;
            of_session(Path::new(session), id)
        }
        [id, ..] => live::stored(&NamedCell::of(cell)?, id),
        [] => unreachable!("clap wants one or two"),
    }
}

fn of_session(session: &Path, id: u64) -> Result<PolicyMsg> {
    let policy = store(session)?.policy(id)?;
    policy.with_context(|| format!("policy {id}: not in this session; see `skillet policy list`"))
}

fn show(policy: &PolicyMsg, as_json: bool) -> Result<Verdict> {
    if as_json {
        let text: serde_json::Value = serde_json::from_str(&policy_json::to_json(policy)?)?;
        let (policy_id, rollout) = (policy.policy_id, policy.rollout);
        print_json(&json!({ "policy_id": policy_id, "rollout": rollout, "policy": text }))?;
    } else {
        print(&as_text(policy))?;
    }
    Ok(Verdict::Done)
}

/// Task coordinates with their units.
const NAMES: [&str; 6] = ["x m", "y m", "z m", "pitch rad", "roll rad", "yaw rad"];

fn as_text(policy: &PolicyMsg) -> String {
    if policy.n_actions > 0 {
        let (id, rollout) = (policy.policy_id, policy.rollout);
        return format!("policy {id} of rollout {rollout}: action {:?}\n", policy.actions());
    }
    if policy.n_systems > 0 {
        return systems_as_text(policy);
    }
    let d = policy.task_dim as usize;
    let driven = if policy.activation == ACTIVATION_DECAY { "decay" } else { "time" };
    let damping = match policy.damping_ratio {
        0.0 => format!("damping {:.2} /s", policy.damping),
        ratio => format!("dampers that follow the stiffness, ratio {ratio:.2}"),
    };
    let mut text = format!(
        "policy {} of rollout {}: {d} coordinates, {} components driven by {driven}, {} s, \
         {damping}\n",
        policy.policy_id, policy.rollout, policy.n_components, policy.duration_s
    );
    for (i, component) in policy.components().iter().enumerate() {
        text += &format!("\ncomponent {} at {:.3}\n", i + 1, component.center);
        for (row, name) in NAMES.iter().enumerate().take(d) {
            let stiffness: Vec<String> =
                (0..d).map(|c| format!("{:9.2}", component.stiffness_at(row, c))).collect();
            let attractor = component.attractor[row];
            text += &format!("  {name:9} {attractor:8.4}   K {} /s²\n", stiffness.join(" "));
        }
    }
    text
}

fn systems_as_text(policy: &PolicyMsg) -> String {
    let d = policy.task_dim as usize;
    let driven = match policy.activation {
        ACTIVATION_STATE => "the state",
        ACTIVATION_DECAY => "decay",
        _ => "time",
    };
    let output = match policy.output {
        OUTPUT_VELOCITY => format!("velocities, followed at {:.1} /s", policy.following),
        _ => "accelerations".into(),
    };
    let mut text = format!(
        "policy {} of rollout {}: {d} coordinates, {} systems driven by {driven}, {} s, {output}\n",
        policy.policy_id, policy.rollout, policy.n_systems, policy.duration_s
    );
    let numbers = |values: &[f64]| -> String {
        values
            .iter()
            .map(|value| format!("{value:9.4} "))
            .collect::<String>()
            .trim_end()
            .to_string()
    };
    text += &format!("target {}\n", numbers(&policy.target));
    for (i, system) in policy.systems().iter().enumerate() {
        let center = numbers(&system.center[..policy.drive_dim()]);
        text += &format!("\nsystem {} at {center}\n", i + 1);
        for (row, name) in NAMES.iter().enumerate().take(d) {
            let entries: Vec<f64> = (0..d).map(|c| system.of_position_at(row, c)).collect();
            text += &format!("  {name:9} A {}   b {:9.4}\n", numbers(&entries), system.offset[row]);
        }
    }
    text
}
