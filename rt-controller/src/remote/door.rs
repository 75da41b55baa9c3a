//! The socket for plants: a thread that accepts one plant, monitors it and closes its connection.
//!
//! Everything slow happens here, so that the rt thread only sends and receives.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

use shm_types::cell::Cell;
use shm_types::channel::ChannelError;
use shm_types::plant::line::Line;
use shm_types::plant::shared::{Host, Shared};
use shm_types::plant::socket::{Buffer, Connection, LinkError, Listener, Message, SocketError};
use shm_types::plant::{MODE_STOP, PlantCommand, PlantHello, PlantState, PlantWelcome};

use crate::remote::expected::{Expected, External};
use crate::remote::{Arrival, Departure, DoorEnds, Ended, PlantName};

/// Timeout for a plant's Hello, and then for its first sample.
const PATIENCE: Duration = Duration::from_secs(5);
/// Time between two checks.
const ROUND: Duration = Duration::from_millis(20);
/// Time until the loop has noticed that its plant is gone.
const MOMENT: Duration = Duration::from_millis(1);
/// How often a simulator whose time stands still gets a sign of life.
const SIGN_OF_LIFE: Duration = Duration::from_millis(500);

pub(crate) struct Door {
    listener: Listener,
    cell: Option<Cell>,
    /// From the first plant on that polls.
    host: Option<Host>,
    expected: Expected,
    boot_id: u64,
    ends: DoorEnds,
    plant: PlantName,
    uid: u32,
    /// The plant in the loop.
    inside: Option<Inside>,
    told: Instant,
}

struct Inside {
    link: Arc<Connection>,
    name: String,
}

/// The thread of a socket; it ends when this is dropped.
pub(crate) struct DoorThread {
    is_over: Arc<AtomicBool>,
    thread: Option<JoinHandle<()>>,
}

impl Drop for DoorThread {
    fn drop(&mut self) {
        self.is_over.store(true, Ordering::Relaxed);
        if let Some(thread) = self.thread.take() {
            // One that panicked has said so.
            let _ = thread.join();
        }
    }
}

impl Door {
    /// Opens the socket of `external` and starts its thread.
    pub fn open(
        external: External,
        boot_id: u64,
        ends: DoorEnds,
        plant: PlantName,
    ) -> Result<DoorThread, SocketError> {
        let External { socket, cell, expected } = external;
        let listener = Listener::bind(&socket)?;
        tracing::info!(socket = %socket.display(), "waiting for a plant");
        let (uid, told) = (rustix::process::getuid().as_raw(), Instant::now());
        let (host, inside) = (None, None);
        let door = Door { listener, cell, host, expected, boot_id, ends, plant, uid, inside, told };
        let is_over = Arc::new(AtomicBool::new(false));
        let stop = is_over.clone();
        let thread = Some(std::thread::spawn(move || door.run(&stop)));
        Ok(DoorThread { is_over, thread })
    }

    /// Runs until `stop` is set.
    fn run(mut self, stop: &AtomicBool) {
        while !stop.load(Ordering::Relaxed) {
            self.look_after();
            match self.listener.accept(ROUND) {
                Ok(Some((link, uid))) => self.meet(link, uid, stop),
                Ok(None) => {}
                Err(error) => {
                    tracing::warn!("plant socket: {error}");
                    std::thread::sleep(ROUND);
                }
            }
        }
        if let Some(inside) = &self.inside {
            // It sees the end of the connection, too.
            let _ = inside.link.send(&PlantCommand { mode: MODE_STOP, ..PlantCommand::HOLD });
        }
    }

    /// Checks the connected plant, and sends it signs of life.
    fn look_after(&mut self) {
        let Some(inside) = &self.inside else { return };
        if let Ok(Departure { why, .. }) = self.ends.departures.pop() {
            if !matches!(why, Ended::Link(LinkError::Gone)) {
                // It may have gone meanwhile.
                let _ = inside.link.send(&PlantWelcome::refused(&why.to_string()));
            }
            tracing::error!(
                plant = inside.name,
                "the plant is lost: {why}; the arm is held. Restart the plant, then run `skillet rearm`"
            );
            self.inside = None;
            self.ends.has_hung_up.store(false, Ordering::Release);
            return;
        }
        if inside.link.is_gone() {
            self.ends.has_hung_up.store(true, Ordering::Release);
        } else if self.expected.is_simulated && self.told.elapsed() >= SIGN_OF_LIFE {
            self.told = Instant::now();
            // Full: then it has not even read the last ones.
            let _ = inside.link.send(&PlantCommand::HOLD);
        }
    }

    /// The next plant may be faster than the loop, which has to let the last one go first.
    fn see_off(&mut self, stop: &AtomicBool) {
        let start = Instant::now();
        let is_gone = |inside: &Inside| inside.link.is_gone();
        while self.inside.as_ref().is_some_and(is_gone)
            && start.elapsed() < PATIENCE
            && !stop.load(Ordering::Relaxed)
        {
            self.look_after();
            std::thread::sleep(MOMENT);
        }
    }

    fn meet(&mut self, link: Connection, uid: u32, stop: &AtomicBool) {
        self.see_off(stop);
        let said = match &self.inside {
            _ if uid != self.uid => {
                Err(format!("it runs as user {uid}, the controller as {}: use one user", self.uid))
            }
            Some(inside) => Err(format!(
                "the cell has a plant already, '{}': stop it, or choose another cell",
                inside.name
            )),
            None => self.introduce(&link, stop),
        };
        match said {
            Ok(Introduced { hello, state, shared }) => {
                let link = Arc::new(link);
                let arrival = Arrival { line: Line::new(link.clone(), shared), state };
                if self.ends.arrivals.push(arrival).is_ok() {
                    self.plant.set(&hello);
                    tracing::info!(plant = hello.name(), "plant connected");
                    self.inside = Some(Inside { link, name: hello.name() });
                }
            }
            Err(why) => {
                tracing::warn!("plant refused: {why}");
                let _ = link.send(&PlantWelcome::refused(&why));
            }
        }
    }

    /// Who is it, does it fit, where is the arm?
    fn introduce(&mut self, link: &Connection, stop: &AtomicBool) -> Result<Introduced, String> {
        let mut buffer = Buffer::new();
        let hello = match within_patience(link, &mut buffer, stop) {
            Ok(Some(Message::Hello(hello))) => *hello,
            other => return Err(said_instead("Hello", &other)),
        };
        self.expected.check(&hello).map_err(|refused| format!("'{}': {refused}", hello.name()))?;
        let mut welcome = PlantWelcome::accepted(self.boot_id, self.expected.period_ns);
        let mut shared = None;
        if hello.polls() {
            match self.invite(stop) {
                Ok(None) => {}
                Ok(Some((end, invitation))) => {
                    (welcome, shared) = (welcome.inviting(&invitation), Some(end));
                }
                Err(error) => tracing::warn!("no shared memory for the plant: {error}"),
            }
        }
        link.send(&welcome).map_err(|error| error.to_string())?;
        match within_patience(link, &mut buffer, stop) {
            Ok(Some(Message::State(state))) => Ok(Introduced { hello, state: *state, shared }),
            other => Err(said_instead("first State", &other)),
        }
    }

    /// Shared memory for a visit, once the cell's services are there.
    fn invite(&mut self, stop: &AtomicBool) -> Result<Option<(Seat, String)>, ChannelError> {
        let start = Instant::now();
        while self.host.is_none()
            && let Some(cell) = &self.cell
            && start.elapsed() < PATIENCE
            && !stop.load(Ordering::Relaxed)
        {
            self.host = Host::join(cell)?;
            std::thread::sleep(MOMENT);
        }
        self.host.as_mut().map(Host::invite).transpose()
    }
}

/// A plant that fits.
struct Introduced {
    hello: PlantHello,
    state: PlantState,
    shared: Option<Seat>,
}

type Seat = Shared<PlantCommand, PlantState>;

/// A message, unless the controller is to end meanwhile.
fn within_patience<'a>(
    link: &Connection,
    buffer: &'a mut Buffer,
    stop: &AtomicBool,
) -> Result<Option<Message<'a>>, LinkError> {
    let start = Instant::now();
    while start.elapsed() < PATIENCE && !stop.load(Ordering::Relaxed) {
        if link.is_waiting(ROUND)? {
            return link.receive(buffer, Duration::ZERO);
        }
    }
    Ok(None)
}

fn said_instead(expected: &str, said: &Result<Option<Message>, LinkError>) -> String {
    let seconds = PATIENCE.as_secs();
    match said {
        Ok(Some(_)) => format!("expected its {expected}, got another message"),
        Ok(None) => format!("it sent no {expected} within {seconds} s"),
        Err(error) => format!("before its {expected}: {error}"),
    }
}
