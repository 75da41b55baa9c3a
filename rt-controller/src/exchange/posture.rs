//! Posture offsets on the exchange thread: admits, sends, reports and resets them.

use physics::arm::JointVector;
use shm_types::command::Command;

use crate::exchange::Exchange;
use crate::exchange::commands::Refusal;
use crate::exchange::swap::Served;
use crate::hot::posture::PostureMove;
use crate::rings::PostureOrder;

impl<P: Clone + PartialEq> Exchange<'_, P> {
    /// Sends the posture of `command` to the loop, if what is served agrees with it: the policy of the rollout in
    /// progress, that of a swap on its way, and that of the rollouts to come. Returns its number, by which the loop
    /// will name it. Also behind a latched fault: it acts in rollouts alone, and may be what a person wants to take
    /// back first.
    pub(crate) fn move_posture(&mut self, command: &Command) -> Result<u64, Refusal> {
        let offset = JointVector::from(command.posture);
        let to = (self.setup.admit_posture)(&offset, command.duration_s, &self.posture.offset)?;
        // After a swap into it the rollout executes what is served.
        let in_flight = self.in_flight.as_ref().filter(|it| !it.is_proposal && !it.swapped);
        let in_progress = in_flight.map(|in_flight| &in_flight.served);
        let to_come = self.serving.sent().or(self.serving.served());
        let mut checked = None;
        for served in in_progress.into_iter().chain(self.serving.served()).chain(to_come) {
            if checked != Some(served.message.digest) && !to.is_none() {
                (self.setup.check_posture)(&served.policy, &to)?;
            }
            checked = Some(served.message.digest);
        }
        let seq = self.posture_seq + 1;
        let order = PostureOrder { seq, to };
        self.ends.postures.push(order).map_err(|_| Refusal::PostureWaits)?;
        (self.posture, self.posture_seq, self.posture_of) = (to, seq, checked);
        Ok(seq)
    }

    /// Before `served` goes into the loop: checks the posture with it, if that was not done yet, and takes it
    /// back where the two do not agree.
    pub(crate) fn fit_posture(&mut self, served: &Served<P>) {
        if self.posture.is_none() || self.posture_of == Some(served.message.digest) {
            return;
        }
        self.posture_of = Some(served.message.digest);
        if let Err(error) = (self.setup.check_posture)(&served.policy, &self.posture) {
            let policy = served.name().describe();
            tracing::warn!(
                "posture offset removed, because it would disturb policy {policy}: {error}"
            );
            self.posture = PostureMove { duration_s: self.posture.duration_s, ..PostureMove::NONE };
            self.posture_seq += 1;
            let order = PostureOrder { seq: self.posture_seq, to: self.posture };
            // Full while the loop stands still; then the next rollout brings it.
            let _ = self.ends.postures.push(order);
        }
    }

    /// Receives the loop's replies on postures, and replies to the commands.
    pub(crate) fn take_posture(&mut self) {
        while let Ok(taken) = self.ends.postures_taken.pop() {
            self.active = true;
            tracing::info!(tick = taken.tick, "posture taken");
            self.answer_posture(&taken);
        }
    }
}
