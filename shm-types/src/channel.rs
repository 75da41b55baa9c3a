//! The doors of a cell: service names, quality of service, and both ends of every channel.
//!
//! The controller creates every service; learner and tool open them and retry. The facts behind
//! the choices: a policy must not live on a blackboard (a killed writer blocks the key for ever);
//! the default back-pressure blocks a publisher on a dead receiver, so every publisher discards.

use std::time::{Duration, Instant};

use iceoryx2::port::update_connections::UpdateConnections;
use iceoryx2::port::{
    BackpressureAction, client::Client, listener::Listener, notifier::Notifier,
    publisher::Publisher, server::Server, subscriber::Subscriber,
};
use iceoryx2::prelude::*;
use iceoryx2::sample_mut::SampleMut;
use iceoryx2::service::port_factory::{event, publish_subscribe, request_response};
use thiserror::Error;

use crate::SCHEMA;
use crate::cell::Cell;
use crate::command::{Command, Reply};
use crate::episode::{Ack, EpisodeHeader, MAX_RECORDS, TickRecord};
use crate::policy::PolicyMsg;
use crate::telemetry::{Heartbeat, Telemetry};

/// Loans cross threads (exchange → rt → exchange), hence the thread-safe variant.
pub type Ipc = ipc_threadsafe::Service;
/// An episode in shared memory, not yet sent. Fill it in place; drop it only off the rt thread.
pub type EpisodeLoan = SampleMut<Ipc, [TickRecord], EpisodeHeader>;

const POLICY: &str = "skillet/policy";
const EPISODE: &str = "skillet/episode";
const ACK: &str = "skillet/ack";
const TELEMETRY: &str = "skillet/telemetry";
const COMMAND: &str = "skillet/command";
const CONTROLLER_BEAT: &str = "skillet/controller-heartbeat";
const LEARNER_BEAT: &str = "skillet/learner-heartbeat";

/// Episodes loaned at once: one being filled, one being sent.
pub const EPISODE_LOANS: usize = 2;

/// Why a channel is not available.
#[derive(Debug, Error)]
pub enum ChannelError {
    #[error(
        "cannot join the cell '{cell}': {reason}; check that its runtime directory is yours and that /dev/shm has space"
    )]
    Node { cell: String, reason: String },
    #[error(
        "channel {service}: {action} failed ({reason}); controller, learner and tool must be of one build: restart them together"
    )]
    Service { service: &'static str, action: &'static str, reason: String },
    #[error(
        "no controller in the cell '{cell}' after {seconds:.1} s: start one with `skillet controller --cell {cell}`"
    )]
    NoController { cell: String, seconds: f64 },
}

fn failed<E: core::fmt::Debug>(
    service: &'static str,
    action: &'static str,
) -> impl Fn(E) -> ChannelError {
    move |error| ChannelError::Service { service, action, reason: format!("{error:?}") }
}

/// Create (and join what exists), or only join.
#[derive(Clone, Copy, PartialEq)]
enum Door {
    Create,
    Open,
}

struct Qos {
    history: usize,
    buffer: usize,
    publishers: usize,
    subscribers: usize,
}

fn node(cell: &Cell) -> Result<Node<Ipc>, ChannelError> {
    set_log_level(LogLevel::Error);
    NodeBuilder::new()
        .config(&cell.ipc_config())
        // Signals belong to the process, not to its transport.
        .signal_handling_mode(SignalHandlingMode::Disabled)
        .create::<Ipc>()
        .map_err(|e| ChannelError::Node { cell: cell.name().into(), reason: format!("{e:?}") })
}

fn service_name(name: &'static str) -> Result<ServiceName, ChannelError> {
    name.try_into().map_err(failed(name, "naming"))
}

fn schema(service: &'static str) -> Result<AttributeVerifier, ChannelError> {
    let key = "schema".try_into().map_err(failed(service, "naming an attribute"))?;
    let value = format!("{SCHEMA:016x}")
        .as_str()
        .try_into()
        .map_err(failed(service, "naming an attribute"))?;
    AttributeVerifier::new().require(&key, &value).map_err(failed(service, "requiring a schema"))
}

type PubSub<T, H = ()> = publish_subscribe::PortFactory<Ipc, T, H>;

/// A lossy latest-value channel: the newest sample overwrites the oldest.
fn latest<T: core::fmt::Debug + ZeroCopySend>(
    node: &Node<Ipc>,
    name: &'static str,
    qos: &Qos,
    door: Door,
) -> Result<PubSub<T>, ChannelError> {
    let builder = node
        .service_builder(&service_name(name)?)
        .publish_subscribe::<T>()
        .enable_safe_overflow(true)
        .history_size(qos.history)
        .subscriber_max_buffer_size(qos.buffer)
        .max_publishers(qos.publishers)
        .max_subscribers(qos.subscribers);
    match door {
        Door::Create => builder
            .open_or_create_with_attributes(&schema(name)?)
            .map_err(failed(name, "creating the service")),
        Door::Open => builder
            .open_with_attributes(&schema(name)?)
            .map_err(failed(name, "opening the service")),
    }
}

fn episodes(
    node: &Node<Ipc>,
    door: Door,
) -> Result<PubSub<[TickRecord], EpisodeHeader>, ChannelError> {
    // No overflow: an episode is never overwritten by a later one.
    let builder = node
        .service_builder(&service_name(EPISODE)?)
        .publish_subscribe::<[TickRecord]>()
        .user_header::<EpisodeHeader>()
        .enable_safe_overflow(false)
        .subscriber_max_buffer_size(4)
        .subscriber_max_borrowed_samples(2)
        .max_publishers(1)
        .max_subscribers(2);
    match door {
        Door::Create => builder
            .open_or_create_with_attributes(&schema(EPISODE)?)
            .map_err(failed(EPISODE, "creating the service")),
        Door::Open => builder
            .open_with_attributes(&schema(EPISODE)?)
            .map_err(failed(EPISODE, "opening the service")),
    }
}

fn episode_events(node: &Node<Ipc>, door: Door) -> Result<event::PortFactory<Ipc>, ChannelError> {
    let builder = node.service_builder(&service_name(EPISODE)?).event();
    match door {
        Door::Create => builder.open_or_create().map_err(failed(EPISODE, "creating the event")),
        Door::Open => builder.open().map_err(failed(EPISODE, "opening the event")),
    }
}

type Commands = request_response::PortFactory<Ipc, Command, (), Reply, ()>;

fn commands(node: &Node<Ipc>, door: Door) -> Result<Commands, ChannelError> {
    let builder = node
        .service_builder(&service_name(COMMAND)?)
        .request_response::<Command, Reply>()
        .max_servers(1)
        .max_clients(8);
    match door {
        Door::Create => builder
            .open_or_create_with_attributes(&schema(COMMAND)?)
            .map_err(failed(COMMAND, "creating the service")),
        Door::Open => builder
            .open_with_attributes(&schema(COMMAND)?)
            .map_err(failed(COMMAND, "opening the service")),
    }
}

const POLICY_QOS: Qos = Qos { history: 1, buffer: 2, publishers: 2, subscribers: 2 };
const ACK_QOS: Qos = Qos { history: 1, buffer: 2, publishers: 1, subscribers: 1 };
const TELEMETRY_QOS: Qos = Qos { history: 0, buffer: 64, publishers: 1, subscribers: 16 };
const BEAT_QOS: Qos = Qos { history: 1, buffer: 2, publishers: 1, subscribers: 16 };

fn publisher<T: core::fmt::Debug + ZeroCopySend>(
    factory: &PubSub<T>,
    name: &'static str,
) -> Result<Publisher<Ipc, T, ()>, ChannelError> {
    factory
        .publisher_builder()
        .backpressure_strategy(BackpressureStrategy::DiscardData)
        .create()
        .map_err(failed(name, "creating the publisher"))
}

fn subscriber<T: core::fmt::Debug + ZeroCopySend>(
    factory: &PubSub<T>,
    name: &'static str,
) -> Result<Subscriber<Ipc, T, ()>, ChannelError> {
    factory.subscriber_builder().create().map_err(failed(name, "creating the subscriber"))
}

/// The controller's ends; owned by its exchange thread.
pub struct ControllerPorts {
    pub policies: Subscriber<Ipc, PolicyMsg, ()>,
    pub episodes: Publisher<Ipc, [TickRecord], EpisodeHeader>,
    pub episode_sent: Notifier<Ipc>,
    pub acks: Subscriber<Ipc, Ack, ()>,
    pub telemetry: Publisher<Ipc, Telemetry, ()>,
    pub commands: Server<Ipc, Command, (), Reply, ()>,
    pub beat: Publisher<Ipc, Heartbeat, ()>,
    pub learner_beat: Subscriber<Ipc, Heartbeat, ()>,
    // Last, so that it is dropped after the ports: it owns their liveness.
    node: Node<Ipc>,
}

impl ControllerPorts {
    /// Creates every service of the cell. Call with the cell's controller lock held.
    pub fn create(cell: &Cell) -> Result<ControllerPorts, ChannelError> {
        let node = node(cell)?;
        let door = Door::Create;
        let episodes = episodes(&node, door)?
            .publisher_builder()
            .initial_max_slice_len(MAX_RECORDS)
            .max_loaned_samples(EPISODE_LOANS)
            .backpressure_strategy(BackpressureStrategy::DiscardData)
            // A full learner must be noticed: the episode is then asked for again.
            .set_backpressure_handler(|_| BackpressureAction::DiscardDataAndFail)
            .create()
            .map_err(failed(EPISODE, "creating the publisher"))?;
        Ok(ControllerPorts {
            policies: subscriber(&latest(&node, POLICY, &POLICY_QOS, door)?, POLICY)?,
            episodes,
            episode_sent: episode_events(&node, door)?
                .notifier_builder()
                .create()
                .map_err(failed(EPISODE, "creating the notifier"))?,
            acks: subscriber(&latest(&node, ACK, &ACK_QOS, door)?, ACK)?,
            telemetry: publisher(&latest(&node, TELEMETRY, &TELEMETRY_QOS, door)?, TELEMETRY)?,
            beat: publisher(&latest(&node, CONTROLLER_BEAT, &BEAT_QOS, door)?, CONTROLLER_BEAT)?,
            learner_beat: subscriber(&latest(&node, LEARNER_BEAT, &BEAT_QOS, door)?, LEARNER_BEAT)?,
            // Last: whoever finds the command service finds all the others.
            commands: commands(&node, door)?
                .server_builder()
                .create()
                .map_err(failed(COMMAND, "creating the server"))?,
            node,
        })
    }

    /// Loans an episode of `n_records` zeroed records in shared memory.
    pub fn loan_episode(&self, n_records: usize) -> Result<EpisodeLoan, ChannelError> {
        let loan = self
            .episodes
            .loan_slice_uninit(n_records)
            .map_err(failed(EPISODE, "loaning an episode"))?;
        Ok(loan.write_from_fn(|_| TickRecord::ZERO))
    }

    /// Frees what dead processes held; also connects ports to newcomers.
    pub fn clean_up(&self) {
        let _ = self.node.try_cleanup_dead_nodes();
        // A late subscriber gets the newest heartbeat only when its publisher acts.
        let _ = self.beat.update_connections();
    }
}

/// The learner's ends.
pub struct LearnerPorts {
    pub policies: Publisher<Ipc, PolicyMsg, ()>,
    pub episodes: Subscriber<Ipc, [TickRecord], EpisodeHeader>,
    pub episode_sent: Listener<Ipc>,
    pub acks: Publisher<Ipc, Ack, ()>,
    pub beat: Publisher<Ipc, Heartbeat, ()>,
    pub controller_beat: Subscriber<Ipc, Heartbeat, ()>,
    node: Node<Ipc>,
}

impl LearnerPorts {
    /// Opens the cell's services, waiting up to `timeout` for a controller. `stop` ends the wait.
    pub fn open(
        cell: &Cell,
        timeout: Duration,
        stop: &dyn Fn() -> bool,
    ) -> Result<LearnerPorts, ChannelError> {
        let node = node(cell)?;
        wait_for_controller(cell, &node, timeout, stop)?;
        let door = Door::Open;
        Ok(LearnerPorts {
            policies: publisher(&latest(&node, POLICY, &POLICY_QOS, door)?, POLICY)?,
            episodes: episodes(&node, door)?
                .subscriber_builder()
                .create()
                .map_err(failed(EPISODE, "creating the subscriber"))?,
            episode_sent: episode_events(&node, door)?
                .listener_builder()
                .create()
                .map_err(failed(EPISODE, "creating the listener"))?,
            acks: publisher(&latest(&node, ACK, &ACK_QOS, door)?, ACK)?,
            beat: publisher(&latest(&node, LEARNER_BEAT, &BEAT_QOS, door)?, LEARNER_BEAT)?,
            controller_beat: subscriber(
                &latest(&node, CONTROLLER_BEAT, &BEAT_QOS, door)?,
                CONTROLLER_BEAT,
            )?,
            node,
        })
    }

    /// Frees what a dead controller held, and hands the newest policy to a restarted one.
    pub fn clean_up(&self) {
        let _ = self.node.try_cleanup_dead_nodes();
        let _ = self.policies.update_connections();
        let _ = self.acks.update_connections();
    }
}

/// The tool's ends: commands and telemetry.
pub struct ToolPorts {
    pub commands: Client<Ipc, Command, (), Reply, ()>,
    pub telemetry: Subscriber<Ipc, Telemetry, ()>,
    _node: Node<Ipc>,
}

impl ToolPorts {
    pub fn open(cell: &Cell, timeout: Duration) -> Result<ToolPorts, ChannelError> {
        let node = node(cell)?;
        wait_for_controller(cell, &node, timeout, &|| false)?;
        Ok(ToolPorts {
            commands: commands(&node, Door::Open)?
                .client_builder()
                .backpressure_strategy(BackpressureStrategy::DiscardData)
                .create()
                .map_err(failed(COMMAND, "creating the client"))?,
            telemetry: subscriber(
                &latest(&node, TELEMETRY, &TELEMETRY_QOS, Door::Open)?,
                TELEMETRY,
            )?,
            _node: node,
        })
    }

    /// Sends a command and waits for its reply; `None` after `timeout`.
    pub fn request(&self, kind: u64, id: u64, timeout: Duration) -> Option<Reply> {
        let command = Command { schema: SCHEMA, id, kind };
        let pending = self.commands.send_copy(command).ok()?;
        let deadline = Instant::now() + timeout;
        while Instant::now() < deadline {
            if let Ok(Some(reply)) = pending.receive()
                && reply.schema == SCHEMA
                && reply.id == id
            {
                return Some(*reply);
            }
            std::thread::sleep(Duration::from_micros(500));
        }
        None
    }
}

fn wait_for_controller(
    cell: &Cell,
    node: &Node<Ipc>,
    timeout: Duration,
    stop: &dyn Fn() -> bool,
) -> Result<(), ChannelError> {
    let start = Instant::now();
    loop {
        match commands(node, Door::Open) {
            Ok(_) => return Ok(()),
            Err(error) if !is_absent(&error) => return Err(error),
            Err(_) if stop() || start.elapsed() >= timeout => {
                let seconds = start.elapsed().as_secs_f64();
                return Err(ChannelError::NoController { cell: cell.name().into(), seconds });
            }
            Err(_) => std::thread::sleep(Duration::from_millis(5)),
        }
    }
}

/// The service is not there yet, as opposed to there but foreign.
fn is_absent(error: &ChannelError) -> bool {
    matches!(error, ChannelError::Service { reason, .. }
        if reason.contains("DoesNotExist") || reason.contains("HangsInCreation"))
}
