//! Whether the learner's machine is within reach, and what is said of that.

use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Instant;

use zenoh::Session;

use super::{BEAT, JoinConfig, JoinError};
use crate::backoff::Backoff;
use crate::event::Event;
use crate::net::{self, NetError};
use crate::said::Said;
use crate::seat::Seat;

/// Whether the hub answers, and what is said of that.
pub(super) struct Reach<'a> {
    pub config: &'a JoinConfig,
    is_connected: bool,
    pub complained: Said,
    pub on_event: &'a mut dyn FnMut(Event),
}

impl<'a> Reach<'a> {
    pub fn new(config: &'a JoinConfig, on_event: &'a mut dyn FnMut(Event)) -> Reach<'a> {
        Reach { config, is_connected: false, complained: Said::default(), on_event }
    }

    /// Connects, however long it takes; `None` when stopped.
    pub fn session(
        &mut self,
        seat: &mut Seat,
        stop: &AtomicBool,
    ) -> Result<Option<Session>, JoinError> {
        let mut backoff = Backoff::new(self.config.id);
        let mut next = Instant::now();
        while !stop.load(Ordering::Relaxed) {
            if Instant::now() >= next {
                match net::connect(&self.config.connect, self.config.keys.as_ref()) {
                    Ok(session) => return Ok(Some(session)),
                    Err(NetError::Transport { reason, .. }) => self.failed(reason),
                    Err(error) => return Err(error.into()),
                }
                next = Instant::now() + backoff.after_failure();
            }
            seat.follow()?;
            std::thread::sleep(BEAT);
        }
        Ok(None)
    }

    pub fn answered(&mut self) {
        self.complained = Said::default();
        if !self.is_connected {
            self.is_connected = true;
            (self.on_event)(Event::Connected { address: self.config.connect.clone() });
        }
    }

    pub fn failed(&mut self, reason: String) {
        self.complain(Event::NoAnswer { address: self.config.connect.clone(), reason });
    }

    pub fn refused(&mut self, reason: String) {
        self.complain(Event::Refused { cell: self.config.cell.name().to_string(), reason });
    }

    /// Says what is wrong, once and then now and then.
    fn complain(&mut self, event: Event) {
        self.is_connected = false;
        if self.complained.is_news(&event) {
            (self.on_event)(event);
        }
    }
}
