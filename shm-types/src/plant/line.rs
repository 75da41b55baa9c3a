//! What carries samples and answers: the socket, or shared memory beside it.

use std::sync::Arc;
use std::time::{Duration, Instant};

use super::shared::{Carried, Shared};
use super::socket::{Buffer, Connection, LOOK_OUT, LinkError, Message};

/// Between two looks at shared memory, once an answer takes longer than a moment.
const REST: Duration = Duration::from_micros(50);
/// Answers between two looks at the socket, which tells of the end and of signs of life.
const EAR: u64 = 256;

/// One end: sends `S`, receives `R`, and whatever else comes over the socket.
pub struct Line<S: Carried, R: Carried> {
    socket: Arc<Connection>,
    shared: Option<Shared<S, R>>,
    n_waits: u64,
}

impl<S: Carried, R: Carried> Line<S, R> {
    pub fn new(socket: Arc<Connection>, shared: Option<Shared<S, R>>) -> Line<S, R> {
        Line { socket, shared, n_waits: 0 }
    }

    pub fn socket(&self) -> &Connection {
        &self.socket
    }

    pub fn is_shared(&self) -> bool {
        self.shared.is_some()
    }

    /// Sends without waiting: false when the peer has not taken those before.
    pub fn send(&self, message: &S) -> Result<bool, LinkError> {
        match &self.shared {
            Some(shared) => {
                shared.write(message);
                Ok(true)
            }
            None => self.socket.send(message),
        }
    }

    /// The answer that is under way, or another message, within `patience`: looked out for a moment, for in
    /// lockstep only one end works at a time; then with rests.
    pub fn receive_answer<'a>(
        &'a mut self,
        buffer: &'a mut Buffer,
        patience: Duration,
    ) -> Result<Option<Message<'a>>, LinkError> {
        let Some(shared) = &mut self.shared else {
            return self.socket.receive_answer(buffer, patience);
        };
        self.n_waits += 1;
        if self.n_waits.is_multiple_of(EAR) && self.socket.is_waiting(Duration::ZERO)? {
            return self.socket.receive(buffer, Duration::ZERO);
        }
        let start = Instant::now();
        while !shared.has_news() {
            let waited = start.elapsed();
            let Some(left) = patience.checked_sub(waited) else { return Ok(None) };
            if waited < LOOK_OUT {
                std::hint::spin_loop();
            } else if self.socket.is_waiting(REST.min(left))? && !shared.has_news() {
                return self.socket.receive(buffer, Duration::ZERO);
            }
        }
        Ok(Some(shared.take().message()))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::cell::{Cell, Role};
    use crate::plant::shared::{Host, follow};
    use crate::plant::socket::Listener;
    use crate::plant::{PlantCommand, PlantState, STATE_IN_CONTACT};

    const SOON: Duration = Duration::from_secs(10);

    #[test]
    fn shared_memory_carries_the_newest_and_the_socket_the_rest() {
        let dir = tempfile::Builder::new().prefix("sk").tempdir().unwrap();
        let cell = Cell::in_dir(dir.path(), "a").unwrap();
        let _lock = cell.lock(Role::Controller).unwrap();
        let mut host = Host::alone(&cell).unwrap();
        let path = crate::plant::socket::path(&cell);
        let listener = Listener::bind(&path).unwrap();
        for visit in 0..3 {
            let plant = Connection::connect(&path, SOON).unwrap();
            let (controller, _) = listener.accept(SOON).unwrap().unwrap();
            let (mine, invitation) = host.invite().unwrap();
            let mut plant = Line::new(Arc::new(plant), Some(follow(&invitation).unwrap()));
            let mut controller = Line::new(Arc::new(controller), Some(mine));
            let (mut ours, mut theirs) = (Buffer::new(), Buffer::new());
            assert!(controller.receive_answer(&mut ours, Duration::ZERO).unwrap().is_none());
            for seq in 1..1000 {
                let flags = STATE_IN_CONTACT;
                let state = PlantState { seq, flags, q: [0.5; 7], ..PlantState::EMPTY };
                assert!(plant.send(&state).unwrap());
                match controller.receive_answer(&mut ours, SOON).unwrap() {
                    Some(Message::State(found)) => assert_eq!(*found, state, "visit {visit}"),
                    other => panic!("{other:?}"),
                }
                let command = PlantCommand { answers_seq: seq, ..PlantCommand::HOLD };
                controller.send(&command).unwrap();
                match plant.receive_answer(&mut theirs, SOON).unwrap() {
                    Some(Message::Command(found)) => assert_eq!(*found, command),
                    other => panic!("{other:?}"),
                }
            }
            // A sign of life comes over the socket, and so does the end.
            controller.socket().send(&PlantCommand::HOLD).unwrap();
            let sign = plant.receive_answer(&mut theirs, SOON).unwrap();
            assert!(matches!(sign, Some(Message::Command(_))));
            drop(controller);
            assert_eq!(plant.receive_answer(&mut theirs, SOON).unwrap_err(), LinkError::Gone);
        }
    }

    #[test]
    fn an_invitation_that_leads_nowhere_is_an_error_in_words() {
        for words in ["", "nowhere", "/nowhere/a x", "/nowhere/a 1", "a 1"] {
            let error = follow(words).err().unwrap().to_string();
            assert!(error.contains("cell"), "{words}: {error}");
        }
    }
}
