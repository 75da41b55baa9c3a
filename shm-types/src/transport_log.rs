//! What the transport logs goes where everything else goes: to the log of this process, or nowhere.
//!
//! By itself iceoryx2 writes to standard error, with colours, also beside a full-screen view. Whoever
//! calls it gets an error and reports that.

use std::fmt::Arguments;

use iceoryx2::prelude::{LogLevel, set_log_level, set_logger};
use iceoryx2_log::Log;

struct ToTracing;

impl Log for ToTracing {
    fn log(&self, level: LogLevel, origin: Arguments<'_>, message: Arguments<'_>) {
        match level {
            LogLevel::Fatal => tracing::error!(target: "iceoryx2", "{message} ({origin})"),
            _ => tracing::warn!(target: "iceoryx2", "{message} ({origin})"),
        }
    }
}

/// To be called before anything of the transport; again does no harm.
pub(crate) fn take_over() {
    set_logger(&ToTracing);
    set_log_level(LogLevel::Error);
}
