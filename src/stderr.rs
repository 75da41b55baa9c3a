//! Standard error that neither blocks nor ends a process: a thread writes the lines of all others.
//!
//! Its reader may be gone, be stuck, or be a full disk. Then lines are lost and counted, and the
//! log says how many once it is written again. `tests/tidy.rs` keeps everybody else from standard error.

use std::collections::VecDeque;
use std::fs::File;
use std::io::{self, ErrorKind, Write};
use std::os::fd::AsFd;
use std::sync::{Arc, Condvar, LazyLock, Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};

/// Lines that wait for a slow reader; the newest are lost.
const MAX_WAITING: usize = 4096;
/// How long a line of a tool is waited for, so that it comes before what follows on standard output.
const IN_TURN: Duration = Duration::from_millis(100);
/// How long the end of the process waits for what is still to be written.
const AT_END: Duration = Duration::from_secs(1);
/// A reader that asked not to be waited for is tried again after this long.
const AGAIN: Duration = Duration::from_millis(10);

/// The one of this process.
static STDERR: LazyLock<Sink> = LazyLock::new(|| {
    let elsewhere = ELSEWHERE.lock().unwrap_or_else(PoisonError::into_inner).take();
    Sink::start(elsewhere.unwrap_or_else(|| of_fd(io::stderr().as_fd())))
});
/// Where lines go instead of standard error.
static ELSEWHERE: Mutex<Option<Box<dyn Write + Send>>> = Mutex::new(None);

/// Where lines go; clones lead to the same place. Every call is a line, or several whole ones.
#[derive(Clone)]
pub struct Sink {
    shared: Arc<Shared>,
}

struct Shared {
    state: Mutex<State>,
    changed: Condvar,
}

#[derive(Default)]
struct State {
    waiting: VecDeque<Vec<u8>>,
    is_writing: bool,
    /// Nobody took the last line in time: the next ones are not waited for.
    is_stuck: bool,
    lost: u64,
}

/// Standard error, for logs. The first call starts its thread, with the core and priority of the caller.
pub fn sink() -> Sink {
    STDERR.clone()
}

/// Has all lines go to `target` instead; after the first line it has no effect.
pub fn redirect(target: Box<dyn Write + Send>) {
    *ELSEWHERE.lock().unwrap_or_else(PoisonError::into_inner) = Some(target);
}

/// Standard output, for progress that must not block.
pub fn stdout() -> Sink {
    Sink::start(of_fd(io::stdout().as_fd()))
}

/// Prints a line for the user of a tool.
pub fn say(text: &str) {
    STDERR.push(format!("{text}\n").into_bytes());
    if !STDERR.shared.lock().is_stuck {
        STDERR.flush_within(IN_TURN);
    }
}

/// Waits a moment for what is still to be written, before the process ends.
pub fn finish() {
    STDERR.finish();
}

/// Has a panic say what it has to say like everybody else.
pub fn take_panics() {
    std::panic::set_hook(Box::new(|panic| {
        let thread = std::thread::current();
        let name = thread.name().unwrap_or("unnamed");
        let trace = std::backtrace::Backtrace::capture();
        let trace = match trace.status() {
            std::backtrace::BacktraceStatus::Captured => format!("{trace}"),
            _ => "RUST_BACKTRACE=1 shows how it got there".into(),
        };
        STDERR.push(format!("thread '{name}': {panic}\n{trace}\n").into_bytes());
        finish();
    }));
}

/// A handle of its own: that of the standard library is locked by a thread that is stuck in it.
fn of_fd(fd: std::os::fd::BorrowedFd) -> Box<dyn Write + Send> {
    match fd.try_clone_to_owned() {
        Ok(fd) => Box::new(File::from(fd)),
        Err(_) => Box::new(io::sink()),
    }
}

impl Sink {
    fn start(target: Box<dyn Write + Send>) -> Sink {
        let shared = Arc::new(Shared { state: Mutex::default(), changed: Condvar::new() });
        let sink = Sink { shared: shared.clone() };
        let work = move || shared.write_to(target);
        // Without a thread nothing is said.
        let _ = std::thread::Builder::new().name("skillet-writer".into()).spawn(work);
        sink
    }

    pub fn push(&self, line: Vec<u8>) {
        let mut state = self.shared.lock();
        if state.waiting.len() < MAX_WAITING {
            state.waiting.push_back(line);
            self.shared.changed.notify_all();
        } else {
            state.lost += 1;
        }
    }

    /// Waits a moment for what is still to be written.
    pub fn finish(&self) {
        self.flush_within(AT_END);
    }

    /// Until all is written, or `patience` is over.
    fn flush_within(&self, patience: Duration) {
        let deadline = Instant::now() + patience;
        let mut state = self.shared.lock();
        while state.is_writing || !state.waiting.is_empty() {
            let left = deadline.saturating_duration_since(Instant::now());
            if left.is_zero() {
                state.is_stuck = true;
                return;
            }
            let waited = self.shared.changed.wait_timeout(state, left);
            state = waited.unwrap_or_else(PoisonError::into_inner).0;
        }
    }
}

impl Write for Sink {
    fn write(&mut self, line: &[u8]) -> io::Result<usize> {
        self.push(line.to_vec());
        Ok(line.len())
    }

    fn flush(&mut self) -> io::Result<()> {
        Ok(())
    }
}

impl Shared {
    fn lock(&self) -> MutexGuard<'_, State> {
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// The thread's work; it ends with the process.
    fn write_to(&self, mut target: Box<dyn Write + Send>) {
        let mut is_torn = false;
        let mut state = self.lock();
        loop {
            let Some(line) = state.waiting.pop_front() else {
                state = self.changed.wait(state).unwrap_or_else(PoisonError::into_inner);
                continue;
            };
            state.is_writing = true;
            drop(state);
            let written = write_line(&mut target, &line, &mut is_torn);
            state = self.lock();
            (state.is_writing, state.is_stuck) = (false, false);
            self.changed.notify_all();
            if written.is_err() {
                state.lost += 1;
            } else if state.lost > 0 {
                let lost = std::mem::take(&mut state.lost);
                drop(state);
                tracing::warn!(
                    lost,
                    "lines of the log were lost: its reader or its disk stood in the way"
                );
                state = self.lock();
            }
        }
    }
}

/// Writes a line as a whole; after one that was cut off, on a line of its own.
fn write_line(target: &mut dyn Write, line: &[u8], is_torn: &mut bool) -> io::Result<()> {
    let mut rest = match is_torn {
        true => [b"\n", line].concat(),
        false => line.to_vec(),
    };
    while !rest.is_empty() {
        match target.write(&rest) {
            Ok(0) => return Err(ErrorKind::WriteZero.into()),
            Ok(n) => {
                rest.drain(..n);
                *is_torn = !rest.is_empty();
            }
            Err(error) if error.kind() == ErrorKind::Interrupted => {}
            Err(error) if error.kind() == ErrorKind::WouldBlock => std::thread::sleep(AGAIN),
            Err(error) => return Err(error),
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::sync::mpsc::{Receiver, Sender, channel};

    /// Answers every write as it is told, in turn; then takes all.
    struct Target {
        answers: Receiver<io::Result<usize>>,
        taken: Sender<Vec<u8>>,
    }

    impl Write for Target {
        fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
            let n = self.answers.recv().unwrap_or(Ok(usize::MAX))?.min(bytes.len());
            let _ = self.taken.send(bytes[..n].to_vec());
            Ok(n)
        }

        fn flush(&mut self) -> io::Result<()> {
            Ok(())
        }
    }

    fn target() -> (Sink, Sender<io::Result<usize>>, Receiver<Vec<u8>>) {
        let (answer, answers) = channel();
        let (taken, written) = channel();
        (Sink::start(Box::new(Target { answers, taken })), answer, written)
    }

    #[test]
    fn a_reader_that_stands_still_costs_lines_and_no_time() {
        let (sink, answer, written) = target();
        for i in 0..MAX_WAITING + 10 {
            sink.push(format!("{i}\n").into_bytes());
        }
        // One is on its way, and as many as fit wait.
        let lost = sink.shared.lock().lost;
        assert!((9..=10).contains(&lost), "{lost}");
        sink.flush_within(Duration::from_millis(1));
        assert!(sink.shared.lock().is_stuck);
        drop(answer);
        assert_eq!(written.recv().unwrap(), b"0\n");
        sink.flush_within(Duration::from_secs(1000));
        assert_eq!(sink.shared.lock().lost, 0, "told");
    }

    #[test]
    fn what_a_full_disk_cuts_off_does_not_run_into_the_next_line() {
        let (mut sink, answer, written) = target();
        answer.send(Ok(2)).unwrap();
        answer.send(Err(ErrorKind::StorageFull.into())).unwrap();
        answer.send(Err(ErrorKind::BrokenPipe.into())).unwrap();
        answer.send(Err(ErrorKind::WouldBlock.into())).unwrap();
        drop(answer);
        for line in ["first\n", "second\n", "third\n"] {
            sink.write_all(line.as_bytes()).unwrap();
        }
        sink.flush_within(Duration::from_secs(1000));
        let text: Vec<u8> = written.try_iter().flatten().collect();
        assert_eq!(String::from_utf8(text).unwrap(), "fi\nthird\n");
    }
}
