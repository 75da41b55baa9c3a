//! Postures moved by hand, as the exchange thread sees them: admitted, sent to the loop, told.

use physics::arm::JointVector;
use shm_types::command::Command;

use crate::exchange::Exchange;
use crate::exchange::commands::Refusal;
use crate::rings::PostureOrder;

impl<P: Clone + PartialEq> Exchange<'_, P> {
    /// Sends the posture of `command` to the loop; returns its number, by which the loop will name it. Also
    /// behind a latched fault: it acts in rollouts alone, and may be what a person wants to take back first.
    pub(crate) fn move_posture(&mut self, command: &Command) -> Result<u64, Refusal> {
        let offset = JointVector::from(command.posture);
        let to = (self.setup.admit_posture)(&offset, command.duration_s, &self.posture.offset)?;
        let seq = self.posture_seq + 1;
        let order = PostureOrder { seq, to };
        self.ends.postures.push(order).map_err(|_| Refusal::PostureWaits)?;
        (self.posture, self.posture_seq) = (to, seq);
        Ok(seq)
    }

    /// Takes the loop's word on postures, and tells who asked for them.
    pub(crate) fn take_posture(&mut self) {
        while let Ok(taken) = self.ends.postures_taken.pop() {
            self.active = true;
            tracing::info!(tick = taken.tick, "posture moved");
            self.answer_posture(&taken);
        }
    }
}
