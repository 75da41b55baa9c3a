//! One turn after the other, and what comes back from each.

use std::sync::mpsc::Sender;
use std::time::Instant;

use zenoh::query::Reply;

use crate::answer::MAX_ANSWER;
use crate::backoff::Backoff;
use crate::turn::reason;

#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Kind {
    News,
    Episode,
    /// To a command.
    Reply,
    Door,
}

/// What comes back from a turn. Its end comes last, and always.
pub(super) enum Word {
    Answer(Vec<u8>),
    Refusal(String),
    End,
}

/// Sends the end of a turn when the network lets go of it.
pub(super) struct Listener {
    pub kind: Kind,
    pub out: Sender<(Kind, Word)>,
}

impl Listener {
    pub fn hear(&self, reply: Reply) {
        let word = match reply.into_result() {
            Ok(sample) if sample.payload().len() <= MAX_ANSWER => {
                Word::Answer(sample.payload().to_bytes().into_owned())
            }
            Ok(_) => Word::Refusal("an answer that is too long".to_string()),
            Err(error) => {
                let text = String::from_utf8_lossy(&error.payload().to_bytes()).into_owned();
                let text: String = text.chars().filter(|c| !c.is_control()).take(512).collect();
                match reason(&text) {
                    Some(reason) => Word::Refusal(reason.to_string()),
                    None => return, // the network's; its end follows
                }
            }
        };
        let _ = self.out.send((self.kind, word));
    }
}

impl Drop for Listener {
    fn drop(&mut self) {
        let _ = self.out.send((self.kind, Word::End));
    }
}

/// Turns of one kind, one after the other.
pub(super) struct Turns {
    pub is_under_way: bool,
    pub is_answered: bool,
    next: Instant,
    backoff: Backoff,
    pub failures: u32,
}

impl Turns {
    pub fn new(seed: u64) -> Turns {
        let backoff = Backoff::new(seed);
        Turns {
            is_under_way: false,
            is_answered: false,
            next: Instant::now(),
            backoff,
            failures: 0,
        }
    }

    pub fn is_due(&self) -> bool {
        !self.is_under_way && Instant::now() >= self.next
    }

    pub fn ended(&mut self) {
        self.is_under_way = false;
        if self.is_answered {
            self.failures = 0;
            self.backoff.succeeded();
        } else {
            self.failures += 1;
            self.next = Instant::now() + self.backoff.after_failure();
        }
    }
}
