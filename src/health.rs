//! Health of a cell: one word for a monitor, and the reasons for a person.

use std::time::Duration;

use rt_controller::fault::Fault;
use serde::Serialize;
use shm_types::cell::Cell;
use shm_types::command::{PLANT_ABSENT, Status};
use shm_types::telemetry::{ASKS_DEMONSTRATION, WAITS_DISK, WAITS_JUDGE, WAITS_RATING};

/// Controller and learner send ten heartbeats a second; without one for this long they count as silent.
/// Observers that poll twice a second then report it within 2 s.
pub const SILENT: Duration = Duration::from_millis(1500);
/// How long a learner that joins or leaves the cell may be silent, ns.
const MUTE_NS: u64 = 3_000_000_000;
/// A real-time loop without a tick for this long has stopped, ns.
const TICKLESS_NS: u64 = 1_000_000_000;
/// How long a stall degrades the health, ns; it stays counted.
const STALL_SHOWN_NS: u64 = 600_000_000_000;

#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Health {
    Ok,
    /// The cell works, with reduced capability.
    Degraded,
    /// The cell needs attention.
    Bad,
}

impl Health {
    pub fn name(self) -> &'static str {
        match self {
            Health::Ok => "ok",
            Health::Degraded => "degraded",
            Health::Bad => "bad",
        }
    }
}

/// The worst health of all findings.
pub fn level(status: &Status) -> Health {
    of(status, "").0
}

/// The worst health of all findings, and the findings, with commands for the cell of that name.
pub fn of(status: &Status, cell: &str) -> (Health, Vec<String>) {
    let found = findings(status, cell);
    let worst = found.iter().map(|(health, _)| *health).max().unwrap_or(Health::Ok);
    (worst, found.into_iter().map(|(_, why)| why).collect())
}

fn findings(status: &Status, cell: &str) -> Vec<(Health, String)> {
    let mut found = Vec::new();
    if status.latched_fault != 0 {
        let fault = Fault::describe(status.latched_fault as u32);
        found.push((
            Health::Bad,
            format!("the arm is held ({fault}); run `skillet rearm --cell {cell}` to resume"),
        ));
    }
    if status.plant == PLANT_ABSENT {
        let why = "no plant has connected yet: start one; `skillet plant check` tests it";
        found.push((Health::Degraded, why.into()));
    }
    if status.tick_age_ns >= TICKLESS_NS {
        let age = status.tick_age_ns as f64 * 1e-9;
        found.push((Health::Bad, format!("the loop has not ticked for {age:.0} s")));
    }
    if status.spool_full == 1 {
        let why = "the spool is full and learning is paused: start the learner of its episodes";
        found.push((Health::Bad, why.into()));
    }
    if status.state_errors > 0 {
        let why = format!(
            "{} writes to the state folder failed: free space or fix permissions, see the log",
            status.state_errors
        );
        found.push((Health::Degraded, why));
    }
    if status.stall_age_ns < STALL_SHOWN_NS {
        let [last, age] = [status.stall_last_ns, status.stall_age_ns].map(|ns| ns as f64 * 1e-9);
        let why = format!("the loop stalled for {last:.1} s, {age:.0} s ago: see the log");
        found.push((Health::Degraded, why));
    }
    if let Some(why) = silence(status).or_else(|| mute(status)) {
        found.push((Health::Degraded, why));
    }
    if status.learner_waits == WAITS_DISK && has_learner(status) {
        let why = "the learner is waiting for its disk: free space or fix permissions, see its log";
        found.push((Health::Degraded, why.into()));
    }
    if status.is_paced() && status.privileged == 0 {
        let why = "the loop has no real-time priority: run `skillet doctor`";
        found.push((Health::Degraded, why.into()));
    }
    found
}

/// A learner that sent heartbeats sends none any more.
pub fn is_learner_silent(status: &Status) -> bool {
    let age_ns = status.learner_age_ns;
    age_ns != u64::MAX && Duration::from_nanos(age_ns) >= SILENT
}

/// Describes a learner that has become silent, and what the controller does without it.
fn silence(status: &Status) -> Option<String> {
    if !is_learner_silent(status) {
        return None;
    }
    let served = if status.active.is_none() { status.last_good } else { status.active };
    let does = match served.is_none() {
        true => "no policy has succeeded yet, so the arm is held".to_string(),
        false => format!("policy {} is served", served.describe()),
    };
    let silent_s = status.learner_age_ns as f64 / 1e9;
    Some(format!("the learner has been silent for {silent_s:.0} s; {does}"))
}

/// Describes a learner that has joined but never sent a heartbeat.
fn mute(status: &Status) -> Option<String> {
    let mute_ns = status.learner_mute_ns;
    (MUTE_NS..u64::MAX).contains(&mute_ns).then(|| {
        let age = mute_ns as f64 * 1e-9;
        format!("a learner has joined the cell but sent no heartbeat for {age:.0} s: it is resuming or stuck, see its log")
    })
}

/// The offsets of a moved posture, joint by joint.
pub fn posture(status: &Status) -> Option<String> {
    let moved = status.posture.iter().enumerate().filter(|(_, offset)| **offset != 0.0);
    let said: Vec<String> =
        moved.map(|(i, offset)| format!("{offset} rad at joint {}", i + 1)).collect();
    (!said.is_empty()).then(|| said.join(", "))
}

pub fn has_learner(status: &Status) -> bool {
    Duration::from_nanos(status.learner_age_ns) < SILENT
}

/// Intended states worth a line: a pinned policy, a held arm, a learner that waits.
pub fn notes(status: &Status, cell: &str) -> Vec<String> {
    let mut notes = Vec::new();
    let active = if status.active.is_none() { status.last_good } else { status.active };
    let policy = active.describe();
    if status.latched_fault != 0 && has_learner(status) {
        notes.push("learner waits until the arm is re-armed".into());
    } else if status.pinned == 1 && has_learner(status) {
        let unpin = format!("`skillet policy unpin --cell {cell}`");
        notes.push(format!("learner waits: policy {policy} is pinned; run {unpin} to release it"));
    }
    if status.learner_waits == WAITS_JUDGE && has_learner(status) {
        notes.push("learner waits for its judge; see judge.log in the session folder".into());
    }
    if has_learner(status) {
        notes.extend(people(status.learner_waits, cell));
    }
    if let Some(offset) = posture(status) {
        notes.push(format!(
            "the posture of served rollouts is offset by {offset}; run `skillet posture --reset --cell {cell}` to reset it"
        ));
    }
    if status.pin_restored == 1 {
        let served = if status.latched_fault == 0 { "is being" } else { "will be" };
        notes.push(format!(
            "policy {policy} was pinned by an earlier run and {served} served; run `skillet policy pin --cell \
             {cell}` to confirm, or `unpin` or `hold`"
        ));
    }
    notes
}

/// What the learner needs from a person, with the command that provides it.
pub fn people(waits: u64, cell: &str) -> Option<String> {
    let folder = || {
        let folder = Cell::new(cell).ok().and_then(|cell| cell.session());
        folder.map_or("SESSION".into(), |folder| folder.display().to_string())
    };
    match waits {
        WAITS_RATING => {
            Some(format!("learner waits for a rating: run `skillet rate {} 7`", folder()))
        }
        ASKS_DEMONSTRATION => Some(format!(
            "the search is stuck: add a demonstration with `skillet demo add {} file.csv`",
            folder()
        )),
        _ => None,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_worst_finding_decides_and_all_are_named() {
        assert_eq!(
            of(&Status::ZERO, "kitchen"),
            (Health::Ok, Vec::new()),
            "no learner yet is no defect"
        );
        let silent = Status { learner_age_ns: 6_000_000_000, state_errors: 2, ..Status::ZERO };
        let (health, why) = of(&silent, "kitchen");
        assert_eq!((health, why.len()), (Health::Degraded, 2));
        assert!(why[1].contains("silent for 6 s") && why[1].contains("held"), "{why:?}");
        let (health, why) = of(&Status { spool_full: 1, ..silent }, "kitchen");
        assert_eq!(health, Health::Bad);
        assert!(why[0].contains("spool is full"), "{why:?}");
        let (health, why) = of(&Status { latched_fault: 1, ..Status::ZERO }, "kitchen");
        assert_eq!(health, Health::Bad);
        assert!(why[0].contains("skillet rearm"), "{why:?}");
    }

    #[test]
    fn what_stood_still_or_says_nothing_is_not_well() {
        let s = 1_000_000_000;
        let finding = |status| of(&status, "kitchen").1.join("; ");
        let stalled =
            Status { stalls: 1, stall_last_ns: 4 * s, stall_age_ns: 12 * s, ..Status::ZERO };
        assert_eq!(of(&stalled, "kitchen").0, Health::Degraded);
        assert!(finding(stalled).contains("stalled for 4.0 s, 12 s ago"));
        assert_eq!(
            of(&Status { stall_age_ns: 600 * s, ..stalled }, "kitchen").0,
            Health::Ok,
            "an old one"
        );
        assert_eq!(of(&Status { tick_age_ns: 2 * s, ..Status::ZERO }, "kitchen").0, Health::Bad);
        let mute = |learner_mute_ns| Status { learner_mute_ns, ..Status::ZERO };
        assert_eq!(of(&mute(s), "kitchen").0, Health::Ok, "it has just come");
        assert!(finding(mute(9 * s)).contains("no heartbeat for 9 s"));
        let full = Status { learner_waits: WAITS_DISK, learner_age_ns: 0, ..Status::ZERO };
        assert!(finding(full).contains("waiting for its disk"));
    }

    #[test]
    fn who_waits_is_said_with_the_way_out() {
        let pinned = Status { pinned: 1, ..Status::ZERO };
        assert!(notes(&pinned, "c1").is_empty(), "nobody waits");
        let waits = notes(&Status { learner_age_ns: 0, ..pinned }, "c1");
        assert_eq!(waits.len(), 1);
        assert!(waits[0].contains("learner waits") && waits[0].contains("unpin --cell c1"));
        let held = Status { latched_fault: 1, learner_age_ns: 0, ..pinned };
        assert_eq!(notes(&held, "c1"), ["learner waits until the arm is re-armed"]);
        assert!(notes(&Status { pin_restored: 1, ..pinned }, "c1")[0].contains("an earlier run"));
        let judged = Status { learner_waits: WAITS_JUDGE, learner_age_ns: 0, ..Status::ZERO };
        assert!(notes(&judged, "c1")[0].contains("waits for its judge"));
        assert_eq!(of(&judged, "kitchen").0, Health::Ok, "it is no defect");
        let moved = Status { posture: [0.4, 0.0, -0.2, 0.0, 0.0, 0.0, 0.0], ..Status::ZERO };
        let said = &notes(&moved, "c1")[0];
        assert!(said.contains("0.4 rad at joint 1, -0.2 rad at joint 3"), "{said}");
        assert!(said.contains("skillet posture --reset --cell c1"), "{said}");
        for (waits, word) in [
            (WAITS_RATING, "skillet rate SESSION"),
            (ASKS_DEMONSTRATION, "skillet demo add SESSION"),
        ] {
            let asks = Status { learner_waits: waits, ..judged };
            assert!(notes(&asks, "nobody-here")[0].contains(word));
            assert_eq!(of(&asks, "kitchen").0, Health::Ok);
        }
    }
}
