//! The other side of the cell: showing it that the learner lives, seeing how the controller does.

use std::time::{Duration, Instant};

use shm_types::SCHEMA;
use shm_types::service_manager::{Notice, notify};
use shm_types::telemetry::{ASKS_DEMONSTRATION, Heartbeat, WAITS_NOT};

use super::{Event, HOUSEKEEPING, Link, SessionError};

const BEAT: Duration = Duration::from_millis(100);
/// A controller whose heartbeat is older than this is silent.
const SILENT: Duration = Duration::from_secs(2);

impl Link {
    /// Beats, listens to the controller's beat, cleans up. True when the controller is a new one.
    pub(super) fn look_around(
        &mut self,
        on_event: &mut dyn FnMut(Event<'_>),
    ) -> Result<bool, SessionError> {
        let now = Instant::now();
        let mut restarted = false;
        if now >= self.next_beat {
            self.next_beat = now + BEAT;
            restarted = self.ports.follow()?;
            if restarted {
                self.controller = None; // its beat is to come
            }
            self.beat(false);
        }
        if now >= self.next_housekeeping {
            self.next_housekeeping = now + HOUSEKEEPING;
            self.ports.clean_up();
            notify(&[Notice::Watchdog]);
        }
        let before = (self.is_pinned, self.latched);
        restarted |= self.hear(now);
        if self.is_pinned != before.0 {
            on_event(Event::Pinned(self.is_pinned));
        }
        if self.latched != before.1 {
            on_event(Event::Held(self.latched));
        }
        let silence = now - self.heard;
        if silence >= SILENT && !self.is_silent {
            self.is_silent = true;
            on_event(Event::ControllerSilent(silence));
        } else if silence < SILENT && self.is_silent {
            self.is_silent = false;
            on_event(Event::ControllerBack);
        }
        Ok(restarted)
    }

    /// Shows the controller that the learner lives, or that it ends in order and nobody need miss it.
    pub(super) fn beat(&mut self, is_leaving: bool) {
        self.beat_counter += 1;
        let beat = Heartbeat {
            schema: SCHEMA,
            boot_id: u64::from(std::process::id()),
            counter: self.beat_counter,
            pinned: 0,
            latched: 0,
            leaving: u64::from(is_leaving),
            waits: match self.waits {
                WAITS_NOT if self.asks => ASKS_DEMONSTRATION,
                waits => waits,
            },
        };
        // Nobody listening is what the controller's own silence will tell.
        let _ = self.ports.beat.send_copy(beat);
    }

    fn hear(&mut self, now: Instant) -> bool {
        let mut restarted = false;
        while let Ok(Some(beat)) = self.ports.controller_beat.receive() {
            if beat.schema != SCHEMA || self.controller == Some(*beat) {
                continue;
            }
            restarted |= self.controller.is_some_and(|last| last.boot_id != beat.boot_id);
            self.controller = Some(*beat);
            (self.is_pinned, self.latched) = (beat.pinned == 1, beat.latched);
            self.heard = now;
        }
        restarted
    }
}
