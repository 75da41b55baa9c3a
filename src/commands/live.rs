//! `skillet policy import | activate | pin | …`: the policies of a running cell.

use std::time::{Duration, SystemTime, UNIX_EPOCH};

use anyhow::{Context, Result, bail};
use rt_controller::disk::state_file::State;
use rt_controller::rt::now_ns;
use serde_json::json;
use shm_types::command::{
    AT_NEXT_ROLLOUT, AT_NOW, COMMAND_ACTIVATE, COMMAND_IMPORT, COMMAND_ROLLBACK, Command, LAST_GOOD,
};
use shm_types::policy::PolicyMsg;
use shm_types::random_id;

use crate::Verdict;
use crate::cell::{NamedCell, through};
use crate::cli::AtArg;
use crate::output::{print, print_json};
use crate::{fields, health};

/// Timeouts of a command that takes effect immediately, and of one that may wait for a rollout and an approach.
const SOON: Duration = Duration::from_secs(5);
const NEXT_ROLLOUT: Duration = Duration::from_secs(60);

/// Number of the last good policy, on the command line.
const LAST_GOOD_WORD: &str = "last-good";

/// A command with a unique id.
fn command(kind: u64) -> Command {
    Command::new(kind, random_id())
}

pub fn import(cell: &NamedCell, policy: PolicyMsg, as_json: bool) -> Result<Verdict> {
    let (reply, _) = cell.request(&Command { policy, ..command(COMMAND_IMPORT) }, SOON)?;
    let (id, digest) = (reply.policy.policy_id, reply.policy.digest);
    if as_json {
        print_json(&json!({
            "policy_id": id, "policy_digest": fields::id(digest), "via": reply.via(),
        }))?;
    } else {
        let name = cell.cell.name();
        print(&format!(
            "policy {id} admitted{}; run `skillet policy activate {id} --cell {name}` to use it\n",
            through(&reply)
        ))?;
    }
    Ok(Verdict::Done)
}

pub fn activate(cell: &NamedCell, id: &str, at: AtArg, as_json: bool) -> Result<Verdict> {
    let policy_id = if id == LAST_GOOD_WORD { LAST_GOOD } else { number(id)? };
    swap(cell, Command { policy_id, ..command(COMMAND_ACTIVATE) }, at, as_json)
}

pub fn rollback(cell: &NamedCell, at: AtArg, as_json: bool) -> Result<Verdict> {
    swap(cell, command(COMMAND_ROLLBACK), at, as_json)
}

/// A number of the cell's catalogue.
pub fn number(id: &str) -> Result<u64> {
    match id.parse() {
        Ok(id) if id > 0 => Ok(id),
        _ => bail!(
            "policy '{id}': give its number, as in `skillet policy list`, or {LAST_GOOD_WORD}"
        ),
    }
}

fn swap(cell: &NamedCell, command: Command, at: AtArg, as_json: bool) -> Result<Verdict> {
    let (at, timeout) = match at {
        AtArg::Now => (AT_NOW, SOON),
        AtArg::NextRollout => (AT_NEXT_ROLLOUT, NEXT_ROLLOUT),
    };
    let (reply, sent_ns) = cell.request(&Command { at, ..command }, timeout)?;
    let age = Duration::from_nanos(now_ns().saturating_sub(reply.applied_ns));
    let applied = (SystemTime::now() - age).duration_since(UNIX_EPOCH)?;
    let latency_ms = fields::ms(reply.applied_ns.saturating_sub(sent_ns));
    if as_json {
        print_json(&json!({
            "policy": fields::policy(&reply.policy),
            "applied_tick": reply.applied_tick,
            "applied_monotonic_ns": reply.applied_ns,
            "applied_unix_s": applied.as_secs_f64(),
            "latency_ms": latency_ms,
            "pinned": reply.status.pinned == 1,
            "via": reply.via(),
        }))?;
    } else {
        let (policy, tick) = (reply.policy.describe(), reply.applied_tick);
        // The clock is that of another machine: what is known is when the reply came.
        let at_most = if reply.via().is_some() { "at most " } else { "" };
        print(&format!(
            "policy {policy} applied at tick {tick}, {at_most}{latency_ms:.2} ms after the request{}\n",
            through(&reply)
        ))?;
        if reply.status.pinned == 1 {
            let name = cell.cell.name();
            print(&format!(
                "it is pinned; learners wait until `skillet policy unpin --cell {name}`\n"
            ))?;
        } else if health::has_learner(&reply.status) {
            let name = cell.cell.name();
            print(&format!(
                "a learner is running, and its rollouts come first; `skillet policy pin --cell {name}` keeps \
                 this policy\n"
            ))?;
        }
    }
    Ok(Verdict::Done)
}

/// Sends a command that changes what is served, and prints what is served now.
pub fn change(cell: &NamedCell, kind: u64, policy_id: u64, as_json: bool) -> Result<Verdict> {
    let (reply, _) = cell.request(&Command { policy_id, ..command(kind) }, SOON)?;
    let status = &reply.status;
    let (active, good) = (status.active.describe(), status.last_good.describe());
    if as_json {
        print_json(&json!({
            "active_policy": fields::policy(&status.active),
            "pinned": status.pinned == 1,
            "last_good_policy": fields::policy(&status.last_good),
            "via": reply.via(),
        }))?;
    } else {
        let pinned =
            if status.pinned == 1 { "pinned" } else { "not pinned: learners take precedence" };
        let through = through(&reply);
        print(&format!("active policy {active} ({pinned}); last good policy {good}{through}\n"))?;
    }
    Ok(Verdict::Done)
}

/// The catalogue lies where the controller is.
fn expect_here(cell: &NamedCell) -> Result<()> {
    if let Some(host) = cell.via() {
        let name = cell.cell.name();
        bail!(
            "the policies of cell '{name}' are on {host}, behind a bridge: run the command there"
        );
    }
    Ok(())
}

/// Lists the catalogue on disk; needs no controller.
pub fn list(cell: &NamedCell, as_json: bool) -> Result<Verdict> {
    expect_here(cell)?;
    let dir = cell.state_dir();
    let state = State::read(&dir)?;
    let digest = |policy: &Option<PolicyMsg>| policy.map(|policy| policy.digest);
    let (active, good) = (digest(&state.active), digest(&state.last_good));
    let remarks = |policy: &PolicyMsg| -> Vec<&str> {
        let is = |digest| digest == Some(policy.digest);
        let all = [
            (is(active), "active"),
            (is(active) && state.pinned, "pinned"),
            (is(good), "last good"),
            (state.forbidden.contains(&policy.policy_id), "forbidden"),
        ];
        all.iter().filter(|(is, _)| *is).map(|(_, remark)| *remark).collect()
    };
    if as_json {
        let row = |policy: &PolicyMsg| {
            json!({
                "policy_id": policy.policy_id,
                "policy_digest": fields::id(policy.digest),
                "components": policy.n_components,
                "systems": policy.n_systems,
                "task_dim": policy.task_dim,
                "duration_s": fields::short(json!(policy.duration_s)),
                "remarks": remarks(policy),
            })
        };
        let rows: Vec<_> = state.policies.values().map(row).collect();
        print_json(&json!({
            "state_dir": dir,
            "active_policy": state.active.map(|active| fields::policy(&active.name())),
            "pinned": state.pinned,
            "last_good_policy": state.last_good.map(|good| fields::policy(&good.name())),
            "policies": rows,
        }))?;
        return Ok(Verdict::Done);
    }
    if state.policies.is_empty() && state.last_good.is_none() {
        let name = cell.cell.name();
        print(&format!(
            "no policy in cell '{name}' ({}) yet; run `skillet policy import`\n",
            dir.display()
        ))?;
        return Ok(Verdict::Done);
    }
    let mut text = "policy  components  coordinates  duration s\n".to_string();
    for policy in state.policies.values() {
        let PolicyMsg { policy_id, task_dim, duration_s, .. } = policy;
        let n_components = policy.n_components + policy.n_systems;
        let remarks = remarks(policy).join(", ");
        text += &format!(
            "{policy_id:6}  {n_components:10}  {task_dim:11}  {duration_s:10.2}  {remarks}\n"
        );
    }
    if let Some(good) = state.last_good.filter(|good| good.session != 0) {
        text += &format!("last good: policy {}\n", good.name().describe());
    }
    print(&text)?;
    Ok(Verdict::Done)
}

/// Reads a policy from the cell's folder, by its number or as the last good one.
pub fn stored(cell: &NamedCell, id: &str) -> Result<PolicyMsg> {
    expect_here(cell)?;
    let dir = cell.state_dir();
    let state = State::read(&dir)?;
    let name = cell.cell.name();
    if id == LAST_GOOD_WORD {
        return state
            .last_good
            .with_context(|| format!("cell '{name}' ({}) has no good policy yet", dir.display()));
    }
    state.policies.get(&number(id)?).copied().with_context(|| {
        format!(
            "policy {id} does not exist in cell '{name}' ({}); `skillet policy list --cell {name}` \
             shows those that do",
            dir.display()
        )
    })
}
