//! What both ends of a bridge say of themselves, for a log.

use std::fmt;

/// Something that happened.
#[derive(Clone, Debug, PartialEq)]
pub enum Event {
    /// The hub serves these cells there. It takes anybody if nothing is encrypted.
    Serves { address: String, cells: String, is_encrypted: bool },
    /// A bridge has joined as this cell, with a controller behind it or without.
    Joined { cell: String, host: String },
    /// The bridge of this cell is gone, or silent.
    Left { cell: String, host: String, why: &'static str },
    /// A turn was refused; said on both sides in the same words.
    Refused { cell: String, reason: String },
    /// An episode was handed to the learner, or was there already.
    HandedIn { cell: String, session: u64, rollout: u64 },
    /// What the cell's machine does not do as it should.
    Trouble { cell: String, reason: String },
    /// This bridge is connected, and its learner's machine answers.
    Connected { address: String },
    /// There is no answer; the controller goes on alone until there is one.
    NoAnswer { address: String, reason: String },
    /// The learner has asked this cell for a rollout.
    Asked { session: u64, rollout: u64 },
    /// The learner holds an episode of this cell.
    Durable { session: u64, rollout: u64 },
    /// The learner works on another session. The episode stays in the spool.
    Foreign { session: u64, rollout: u64, asks: u64 },
    /// The learner's machine answers, but no learner works in this cell there; or one does again.
    Learner { cell: String, is_there: bool },
    /// The cell has a controller, or another one.
    Controller { cell: String },
    /// A command of the learner's machine, and how it ended; said on both sides.
    Command { cell: String, what: &'static str, outcome: Result<(), String> },
    /// Somebody on the learner's machine looks at the loop of the cell, or nobody any more.
    Watched { cell: String, is_watched: bool },
}

impl Event {
    /// It needs somebody's attention.
    pub fn is_warning(&self) -> bool {
        matches!(
            self,
            Event::Left { .. }
                | Event::Refused { .. }
                | Event::Trouble { .. }
                | Event::NoAnswer { .. }
                | Event::Foreign { .. }
                | Event::Learner { is_there: false, .. }
                | Event::Command { outcome: Err(_), .. }
                | Event::Serves { is_encrypted: false, .. }
        )
    }
}

impl fmt::Display for Event {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Event::Serves { address, cells, is_encrypted: true } => {
                write!(f, "listening on {address} for cells {cells}, with mutual TLS")
            }
            Event::Serves { address, cells, is_encrypted: false } => write!(
                f,
                "listening on {address} for cells {cells}, without keys: this machine only, any process on it"
            ),
            Event::Joined { cell, host } => write!(f, "cell {cell}: joined from {host}"),
            Event::Left { cell, host, why } => {
                write!(
                    f,
                    "cell {cell}: its bridge on {host} {why}; its learner waits or uses other cells"
                )
            }
            Event::Refused { cell, reason } => write!(f, "cell {cell}: refused: {reason}"),
            Event::HandedIn { cell, session, rollout } => {
                write!(f, "cell {cell}: rollout {rollout} of session {session:016x} handed in")
            }
            Event::Trouble { cell, reason } => write!(f, "cell {cell}: {reason}"),
            Event::Connected { address } => write!(f, "connected to the learner at {address}"),
            Event::NoAnswer { address, reason } => write!(
                f,
                "no answer from the learner at {address}: {reason}; the controller continues \
                 alone; finished episodes wait in its spool"
            ),
            Event::Asked { session, rollout } => {
                write!(f, "asked for rollout {rollout} of session {session:016x}")
            }
            Event::Durable { session, rollout } => {
                write!(f, "rollout {rollout} of session {session:016x} is durable")
            }
            Event::Foreign { session, rollout, asks } => write!(
                f,
                "rollout {rollout} belongs to session {session:016x}, but the learner works on {asks:016x}: kept in \
                 the spool until a learner resumes its session"
            ),
            Event::Learner { cell, is_there: true } => {
                write!(f, "cell {cell}: learner connected")
            }
            Event::Learner { cell, is_there: false } => write!(
                f,
                "cell {cell}: no learner works in it, its session may have ended; finished \
                 episodes wait in its spool"
            ),
            Event::Controller { cell } => write!(f, "cell {cell}: controller connected"),
            Event::Command { cell, what, outcome: Ok(()) } => {
                write!(f, "cell {cell}: `{what}` through the bridge: done")
            }
            Event::Command { cell, what, outcome: Err(reason) } => {
                write!(f, "cell {cell}: `{what}` through the bridge: {reason}")
            }
            Event::Watched { cell, is_watched: true } => {
                write!(f, "cell {cell}: its loop is watched through the bridge")
            }
            Event::Watched { cell, is_watched: false } => {
                write!(f, "cell {cell}: no observer is left on the bridge")
            }
        }
    }
}
