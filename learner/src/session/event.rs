//! What the session loop tells, and how it ends.

use std::time::Duration;

use shm_types::channel::ChannelError;
use shm_types::episode::{EpisodeHeader, TickRecord};
use shm_types::policy::PolicyMsg;
use thiserror::Error;

use crate::cells::Odd;
use crate::error::LearnerError;
use crate::learner::Taken;
use crate::modes::ModeReport;
use crate::summary::{Summary, TrialReport};

/// What an observer may want to know.
#[derive(Debug)]
pub enum Event<'a> {
    /// A rollout that was learnt from, as it was executed, before its trial is told.
    Executed {
        policy: &'a PolicyMsg,
        header: &'a EpisodeHeader,
        records: &'a [TickRecord],
    },
    Trial {
        cell: &'a str,
        report: &'a TrialReport,
    },
    /// What the search has found: now and then, and at the end.
    Modes(&'a [ModeReport]),
    /// The cell has a controller, and is asked for rollouts from now on.
    Joined {
        cell: &'a str,
    },
    /// The cell has had no controller so far; it is waited for.
    NoController {
        cell: &'a str,
    },
    /// Nothing was heard from the controller for this long; the learner waits.
    ControllerSilent {
        cell: &'a str,
        silence: Duration,
    },
    ControllerBack {
        cell: &'a str,
    },
    /// The controller serves a pinned policy, and what was asked for waits; or does no more.
    Pinned {
        cell: &'a str,
        is_pinned: bool,
    },
    /// The arm is held after this fault of the machine, and what was asked for waits until it is
    /// re-armed; or, 0, it no longer is.
    Held {
        cell: &'a str,
        fault: u64,
    },
    /// The cell let this rollout lie; another one is asked for it.
    LeftToOthers {
        cell: &'a str,
        rollout: u64,
    },
    /// Its controller has another task or arm than the session: it is asked for nothing.
    OtherWorld {
        cell: &'a str,
        found: String,
        wanted: String,
    },
    /// Its controller has the task and the arm of the session again.
    SameWorld {
        cell: &'a str,
    },
    /// Its plant is not the `other` one, which cell `of`, perhaps itself, had so far.
    OtherPlant {
        cell: &'a str,
        plant: String,
        of: String,
        other: String,
    },
    /// Its rollouts differ from those of the other cells.
    Odd(&'a Odd),
    /// The cell is asked for nothing more until its controller is a new one.
    Retired {
        cell: &'a str,
        reason: String,
    },
    /// The rollout gave no usable episode: stored and counted, not learnt.
    SetAside {
        rollout: u64,
        reason: String,
    },
    /// The controller refused the policy: a trial without reward.
    Refused {
        rollout: u64,
        reason: String,
    },
    /// Learning waits for somebody to rate this rollout.
    AwaitsRating {
        rollout: u64,
    },
    /// People have said something of rollouts, or shown another movement.
    Said {
        taken: &'a [Taken],
        /// The summary of the trials as they count now, before proposal `next`.
        summary: &'a Summary,
        next: u64,
    },
    /// The search stands still and asks for a demonstration, or does no more.
    StandsStill(bool),
    /// The disk refuses what was learnt or asked; tried again until it does not.
    NotStored(String),
    Stored,
    /// The rollout was asked for again.
    AskedAgain {
        cell: &'a str,
        rollout: u64,
        reason: String,
    },
}

impl<'a> Event<'a> {
    /// The event of a checked episode.
    pub(super) fn executed(
        policy: &'a PolicyMsg,
        header: &'a EpisodeHeader,
        records: &'a [TickRecord],
    ) -> Event<'a> {
        let records = &records[..records.len().min(header.n_records as usize)];
        Event::Executed { policy, header, records }
    }
}

/// How the loop ended without an error.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum End {
    /// All rollouts are done.
    Done,
    /// `stop` was set; everything told so far is stored.
    Stopped,
}

#[derive(Debug, Error)]
pub enum SessionError {
    #[error(transparent)]
    Learner(#[from] LearnerError),
    #[error(transparent)]
    Channel(#[from] ChannelError),
    #[error(
        "rollout {rollout} was not executed in {attempts} attempts: {reason}; everything before it \
         is saved"
    )]
    NotExecuted { rollout: u64, attempts: u32, reason: String },
    #[error(
        "{rollouts} rollouts in a row, up to {last}, gave no usable episode: {reason}; everything \
         is saved, fix the controller and resume"
    )]
    Unusable { rollouts: u32, last: u64, reason: String },
    #[error(
        "{rollouts} rollouts in a row, up to {last}, were executed but not judged; the last one: \
         {reason}; everything is saved; fix the judge and start another session, or resume if it is a \
         program, or see `skillet judge SESSION --config FILE`"
    )]
    NoneJudged { rollouts: u64, last: u64, reason: String },
    #[error(
        "the controller refused the policy of rollout {rollout}, which is the demonstration itself: \
         {reason}; change the demonstration, or the setting that the reason names"
    )]
    StartRefused { rollout: u64, reason: String },
    #[error(
        "the controller refused the policies of {rollouts} rollouts in a row, up to {last}; the last \
         one: {reason}; everything is saved; change the setting that the reason names and resume, or \
         explore less in a new session"
    )]
    AllRefused { rollouts: u64, last: u64, reason: String },
    #[error(
        "policy of rollout {rollout} cannot be published ({reason}); restart learner and controller"
    )]
    Publish { rollout: u64, reason: String },
}
