//! Between two rollouts people are heard, and waited for where learning waits for them.

use std::sync::atomic::{AtomicBool, Ordering};

use shm_types::telemetry::{WAITS_NOT, WAITS_RATING};

use super::{Event, Link, SessionError, WAIT};
use crate::learner::Learner;

impl Link {
    /// Takes what people have said; waits for the rating of the newest rollout if learning does. `None` when
    /// stopped.
    pub(super) fn hear_people(
        &mut self,
        learner: &mut Learner,
        stop: &AtomicBool,
        on_event: &mut dyn FnMut(Event<'_>),
    ) -> Result<Option<()>, SessionError> {
        let mut has_said = false;
        loop {
            let Some(taken) = self.stored(stop, on_event, || learner.take_mail())? else {
                return Ok(None);
            };
            if !taken.is_empty() {
                let about: Vec<u64> = taken.iter().flat_map(|one| one.rollouts.clone()).collect();
                self.news.again(&self.ports, learner, &about);
                let (summary, next) = (learner.summary(), learner.durable_rollout() + 1);
                on_event(Event::Said { taken: &taken, summary: &summary, next });
            }
            if learner.stands_still() != self.asks {
                self.asks = !self.asks;
                on_event(Event::StandsStill(self.asks));
            }
            let Some(rollout) = learner.awaits_rating() else { break };
            if !has_said {
                has_said = true;
                on_event(Event::AwaitsRating { rollout });
            }
            self.waits = WAITS_RATING;
            if stop.load(Ordering::Relaxed) {
                return Ok(None);
            }
            if self.look_around(on_event)? {
                self.news.all(&self.ports, learner);
            }
            std::thread::sleep(WAIT);
        }
        self.waits = WAITS_NOT;
        Ok(Some(()))
    }
}
