//! A service in the background: in a session of its own, with its log in a file that stays bounded.

use std::fs::{self, File, OpenOptions};
use std::io::{self, Write};
use std::path::{Path, PathBuf};

use anyhow::{Context, Result};

use crate::stderr;

/// A log that has grown beyond this many bytes is set aside as `<log>.1`, which replaces the one before.
const MAX_BYTES: u64 = 8_000_000;

/// Leaves the session of the terminal and logs to the file `log`. Call it before the first line is logged.
pub fn enter(log: &Path) -> Result<()> {
    rustix::process::setsid().context("leaving the session of the terminal")?;
    stderr::redirect(Box::new(BoundedLog::open(log, MAX_BYTES)?));
    Ok(())
}

/// A log file that is replaced when it has grown too large.
struct BoundedLog {
    path: PathBuf,
    file: File,
    bytes: u64,
    max_bytes: u64,
    /// What is written next begins a line.
    is_at_start: bool,
}

impl BoundedLog {
    fn open(path: &Path, max_bytes: u64) -> Result<BoundedLog> {
        let opened = append_to(path).and_then(|file| Ok((file.metadata()?.len(), file)));
        let (bytes, file) =
            opened.with_context(|| format!("{}: cannot write the log", path.display()))?;
        Ok(BoundedLog { path: path.into(), file, bytes, max_bytes, is_at_start: true })
    }

    /// If it fails, the log grows on; the next line tries again.
    fn set_aside(&mut self) -> io::Result<()> {
        let mut old = self.path.clone().into_os_string();
        old.push(".1");
        fs::rename(&self.path, old)?;
        (self.file, self.bytes) = (append_to(&self.path)?, 0);
        Ok(())
    }
}

impl Write for BoundedLog {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        if self.is_at_start && self.bytes >= self.max_bytes {
            let _ = self.set_aside();
        }
        let n = self.file.write(bytes)?;
        self.bytes += n as u64;
        self.is_at_start = bytes[..n].ends_with(b"\n");
        Ok(n)
    }

    fn flush(&mut self) -> io::Result<()> {
        Ok(())
    }
}

fn append_to(path: &Path) -> io::Result<File> {
    OpenOptions::new().create(true).append(true).open(path)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_log_keeps_two_files_of_whole_lines() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("c.log");
        fs::write(&path, "before\n").unwrap();
        let mut log = BoundedLog::open(&path, 40).unwrap();
        for i in 0..100 {
            log.write_all(format!("line {i} ").as_bytes()).unwrap();
            log.write_all(b"ends\n").unwrap();
        }
        let text = |name: &str| fs::read_to_string(dir.path().join(name)).unwrap();
        let both = text("c.log.1") + &text("c.log");
        assert!(both.ends_with("line 99 ends\n"), "{both}");
        assert!(both.len() < 100 && both.len() > 40, "{both}");
        assert!(
            both.lines().all(|line| line.starts_with("line ") && line.ends_with(" ends")),
            "{both}"
        );
        assert_eq!(fs::read_dir(dir.path()).unwrap().count(), 2);
    }
}
