//! A service under test, and how soon it is up: by what it tells a service manager.

use std::ffi::{OsStr, OsString};
use std::os::unix::net::UnixDatagram;
use std::path::{Path, PathBuf};
use std::process::ExitStatus;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{Receiver, RecvTimeoutError, Sender, channel};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

use anyhow::{Context, Result, bail};

use crate::children::Service;

/// Nothing may take so long.
const PATIENCE: Duration = Duration::from_secs(30);
/// How soon a service is looked after that says nothing.
const LOOK: Duration = Duration::from_millis(5);
/// How soon the manager sees that its service has gone.
const SEE: Duration = Duration::from_millis(50);

pub struct Process {
    service: Service,
    manager: Manager,
    started: Instant,
}

/// Reads all the time, as a manager does: a socket holds a few messages only.
struct Manager {
    said: Receiver<String>,
    over: Arc<AtomicBool>,
    thread: Option<JoinHandle<()>>,
    socket: PathBuf,
}

impl Manager {
    fn start(socket: PathBuf) -> Result<Manager> {
        // Of the process before: what it said is not this one's.
        let _ = std::fs::remove_file(&socket);
        let inbox = UnixDatagram::bind(&socket)
            .with_context(|| format!("{}: cannot bind; use a shorter --out", socket.display()))?;
        inbox.set_read_timeout(Some(SEE))?;
        let (lines, said) = channel();
        let over = Arc::new(AtomicBool::new(false));
        let ends = over.clone();
        let read = move || listen(&inbox, &lines, &ends);
        let thread = std::thread::Builder::new().name("soak-manager".into()).spawn(read)?;
        Ok(Manager { said, over, thread: Some(thread), socket })
    }
}

impl Drop for Manager {
    fn drop(&mut self) {
        self.over.store(true, Ordering::Relaxed);
        if let Some(thread) = self.thread.take() {
            let _ = thread.join();
        }
        let _ = std::fs::remove_file(&self.socket);
    }
}

fn listen(inbox: &UnixDatagram, lines: &Sender<String>, over: &AtomicBool) {
    let mut message = [0; 512];
    while !over.load(Ordering::Relaxed) {
        let Ok(n) = inbox.recv(&mut message) else { continue };
        for line in String::from_utf8_lossy(&message[..n]).lines() {
            let _ = lines.send(line.into());
        }
    }
}

impl Process {
    /// Starts `skillet <arguments>`; `dir` holds its log and its notification socket.
    pub fn start(name: &'static str, arguments: &[&OsStr], dir: &Path) -> Result<Process> {
        Process::managed(name, dir, |log, socket| {
            Service::start_apart(name, arguments, log, &[("NOTIFY_SOCKET", socket)])
        })
    }

    /// The same with another program, and with further variables in its environment.
    pub fn start_program(
        name: &'static str,
        program: &[OsString],
        dir: &Path,
        environment: &[(&str, &OsStr)],
    ) -> Result<Process> {
        Process::managed(name, dir, |log, socket| {
            let environment = [environment, &[("NOTIFY_SOCKET", socket)]].concat();
            Service::start_program(name, program, log, &environment)
        })
    }

    fn managed(
        name: &'static str,
        dir: &Path,
        start: impl FnOnce(PathBuf, &OsStr) -> Result<Service>,
    ) -> Result<Process> {
        let manager = Manager::start(dir.join(format!("{name}.notify")))?;
        let started = Instant::now();
        let service = start(dir.join(format!("{name}.log")), manager.socket.as_os_str())?;
        Ok(Process { service, manager, started })
    }

    pub fn id(&self) -> u32 {
        self.service.id()
    }

    /// `Some` once it has ended.
    pub fn exited(&mut self) -> Result<Option<ExitStatus>> {
        self.service.exited()
    }

    /// Waits until it has told its manager `word`: time since its start. `None` when it ended first,
    /// with success; any other end is an error.
    pub fn said(&mut self, word: &str) -> Result<Option<Duration>> {
        while self.started.elapsed() < PATIENCE {
            match self.manager.said.recv_timeout(LOOK) {
                Ok(line) if line == word => return Ok(Some(self.started.elapsed())),
                Ok(_) => continue,
                Err(RecvTimeoutError::Timeout) => {}
                Err(RecvTimeoutError::Disconnected) => bail!("the service's socket is closed"),
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
    pub fn kill(&mut self) {
        self.service.kill();
    }

    /// It ends by itself, with an exit code.
    pub fn end(mut self) -> Result<()> {
        let start = Instant::now();
        while start.elapsed() < PATIENCE {
            match self.service.exited()? {
                Some(status) if status.code().is_some() => return Ok(()),
                Some(status) => bail!(self.service.obituary(status)),
                None => std::thread::sleep(LOOK),
            }
        }
        bail!("it has not ended within {PATIENCE:?}")
    }

    pub fn obituary(&self, status: ExitStatus) -> String {
        self.service.obituary(status)
    }

    /// SIGTERM; it must end cleanly.
    pub fn stop(mut self) -> Result<()> {
        let status = self.service.stop()?;
        match status.success() || status.code() == Some(1) {
            true => Ok(()),
            false => bail!(self.service.obituary(status)),
        }
    }
}
