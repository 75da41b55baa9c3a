//! The policies a cell has imported, kept in step with its folder on disk.

use std::path::{Path, PathBuf};

use shm_types::policy::{PolicyMsg, PolicyName};
use shm_types::policy_json;
use thiserror::Error;

use crate::disk::keeper::{Keeper, Kept, own_folder};
use crate::disk::state_file::{Remember, STATE_FILE, State, StateError, state_text};

/// More policies than anybody compares; a runaway script must not fill the disk.
const MAX_POLICIES: usize = 1000;

/// Why a policy cannot be had or put.
#[derive(Debug, Error)]
pub enum CatalogueError {
    #[error("policy {0} does not exist in this cell: `skillet policy list` shows those that do")]
    Unknown(u64),
    #[error("policy {0} is forbidden in this cell: `skillet policy allow {0}` allows it")]
    Forbidden(u64),
    #[error("no policy has succeeded in this cell yet")]
    NoneGood,
    #[error(
        "the catalogue holds {MAX_POLICIES} policies: remove files from its folder and restart"
    )]
    Full,
}

pub(crate) struct Catalogue {
    dir: Option<PathBuf>,
    keeper: Option<Keeper>,
    /// As read at the start; policies, forbidden and next number are kept up to date.
    state: State,
    pub errors: u64,
}

impl Catalogue {
    /// With what lies in `dir`; without one it lives in memory only.
    pub fn open(dir: Option<&Path>) -> Result<Catalogue, StateError> {
        let mut catalogue = Catalogue {
            dir: dir.map(Path::to_path_buf),
            keeper: None,
            state: State { next_id: 1, ..State::default() },
            errors: 0,
        };
        if let Some(dir) = dir {
            let io = |cause| StateError::Io { path: dir.to_path_buf(), cause };
            own_folder(dir).map_err(io)?;
            catalogue.keeper = Some(Keeper::start().map_err(io)?);
            catalogue.state = State::read(dir)?;
        }
        Ok(catalogue)
    }

    /// What the last run left.
    pub fn left(&self) -> &State {
        &self.state
    }

    pub fn len(&self) -> usize {
        self.state.policies.len()
    }

    pub fn get(&self, id: u64) -> Result<&PolicyMsg, CatalogueError> {
        if self.state.forbidden.contains(&id) {
            return Err(CatalogueError::Forbidden(id));
        }
        self.state.policies.get(&id).ok_or(CatalogueError::Unknown(id))
    }

    /// Adds an admitted policy under a number of its own; one that is there already keeps its
    /// number. Returns the ticket of its writing.
    pub fn import(&mut self, policy: &PolicyMsg) -> Result<Option<u64>, CatalogueError> {
        let id = match self.numbered(policy.digest) {
            known if !known.is_none() => known.policy_id,
            _ if self.len() >= MAX_POLICIES => return Err(CatalogueError::Full),
            _ => self.state.next_id,
        };
        self.state.next_id = self.state.next_id.max(id + 1);
        let policy = PolicyMsg { session: 0, rollout: 0, policy_id: id, ..*policy };
        self.state.policies.insert(id, policy);
        // Admission has validated it, which is all that can fail here.
        let text = policy_json::to_json(&policy).unwrap_or_default();
        tracing::info!(policy = id, "policy imported");
        Ok(self.order(format!("policies/{id}.json"), text))
    }

    /// The policy with this digest, or none.
    pub fn numbered(&self, digest: u64) -> PolicyName {
        let known = self.state.policies.values().find(|known| known.digest == digest);
        known.map_or(PolicyName::NONE, PolicyMsg::name)
    }

    /// The policy of this number, or none.
    pub fn name(&self, id: u64) -> PolicyName {
        self.state.policies.get(&id).map_or(PolicyName::NONE, PolicyMsg::name)
    }

    /// Forbids or allows; returns the policy's digest.
    pub fn forbid(&mut self, id: u64, forbidden: bool) -> Result<u64, CatalogueError> {
        let digest = self.state.policies.get(&id).ok_or(CatalogueError::Unknown(id))?.digest;
        match forbidden {
            true => self.state.forbidden.insert(id),
            false => self.state.forbidden.remove(&id),
        };
        Ok(digest)
    }

    /// Orders the state to be written; returns the ticket.
    pub fn remember(&mut self, remember: Remember) -> Option<u64> {
        self.keeper.as_ref()?;
        let text = state_text(remember, &self.state.forbidden, self.state.next_id);
        self.order(STATE_FILE, text.unwrap_or_default())
    }

    /// Orders `text` to be put into a file of the folder; `None` where nothing is kept.
    pub fn order(&mut self, name: impl AsRef<Path>, text: String) -> Option<u64> {
        match (&mut self.keeper, &self.dir) {
            (Some(keeper), Some(dir)) => Some(keeper.order(dir.join(name), text)),
            _ => None,
        }
    }

    /// Tickets of what has been written, or failed to be.
    pub fn kept(&mut self) -> Option<Kept> {
        let kept = self.keeper.as_ref()?.kept()?;
        if let Err(error) = &kept.result {
            self.errors += 1;
            tracing::error!("state not saved: {error}; free space or fix permissions");
        }
        Some(kept)
    }
}

#[cfg(test)]
mod tests;
