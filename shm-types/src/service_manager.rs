//! Messages from a service to its manager (such as systemd), as in sd_notify(3), which never block.
//!
//! A manager that does not read fills its socket. Essential messages (`READY`, `STATUS`, …) are then kept
//! and sent with the next message that gets through; a sign of life is not worth resending.

use std::ffi::OsStr;
use std::os::linux::net::SocketAddrExt;
use std::os::unix::ffi::OsStrExt;
use std::os::unix::net::{SocketAddr, UnixDatagram};
use std::sync::{LazyLock, Mutex, PoisonError};
use std::time::Duration;

/// One message.
#[derive(Clone, Copy, Debug)]
pub enum Notice<'a> {
    /// The service is up.
    Ready,
    /// Its current activity, as text.
    Status(&'a str),
    /// A sign of life.
    Watchdog,
    /// Wait longer for its start.
    ExtendTimeout(Duration),
    /// It is ending.
    Stopping,
}

/// The socket that `$NOTIFY_SOCKET` names, and what it has not taken yet.
struct Manager {
    socket: Option<(UnixDatagram, SocketAddr)>,
    /// The newest value of each variable.
    owed: Vec<(&'static str, String)>,
}

/// Sends a message to the manager of this process, if there is one. Returns at once.
pub fn notify(notices: &[Notice]) {
    static MANAGER: LazyLock<Mutex<Manager>> =
        LazyLock::new(|| Mutex::new(Manager::at(std::env::var_os("NOTIFY_SOCKET").as_deref())));
    MANAGER.lock().unwrap_or_else(PoisonError::into_inner).tell(notices);
}

impl Notice<'_> {
    fn assignment(&self) -> (&'static str, String) {
        match self {
            Notice::Ready => ("READY", "1".into()),
            // A line feed would begin another variable.
            Notice::Status(text) => ("STATUS", text.replace('\n', " ")),
            Notice::Watchdog => ("WATCHDOG", "1".into()),
            Notice::ExtendTimeout(more) => ("EXTEND_TIMEOUT_USEC", more.as_micros().to_string()),
            Notice::Stopping => ("STOPPING", "1".into()),
        }
    }
}

impl Manager {
    /// One that cannot be reached is none.
    fn at(name: Option<&OsStr>) -> Manager {
        let socket = name.and_then(|name| {
            let address = match name.as_bytes().strip_prefix(b"@") {
                Some(name) => SocketAddr::from_abstract_name(name).ok()?,
                None => SocketAddr::from_pathname(name).ok()?,
            };
            let socket = UnixDatagram::unbound().ok()?;
            socket.set_nonblocking(true).ok()?;
            Some((socket, address))
        });
        Manager { socket, owed: Vec::new() }
    }

    fn tell(&mut self, notices: &[Notice]) {
        let Some((socket, address)) = &self.socket else { return };
        let mut message = String::new();
        for notice in notices {
            let (name, value) = notice.assignment();
            match notice {
                Notice::Watchdog => message += &format!("{name}={value}\n"),
                _ => {
                    self.owed.retain(|(owed, _)| *owed != name);
                    self.owed.push((name, value));
                }
            }
        }
        message.extend(self.owed.iter().map(|(name, value)| format!("{name}={value}\n")));
        // Full, gone or not there yet: what is owed goes with the next one.
        if !message.is_empty() && socket.send_to_addr(message.as_bytes(), address).is_ok() {
            self.owed.clear();
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn read(socket: &UnixDatagram) -> String {
        let mut buffer = [0; 512];
        let n = socket.recv(&mut buffer).unwrap();
        String::from_utf8_lossy(&buffer[..n]).into_owned()
    }

    #[test]
    fn a_manager_that_does_not_read_is_not_waited_for_and_learns_what_it_must_later() {
        let path = std::env::temp_dir().join(format!("skillet-manager-{}", std::process::id()));
        let socket = UnixDatagram::bind(&path).unwrap();
        let mut manager = Manager::at(Some(path.as_os_str()));
        // Far more than any queue holds: each of these would wait for ever.
        (0..2000).for_each(|_| manager.tell(&[Notice::Watchdog]));
        manager.tell(&[Notice::Ready]);
        manager.tell(&[Notice::Status("a")]);
        manager.tell(&[Notice::Status("b\nREADY=0")]);
        socket.set_nonblocking(true).unwrap();
        let mut buffer = [0; 64];
        while let Ok(n) = socket.recv(&mut buffer) {
            assert_eq!(&buffer[..n], b"WATCHDOG=1\n");
        }
        manager.tell(&[Notice::Watchdog]);
        assert_eq!(read(&socket), "WATCHDOG=1\nREADY=1\nSTATUS=b READY=0\n");
        manager.tell(&[]);
        assert!(socket.recv(&mut buffer).is_err(), "nothing is owed any more");
        std::fs::remove_file(&path).unwrap();
        manager.tell(&[Notice::Stopping]);
    }

    #[test]
    fn names_without_a_file_are_reached_and_none_is_none() {
        let name = format!("skillet-manager-{}", std::process::id());
        let address = SocketAddr::from_abstract_name(&name).unwrap();
        let socket = UnixDatagram::bind_addr(&address).unwrap();
        Manager::at(Some(OsStr::new(&format!("@{name}")))).tell(&[Notice::Ready]);
        assert_eq!(read(&socket), "READY=1\n");
        Manager::at(None).tell(&[Notice::Ready]);
    }
}
