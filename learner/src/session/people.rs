//! When nothing is in flight people are heard, and waited for where learning waits for them.

use shm_types::telemetry::{WAITS_NOT, WAITS_RATING};

use super::{Event, Session, SessionError};

impl Session<'_> {
    /// Takes what people have said, and a new wish, once no cell executes a rollout; meanwhile nothing new is
    /// asked for. Whether rollouts may be asked for now; `None` when stopped.
    pub(super) fn hear_people(&mut self) -> Result<Option<bool>, SessionError> {
        let has_news = self.learner.has_news();
        let is_quiet = self.links.iter().all(|link| link.asked.is_none());
        if has_news && !(is_quiet && self.learner.is_settled()) {
            return Ok(Some(false));
        }
        if has_news && self.take_mail()?.is_none() {
            return Ok(None);
        }
        if self.learner.stands_still() != self.asks {
            self.asks = !self.asks;
            (self.on_event)(Event::StandsStill(self.asks));
        }
        let awaited = self.learner.awaits_rating();
        if let Some(rollout) = awaited.filter(|_| self.awaited != awaited) {
            (self.on_event)(Event::AwaitsRating { rollout });
        }
        if self.awaited.is_some() && awaited.is_none() {
            // Only now it is known which of them were successes.
            self.acknowledge_all();
        }
        self.awaited = awaited;
        self.waits = if awaited.is_some() { WAITS_RATING } else { WAITS_NOT };
        Ok(Some(awaited.is_none()))
    }

    fn take_mail(&mut self) -> Result<Option<()>, SessionError> {
        let Some(taken) = self.stored(|learner| learner.take_mail())? else { return Ok(None) };
        if !taken.is_empty() {
            let about: Vec<u64> = taken.iter().flat_map(|one| one.rollouts.clone()).collect();
            for ports in self.links.iter().filter_map(|link| link.ports.as_ref()) {
                self.news.again(ports, self.learner, &about);
            }
            let (summary, next) = (self.learner.summary(), self.learner.trials().len() as u64 + 1);
            (self.on_event)(Event::Said { taken: &taken, summary: &summary, next });
        }
        Ok(Some(()))
    }
}
