//! Clears away shared memory that a killed process left without a size.
//!
//! A process that dies between creating a segment and giving it a size leaves an empty file. iceoryx2 0.10
//! waits for such a file to grow, and of all its waits this one has no timeout: a process that connects to the dead
//! process, or cleans up after it, hangs. It looks for the file again and again, and gives up when it is
//! gone; so another thread must remove it. About one kill in 10,000 leaves one.

use std::fs;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread::JoinHandle;
use std::time::Duration;

use crate::generation::shared_memory;

const EVERY: Duration = Duration::from_millis(250);
/// An empty segment this old will stay empty: a living process needs microseconds.
const OLD: Duration = Duration::from_secs(1);
/// It needs next to none, and in a controller it is locked in memory.
const STACK: usize = 128 * 1024;

/// Looks after the segments of one generation for as long as it lives.
pub(crate) struct Janitor {
    is_over: Arc<AtomicBool>,
    thread: Option<JoinHandle<()>>,
}

impl Janitor {
    /// Starts to watch the segments whose names begin with `prefix`.
    pub fn start(prefix: &str) -> Janitor {
        let is_over = Arc::new(AtomicBool::new(false));
        let (prefix, over) = (prefix.to_string(), is_over.clone());
        let thread = std::thread::Builder::new().name("skillet-janitor".into()).stack_size(STACK);
        let look = move || {
            while !over.load(Ordering::Acquire) {
                remove_stillborn(&prefix, OLD);
                std::thread::park_timeout(EVERY);
            }
        };
        // Without a thread all is as it would be without a janitor.
        Janitor { is_over, thread: thread.spawn(look).ok() }
    }
}

impl Drop for Janitor {
    fn drop(&mut self) {
        self.is_over.store(true, Ordering::Release);
        if let Some(thread) = self.thread.take() {
            thread.thread().unpark();
            let _ = thread.join();
        }
    }
}

/// Removes the empty segments that are at least so `old`.
fn remove_stillborn(prefix: &str, old: Duration) {
    for path in shared_memory(prefix) {
        let Ok(found) = fs::metadata(&path) else { continue };
        let age = found.modified().ok().and_then(|at| at.elapsed().ok());
        if found.len() == 0 && age.is_some_and(|age| age >= old) {
            let _ = fs::remove_file(&path);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::fs::File;
    use std::path::PathBuf;
    use std::time::{Instant, SystemTime};

    fn segment(prefix: &str, name: &str, bytes: u64, age_s: u64) -> PathBuf {
        let path = PathBuf::from(format!("/dev/shm/{prefix}{name}"));
        let file = File::create(&path).unwrap();
        file.set_len(bytes).unwrap();
        file.set_modified(SystemTime::now() - Duration::from_secs(age_s)).unwrap();
        path
    }

    #[test]
    fn only_what_is_empty_and_old_goes() {
        let prefix = format!("skj{}_", std::process::id());
        let stillborn = segment(&prefix, "a.connection", 0, 5);
        let newborn = segment(&prefix, "b.connection", 0, 0);
        let grown = segment(&prefix, "c.connection", 8, 5);
        let foreign = segment("skother", &prefix, 0, 5);
        let janitor = Janitor::start(&prefix);
        let start = Instant::now();
        while stillborn.exists() && start.elapsed() < Duration::from_secs(30) {
            std::thread::sleep(Duration::from_millis(5));
        }
        drop(janitor);
        assert!(!stillborn.exists() && newborn.exists() && grown.exists() && foreign.exists());
        remove_stillborn(&prefix, Duration::ZERO);
        assert!(!newborn.exists() && grown.exists());
        let _ = (fs::remove_file(grown), fs::remove_file(foreign));
    }
}
