//! What a log was told last, so that what happens again and again is not told again at once.

use std::time::{Duration, Instant};

use crate::event::Event;

/// The same is said again after this long.
const SAY_AGAIN: Duration = Duration::from_secs(60);

/// The newest event that was said, and when.
#[derive(Default)]
pub(crate) struct Said(Option<(Event, Instant)>);

impl Said {
    pub fn is_nothing(&self) -> bool {
        self.0.is_none()
    }

    /// Takes note of an event that is to be said now; false if it was said just now.
    pub fn is_news(&mut self, event: &Event) -> bool {
        let is_said = |(said, at): &(Event, Instant)| said == event && at.elapsed() < SAY_AGAIN;
        let is_news = !self.0.as_ref().is_some_and(is_said);
        if is_news {
            self.0 = Some((event.clone(), Instant::now()));
        }
        is_news
    }
}
