//! The protocol over a Unix socket that keeps packets apart: one packet is one message.
//!
//! Nothing waits without a limit, and a peer that has died is seen at once: the kernel closes its end.

use std::io;
use std::os::fd::OwnedFd;
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

use rustix::event::{PollFd, PollFlags, Timespec, poll};
use rustix::io::Errno;
use rustix::net::sockopt::socket_peercred;
use rustix::net::{
    AddressFamily, RecvFlags, SendFlags, SocketAddrUnix, SocketFlags, SocketType, accept_with,
    bind, connect, listen, recv, send, socket_with,
};
use thiserror::Error;
use zerocopy::{FromBytes, Immutable, IntoBytes, KnownLayout};

use super::{
    KIND_COMMAND, KIND_HELLO, KIND_OUTCOME, KIND_STATE, KIND_WELCOME, PlantCommand, PlantHello,
    PlantOutcome, PlantState, PlantWelcome,
};
use crate::advice;
use crate::cell::Cell;

/// Where its parent has a plant connect to.
pub const PLANT_VARIABLE: &str = "SKILLET_PLANT";
const FILE: &str = "plant.sock";
/// Between two attempts to connect.
const AGAIN: Duration = Duration::from_millis(20);
/// How long an answer is looked out for: about a step of a simulator.
pub(super) const LOOK_OUT: Duration = Duration::from_micros(100);
/// Words of the longest message, and one more, so that a longer one shows.
const BUFFER_WORDS: usize = size_of::<PlantOutcome>() / 8 + 1;

/// The socket of a cell.
pub fn path(cell: &Cell) -> PathBuf {
    cell.dir().join(FILE)
}

/// Why a connection has ended, or must.
#[derive(Clone, Copy, Debug, Error, PartialEq, Eq)]
pub enum LinkError {
    #[error("the other end has closed the connection")]
    Gone,
    #[error("a message of kind {kind} with {length} bytes is not part of the protocol")]
    Malformed { kind: u64, length: usize },
    #[error("the socket failed: {0}")]
    Io(Errno),
}

/// A socket cannot be opened, or nobody answers there.
#[derive(Debug, Error)]
pub enum SocketError {
    #[error("{path}: {cause}: {}", advice::on_io(cause))]
    Io { path: PathBuf, cause: io::Error },
    #[error(
        "{path} is {length} characters long, a socket's path at most 107: choose a shorter one"
    )]
    TooLong { path: PathBuf, length: usize },
    #[error(
        "no controller is waiting for a plant at {path} after {seconds:.1} s: start one with \
         `skillet controller --plant external`"
    )]
    Nobody { path: PathBuf, seconds: f64 },
}

/// What came.
#[derive(Clone, Copy, Debug)]
pub enum Message<'a> {
    Hello(&'a PlantHello),
    Welcome(&'a PlantWelcome),
    State(&'a PlantState),
    Command(&'a PlantCommand),
    Outcome(&'a PlantOutcome),
}

/// Where a message is received to.
pub struct Buffer([u64; BUFFER_WORDS]);

impl Buffer {
    pub const fn new() -> Buffer {
        Buffer([0; BUFFER_WORDS])
    }
}

impl Default for Buffer {
    fn default() -> Self {
        Buffer::new()
    }
}

/// The controller's door: where plants come to.
pub struct Listener {
    socket: OwnedFd,
    path: PathBuf,
}

impl Listener {
    /// Call with the cell's controller lock held: what was there is another controller's no longer.
    pub fn bind(path: &Path) -> Result<Listener, SocketError> {
        let failed = |cause: io::Error| SocketError::Io { path: path.into(), cause };
        let address = address(path)?;
        if let Some(dir) = path.parent() {
            std::fs::create_dir_all(dir).map_err(failed)?;
        }
        match std::fs::remove_file(path) {
            Err(cause) if cause.kind() != io::ErrorKind::NotFound => return Err(failed(cause)),
            _ => {}
        }
        let socket = open(path)?;
        bind(&socket, &address).and_then(|()| listen(&socket, 4)).map_err(|e| failed(e.into()))?;
        Ok(Listener { socket, path: path.into() })
    }

    /// One that has come within `patience`, and its user.
    pub fn accept(&self, patience: Duration) -> Result<Option<(Connection, u32)>, LinkError> {
        if !is_readable(&self.socket, patience)? {
            return Ok(None);
        }
        let socket = match accept_with(&self.socket, SocketFlags::CLOEXEC) {
            Ok(socket) => socket,
            // It has gone again.
            Err(Errno::AGAIN | Errno::CONNABORTED | Errno::INTR) => return Ok(None),
            Err(errno) => return Err(LinkError::Io(errno)),
        };
        let uid = socket_peercred(&socket).map_err(LinkError::Io)?.uid.as_raw();
        Ok(Some((Connection { socket }, uid)))
    }
}

impl Drop for Listener {
    fn drop(&mut self) {
        // Nobody can connect to it any more; that it stays would do no harm.
        let _ = std::fs::remove_file(&self.path);
    }
}

/// One end of a plant's line to a controller.
#[derive(Debug)]
pub struct Connection {
    socket: OwnedFd,
}

impl Connection {
    /// The plant's end; tries until `patience` is over.
    pub fn connect(path: &Path, patience: Duration) -> Result<Connection, SocketError> {
        let address = address(path)?;
        let start = Instant::now();
        loop {
            let socket = open(path)?;
            match connect(&socket, &address) {
                Ok(()) => return Ok(Connection { socket }),
                Err(Errno::NOENT | Errno::CONNREFUSED | Errno::AGAIN | Errno::INTR) => {}
                Err(errno) => {
                    return Err(SocketError::Io { path: path.into(), cause: errno.into() });
                }
            }
            if start.elapsed() >= patience {
                let seconds = patience.as_secs_f64();
                return Err(SocketError::Nobody { path: path.into(), seconds });
            }
            std::thread::sleep(AGAIN);
        }
    }

    /// Sends a message without waiting: false when the peer has not taken those before.
    pub fn send<M: IntoBytes + Immutable + ?Sized>(&self, message: &M) -> Result<bool, LinkError> {
        match send(&self.socket, message.as_bytes(), SendFlags::DONTWAIT | SendFlags::NOSIGNAL) {
            Ok(_) => Ok(true),
            Err(Errno::AGAIN | Errno::INTR | Errno::NOBUFS) => Ok(false),
            Err(Errno::PIPE | Errno::CONNRESET | Errno::NOTCONN) => Err(LinkError::Gone),
            Err(errno) => Err(LinkError::Io(errno)),
        }
    }

    /// A message that comes within `patience`.
    pub fn receive<'a>(
        &self,
        buffer: &'a mut Buffer,
        patience: Duration,
    ) -> Result<Option<Message<'a>>, LinkError> {
        if !patience.is_zero() && !is_readable(&self.socket, patience)? {
            return Ok(None);
        }
        // The kernel would tell neither a packet without bytes from an end that is gone, nor send one.
        let bytes = buffer.0.as_mut_bytes();
        let received = match recv(&self.socket, &mut *bytes, RecvFlags::DONTWAIT) {
            // Said once, and before what the peer had to say.
            Err(Errno::CONNRESET) => recv(&self.socket, &mut *bytes, RecvFlags::DONTWAIT),
            received => received,
        };
        let length = match received {
            Ok((0, _)) | Err(Errno::CONNRESET | Errno::NOTCONN) => return Err(LinkError::Gone),
            Ok((length, _)) => length,
            Err(Errno::AGAIN | Errno::INTR) => return Ok(None),
            Err(errno) => return Err(LinkError::Io(errno)),
        };
        parse(&buffer.0.as_bytes()[..length]).map(Some)
    }

    /// The same of an answer that is under way: in lockstep only one end works at a time, so the other one
    /// looks out for it a moment before it sleeps, which halves the time of a step.
    pub fn receive_answer<'a>(
        &self,
        buffer: &'a mut Buffer,
        patience: Duration,
    ) -> Result<Option<Message<'a>>, LinkError> {
        let start = Instant::now();
        while start.elapsed() < LOOK_OUT {
            if is_readable(&self.socket, Duration::ZERO)? {
                break;
            }
            std::hint::spin_loop();
        }
        self.receive(buffer, patience)
    }

    /// A message, or the end, can be seen within `patience`.
    pub fn is_waiting(&self, patience: Duration) -> Result<bool, LinkError> {
        is_readable(&self.socket, patience)
    }

    /// The peer has closed its end.
    pub fn is_gone(&self) -> bool {
        let mut fds = [PollFd::new(&self.socket, PollFlags::RDHUP)];
        let ended = PollFlags::RDHUP | PollFlags::HUP | PollFlags::ERR;
        match poll(&mut fds, Some(&Timespec { tv_sec: 0, tv_nsec: 0 })) {
            Ok(_) => fds[0].revents().intersects(ended),
            Err(errno) => errno != Errno::INTR,
        }
    }
}

fn parse(bytes: &[u8]) -> Result<Message<'_>, LinkError> {
    fn of<M: FromBytes + Immutable + KnownLayout>(bytes: &[u8]) -> Option<&M> {
        M::ref_from_bytes(bytes).ok()
    }
    let kind = u64::read_from_prefix(bytes).map_or(0, |(kind, _)| kind);
    let message = match kind {
        KIND_HELLO => of(bytes).map(Message::Hello),
        KIND_WELCOME => of(bytes).map(Message::Welcome),
        KIND_STATE => of(bytes).map(Message::State),
        KIND_COMMAND => of(bytes).map(Message::Command),
        KIND_OUTCOME => of(bytes).map(Message::Outcome),
        _ => None,
    };
    message.ok_or(LinkError::Malformed { kind, length: bytes.len() })
}

fn address(path: &Path) -> Result<SocketAddrUnix, SocketError> {
    let length = path.as_os_str().len();
    SocketAddrUnix::new(path).map_err(|_| SocketError::TooLong { path: path.into(), length })
}

fn open(path: &Path) -> Result<OwnedFd, SocketError> {
    socket_with(AddressFamily::UNIX, SocketType::SEQPACKET, SocketFlags::CLOEXEC, None)
        .map_err(|errno| SocketError::Io { path: path.into(), cause: errno.into() })
}

/// Something can be read, or the end be seen, within `patience`.
fn is_readable(socket: &OwnedFd, patience: Duration) -> Result<bool, LinkError> {
    let mut fds = [PollFd::new(socket, PollFlags::IN)];
    let patience = Timespec {
        tv_sec: patience.as_secs().min(i64::MAX as u64) as i64,
        tv_nsec: patience.subsec_nanos().into(),
    };
    match poll(&mut fds, Some(&patience)) {
        Ok(n) => Ok(n > 0),
        Err(Errno::INTR) => Ok(false),
        Err(errno) => Err(LinkError::Io(errno)),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const SOON: Duration = Duration::from_secs(10);

    fn ends() -> (tempfile::TempDir, Connection, Connection) {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join(FILE);
        let listener = Listener::bind(&path).unwrap();
        let plant = Connection::connect(&path, SOON).unwrap();
        let (controller, uid) = listener.accept(SOON).unwrap().unwrap();
        assert_eq!(uid, rustix::process::getuid().as_raw());
        (dir, plant, controller)
    }

    #[test]
    fn a_message_arrives_as_it_was_sent_or_not_at_all() {
        let (_dir, plant, controller) = ends();
        let mut buffer = Buffer::new();
        assert!(controller.receive(&mut buffer, Duration::ZERO).unwrap().is_none());
        let sent = PlantState { seq: 7, q: [0.5; 7], ..PlantState::EMPTY };
        plant.send(&sent).unwrap();
        match controller.receive(&mut buffer, SOON).unwrap() {
            Some(Message::State(state)) => assert_eq!(*state, sent),
            other => panic!("{other:?}"),
        }
        // Too short, too long, of no kind.
        for (bytes, kind) in
            [(vec![3_u8, 0, 0, 0, 0, 0, 0, 0], 3), (vec![1; 4000], 0x0101_0101_0101_0101)]
        {
            plant.send(bytes.as_slice()).unwrap();
            let error = controller.receive(&mut buffer, SOON).unwrap_err();
            assert!(matches!(error, LinkError::Malformed { kind: k, .. } if k == kind), "{error}");
        }
        plant.send(&9_u64).unwrap();
        assert!(controller.receive(&mut buffer, SOON).is_err());
        assert!(!controller.is_gone());
        drop(plant);
        assert!(controller.is_gone());
        assert_eq!(controller.receive(&mut buffer, SOON).unwrap_err(), LinkError::Gone);
        assert_eq!(controller.send(&sent), Err(LinkError::Gone));
    }

    #[test]
    fn who_does_not_read_blocks_nobody() {
        let (_dir, plant, controller) = ends();
        let all = (0..100_000).all(|_| controller.send(&PlantCommand::HOLD).unwrap());
        assert!(!all, "a socket without end");
        // What was taken is still there, in order.
        let mut buffer = Buffer::new();
        let first = plant.receive(&mut buffer, SOON).unwrap();
        assert!(matches!(first, Some(Message::Command(_))));
    }

    #[test]
    fn nobody_there_is_an_error_in_words() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join(FILE);
        let error = Connection::connect(&path, Duration::from_millis(50)).unwrap_err();
        assert!(error.to_string().contains("--plant external"), "{error}");
        let long = dir.path().join("x".repeat(120));
        let error = Connection::connect(&long, SOON).unwrap_err();
        assert!(error.to_string().contains("at most 107"), "{error}");
        drop(Listener::bind(&path).unwrap());
        assert!(!path.exists());
    }
}
