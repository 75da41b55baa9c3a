//! The latch of a hardware fault: the loop owns it, the exchange thread reads it and requests a re-arm.
//!
//! Plain atomics: neither side ever waits for the other.

use std::sync::atomic::{AtomicBool, AtomicU32, Ordering};
use std::time::{Duration, SystemTime, UNIX_EPOCH};

use crate::fault::Fault;
use crate::hot::tick::Controller;

/// A latched fault, as remembered over a restart.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Latched {
    pub fault: Fault,
    /// When it latched, s since 1970: a restart does not make it younger.
    pub since_unix_s: u64,
}

impl Latched {
    pub(crate) fn now(fault: Fault) -> Latched {
        Latched { fault, since_unix_s: unix_time().as_secs() }
    }

    pub(crate) fn age_ns(self) -> u64 {
        unix_time().saturating_sub(Duration::from_secs(self.since_unix_s)).as_nanos() as u64
    }
}

/// Since 1970, for people; decides nothing.
fn unix_time() -> Duration {
    SystemTime::now().duration_since(UNIX_EPOCH).unwrap_or_default()
}

pub(crate) struct Latch {
    /// The latched fault, or 0.
    fault: AtomicU32,
    /// What led to it was seen not long ago.
    is_present: AtomicBool,
    /// Asked to re-arm and not yet answered.
    is_asked: AtomicBool,
    /// Asked to hold the arm.
    is_hold_asked: AtomicBool,
    /// No plant has come yet, so nothing ticks.
    is_absent: AtomicBool,
}

impl Latch {
    pub const fn new() -> Latch {
        Latch {
            fault: AtomicU32::new(Fault::None as u32),
            is_present: AtomicBool::new(false),
            is_asked: AtomicBool::new(false),
            is_hold_asked: AtomicBool::new(false),
            is_absent: AtomicBool::new(false),
        }
    }

    /// The loop's word on whether a plant has come.
    pub fn set_absent(&self, is_absent: bool) {
        if self.is_absent.load(Ordering::Relaxed) != is_absent {
            self.is_absent.store(is_absent, Ordering::Relaxed);
        }
    }

    pub fn is_absent(&self) -> bool {
        self.is_absent.load(Ordering::Relaxed)
    }

    /// As an earlier run left it; before the loop starts.
    pub fn restore(&self, fault: Fault) {
        self.is_present.store(true, Ordering::Relaxed);
        self.fault.store(fault as u32, Ordering::Release);
    }

    pub fn fault(&self) -> Option<Fault> {
        Fault::latching(self.fault.load(Ordering::Acquire))
    }

    pub fn is_present(&self) -> bool {
        self.is_present.load(Ordering::Relaxed)
    }

    /// Asks the loop to re-arm; it answers before its next tick.
    pub fn ask(&self) {
        self.is_asked.store(true, Ordering::Release);
    }

    /// Asks the loop to hold the arm from its next tick on.
    pub fn hold(&self) {
        self.is_hold_asked.store(true, Ordering::Release);
    }

    /// The loop has not taken notice of it yet.
    pub fn is_hold_asked(&self) -> bool {
        self.is_hold_asked.load(Ordering::Acquire)
    }

    /// The loop's answer to [`Latch::ask`]: what is latched after it; `None` while there is none.
    ///
    /// The loop writes the latch before it says that it has answered, so it is read after that.
    pub fn answer(&self) -> Option<Result<(), Fault>> {
        if self.is_asked.load(Ordering::Acquire) {
            return None;
        }
        Some(self.fault().map_or(Ok(()), Err))
    }

    /// The loop's side, once a tick: shows the latch, and re-arms where that was asked for and the
    /// cause is gone.
    pub fn follow(&self, controller: &mut Controller) {
        let asked = self.is_asked.load(Ordering::Acquire);
        if asked {
            controller.rearm();
        }
        if self.is_hold_asked() {
            controller.trip(Fault::Held);
            self.is_hold_asked.store(false, Ordering::Release);
        }
        let (latched, present) = (controller.latched(), controller.is_cause_present());
        // Written only when it changes: the other core keeps its copy of the line.
        if self.is_present.load(Ordering::Relaxed) != present {
            self.is_present.store(present, Ordering::Relaxed);
        }
        let code = latched.unwrap_or(Fault::None) as u32;
        if self.fault.load(Ordering::Relaxed) != code {
            self.fault.store(code, Ordering::Release);
        }
        if asked {
            self.is_asked.store(false, Ordering::Release);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use physics::arm::ArmModel;
    use physics::ideal::IdealArm;
    use physics::pancake::WAM7_START_POSTURE;
    use physics::plant::Plant;
    use physics::referee::Referee;
    use shm_types::episode::TickRecord;

    use crate::config::ControllerConfig;

    /// The answer is read while the loop writes it: old latch and new answer never come together.
    #[test]
    fn an_answer_is_never_that_of_before() {
        let urdf = include_str!("../../../robots/wam7/wam7_pan.urdf");
        let model = ArmModel::from_urdf(urdf, "pan").unwrap();
        let config = ControllerConfig::default();
        let mut controller = Controller::new(&model, &WAM7_START_POSTURE, &config, &Referee::Clock);
        let mut arm = IdealArm::new(&model, &WAM7_START_POSTURE, config.period_s(), 0.01);
        for _ in 0..300 {
            let tau = controller.tick(&arm.measure(), &mut { TickRecord::ZERO });
            arm.apply(&tau);
            arm.advance();
        }
        assert!(!controller.is_cause_present());
        let (latch, stop) = (Latch::new(), AtomicBool::new(false));
        std::thread::scope(|scope| {
            scope.spawn(|| {
                while !stop.load(Ordering::Relaxed) {
                    latch.follow(&mut controller);
                }
            });
            for round in 0..20_000 {
                latch.hold();
                while latch.fault().is_none() {
                    std::hint::spin_loop();
                }
                latch.ask();
                let answer = loop {
                    if let Some(answer) = latch.answer() {
                        break answer;
                    }
                };
                if answer != Ok(()) {
                    stop.store(true, Ordering::Relaxed);
                    panic!("round {round}: re-armed, but told {answer:?}");
                }
            }
            stop.store(true, Ordering::Relaxed);
        });
    }
}
