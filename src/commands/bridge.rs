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
        BridgeVerb::Ros2(args) => network::ros2(args),
    }
}

#[cfg(feature = "bridge")]
mod network {
    use std::path::Path;
    use std::sync::atomic::Ordering;
    use std::time::Instant;

    use anyhow::{Context, Result, bail};
    use bridge::command::Accepts;
    use bridge::event::Event;
    use bridge::hub::{self, HubConfig};
    use bridge::join::{self, JoinConfig};
    use bridge::keys::{self, KeysConfig};
    use bridge::net::Keys;
    use bridge::ros2::layout::{self, NodeName};
    use bridge::ros2::node::Graph;
    use rt_controller::rt::{leave_core, loop_core};
    use shm_types::cell::Cell;
    use shm_types::random_id;
    use shm_types::service_manager::{Notice, notify};

    use crate::Verdict;
    use crate::cell::{NamedCell, named_twice};
    use crate::cli::bridge::{JoinArgs, KeysArgs, Ros2Args, ServeArgs};
    use crate::config::{Config, LogConfig};
    use crate::ros2::live::{self, LiveConfig};
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
            accepts: Accepts { commands: args.accept_commands, rearm: args.accept_rearm },
            telemetry_hz: args.telemetry,
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

    pub fn ros2(args: &Ros2Args) -> Result<Verdict> {
        let named = NamedCell::of(&args.cell)?;
        let stop = start(None, named.config(), args.cell.config.as_deref())?;
        let since = Instant::now();
        let graph = match &args.listen {
            Some(address) => Graph::Here(address.clone()),
            None => Graph::Router(args.connect.clone()),
        };
        let live = LiveConfig {
            cell: &named.cell,
            config: named.config(),
            graph,
            node: node_name(args, named.cell.name())?,
            rate_hz: args.rate,
        };
        // One that waits for its router or its controller is up.
        notify(&[Notice::Ready]);
        live::run(&live, &|| {
            let elapsed = since.elapsed().as_secs_f64();
            stop.load(Ordering::Relaxed) || args.duration_s.is_some_and(|limit| elapsed >= limit)
        })?;
        notify(&[Notice::Stopping]);
        Ok(Verdict::Done)
    }

    /// Names of ROS have no hyphen.
    fn node_name(args: &Ros2Args, cell: &str) -> Result<NodeName> {
        let namespace = match args.namespace.trim_matches('/') {
            "" => String::new(),
            inner => format!("/{inner}"),
        };
        if !namespace.is_empty() && !layout::is_namespace(&namespace) {
            let given = &args.namespace;
            bail!(
                "--namespace '{given}': use letters, digits and '_', as in kitchen or line_2/kitchen"
            );
        }
        let domain = match (args.domain, std::env::var("ROS_DOMAIN_ID")) {
            (Some(domain), _) => domain,
            (None, Ok(text)) if !text.is_empty() => text.parse().with_context(|| {
                format!("ROS_DOMAIN_ID is '{text}': set it to a number, or give --domain")
            })?,
            _ => 0,
        };
        Ok(NodeName { domain, namespace, name: format!("skillet_{}", cell.replace('-', "_")) })
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
        Ok(setup::equipment(config)?.world())
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
