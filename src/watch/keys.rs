//! Keys of the terminal view: each runs a command of the tool on its own thread.

use std::sync::mpsc::{Receiver, Sender, channel};

use shm_types::cell::Cell;

use super::action::Action;

/// What the bottom line asks.
#[derive(Clone, Debug, PartialEq)]
pub enum Prompt {
    None,
    /// Number of the policy to activate, as typed so far.
    Number(String),
    /// A rating from 0 to 10, as typed so far.
    Rating(String),
    /// An action that wants a second key.
    Sure(Action),
}

/// Runs actions and collects their results.
pub struct Keys {
    cell: Cell,
    said: Sender<String>,
    says: Receiver<String>,
}

impl Keys {
    pub fn new(cell: &Cell) -> Keys {
        let (said, says) = channel();
        Keys { cell: cell.clone(), said, says }
    }

    /// `newest` is the newest rollout that is shown.
    pub fn send(&self, action: Action, newest: Option<u64>) {
        let (cell, said) = (self.cell.clone(), self.said.clone());
        std::thread::spawn(move || {
            let answer = action.carry_out(&cell, newest).unwrap_or_else(|refusal| refusal);
            // The receiver may be gone; nobody needs the reply then.
            let _ = said.send(answer);
        });
    }

    /// Results of earlier actions.
    pub fn answers(&self) -> impl Iterator<Item = String> {
        self.says.try_iter()
    }
}
