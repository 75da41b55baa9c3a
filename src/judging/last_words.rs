//! What a judge's program writes to its standard error: always taken, kept as `judge.log` as far as there is
//! space, its last line at hand. A full disk neither blocks nor ends the program.

use std::fs::{File, OpenOptions};
use std::io::{self, ErrorKind, Read, Write};
use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex, PoisonError};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

use super::answer::words;

/// A log that has grown so large begins anew; the one before is kept as `judge.log.old`.
const MAX_BYTES: u64 = 1_000_000;
/// Bytes of which the last line is taken.
const TAIL: usize = 4096;
/// How long the end of what a dead program wrote is waited for.
const PATIENCE: Duration = Duration::from_millis(100);

pub struct LastWords {
    tail: Arc<Mutex<Vec<u8>>>,
    /// Reads until nobody has the other end any more.
    reader: io::Result<JoinHandle<()>>,
}

impl LastWords {
    /// Takes what comes from `stderr` and keeps it at `path`.
    pub fn of(stderr: impl Read + Send + 'static, path: &Path) -> LastWords {
        let tail: Arc<Mutex<Vec<u8>>> = Arc::default();
        let (log, last) = (Log::at(path), tail.clone());
        let work = move || take(stderr, log, &last);
        let reader = std::thread::Builder::new().name("skillet-judge-log".into()).spawn(work);
        LastWords { tail, reader }
    }

    /// The last line of a program that is dead, where it said anything.
    pub fn line(&self) -> Option<String> {
        let start = Instant::now();
        let is_reading = || self.reader.as_ref().is_ok_and(|reader| !reader.is_finished());
        while is_reading() && start.elapsed() < PATIENCE {
            std::thread::sleep(Duration::from_millis(1));
        }
        let tail = self.tail.lock().unwrap_or_else(PoisonError::into_inner);
        let mut lines = tail.split(|byte| *byte == b'\n').map(words);
        lines.rfind(|line| !line.is_empty())
    }
}

fn take(mut stderr: impl Read, mut log: Log, tail: &Mutex<Vec<u8>>) {
    let mut some = [0; 4096];
    loop {
        match stderr.read(&mut some) {
            Ok(0) => return,
            Ok(n) => {
                // What cannot be kept is lost.
                let _ = log.append(&some[..n]);
                let mut tail = tail.lock().unwrap_or_else(PoisonError::into_inner);
                tail.extend_from_slice(&some[..n]);
                let too_many = tail.len().saturating_sub(TAIL);
                tail.drain(..too_many);
            }
            Err(error) if error.kind() == ErrorKind::Interrupted => {}
            Err(_) => return,
        }
    }
}

/// A file of limited size.
struct Log {
    path: PathBuf,
    file: Option<File>,
    bytes: u64,
}

impl Log {
    fn at(path: &Path) -> Log {
        Log { path: path.into(), file: None, bytes: 0 }
    }

    fn append(&mut self, some: &[u8]) -> io::Result<()> {
        if self.bytes > MAX_BYTES {
            self.file = None;
            std::fs::rename(&self.path, self.path.with_extension("log.old"))?;
        }
        if self.file.is_none() {
            let file = OpenOptions::new().create(true).append(true).open(&self.path)?;
            self.bytes = file.metadata()?.len();
            self.file = Some(file);
        }
        if let Some(file) = &mut self.file {
            file.write_all(some)?;
            self.bytes += some.len() as u64;
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::io::Cursor;

    /// All of `text` has been said.
    fn said(path: &Path, text: &[u8]) -> LastWords {
        let words = LastWords::of(Cursor::new(text.to_vec()), path);
        while words.reader.as_ref().is_ok_and(|reader| !reader.is_finished()) {
            std::thread::sleep(Duration::from_millis(1));
        }
        words
    }

    #[test]
    fn the_last_line_is_at_hand_and_all_of_them_are_kept() {
        let folder = tempfile::TempDir::new().unwrap();
        let path = folder.path().join("judge.log");
        let text = b"Traceback:\n  File\nValueError: no \x1bapex\n\n";
        assert_eq!(said(&path, text).line().as_deref(), Some("ValueError: no  apex"));
        assert_eq!(said(&path, b"").line(), None);
        assert_eq!(said(&path, b"again").line().as_deref(), Some("again"));
        let kept = std::fs::read(&path).unwrap();
        assert_eq!(kept, [&text[..], b"again"].concat());
    }

    #[test]
    fn a_flood_is_kept_in_two_files_of_limited_size() {
        let folder = tempfile::TempDir::new().unwrap();
        let path = folder.path().join("judge.log");
        let line = [b"a line\n".repeat(1_000_000), b"the end\n".to_vec()].concat();
        assert_eq!(said(&path, &line).line().as_deref(), Some("the end"));
        for name in ["judge.log", "judge.log.old"] {
            let bytes = std::fs::metadata(folder.path().join(name)).unwrap().len();
            assert!(bytes > 0 && bytes <= MAX_BYTES + 4096, "{name}: {bytes}");
        }
    }

    #[test]
    fn a_log_that_cannot_be_written_holds_nobody_up() {
        let nowhere = Path::new("/nowhere/judge.log");
        assert_eq!(said(nowhere, b"all the same\n").line().as_deref(), Some("all the same"));
    }
}
