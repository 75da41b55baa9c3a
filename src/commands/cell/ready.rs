//! Waits until a service says that it is ready, as systemd does.

use std::os::unix::net::UnixDatagram;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

use anyhow::{Context, Result, bail};

use crate::children::Service;
use crate::stderr::say;

/// How long a start may take that does not ask for more time.
const PATIENCE: Duration = Duration::from_secs(60);
const LOOK: Duration = Duration::from_millis(50);

/// The socket on which one service reports; its file goes with it.
pub struct Manager {
    socket: UnixDatagram,
    path: PathBuf,
}

/// What a wait has come to.
#[derive(Debug, PartialEq)]
pub enum Start {
    Ready,
    Interrupted,
}

impl Manager {
    /// In the folder of the cells, whose path is short; no cell can have this name.
    pub fn new(runtime_dir: &Path, service: &str) -> Result<Manager> {
        let path = runtime_dir.join(format!(".{service}-{}", std::process::id()));
        std::fs::create_dir_all(runtime_dir)
            .and_then(|()| UnixDatagram::bind(&path))
            .and_then(|socket| {
                socket.set_read_timeout(Some(LOOK))?;
                Ok(Manager { socket, path: path.clone() })
            })
            .with_context(|| format!("{}: cannot make a socket", path.display()))
    }

    pub fn path(&self) -> &Path {
        &self.path
    }

    /// Until the service is ready. If it ends or takes too long, the error shows the end of its log.
    pub fn wait_for(&self, service: &mut Service, stop: &AtomicBool) -> Result<Start> {
        let mut deadline = Instant::now() + PATIENCE;
        let mut buffer = [0; 4096];
        loop {
            if let Ok(n) = self.socket.recv(&mut buffer) {
                for line in String::from_utf8_lossy(&buffer[..n]).lines() {
                    match line.split_once('=') {
                        Some(("READY", "1")) => return Ok(Start::Ready),
                        Some(("STATUS", text)) => say(text),
                        Some(("EXTEND_TIMEOUT_USEC", more)) => {
                            let more = Duration::from_micros(more.parse().unwrap_or(0));
                            deadline = deadline.max(Instant::now() + more);
                        }
                        _ => {}
                    }
                }
            } else if let Some(status) = service.exited()? {
                bail!(service.obituary(status));
            }
            if stop.load(Ordering::Relaxed) {
                return Ok(Start::Interrupted);
            }
            if Instant::now() > deadline {
                bail!("not ready after {PATIENCE:?}; {}", service.last_words());
            }
        }
    }
}

impl Drop for Manager {
    fn drop(&mut self) {
        let _ = std::fs::remove_file(&self.path);
    }
}
