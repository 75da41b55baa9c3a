//! The controller's status.

use std::sync::Arc;
use std::time::Duration;

use shm_types::command::{
    PACE_MAX, PACE_PLANT, PACE_REALTIME, PLANT_ABSENT, PLANT_BUILT_IN, PLANT_THERE, Status,
};
use shm_types::policy::PolicyName;

use crate::config::Pace;
use crate::exchange::Exchange;
use crate::exchange::swap::Served;
use crate::executor::latch::Latched;

fn ns_or_max(time: Option<Duration>) -> u64 {
    time.map_or(u64::MAX, |time| time.as_nanos() as u64)
}

impl<P: Clone + PartialEq> Exchange<'_, P> {
    pub(crate) fn status(&self) -> Status {
        let (wakeup, tick) = (self.report.stats.wakeup(), self.report.stats.tick());
        let name = |served: Option<&Arc<Served<P>>>| served.map_or(PolicyName::NONE, |s| s.name());
        let latched = |f: &dyn Fn(Latched) -> u64| self.latched.map_or(0, f);
        Status {
            boot_id: self.boot_id,
            tick: self.report.last.record.tick,
            // Without the wall clock nothing ticks between rollouts: the last tick is no news.
            phase: if self.in_flight.is_some() {
                u64::from(self.report.last.record.phase)
            } else {
                0
            },
            fault: u64::from(self.report.last.record.fault),
            latched_fault: latched(&|latched| latched.fault as u64),
            latched_ns: latched(&Latched::age_ns),
            latched_present: latched(&|_| u64::from(self.setup.latch.is_present())),
            plant: match self.setup.latch.is_absent() {
                true => PLANT_ABSENT,
                false if self.setup.plant_apart.is_some() => PLANT_THERE,
                false => PLANT_BUILT_IN,
            },
            equipment: self.setup.equipment(),
            fault_records: self.flights.as_ref().map_or(0, |files| files.len() as u64),
            period_ns: self.setup.period_ns,
            pace: match self.setup.pace {
                Pace::Max => PACE_MAX,
                Pace::Realtime => PACE_REALTIME,
                Pace::Plant => PACE_PLANT,
            },
            privileged: u64::from(self.setup.is_privileged()),
            in_loop: self.in_loop,
            applied_tick: self.applied_tick,
            active: name(self.serving.active()),
            last_good: name(self.serving.last_good()),
            pinned: u64::from(self.serving.is_pinned()),
            pin_restored: u64::from(self.serving.is_pin_restored()),
            posture: self.posture.offset.into(),
            posture_s: self.posture.duration_s,
            imported: self.catalogue.len() as u64,
            rollouts_done: self.rollouts,
            rollouts_served: self.served,
            swaps_applied: self.serving.applied,
            swaps_torn: self.serving.torn,
            policies_refused: self.refused,
            commands_refused: self.commands.refused,
            rollbacks: self.serving.rollbacks,
            state_errors: self.catalogue.errors,
            spooled: self.spool.as_ref().map_or(0, |spool| spool.len() as u64),
            spool_full: u64::from(self.spool.as_ref().is_some_and(|spool| spool.is_full())),
            unacknowledged: self.link.unacknowledged(),
            learner_age_ns: ns_or_max(self.link.age()),
            learner_mute_ns: ns_or_max(self.link.mute()),
            learner_waits: self.link.waits(),
            stalls: self.stalls.count,
            stall_longest_ns: self.stalls.longest.as_nanos() as u64,
            stall_last_ns: self.stalls.last().map_or(0, |(stall, _)| stall.as_nanos() as u64),
            stall_age_ns: ns_or_max(self.stalls.last().map(|(_, age)| age)),
            tick_age_ns: self.stalls.tick_age().as_nanos() as u64,
            deadline_misses: self.report.stats.missed,
            wakeup_p50_ns: wakeup.p50,
            wakeup_p99_ns: wakeup.p99,
            wakeup_max_ns: wakeup.max,
            tick_p50_ns: tick.p50,
            tick_p99_ns: tick.p99,
            tick_max_ns: tick.max,
        }
    }
}
