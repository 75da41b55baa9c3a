//! Postures moved by hand, as the exchange thread sees them: admitted, sent to the loop, told, taken back.

use physics::arm::JointVector;
use shm_types::command::Command;

use crate::exchange::Exchange;
use crate::exchange::commands::Refusal;
use crate::exchange::swap::Served;
use crate::hot::posture::PostureMove;
use crate::rings::PostureOrder;

impl<P: Clone + PartialEq> Exchange<'_, P> {
    /// Sends the posture of `command` to the loop, if the policy that is served agrees with it; returns its number,
    /// by which the loop will name it. Also behind a latched fault: it acts in rollouts alone, and may be what a
    /// person wants to take back first.
    pub(crate) fn move_posture(&mut self, command: &Command) -> Result<u64, Refusal> {
        let offset = JointVector::from(command.posture);
        let to = (self.setup.admit_posture)(&offset, command.duration_s, &self.posture.offset)?;
        let served = self.serving.served();
        if let Some(served) = served.filter(|_| !to.is_none()) {
            (self.setup.check_posture)(&served.policy, &to)?;
        }
        let digest = served.map_or(0, |served| served.message.digest);
        let seq = self.send_posture(to)?;
        self.posture_of = digest;
        Ok(seq)
    }

    fn send_posture(&mut self, to: PostureMove) -> Result<u64, Refusal> {
        let seq = self.posture_seq + 1;
        let order = PostureOrder { seq, to };
        self.ends.postures.push(order).map_err(|_| Refusal::PostureWaits)?;
        (self.posture, self.posture_seq) = (to, seq);
        Ok(seq)
    }

    /// Before `served` goes into the loop: a posture that was not checked with it is, and is taken back where the
    /// two do not agree.
    pub(crate) fn fit_posture(&mut self, served: &Served<P>) {
        if self.posture.is_none() || self.posture_of == served.message.digest {
            return;
        }
        self.posture_of = served.message.digest;
        if let Err(error) = (self.setup.check_posture)(&served.policy, &self.posture) {
            let policy = served.name().describe();
            tracing::warn!("the posture goes back to its start under policy {policy}: {error}");
            let back = PostureMove { duration_s: self.posture.duration_s, ..PostureMove::NONE };
            self.posture = back;
            // A full ring takes nothing: a rollout that begins brings its own.
            let _ = self.send_posture(back);
        }
    }

    /// Takes the loop's word on postures, and tells who asked for them.
    pub(crate) fn take_posture(&mut self) {
        while let Ok(taken) = self.ends.postures_taken.pop() {
            self.active = true;
            tracing::info!(tick = taken.tick, "posture taken");
            self.answer_posture(&taken);
        }
    }
}
