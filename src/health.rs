//! Is the cell well? One word for a monitor, and the reasons for a person.

use std::time::Duration;

use rt_controller::fault::Fault;
use serde::Serialize;
use shm_types::command::Status;

/// Controller and learner beat ten times a second; who was not heard for so long is silent. It is said
/// within 2 s, by observers that look twice a second, too.
pub const SILENT: Duration = Duration::from_millis(1500);

#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Health {
    Ok,
    /// It goes on, with less than it should have.
    Degraded,
    /// Something waits for a person.
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

/// The worst of all findings, and what was found.
pub fn of(status: &Status) -> (Health, Vec<String>) {
    let found = findings(status);
    let worst = found.iter().map(|(health, _)| *health).max().unwrap_or(Health::Ok);
    (worst, found.into_iter().map(|(_, why)| why).collect())
}

fn findings(status: &Status) -> Vec<(Health, String)> {
    let mut found = Vec::new();
    if status.latched_fault != 0 {
        let fault = Fault::describe(status.latched_fault as u32);
        found.push((Health::Bad, format!("the arm is held ({fault}) until `skillet rearm`")));
    }
    if status.spool_full == 1 {
        let why =
            "the spool is full and learning pauses: start the learner that its episodes wait for";
        found.push((Health::Bad, why.into()));
    }
    if status.state_errors > 0 {
        let why = format!(
            "{} writes to the state folder failed: free space or mend permissions, see the log",
            status.state_errors
        );
        found.push((Health::Degraded, why));
    }
    if let Some(why) = silence(status) {
        found.push((Health::Degraded, why));
    }
    if status.realtime == 1 && status.privileged == 0 {
        let why = "the loop has no real-time priority: see `skillet doctor`";
        found.push((Health::Degraded, why.into()));
    }
    found
}

/// A learner that was there and is silent, and what the controller does without it.
fn silence(status: &Status) -> Option<String> {
    let age_ns = status.learner_age_ns;
    if age_ns == u64::MAX || Duration::from_nanos(age_ns) < SILENT {
        return None;
    }
    let served = if status.active.is_none() { status.last_good } else { status.active };
    let does = match served.is_none() {
        true => "no policy is good yet, so the arm is held".to_string(),
        false => format!("policy {} is at hand", served.describe()),
    };
    Some(format!("the learner is silent for {:.0} s; {does}", age_ns as f64 * 1e-9))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_worst_finding_decides_and_all_are_named() {
        assert_eq!(of(&Status::ZERO), (Health::Ok, Vec::new()), "no learner yet is no defect");
        let silent = Status { learner_age_ns: 6_000_000_000, state_errors: 2, ..Status::ZERO };
        let (health, why) = of(&silent);
        assert_eq!((health, why.len()), (Health::Degraded, 2));
        assert!(why[1].contains("silent for 6 s") && why[1].contains("held"), "{why:?}");
        let (health, why) = of(&Status { spool_full: 1, ..silent });
        assert_eq!(health, Health::Bad);
        assert!(why[0].contains("spool is full"), "{why:?}");
        let (health, why) = of(&Status { latched_fault: 1, ..Status::ZERO });
        assert_eq!(health, Health::Bad);
        assert!(why[0].contains("skillet rearm"), "{why:?}");
    }
}
