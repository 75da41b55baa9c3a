//! A service under test, and how soon it is up: by what it tells a service manager.

use std::ffi::OsStr;
use std::io::ErrorKind;
use std::os::unix::net::UnixDatagram;
use std::path::{Path, PathBuf};
use std::process::{ExitStatus, Stdio};
use std::time::{Duration, Instant};

use anyhow::{Context, Result, bail};

use crate::children::Service;

/// Nothing may take so long.
const PATIENCE: Duration = Duration::from_secs(30);

pub struct Process {
    service: Service,
    manager: UnixDatagram,
    socket: PathBuf,
    started: Instant,
}

impl Process {
    /// Starts `skillet <arguments>`; `dir` holds its log and its notification socket.
    pub fn start(name: &'static str, arguments: &[&OsStr], dir: &Path) -> Result<Process> {
        let socket = dir.join(format!("{name}.notify"));
        // Of the process before: what it said is not this one's.
        let _ = std::fs::remove_file(&socket);
        let manager = UnixDatagram::bind(&socket)
            .with_context(|| format!("{}: cannot bind; use a shorter --out", socket.display()))?;
        let log = dir.join(format!("{name}.log"));
        let environment = [("NOTIFY_SOCKET", socket.as_os_str())];
        let started = Instant::now();
        let service = Service::start_with(name, arguments, log, Stdio::null(), &environment)?;
        Ok(Process { service, manager, socket, started })
    }

    pub fn id(&self) -> u32 {
        self.service.id()
    }

    /// `Some` once it has ended. Reads, as a manager does, what it has to say.
    pub fn exited(&mut self) -> Result<Option<ExitStatus>> {
        self.manager.set_nonblocking(true)?;
        while self.manager.recv(&mut [0; 512]).is_ok() {}
        self.service.exited()
    }

    /// Waits until it has told its manager `word`: time since its start. `None` when it ended first,
    /// with success; any other end is an error.
    pub fn said(&mut self, word: &str) -> Result<Option<Duration>> {
        self.manager.set_nonblocking(false)?;
        self.manager.set_read_timeout(Some(Duration::from_millis(5)))?;
        let mut message = [0; 512];
        while self.started.elapsed() < PATIENCE {
            match self.manager.recv(&mut message) {
                Ok(n) if String::from_utf8_lossy(&message[..n]).lines().any(|l| l == word) => {
                    return Ok(Some(self.started.elapsed()));
                }
                Ok(_) => continue,
                Err(error)
                    if matches!(error.kind(), ErrorKind::WouldBlock | ErrorKind::TimedOut) => {}
                Err(error) => return Err(error).context("listening to a service"),
            }
            match self.service.exited()? {
                Some(status) if status.success() => return Ok(None),
                Some(status) => bail!(self.service.obituary(status)),
                None => {}
            }
        }
        bail!("no '{word}' within {PATIENCE:?} after the start");
    }

    /// SIGKILL: it learns nothing of it.
    pub fn kill(mut self) {
        self.service.kill();
        let _ = std::fs::remove_file(&self.socket);
    }

    pub fn obituary(&self, status: ExitStatus) -> String {
        self.service.obituary(status)
    }

    /// SIGTERM; it must end in order.
    pub fn stop(mut self) -> Result<()> {
        let status = self.service.stop()?;
        let _ = std::fs::remove_file(&self.socket);
        match status.success() || status.code() == Some(1) {
            true => Ok(()),
            false => bail!(self.service.obituary(status)),
        }
    }
}
