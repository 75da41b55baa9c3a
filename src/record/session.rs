//! Records what a learner learns from: every rollout with its policy, outcome, trial and mixture.
//!
//! Nothing is lost on this way, at any pace, and it is a function of the session: time counts from the
//! first rollout, one after the other. What only the loop knows, its timing, is not in it.

use std::path::Path;
use std::time::Duration;

use anyhow::Result;
use learner::modes::ModeReport;
use learner::summary::TrialReport;
use shm_types::episode::{EpisodeHeader, TickRecord};
use shm_types::policy::PolicyMsg;
use shm_types::telemetry::TelemetryTick;

use super::messages::{Measures, Mixture, Trial};
use super::recorder::{Attachment, Limits, Recorder};
use super::scribe::Scribe;

/// Between two rollouts.
const GAP: Duration = Duration::from_millis(500);

pub struct SessionRecorder {
    recorder: Recorder,
    /// Session of the last recorded rollout.
    session: u64,
    policy_digest: u64,
}

impl SessionRecorder {
    /// Records into `path`, or the first free name after it.
    pub fn new(
        scribe: Scribe,
        path: &Path,
        limits: Limits,
        attachments: Vec<Attachment>,
    ) -> Result<SessionRecorder> {
        let recorder = Recorder::new(scribe, path, limits, attachments)?;
        Ok(SessionRecorder { recorder, session: 0, policy_digest: 0 })
    }

    /// One rollout as it was executed.
    pub fn executed(
        &mut self,
        policy: &PolicyMsg,
        header: &EpisodeHeader,
        records: &[TickRecord],
    ) -> Result<()> {
        (self.session, self.policy_digest) = (policy.session, policy.digest);
        let start_ns = match self.recorder.scribe().now_ns() {
            0 => 0,
            end => end + GAP.as_nanos() as u64,
        };
        self.recorder.scribe().set_now(start_ns);
        self.recorder.begin_rollout()?;
        self.recorder.scribe().policy(policy);
        let mut at_ns = start_ns;
        for record in records {
            let (record, policy_digest) = (*record, policy.digest);
            let tick = TelemetryTick { record, policy_digest, ..TelemetryTick::ZERO };
            self.recorder.tick(&tick, at_ns)?;
            at_ns += header.period_ns;
        }
        self.recorder.scribe().outcome(header);
        self.recorder.keep()
    }

    pub fn trial(&mut self, report: &TrialReport) {
        let trial = Trial::new(self.session, self.policy_digest, report);
        self.recorder.scribe().trial(&trial);
        self.recorder.scribe().measures(&Measures::of(&trial, &report.measures));
    }

    pub fn modes(&mut self, reports: &[ModeReport]) {
        self.recorder.scribe().mixture(&Mixture::from(reports));
    }

    pub fn finish(self) -> Result<Vec<std::path::PathBuf>> {
        self.recorder.finish()
    }
}
