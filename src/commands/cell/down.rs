//! `skillet cell down`: stops learner and controller, and waits for their clean end.

use std::path::PathBuf;
use std::time::{Duration, Instant};

use anyhow::{Context, Result, bail};
use serde_json::json;
use shm_types::cell::{Cell, Holder, Role, runtime_dir};

use super::short;
use crate::Verdict;
use crate::cli::cell::DownArgs;
use crate::output::{print, print_json};

/// How long a service may take to end: longer than any write, reply or rollout it finishes.
const PATIENCE: Duration = Duration::from_secs(30);
const LOOK: Duration = Duration::from_millis(100);

pub fn run(args: &DownArgs) -> Result<Verdict> {
    let cell = super::named(&args.name)?;
    let session = cell.session().filter(|_| cell.has(Role::Learner));
    let others = other_cells(&cell);
    let mut stopped = Vec::new();
    if others.is_empty() {
        stopped.extend(stop(&cell, Role::Learner)?);
    }
    stopped.extend(stop(&cell, Role::Controller)?);
    cell.remove_if_idle();
    if args.json {
        let rows = stopped.iter().map(|(role, pid)| json!({ "role": role.name(), "pid": pid }));
        print_json(&json!({
            "cell": cell.name(),
            "stopped": rows.collect::<Vec<_>>(),
            "learner_left_for": others,
            "session": session,
        }))?;
    } else {
        print(&text(&cell, &stopped, &others, session))?;
    }
    Ok(Verdict::Done)
}

/// Other cells with a controller in which the learner of `cell` works as well.
fn other_cells(cell: &Cell) -> Vec<String> {
    let Some(learner) = cell.holder(Role::Learner) else { return Vec::new() };
    let works_in = |other: &Cell| {
        other.has(Role::Controller)
            && other.holder(Role::Learner).is_some_and(|holder| holder.pid() == learner.pid())
    };
    let all = Cell::all_in(&runtime_dir()).into_iter();
    let others = all.filter(|other| other.name() != cell.name() && works_in(other));
    others.map(|other| other.name().to_string()).collect()
}

/// Ends the process that plays `role`; `None` if there is none.
fn stop(cell: &Cell, role: Role) -> Result<Option<(Role, u32)>> {
    let Some(holder) = cell.holder(role) else {
        // A check of the lock by another process holds it for an instant.
        std::thread::sleep(LOOK);
        if cell.has(role) && cell.holder(role).is_none() {
            bail!(
                "the {} of cell '{}' cannot be seen from here: stop it where it runs, for example in its \
                 container",
                role.name(),
                cell.name()
            );
        }
        return Ok(None);
    };
    let pid = holder.pid();
    holder.terminate().with_context(|| format!("stopping the {}, process {pid}", role.name()))?;
    if !has_ended(&holder) {
        bail!(
            "the {} of cell '{}', process {pid}, has not ended within {} s: see its log; `kill -9 {pid}` ends \
             it without a loss",
            role.name(),
            cell.name(),
            PATIENCE.as_secs()
        );
    }
    Ok(Some((role, pid)))
}

fn has_ended(holder: &Holder) -> bool {
    let deadline = Instant::now() + PATIENCE;
    while Instant::now() < deadline {
        // A signal ends a wait early.
        if holder.ends_within(LOOK) {
            return true;
        }
    }
    false
}

fn text(
    cell: &Cell,
    stopped: &[(Role, u32)],
    others: &[String],
    session: Option<PathBuf>,
) -> String {
    let mut text = String::new();
    for (role, pid) in stopped {
        text += &format!("{:<11} stopped, process {pid}\n", role.name());
    }
    if let Some(session) = session.filter(|_| others.is_empty()) {
        text +=
            &format!("session     {}, resumed by `skillet cell up`\n", short(&session).display());
    }
    if !others.is_empty() {
        text += &format!("learner     left running: it also works in {}\n", others.join(", "));
    }
    if text.is_empty() {
        text = format!("nothing runs in cell '{}'\n", cell.name());
    }
    text
}
