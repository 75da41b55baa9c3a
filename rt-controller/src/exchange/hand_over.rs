//! Rollouts on their way to the loop and back: handing over, results, and replies.

use std::sync::Arc;

use shm_types::channel::EpisodeLoan;
use shm_types::episode::{Ack, EpisodeHeader};
use shm_types::measures::Measures;
use shm_types::policy::{PolicyMsg, PolicyName};
use shm_types::text;

use crate::disk::spool::{Spool, Spooled};
use crate::exchange::serving::Next;
use crate::exchange::swap::Served;
use crate::exchange::{Exchange, InFlight};
use crate::executor::recording::Recording;
use crate::fault::Fault;
use crate::rings::{Done, Job, PostureOrder};

impl<P: Clone + PartialEq> Exchange<'_, P> {
    /// Receives the loop's replies on swaps, and replies to the commands.
    pub(crate) fn take_applied(&mut self) {
        while let Ok(applied) = self.ends.applied.pop() {
            self.active = true;
            let torn = self.serving.torn;
            let Some(policy) = self.serving.applied(&applied) else { continue };
            if self.serving.torn > torn {
                tracing::error!(
                    policy = policy.policy_id,
                    "the policy in the loop differs from the one sent"
                );
            }
            if let (true, Some(in_flight)) = (applied.in_rollout, &mut self.in_flight) {
                in_flight.swapped |= in_flight.served.name() != policy;
            }
            (self.in_loop, self.applied_tick) = (policy, applied.tick);
            tracing::info!(policy = policy.policy_id, tick = applied.tick, "policy applied");
            self.answer_applied(&applied, policy);
            self.remember();
        }
    }

    pub(crate) fn take_done(&mut self) {
        while let Ok(done) = self.ends.done.pop() {
            self.active = true;
            // What the loop applied before this rollout ended must be known first.
            self.take_applied();
            let Some(in_flight) = self.in_flight.take() else {
                tracing::error!("received an episode that was not requested; dropped");
                continue;
            };
            let Recording { n_records, applied_tick, .. } = done.recording;
            if n_records > 0 && !in_flight.swapped {
                (self.in_loop, self.applied_tick) = (in_flight.served.name(), applied_tick);
            }
            if in_flight.is_proposal {
                self.rollouts += 1;
                self.proposal_ended(in_flight, done);
            } else {
                self.served += 1;
                self.service_ended(&in_flight, &done);
            }
        }
    }

    fn proposal_ended(&mut self, in_flight: InFlight<P>, mut done: Done) {
        let name = in_flight.served.name();
        // Whatever happened after a swap is not the proposal's doing.
        let is_swapped = in_flight.swapped && !done.fault.latches();
        let fault = if is_swapped { Fault::Swapped } else { done.fault };
        let header = self.header_of(&name, &done, fault);
        *done.episode.user_header_mut() = header;
        let _ = self.ports.outcomes.send_copy(header);
        if fault != Fault::None {
            let why = Fault::describe(fault as u32);
            tracing::info!(rollout = name.rollout, "rollout ended early: {why}");
        }
        if in_flight.swapped && done.fault.blames_policy() {
            self.fault_in_service(&name, done.fault);
        }
        self.to_judge = Some(in_flight.served.message).filter(|_| fault == Fault::None);
        match &mut self.spool {
            // A proposal that is no trial is asked for again, whatever it did.
            Some(spool) if fault != Fault::Swapped && !fault.latches() => {
                spool.store(name, done.episode)
            }
            _ => self.send(name, done.episode),
        }
    }

    /// A learner has made trials durable; of the newest it says whether it was a success.
    pub(crate) fn take_acknowledged(&mut self, ack: &Ack) {
        if let Some(spool) = &mut self.spool {
            spool.acknowledged(ack);
        }
        let is_it = |message: &mut PolicyMsg| {
            (message.session, message.rollout) == (ack.session, ack.rollout)
        };
        if let Some(message) = self.to_judge.take_if(is_it)
            && ack.success != 0
        {
            self.to_prove = Some(message);
        }
    }

    /// A proposal that succeeded becomes the last good policy, if it passes what every served policy
    /// must: it ran as an experiment, without the dry run. While nothing else is to be done.
    pub(crate) fn prove(&mut self) {
        let Some(message) = self.to_prove.take() else { return };
        self.active = true;
        match (self.setup.admit_to_serve)(&message) {
            Ok((policy, n_records)) => {
                self.serving.proved_itself(Arc::new(Served { message, policy, n_records }));
                self.remember();
            }
            Err(error) => {
                let rollout = message.rollout;
                tracing::debug!(rollout, "succeeded, but cannot be served: {error}");
            }
        }
    }

    /// Sends spooled episodes, and also those that could not be written: the learner may still
    /// receive them.
    pub(crate) fn take_spooled(&mut self) {
        while let Some(Spooled { name, episode, result }) =
            self.spool.as_mut().and_then(Spool::spooled)
        {
            self.active = true;
            if let Err(error) = result {
                self.catalogue.errors += 1;
                tracing::error!("episode not spooled: {error}; free space or fix permissions");
            }
            self.send(name, episode);
        }
    }

    fn service_ended(&mut self, in_flight: &InFlight<P>, done: &Done) {
        let name = in_flight.served.name();
        let _ = self.ports.outcomes.send_copy(self.header_of(&name, done, done.fault));
        if let Some(seq) = self.serving.abandon() {
            self.answer_abandoned(seq, name, Fault::describe(done.fault as u32));
            return;
        }
        match done.fault {
            Fault::None => {
                // One with a swap in it proves neither policy.
                if !in_flight.swapped && self.serving.served_rollout_ended(&name, false) {
                    self.remember();
                }
            }
            fault if fault.blames_policy() => self.fault_in_service(&name, fault),
            fault => {
                tracing::warn!("served rollout ended early: {}", Fault::describe(fault as u32));
            }
        }
    }

    /// A policy that was not a learner's proposal led to a fault.
    fn fault_in_service(&mut self, name: &PolicyName, fault: Fault) {
        let why = Fault::describe(fault as u32);
        let active = self.serving.active().map_or(*name, |active| active.name());
        if self.serving.served_rollout_ended(name, true) {
            self.remember();
        }
        match self.serving.served() {
            Some(good) => tracing::error!(
                "fault under policy {}: {why}; back to the last good policy, {}",
                active.describe(),
                good.name().describe()
            ),
            None => tracing::error!(
                "fault under policy {}: {why}; no good policy to fall back to, the arm is held",
                active.describe()
            ),
        }
    }

    fn header_of(&self, name: &PolicyName, done: &Done, fault: Fault) -> EpisodeHeader {
        EpisodeHeader {
            applied_tick: done.recording.applied_tick,
            applied_ns: done.recording.applied_ns,
            n_records: done.recording.n_records as u64,
            fault: fault as u64,
            measures: checked(&done.measures),
            ..self.header(name)
        }
    }

    fn header(&self, name: &PolicyName) -> EpisodeHeader {
        EpisodeHeader {
            boot_id: self.boot_id,
            session: name.session,
            rollout: name.rollout,
            policy_id: name.policy_id,
            policy_digest: name.digest,
            period_ns: self.setup.record_ns,
            equipment: self.setup.equipment(),
            ..EpisodeHeader::default()
        }
    }

    fn send(&mut self, name: PolicyName, episode: EpisodeLoan) {
        self.link.reported(name);
        match episode.send() {
            Ok(0) => tracing::warn!(
                rollout = name.rollout,
                "no learner received the episode; it will request the rollout again"
            ),
            Ok(_) => {
                let _ = self.ports.episode_sent.notify();
            }
            Err(error) => tracing::warn!(
                rollout = name.rollout,
                "episode not delivered ({error:?}); the learner will request the rollout again"
            ),
        }
    }

    /// Hands the next rollout to the loop, with memory for its records.
    pub(crate) fn hand_over(&mut self) {
        if self.in_flight.is_some() || self.latched.is_some() {
            return;
        }
        let alone = self.setup.alone_after.is_some_and(|after| self.link.is_absent(after));
        let learner_waits = self.link.proposal.is_some() && !self.must_pause();
        match self.serving.next(learner_waits, alone) {
            Next::Nothing => {}
            Next::Serve(served, swap) => {
                let n_records = served.n_records;
                match self.loan(n_records) {
                    Some(episode) => self.start(served, episode, swap, false),
                    None => self.serving.not_handed_over(swap),
                }
            }
            Next::Learner => self.hand_over_proposal(),
        }
    }

    /// The spool is full: no further proposal is executed, unless it lies there already.
    fn must_pause(&mut self) -> bool {
        let (Some(spool), Some(proposal)) = (&mut self.spool, &self.link.proposal) else {
            return false;
        };
        spool.asked_by(proposal.session);
        spool.is_full() && !spool.holds(&proposal.name())
    }

    /// Sends a refusal as an episode without records.
    fn hand_over_proposal(&mut self) {
        let Some(message) = self.link.proposal.take() else { return };
        let name = message.name();
        if self.spool.as_ref().is_some_and(|spool| spool.is_writing(&name)) {
            return; // it will be sent in a moment
        }
        if let Some((header, records)) = self.spool.as_mut().and_then(|spool| spool.find(&name)) {
            let Some(mut episode) = self.loan(records.len()) else {
                self.link.proposal = Some(message);
                return;
            };
            *episode.user_header_mut() = header;
            episode.payload_mut()[..records.len()].copy_from_slice(&records);
            tracing::info!(rollout = name.rollout, "episode resent from the spool");
            self.send(name, episode);
            return;
        }
        let admitted = (self.setup.admit)(&message);
        let n_records = admitted.as_ref().map_or(1, |(_, n_records)| *n_records);
        let Some(mut episode) = self.loan(n_records) else {
            self.link.proposal = Some(message);
            return;
        };
        match admitted {
            Ok((policy, n_records)) => {
                self.start(Arc::new(Served { message, policy, n_records }), episode, None, true);
            }
            Err(error) => {
                tracing::warn!(rollout = name.rollout, "policy refused: {error}");
                self.refused += 1;
                *episode.user_header_mut() = EpisodeHeader {
                    fault: Fault::PolicyRefused as u64,
                    reason: text::pack(&error.to_string()),
                    ..self.header(&name)
                };
                self.send(name, episode);
            }
        }
    }

    fn loan(&mut self, n_records: usize) -> Option<EpisodeLoan> {
        match self.ports.loan_episode(n_records.max(1)) {
            Ok(episode) => {
                self.loan_failed = false;
                Some(episode)
            }
            Err(error) => {
                if !self.loan_failed {
                    tracing::warn!("{error}; trying again");
                    self.loan_failed = true;
                }
                None
            }
        }
    }

    fn start(
        &mut self,
        served: Arc<Served<P>>,
        episode: EpisodeLoan,
        swap: Option<u64>,
        is_proposal: bool,
    ) {
        self.active = true;
        if !is_proposal {
            self.fit_posture(&served);
        }
        let _ = self.ports.in_loop.send_copy(served.message);
        let job = Job {
            policy: served.policy.clone(),
            policy_digest: served.message.digest,
            posture: PostureOrder { seq: self.posture_seq, to: self.posture },
            rollout: served.message.rollout,
            episode,
            swap,
            is_experiment: is_proposal,
        };
        // Never full: one rollout is in flight at a time.
        let _ = self.ends.jobs.push(job);
        self.in_flight = Some(InFlight { served, is_proposal, swapped: false });
    }
}

/// The plant's measures, if they are valid; invalid ones do not lose the episode.
fn checked(measures: &Measures) -> Measures {
    match measures.validate() {
        Ok(()) => *measures,
        Err(error) => {
            tracing::warn!("measures of the plant dropped: {error}");
            Measures::NONE
        }
    }
}
