//! Where the records of a rollout go.

use shm_types::episode::TickRecord;

use crate::rollout::Phase;
use crate::tick::Controller;

/// Counts the records of one rollout, Execute and Settle.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Recording {
    pub n_records: usize,
    /// First tick of Execute.
    pub applied_tick: u64,
}

impl Recording {
    /// The place in `records` of the tick to come; `None` outside Execute and Settle, and when the
    /// records are full.
    pub fn next<'a>(
        &mut self,
        controller: &Controller,
        records: &'a mut [TickRecord],
    ) -> Option<&'a mut TickRecord> {
        if !matches!(controller.phase(), Phase::Execute | Phase::Settle) {
            return None;
        }
        if self.n_records == 0 {
            self.applied_tick = controller.tick_number();
        }
        let record = records.get_mut(self.n_records)?;
        self.n_records += 1;
        Some(record)
    }
}
