//! What the loop is to execute next: the active policy and the ways back from it.
//!
//! A pure state machine: no ports, no clock, no disk. The *active* policy is what is served when it
//! is pinned, or when no learner is there; an activation swaps it in. The *last good* policy is the
//! newest that proved itself: an activated one by a rollout without fault, a learner's proposal,
//! which is an experiment, by success.

use std::sync::Arc;

use shm_types::command::AT_NOW;
use shm_types::policy::PolicyName;

use crate::exchange::swap::{Served, Stage, SwapRefused, Swapping};
use crate::rings::Applied;

/// Activations that can be rolled back one after the other.
const MAX_PREVIOUS: usize = 32;

/// What to hand to the loop.
#[derive(Debug)]
pub(crate) enum Next<P> {
    /// A served policy, and the swap that this rollout fulfils.
    Serve(Arc<Served<P>>, Option<u64>),
    /// The learner's proposal.
    Learner,
    Nothing,
}

#[derive(Debug)]
pub(crate) struct Serving<P> {
    active: Option<Arc<Served<P>>>,
    previous: Vec<Arc<Served<P>>>,
    last_good: Option<Arc<Served<P>>>,
    pinned: bool,
    /// The pin is that of an earlier run, and no command has been about it since.
    pin_restored: bool,
    swap: Option<Swapping<P>>,
    /// One rollout of the active policy is due: it was swapped in while none was in progress.
    due: bool,
    last_seq: u64,
    blend_ticks: u64,
    pub applied: u64,
    pub torn: u64,
    pub rollbacks: u64,
}

impl<P: PartialEq> Serving<P> {
    pub fn new(blend_ticks: u64) -> Serving<P> {
        Serving {
            active: None,
            previous: Vec::new(),
            last_good: None,
            pinned: false,
            pin_restored: false,
            swap: None,
            due: false,
            last_seq: 0,
            blend_ticks,
            applied: 0,
            torn: 0,
            rollbacks: 0,
        }
    }

    /// As an earlier run of the controller left it.
    pub fn restore(
        &mut self,
        active: Option<Arc<Served<P>>>,
        last_good: Option<Arc<Served<P>>>,
        pinned: bool,
    ) {
        self.pinned = pinned && (active.is_some() || last_good.is_some());
        self.pin_restored = self.pinned;
        (self.active, self.last_good) = (active, last_good);
    }

    /// What is served: the active policy, else the last good one.
    pub fn served(&self) -> Option<&Arc<Served<P>>> {
        self.active.as_ref().or(self.last_good.as_ref())
    }

    pub fn active(&self) -> Option<&Arc<Served<P>>> {
        self.active.as_ref()
    }

    pub fn last_good(&self) -> Option<&Arc<Served<P>>> {
        self.last_good.as_ref()
    }

    pub fn is_pinned(&self) -> bool {
        self.pinned
    }

    pub fn is_pin_restored(&self) -> bool {
        self.pinned && self.pin_restored
    }

    pub fn pin(&mut self, pinned: bool) -> Result<(), SwapRefused> {
        if pinned && self.served().is_none() {
            return Err(SwapRefused::NothingToPin);
        }
        (self.pinned, self.pin_restored) = (pinned, false);
        Ok(())
    }

    /// Begins a swap; returns its number, by which [`Serving::applied`] will name it.
    pub fn activate(&mut self, to: Arc<Served<P>>, at: u64) -> Result<u64, SwapRefused> {
        self.begin(to, at, false)
    }

    /// Begins the swap to the policy that was active before, else to the last good one.
    pub fn rollback(&mut self, at: u64) -> Result<u64, SwapRefused> {
        self.may_swap()?;
        let to = match self.previous.pop() {
            Some(previous) => previous,
            None => self.other_good().ok_or(SwapRefused::NoWayBack)?,
        };
        self.begin(to, at, true)
    }

    fn begin(
        &mut self,
        to: Arc<Served<P>>,
        at: u64,
        is_rollback: bool,
    ) -> Result<u64, SwapRefused> {
        self.may_swap()?;
        self.last_seq += 1;
        let (seq, now) = (self.last_seq, at == AT_NOW);
        self.swap = Some(Swapping { seq, to, now, stage: Stage::Waiting, is_rollback });
        Ok(seq)
    }

    fn may_swap(&self) -> Result<(), SwapRefused> {
        match &self.swap {
            Some(swap) => Err(SwapRefused::UnderWay(swap.to.name().describe())),
            None => Ok(()),
        }
    }

    /// The last good policy, if it is not the active one.
    fn other_good(&self) -> Option<Arc<Served<P>>> {
        let active = self.active.as_ref().map(|active| active.message.digest);
        self.last_good.clone().filter(|good| Some(good.message.digest) != active)
    }

    /// The swap to hand to the loop at once, into the rollout in progress.
    pub fn swap_now(&mut self) -> Option<(u64, &Arc<Served<P>>)> {
        let swap = self.swap.as_mut().filter(|swap| swap.now && swap.stage == Stage::Waiting)?;
        swap.stage = Stage::Sent;
        Some((swap.seq, &swap.to))
    }

    /// The policy of a swap that the loop has been sent.
    pub fn sent(&self) -> Option<&Arc<Served<P>>> {
        let swap = self.swap.as_ref().filter(|swap| swap.stage != Stage::Waiting)?;
        Some(&swap.to)
    }

    /// What the next rollout executes. `learner_waits`: a proposal is there; `alone`: no learner is,
    /// and the configuration wants service nevertheless.
    pub fn next(&mut self, learner_waits: bool, alone: bool) -> Next<P> {
        if let Some(swap) = self.swap.as_mut().filter(|swap| swap.stage == Stage::Waiting) {
            swap.stage = Stage::Sent;
            return Next::Serve(swap.to.clone(), Some(swap.seq));
        }
        let serve = self.pinned || self.due || (alone && !learner_waits);
        match self.served() {
            Some(served) if serve => {
                let served = served.clone();
                self.due = false;
                Next::Serve(served, None)
            }
            _ if learner_waits && !self.pinned => Next::Learner,
            _ => Next::Nothing,
        }
    }

    /// What was to be served could not be handed over; it will be asked for again.
    pub fn not_handed_over(&mut self, swap: Option<u64>) {
        match (&mut self.swap, swap) {
            (Some(swap), Some(_)) => swap.stage = Stage::Waiting,
            _ => self.due = true,
        }
    }

    /// Takes the loop's word; returns the name of the policy, `None` for a word about no swap.
    pub fn applied(&mut self, applied: &Applied<P>) -> Option<PolicyName> {
        let swap = self.swap.as_mut().filter(|swap| swap.seq == applied.seq)?;
        let to = swap.to.clone();
        let (is_rollback, now) = (swap.is_rollback, swap.now);
        self.applied += 1;
        self.rollbacks += u64::from(is_rollback);
        self.pin_restored = false;
        self.torn += u64::from(applied.policy != to.policy);
        if applied.in_rollout && now && self.blend_ticks > 0 {
            swap.stage = Stage::Fading { until: applied.tick + self.blend_ticks };
        } else {
            self.swap = None;
        }
        self.due = !applied.in_rollout;
        let name = to.name();
        let changes = self.active.as_ref().is_none_or(|active| active.name() != name);
        if let Some(active) = self.active.replace(to).filter(|_| changes && !is_rollback) {
            self.previous.push(active);
            if self.previous.len() > MAX_PREVIOUS {
                self.previous.remove(0);
            }
        }
        Some(name)
    }

    /// The loop has come to `tick`; `in_rollout`: it executes one.
    pub fn passed(&mut self, tick: u64, in_rollout: bool) {
        if let Some(Swapping { stage: Stage::Fading { until }, .. }) = self.swap
            && (tick >= until || !in_rollout)
        {
            self.swap = None;
        }
    }

    /// The rollout that was to fulfil a swap has ended before its policy acted: there is no swap
    /// any more. Returns its number.
    pub fn abandon(&mut self) -> Option<u64> {
        let is_lost = |swap: &Swapping<P>| swap.stage == Stage::Sent && !swap.now;
        let seq = self.swap.as_ref().filter(|swap| is_lost(swap))?.seq;
        self.swap = None;
        Some(seq)
    }

    /// A rollout of the served policy has ended. True when what is active or good has changed.
    pub fn served_rollout_ended(&mut self, name: &PolicyName, faulted: bool) -> bool {
        if faulted {
            return self.go_back();
        }
        let proven = self.served().filter(|served| served.name() == *name).cloned();
        proven.is_some_and(|proven| self.proved_itself(proven))
    }

    /// The policy becomes the last good one. True when it was not.
    pub fn proved_itself(&mut self, policy: Arc<Served<P>>) -> bool {
        let is_new = self.last_good.as_ref().is_none_or(|good| good.name() != policy.name());
        self.last_good = Some(policy);
        is_new
    }

    /// After a fault: the last good policy, or none when the fault was its own.
    fn go_back(&mut self) -> bool {
        let had = self.active.is_some() || self.pinned;
        match self.other_good() {
            Some(good) => {
                self.previous.retain(|previous| previous.name() != good.name());
                self.active = Some(good);
                self.rollbacks += 1;
                true
            }
            None => {
                (self.active, self.last_good, self.pinned) = (None, None, false);
                had
            }
        }
    }

    /// Nothing serves this policy any more, nor leads back to it; the one before it is active.
    pub fn drop_policy(&mut self, digest: u64) {
        let is_it = |served: &Arc<Served<P>>| served.message.digest == digest;
        self.previous.retain(|previous| !is_it(previous));
        self.last_good = self.last_good.take().filter(|good| !is_it(good));
        if self.active.as_ref().is_some_and(is_it) {
            self.active = self.previous.pop();
        }
        self.pinned &= self.served().is_some();
    }
}

#[cfg(test)]
mod tests;
