//! SIGHUP: a service reads its configuration again and takes over what is safe while it runs.
//!
//! That is the level of its log. Everything else decides what a session, a policy or a deadline means:
//! it is named, and waits for a restart.

use std::path::{Path, PathBuf};

use anyhow::{Context, Result};
use signal_hook::consts::SIGHUP;
use signal_hook::iterator::Signals;

use crate::config::{Config, LogConfig};
use crate::log::SetLevel;

/// Listens until the process ends. `path` is what it was started with; without one there is nothing to
/// read again, and a SIGHUP is no reason to die.
pub fn on_hangup(path: Option<&Path>, running: &Config, set_level: SetLevel) -> Result<()> {
    let mut signals = Signals::new([SIGHUP]).context("listening for SIGHUP")?;
    let (path, running) = (path.map(Path::to_path_buf), running.clone());
    let listen = move || {
        for _ in signals.forever() {
            reload(path.as_ref(), &running, &set_level);
        }
    };
    std::thread::Builder::new().name("skillet-reload".into()).spawn(listen)?;
    Ok(())
}

fn reload(path: Option<&PathBuf>, running: &Config, set_level: &SetLevel) {
    let Some(path) = path else {
        tracing::warn!("nothing to reload: this service was started without --config");
        return;
    };
    let config = match Config::load(Some(path)) {
        Ok(config) => config,
        Err(error) => {
            tracing::error!("configuration not reloaded: {error:#}");
            return;
        }
    };
    if let Err(error) = set_level(&config.log.level) {
        tracing::error!("log.level not changed: {error}");
    }
    let changed = changed_tables(running, &config);
    tracing::info!(level = config.log.level, "configuration reloaded");
    if !changed.is_empty() {
        tracing::warn!("changes in {} take effect after a restart", changed.join(", "));
    }
}

/// Tables with changes that need a restart.
fn changed_tables(running: &Config, config: &Config) -> Vec<&'static str> {
    let log = |config: &Config| LogConfig { level: String::new(), ..config.log.clone() };
    [
        ("[cell]", running.cell != config.cell),
        ("[task]", running.task != config.task),
        ("[log]", log(running) != log(config)),
        ("[plant]", running.plant != config.plant),
        ("[controller]", running.controller != config.controller),
        ("[learner]", running.learner != config.learner),
        ("[metrics]", running.metrics != config.metrics),
    ]
    .into_iter()
    .filter_map(|(table, differs)| differs.then_some(table))
    .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_the_level_of_the_log_needs_no_restart() {
        let running = Config::default();
        let mut config = running.clone();
        config.log.level = "debug".into();
        assert!(changed_tables(&running, &config).is_empty());
        config.log.format = "json".into();
        config.controller.period_us = 2000;
        assert_eq!(changed_tables(&running, &config), ["[log]", "[controller]"]);
    }
}
