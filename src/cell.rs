//! The cell that a command is about: its name, its folder, its controller.

use std::path::PathBuf;
use std::time::Duration;

use anyhow::{Result, bail};
use rt_controller::rt::now_ns;
use shm_types::cell::Cell;
use shm_types::command::{ACCEPTED, Command, Reply, UNKNOWN, command_name};
use shm_types::ports::ToolPorts;

use crate::cli::CellArgs;
use crate::config::Config;

/// How long a command looks for a controller.
const OPEN: Duration = Duration::from_secs(1);

/// A cell as named on the command line, else by the configuration.
pub struct NamedCell {
    pub cell: Cell,
    config: Config,
}

impl NamedCell {
    pub fn of(args: &CellArgs) -> Result<NamedCell> {
        let config = Config::load(args.config.as_deref())?;
        let cell = Cell::new(args.cell.as_deref().unwrap_or(&config.cell.name))?;
        Ok(NamedCell { cell, config })
    }

    pub fn config(&self) -> &Config {
        &self.config
    }

    pub fn state_dir(&self) -> PathBuf {
        state_dir(&self.config, &self.cell)
    }

    /// The machine of the controller, if a bridge lies between.
    pub fn via(&self) -> Option<String> {
        let ports = ToolPorts::open(&self.cell, Duration::ZERO).ok()?;
        ports.ask(OPEN).ok()?.via()
    }

    /// Sends `command` and waits for the reply; a refusal is an error with the controller's reason. Also
    /// returns the time of sending (monotonic clock, ns): joining the cell takes longer than most commands.
    pub fn request(&self, command: &Command, timeout: Duration) -> Result<(Reply, u64)> {
        let ports = ToolPorts::open(&self.cell, OPEN)?;
        // Now: a bridge that is gone when the reply is due cannot say that it was one.
        let via = ports.ask(OPEN).ok().and_then(|reply| reply.via());
        let sent_ns = now_ns();
        let name = self.cell.name();
        let Some(reply) = ports.request(command, timeout) else {
            if let Some(host) = via {
                bail!(
                    "no reply through the bridge to {host} within {timeout:.0?}: it is unknown whether `{}` was \
                     carried out; `skillet status --cell {name}` shows the state of the cell",
                    command_name(command.kind)
                );
            }
            if ports.status(OPEN).is_none() {
                return Err(ports.silence(timeout).into());
            }
            bail!(
                "the controller of cell '{name}' has not executed the command within {timeout:.0?}: it is \
                 still queued; see `skillet status --cell {name}`"
            );
        };
        match (reply.accepted, reply.via()) {
            (ACCEPTED, _) => Ok((reply, sent_ns)),
            (UNKNOWN, _) => bail!("{}", reply.reason_text()),
            (_, Some(host)) => {
                bail!("refused, through the bridge to {host}: {}", reply.reason_text())
            }
            (_, None) => {
                bail!("refused by the controller of cell '{name}': {}", reply.reason_text())
            }
        }
    }
}

/// How the cells begin that `learn` makes for itself; its process id follows.
pub const PRIVATE: &str = "learn-";

/// The running command that made the cell `name` for itself, if one did.
pub fn owner(name: &str) -> Option<&'static str> {
    let made_by = [(PRIVATE, "learn"), ("soak-", "soak"), ("bench-", "bench"), ("bl-", "bench")];
    made_by.into_iter().find_map(|(prefix, command)| {
        let pid = name.strip_prefix(prefix)?.split('-').next()?;
        let program = std::fs::read_to_string(format!("/proc/{pid}/comm")).ok()?;
        (program.trim() == env!("CARGO_PKG_NAME")).then_some(command)
    })
}

/// Which way a reply came, behind what is said of it.
pub fn through(reply: &Reply) -> String {
    reply.via().map_or(String::new(), |host| format!(", through the bridge to {host}"))
}

/// The first of `names` that is among those before it.
pub fn named_twice(names: &[String]) -> Option<&String> {
    names.iter().enumerate().find(|(k, name)| names[..*k].contains(name)).map(|(_, name)| name)
}

/// Where a controller keeps what must survive it: `cell.state_dir`, else below
/// $SKILLET_STATE_DIR, $STATE_DIRECTORY (set by systemd), $XDG_STATE_HOME/skillet or
/// ~/.local/state/skillet.
pub fn state_dir(config: &Config, cell: &Cell) -> PathBuf {
    if let Some(dir) = &config.cell.state_dir {
        return dir.clone();
    }
    let of = |name: &str| std::env::var_os(name).map(PathBuf::from);
    let root = of("SKILLET_STATE_DIR")
        .or_else(|| of("STATE_DIRECTORY"))
        .or_else(|| of("XDG_STATE_HOME").map(|dir| dir.join("skillet")))
        .or_else(|| of("HOME").map(|dir| dir.join(".local/state/skillet")))
        .unwrap_or_else(|| std::env::temp_dir().join("skillet-state"));
    root.join(cell.name())
}
