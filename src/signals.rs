//! Signals that ask a command to end: SIGINT, SIGTERM and, where it is no service, the end of its terminal.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

use anyhow::{Context, Result};
use signal_hook::consts::{SIGHUP, SIGINT, SIGTERM};
use signal_hook::iterator::Signals;
use signal_hook::low_level::exit;

/// Signals closer together are one request: `timeout` sends two, a terminal one to each process.
const ONE_REQUEST: Duration = Duration::from_secs(1);
const INSTALLING: &str =
    "installing signal handlers, which takes a few open files: see `ulimit -n`";
/// Exit code of a command that ends unfinished.
const INTERRUPTED: i32 = 1;
/// Exit code of a process that a second request ends at once.
const AT_ONCE: i32 = 130;

/// Who is asked to end.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Who {
    /// A command in a terminal, which ends with it.
    Tool,
    /// A service; it lives on without its terminal, and SIGHUP is for `reload`.
    Service,
    /// A service that another command started, ends, and kills where it must.
    Child,
}

impl Who {
    /// A controller or learner, of the parent that started it.
    pub fn service(parent: Option<u32>) -> Who {
        if parent.is_some() { Who::Child } else { Who::Service }
    }
}

/// A flag set by the first request. Another request, a second later, ends the process at once.
pub fn stop_flag(who: Who) -> Result<Arc<AtomicBool>> {
    let mut signals = Signals::new(ending(who)).context(INSTALLING)?;
    let stop = Arc::new(AtomicBool::new(false));
    let flag = stop.clone();
    let listen = move || {
        let mut first = None;
        for _ in signals.forever() {
            flag.store(true, Ordering::Relaxed);
            let first = *first.get_or_insert_with(Instant::now);
            if first.elapsed() >= ONE_REQUEST && who != Who::Child {
                exit(AT_ONCE);
            }
        }
    };
    std::thread::Builder::new().name("skillet-signals".into()).spawn(listen)?;
    Ok(stop)
}

/// A request that `end_after` takes up has come.
static IS_ENDING: AtomicBool = AtomicBool::new(false);

/// Returns only if no end was requested. Later failures are caused by the end, which reports
/// itself.
pub fn let_it_end() {
    while IS_ENDING.load(Ordering::Relaxed) {
        std::thread::park();
    }
}

/// For a command that has nothing to finish: the first request ends the process after `last`.
pub fn end_after(last: impl FnOnce() + Send + 'static) -> Result<()> {
    let mut signals = Signals::new(ending(Who::Tool)).context(INSTALLING)?;
    let listen = move || {
        signals.forever().next();
        IS_ENDING.store(true, Ordering::Relaxed);
        last();
        exit(INTERRUPTED);
    };
    std::thread::Builder::new().name("skillet-signals".into()).spawn(listen)?;
    Ok(())
}

/// For a process that serves its parent `parent` until that ends: signals that reach both are for the
/// parent; the one that tells of its end ends this process after `last`.
pub fn end_after_parent(parent: u32, last: impl FnOnce() + Send + 'static) -> Result<()> {
    let mut signals = Signals::new(ending(Who::Tool)).context(INSTALLING)?;
    let listen = move || {
        signals.forever().find(|_| std::os::unix::process::parent_id() != parent);
        last();
        exit(INTERRUPTED);
    };
    std::thread::Builder::new().name("skillet-signals".into()).spawn(listen)?;
    Ok(())
}

/// The signals that ask for an end.
fn ending(who: Who) -> Vec<i32> {
    let mut signals = vec![SIGINT, SIGTERM];
    if who == Who::Tool && !is_ignored(SIGHUP) {
        signals.push(SIGHUP);
    }
    signals
}

/// `nohup` and some shells have a signal ignored: that is their wish.
fn is_ignored(signal: i32) -> bool {
    let status = std::fs::read_to_string("/proc/self/status").unwrap_or_default();
    let mask = status.lines().find_map(|line| line.strip_prefix("SigIgn:"));
    let mask = mask.and_then(|mask| u64::from_str_radix(mask.trim(), 16).ok());
    mask.is_some_and(|mask| mask & (1 << (signal - 1)) != 0)
}
