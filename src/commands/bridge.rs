//! `skillet bridge`: cells on other machines.

use anyhow::Result;

use crate::Verdict;
use crate::cli::bridge::BridgeArgs;

#[cfg(not(feature = "bridge"))]
pub fn run(args: &BridgeArgs) -> Result<Verdict> {
    let crate::cli::bridge::BridgeArgs { verb: _ } = args;
    anyhow::bail!(crate::cli::bridge::NOT_BUILT)
}

#[cfg(feature = "bridge")]
pub fn run(args: &BridgeArgs) -> Result<Verdict> {
    use crate::cli::bridge::BridgeVerb;
    match &args.verb {
        BridgeVerb::Serve(args) => network::serve(args),
        BridgeVerb::Join(args) => network::join(args),
        BridgeVerb::Keys(args) => network::keys(args),
    }
}

#[cfg(feature = "bridge")]
mod network {
    use std::path::Path;

    use anyhow::{Result, bail};
    use bridge::event::Event;
    use bridge::hub::{self, HubConfig};
    use bridge::join::{self, JoinConfig};
    use bridge::keys::{self, KeysConfig};
    use bridge::net::Keys;
    use rt_controller::rt::{leave_core, loop_core};
    use sha2::{Digest, Sha256};
    use shm_types::cell::Cell;
    use shm_types::random_id;
    use shm_types::service_manager::{Notice, notify};

    use crate::Verdict;
    use crate::cell::named_twice;
    use crate::cli::bridge::{JoinArgs, KeysArgs, ServeArgs};
    use crate::config::{Config, LogConfig};
    use crate::signals::{Who, stop_flag};
    use crate::{log, output, reload, setup};

    pub fn serve(args: &ServeArgs) -> Result<Verdict> {
        let config = Config::load(args.config.as_deref())?;
        let stop = start(args.child, &config, args.config.as_deref())?;
        if let Some(twice) = named_twice(&args.allow) {
            bail!("--allow {twice}: named twice");
        }
        let hub = HubConfig {
            listen: args.listen.clone(),
            keys: args.keys.as_deref().map(Keys::at),
            cells: args.allow.iter().map(|name| Cell::new(name)).collect::<Result<_, _>>()?,
            world: world(args.config.as_deref(), &config)?,
            id: random_id(),
        };
        hub::run(&hub, &stop, &|event| {
            if let Event::Serves { .. } = event {
                notify(&[Notice::Ready]);
            }
            tell(&event);
        })?;
        notify(&[Notice::Stopping]);
        Ok(Verdict::Done)
    }

    pub fn join(args: &JoinArgs) -> Result<Verdict> {
        let config = Config::load(args.config.as_deref())?;
        let stop = start(args.child, &config, args.config.as_deref())?;
        let join = JoinConfig {
            cell: Cell::new(args.cell.as_deref().unwrap_or(&config.cell.name))?,
            connect: args.connect.clone(),
            keys: args.keys.as_deref().map(Keys::at),
            world: world(args.config.as_deref(), &config)?,
            id: random_id(),
        };
        // One that waits for its learner is up.
        notify(&[Notice::Ready]);
        join::run(&join, &stop, &mut |event| tell(&event))?;
        notify(&[Notice::Stopping]);
        Ok(Verdict::Done)
    }

    pub fn keys(args: &KeysArgs) -> Result<Verdict> {
        let KeysArgs { out, learner, cells, days } = args;
        let folders = keys::make(&KeysConfig { out, learner, cells, days: *days })?;
        for folder in &folders {
            output::print(&format!("{}\n", folder.display()))?;
        }
        output::print(&format!(
            "valid for {days} days, from yesterday on; copy each folder to its machine, and keep {} elsewhere\n",
            out.join("ca.key").display()
        ))?;
        Ok(Verdict::Done)
    }

    /// As every service of a cell does. The loop keeps its core.
    fn start(
        child: Option<u32>,
        config: &Config,
        path: Option<&Path>,
    ) -> Result<std::sync::Arc<std::sync::atomic::AtomicBool>> {
        if let Some(parent) = child {
            setup::end_with_parent(parent)?;
        }
        leave_core(loop_core(config.controller.cpu)); // before a thread starts
        let stop = stop_flag(Who::service(child))?;
        // Of its every attempt the transport says what goes wrong, and much besides.
        let level = format!("{},zenoh=warn", config.log.level);
        let set_level = log::start(&LogConfig { level, ..config.log.clone() });
        reload::on_hangup(path, config, set_level)?;
        Ok(stop)
    }

    /// Task and arm of a configuration that was named; nothing of one that was not.
    fn world(path: Option<&Path>, config: &Config) -> Result<String> {
        if path.is_none() {
            return Ok(String::new());
        }
        let task = &config.task.name;
        if config.task()?.arm().is_err() {
            return Ok(format!("task {task}"));
        }
        let digest = Sha256::digest(setup::arm_text(config)?);
        let digest: String = digest[..6].iter().map(|byte| format!("{byte:02x}")).collect();
        Ok(format!("task {task} on the arm with URDF {digest}"))
    }

    fn tell(event: &Event) {
        notify(&[Notice::Status(&event.to_string())]);
        if event.is_warning() {
            tracing::warn!("{event}");
        } else {
            tracing::info!("{event}");
        }
    }
}
