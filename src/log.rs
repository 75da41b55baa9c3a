//! Structured logs on standard error, which never block.

use tracing_subscriber::filter::Targets;
use tracing_subscriber::layer::SubscriberExt;
use tracing_subscriber::util::SubscriberInitExt;
use tracing_subscriber::{Layer, fmt, registry, reload};

use crate::config::LogConfig;
use crate::{stderr, tty};

/// Sets the level of a log that has been started; the error says why it cannot.
pub type SetLevel = Box<dyn Fn(&str) -> Result<(), String> + Send>;

/// Starts logging. `RUST_LOG`, a level or a list of `target=level`, overrides the configured level.
pub fn start(config: &LogConfig) -> SetLevel {
    // Now: a first line from the loop's thread would have the writer share its core and priority.
    stderr::sink();
    let of_environment = std::env::var("RUST_LOG").ok().filter(|text| !text.is_empty());
    let wanted = of_environment.and_then(|text| text.parse::<Targets>().ok());
    let configured = || config.level.parse().unwrap_or_default();
    let (filter, handle) = reload::Layer::new(wanted.unwrap_or_else(configured));
    let lines =
        fmt::layer().with_writer(stderr::sink).with_ansi(tty::has_color(&std::io::stderr()));
    let lines = match config.format.as_str() {
        "json" => lines.json().boxed(),
        _ => lines.with_target(false).boxed(),
    };
    // A second start in one process keeps the first; nothing else can fail here.
    let _ = registry().with(filter).with(lines).try_init();
    Box::new(move |level| {
        let filter = level.parse::<Targets>().map_err(|error| format!("{level}: {error}"))?;
        handle.reload(filter).map_err(|error| error.to_string())
    })
}
