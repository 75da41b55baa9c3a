//! Structured logs on standard error, which never block.

use tracing_subscriber::EnvFilter;

use crate::config::LogConfig;
use crate::{stderr, tty};

/// Sets the level of a log that has been started; the error says why it cannot.
pub type SetLevel = Box<dyn Fn(&str) -> Result<(), String> + Send>;

/// Starts logging; `RUST_LOG` overrides the configured level.
pub fn start(config: &LogConfig) -> SetLevel {
    // Now: a first line from the loop's thread would have the writer share its core and priority.
    stderr::sink();
    let filter =
        EnvFilter::try_from_default_env().unwrap_or_else(|_| EnvFilter::new(&config.level));
    let builder = tracing_subscriber::fmt()
        .with_writer(stderr::sink)
        .with_ansi(tty::has_color(&std::io::stderr()));
    // A second start in one process keeps the first; nothing else can fail here.
    match config.format.as_str() {
        "json" => {
            let builder = builder.json().with_env_filter(filter).with_filter_reloading();
            let handle = builder.reload_handle();
            let _ = builder.try_init();
            Box::new(move |level| handle.reload(EnvFilter::new(level)).map_err(|e| e.to_string()))
        }
        _ => {
            let builder =
                builder.with_target(false).with_env_filter(filter).with_filter_reloading();
            let handle = builder.reload_handle();
            let _ = builder.try_init();
            Box::new(move |level| handle.reload(EnvFilter::new(level)).map_err(|e| e.to_string()))
        }
    }
}
