//! Where the records of a rollout go.

use shm_types::episode::TickRecord;

use crate::hot::rollout::Phase;
use crate::hot::tick::Controller;
use crate::rt::now_ns;

/// Counts the ticks and records of one rollout, Execute and Settle.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Recording {
    /// Every so many ticks one is recorded: fast loops must fit into an episode, too.
    stride: usize,
    n_ticks: usize,
    pub n_records: usize,
    /// First tick of Execute, and when it began on the monotonic clock.
    pub applied_tick: u64,
    pub applied_ns: u64,
}

impl Recording {
    pub fn new(stride: usize) -> Recording {
        Recording { stride, n_ticks: 0, n_records: 0, applied_tick: 0, applied_ns: 0 }
    }

    /// The recording of a world without ticks, which writes all records at once.
    pub fn at_once(n_records: usize, applied_tick: u64, applied_ns: u64) -> Recording {
        Recording { stride: 1, n_ticks: n_records, n_records, applied_tick, applied_ns }
    }

    /// The tick to come is the first of Execute.
    pub fn begins(&self, controller: &Controller) -> bool {
        self.n_ticks == 0 && controller.phase() == Phase::Execute
    }

    /// The place in `records` of the tick to come; `None` outside Execute and Settle, between two
    /// recorded ticks, and when the records are full.
    pub fn next<'a>(
        &mut self,
        controller: &Controller,
        records: &'a mut [TickRecord],
    ) -> Option<&'a mut TickRecord> {
        if !matches!(controller.phase(), Phase::Execute | Phase::Settle) {
            return None;
        }
        if self.n_ticks == 0 {
            (self.applied_tick, self.applied_ns) = (controller.tick_number(), now_ns());
        }
        let is_recorded = self.n_ticks.is_multiple_of(self.stride);
        self.n_ticks += 1;
        let record = records.get_mut(self.n_records).filter(|_| is_recorded)?;
        self.n_records += 1;
        Some(record)
    }
}
