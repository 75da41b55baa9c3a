//! What a controller leaves on disk for its next start, and for those who look at it.
//!
//! ```text
//! <state>/policies/<id>.json    one imported policy, written once
//! <state>/state.json            active, pinned, last good, forbidden, latched fault
//! ```

use std::collections::{BTreeMap, BTreeSet};
use std::fs;
use std::path::{Path, PathBuf};

use serde::{Deserialize, Serialize};
use shm_types::command::LAST_GOOD;
use shm_types::policy::{PolicyMsg, PolicyName};
use shm_types::policy_json::{self, PolicyJsonError};
use thiserror::Error;

use crate::executor::latch::Latched;
use crate::fault::Fault;

pub(crate) const STATE_FILE: &str = "state.json";
const FORMAT: u32 = 1;

/// Why a state folder cannot be used.
#[derive(Debug, Error)]
pub enum StateError {
    #[error("{path}: {cause}: check permissions, or set cell.state_dir to another folder")]
    Io { path: PathBuf, cause: std::io::Error },
    #[error("{path}: {reason}: restore it, or move it away and restart")]
    Broken { path: PathBuf, reason: String },
}

/// A state folder as it was left. Nothing of it is admitted yet.
#[derive(Debug, Default)]
pub struct State {
    pub policies: BTreeMap<u64, PolicyMsg>,
    pub forbidden: BTreeSet<u64>,
    pub active: Option<PolicyMsg>,
    pub last_good: Option<PolicyMsg>,
    pub pinned: bool,
    pub latched: Option<Latched>,
    /// Numbers from here on were never given.
    pub(crate) next_id: u64,
}

/// What to remember.
#[derive(Clone, Copy)]
pub(crate) struct Remember<'a> {
    pub active: Option<PolicyName>,
    pub last_good: Option<&'a PolicyMsg>,
    pub pinned: bool,
    pub latched: Option<Latched>,
}

#[derive(Debug, Default, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct StateFile {
    format: u32,
    next_id: u64,
    /// Number in the catalogue; [`LAST_GOOD`] for the policy below.
    active: Option<u64>,
    pinned: bool,
    forbidden: BTreeSet<u64>,
    last_good: Option<GoodFile>,
    /// Absent in files of a controller before there was a latch.
    latched: Option<LatchedFile>,
}

#[derive(Debug, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct LatchedFile {
    fault: u32,
    since_unix_s: u64,
}

#[derive(Debug, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct GoodFile {
    session: u64,
    rollout: u64,
    policy_id: u64,
    policy: serde_json::Value,
}

impl State {
    /// Reads the folder; an absent one is empty. A policy that cannot be read is left out with a
    /// warning: it does not take the others with it.
    pub fn read(dir: &Path) -> Result<State, StateError> {
        let mut state = State { next_id: 1, ..State::default() };
        state.read_policies(&dir.join("policies"));
        let path = dir.join(STATE_FILE);
        let text = match fs::read_to_string(&path) {
            Ok(text) => text,
            Err(error) if error.kind() == std::io::ErrorKind::NotFound => return Ok(state),
            Err(cause) => return Err(StateError::Io { path, cause }),
        };
        let broken = |reason| StateError::Broken { path: path.clone(), reason };
        let file = StateFile::parse(&text).map_err(broken)?;
        if let Some(good) = &file.last_good {
            let message = good.message().map_err(|error| broken(format!("last_good: {error}")))?;
            state.last_good = Some(message);
        }
        state.active = match file.active {
            Some(LAST_GOOD) => state.last_good,
            Some(id) => state.policies.get(&id).copied(),
            None => None,
        };
        state.next_id = state.next_id.max(file.next_id);
        if let Some(LatchedFile { fault, since_unix_s }) = file.latched {
            let known = Fault::latching(fault);
            let fault = known.ok_or_else(|| broken(format!("latched: no fault {fault}")))?;
            state.latched = Some(Latched { fault, since_unix_s });
        }
        (state.pinned, state.forbidden) = (file.pinned, file.forbidden);
        Ok(state)
    }

    fn read_policies(&mut self, dir: &Path) {
        let Ok(entries) = fs::read_dir(dir) else { return };
        for path in entries.flatten().map(|entry| entry.path()) {
            let stem = path.file_stem().and_then(|stem| stem.to_str());
            let id = stem.and_then(|stem| stem.parse::<u64>().ok()).filter(|id| *id > 0);
            let Some(id) = id.filter(|_| path.extension().is_some_and(|e| e == "json")) else {
                continue;
            };
            self.next_id = self.next_id.max(id + 1);
            let text = fs::read_to_string(&path).map_err(|error| error.to_string());
            let policy = text.and_then(|text| {
                policy_json::from_json(&text).map_err(|error: PolicyJsonError| error.to_string())
            });
            match policy {
                Ok(policy) => {
                    self.policies.insert(id, PolicyMsg { policy_id: id, ..policy });
                }
                Err(error) => tracing::warn!("{}: {error}; left out", path.display()),
            }
        }
    }
}

/// The text of a state file.
pub(crate) fn state_text(
    remember: Remember,
    forbidden: &BTreeSet<u64>,
    next_id: u64,
) -> Result<String, serde_json::Error> {
    let file = StateFile {
        format: FORMAT,
        next_id,
        // A session's policy is not in the catalogue: only the good one is kept.
        active: remember.active.map(|p| if p.session == 0 { p.policy_id } else { LAST_GOOD }),
        pinned: remember.pinned,
        forbidden: forbidden.clone(),
        last_good: remember.last_good.and_then(|good| GoodFile::of(good).ok()),
        latched: remember.latched.map(|latched| LatchedFile {
            fault: latched.fault as u32,
            since_unix_s: latched.since_unix_s,
        }),
    };
    serde_json::to_string_pretty(&file)
}

impl StateFile {
    fn parse(text: &str) -> Result<StateFile, String> {
        let state: StateFile = serde_json::from_str(text).map_err(|error| error.to_string())?;
        if state.format != FORMAT {
            return Err(format!("format {} instead of {FORMAT}", state.format));
        }
        Ok(state)
    }
}

impl GoodFile {
    fn of(good: &PolicyMsg) -> Result<GoodFile, PolicyJsonError> {
        let policy = serde_json::from_str(&policy_json::to_json(good)?)?;
        let PolicyMsg { session, rollout, policy_id, .. } = *good;
        Ok(GoodFile { session, rollout, policy_id, policy })
    }

    fn message(&self) -> Result<PolicyMsg, PolicyJsonError> {
        let policy = policy_json::from_json(&self.policy.to_string())?;
        let GoodFile { session, rollout, policy_id, .. } = *self;
        Ok(PolicyMsg { session, rollout, policy_id, ..policy })
    }
}
