//! The channels of a cell: service names, quality of service, and how they are opened.
//!
//! The controller creates every service, in a new generation of the cell; learner and tool join the
//! newest complete one and retry. The facts behind
//! the choices: a policy must not live on a blackboard (a killed writer blocks the key for ever);
//! the default back-pressure blocks a publisher on a dead receiver, so every publisher discards.

use iceoryx2::active_request::ActiveRequest;
use iceoryx2::port::{publisher::Publisher, subscriber::Subscriber};
use iceoryx2::prelude::*;
use iceoryx2::sample_mut::SampleMut;
use iceoryx2::service::attribute::{AttributeKey, AttributeValue};
use iceoryx2::service::port_factory::{event, publish_subscribe, request_response};
use thiserror::Error;

use crate::SCHEMA;
use crate::advice;
use crate::cell::{Cell, CellError, Role};
use crate::command::{Command, Reply};
use crate::episode::{EpisodeHeader, TickRecord};
use crate::generation::Generation;
use crate::janitor::Janitor;
use crate::news::TRIAL_HISTORY;

/// Loans cross threads (exchange → rt → exchange), hence the thread-safe variant.
pub type Ipc = ipc_threadsafe::Service;
/// An episode in shared memory, not yet sent. Fill it in place; drop it only off the rt thread.
pub type EpisodeLoan = SampleMut<Ipc, [TickRecord], EpisodeHeader>;

/// A command whose reply may come later; kept until it is answered.
pub type CommandRequest = ActiveRequest<Ipc, Command, (), Reply, ()>;

pub(crate) const POLICY: &str = "skillet/policy";
pub(crate) const EPISODE: &str = "skillet/episode";
pub(crate) const ACK: &str = "skillet/ack";
pub(crate) const TELEMETRY: &str = "skillet/telemetry";
pub(crate) const IN_LOOP: &str = "skillet/policy-in-loop";
pub(crate) const OUTCOME: &str = "skillet/outcome";
pub(crate) const TRIAL: &str = "skillet/trial";
pub(crate) const MEASURES: &str = "skillet/measures";
pub(crate) const COMMAND: &str = "skillet/command";
pub(crate) const CONTROLLER_BEAT: &str = "skillet/controller-heartbeat";
pub(crate) const LEARNER_BEAT: &str = "skillet/learner-heartbeat";

/// Episodes loaned at once: one being filled, one being sent.
pub const EPISODE_LOANS: usize = 2;

/// Why a channel is not available.
#[derive(Debug, Error)]
pub enum ChannelError {
    #[error(transparent)]
    Cell(#[from] CellError),
    #[error("cannot join the cell '{cell}' ({reason}): {advice}")]
    Node { cell: String, reason: String, advice: String },
    #[error("channel {service}: {action} failed ({reason}): {advice}")]
    Service { service: &'static str, action: &'static str, reason: String, advice: String },
    #[error(
        "no controller in the cell '{cell}' after {seconds:.1} s: start the cell with `skillet cell up {cell}`, or a \
         controller alone with `skillet controller --cell {cell}`"
    )]
    NoController { cell: String, seconds: f64 },
    #[error(
        "the controller of cell '{cell}' does not respond ({seconds:.1} s): it is stopped or stuck; continue it (`kill -CONT`) or restart it"
    )]
    NoAnswer { cell: String, seconds: f64 },
    #[error(
        "cell '{cell}' is behind a bridge, and its machine {host} is not connected: check the network, and that \
         `skillet bridge join --cell {cell}` runs there"
    )]
    NotConnected { cell: String, host: String },
}

impl ChannelError {
    /// Nobody is there who could answer, as opposed to something that went wrong.
    pub fn is_absence(&self) -> bool {
        use ChannelError::{NoAnswer, NoController, NotConnected};
        matches!(self, NoController { .. } | NoAnswer { .. } | NotConnected { .. })
    }
}

pub(crate) fn failed<E: core::fmt::Debug>(
    service: &'static str,
    action: &'static str,
) -> impl Fn(E) -> ChannelError {
    move |error| {
        let reason = format!("{error:?}");
        let advice = advice::on_transport(&reason);
        ChannelError::Service { service, action, reason, advice }
    }
}

/// Create, in a generation that is new, or join.
#[derive(Clone, Copy, PartialEq)]
pub(crate) enum Door {
    Create,
    Open,
}

/// Publishers of a channel: one lives, the others are dead and not cleared away yet.
const PLACES: usize = 4;

pub(crate) struct Qos {
    history: usize,
    buffer: usize,
    publishers: usize,
    subscribers: usize,
}

/// This process in one generation of a cell.
pub(crate) struct Member {
    // Dropped first: it lives in the folder that the other one holds.
    pub node: Node<Ipc>,
    /// Before the node is there, and until it is gone: both look at what the dead left.
    _janitor: Janitor,
    pub generation: Generation,
}

impl Member {
    /// Joins a new generation, to be published once its services exist.
    pub fn first(cell: &Cell) -> Result<Member, ChannelError> {
        Member::of(cell, Generation::create(cell)?)
    }

    /// Joins the current generation; `None` if there is none, or its controller has died.
    pub fn join(cell: &Cell) -> Result<Option<Member>, ChannelError> {
        cell.expect_own()?;
        if !cell.has(Role::Controller) {
            return Ok(None);
        }
        Generation::current(cell)?.map(|generation| Member::of(cell, generation)).transpose()
    }

    fn of(cell: &Cell, generation: Generation) -> Result<Member, ChannelError> {
        set_log_level(LogLevel::Error);
        let janitor = Janitor::start(generation.shm_prefix());
        let node = NodeBuilder::new()
            .config(&generation.ipc_config())
            // Signals belong to the process, not to its transport.
            .signal_handling_mode(SignalHandlingMode::Disabled)
            .create::<Ipc>()
            .map_err(|error| {
                let reason = format!("{error:?}");
                let advice = advice::on_transport(&reason);
                ChannelError::Node { cell: cell.name().into(), reason, advice }
            })?;
        generation.close_to_others();
        Ok(Member { node, _janitor: janitor, generation })
    }
}

fn service_name(name: &'static str) -> Result<ServiceName, ChannelError> {
    name.try_into().map_err(failed(name, "naming"))
}

/// The schema of this build, written into a service by the process that creates it.
fn written_schema(service: &'static str) -> Result<AttributeSpecifier, ChannelError> {
    let (key, value) = schema(service)?;
    AttributeSpecifier::new().define(&key, &value).map_err(failed(service, "defining a schema"))
}

/// A process that joins a service must have the same schema.
fn required_schema(service: &'static str) -> Result<AttributeVerifier, ChannelError> {
    let (key, value) = schema(service)?;
    AttributeVerifier::new().require(&key, &value).map_err(failed(service, "requiring a schema"))
}

fn schema(service: &'static str) -> Result<(AttributeKey, AttributeValue), ChannelError> {
    let action = "naming an attribute";
    let key = "schema".try_into().map_err(failed(service, action))?;
    let value = format!("{SCHEMA:016x}").as_str().try_into().map_err(failed(service, action))?;
    Ok((key, value))
}

pub(crate) type PubSub<T, H = ()> = publish_subscribe::PortFactory<Ipc, T, H>;

/// A lossy latest-value channel: the newest sample overwrites the oldest.
pub(crate) fn latest<T: core::fmt::Debug + ZeroCopySend>(
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
            .create_with_attributes(&written_schema(name)?)
            .map_err(failed(name, "creating the service")),
        Door::Open => builder
            .open_with_attributes(&required_schema(name)?)
            .map_err(failed(name, "opening the service")),
    }
}

pub(crate) fn episodes(
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
            .create_with_attributes(&written_schema(EPISODE)?)
            .map_err(failed(EPISODE, "creating the service")),
        Door::Open => builder
            .open_with_attributes(&required_schema(EPISODE)?)
            .map_err(failed(EPISODE, "opening the service")),
    }
}

pub(crate) fn episode_events(
    node: &Node<Ipc>,
    door: Door,
) -> Result<event::PortFactory<Ipc>, ChannelError> {
    let builder = node.service_builder(&service_name(EPISODE)?).event();
    match door {
        Door::Create => builder.create().map_err(failed(EPISODE, "creating the event")),
        Door::Open => builder.open().map_err(failed(EPISODE, "opening the event")),
    }
}

pub(crate) type Commands = request_response::PortFactory<Ipc, Command, (), Reply, ()>;

pub(crate) fn commands(node: &Node<Ipc>, door: Door) -> Result<Commands, ChannelError> {
    let builder = node
        .service_builder(&service_name(COMMAND)?)
        .request_response::<Command, Reply>()
        .max_servers(1)
        .max_clients(16);
    match door {
        Door::Create => builder
            .create_with_attributes(&written_schema(COMMAND)?)
            .map_err(failed(COMMAND, "creating the service")),
        Door::Open => builder
            .open_with_attributes(&required_schema(COMMAND)?)
            .map_err(failed(COMMAND, "opening the service")),
    }
}

pub(crate) const POLICY_QOS: Qos =
    Qos { history: 1, buffer: 2, publishers: PLACES, subscribers: 2 };
/// A bridge that was cut off says what is durable of several sessions at once.
pub(crate) const ACK_QOS: Qos = Qos { history: 1, buffer: 16, publishers: PLACES, subscribers: 1 };
pub(crate) const TELEMETRY_QOS: Qos =
    Qos { history: 0, buffer: 64, publishers: PLACES, subscribers: 16 };
pub(crate) const IN_LOOP_QOS: Qos =
    Qos { history: 1, buffer: 16, publishers: PLACES, subscribers: 16 };
pub(crate) const OUTCOME_QOS: Qos =
    Qos { history: 1, buffer: 16, publishers: PLACES, subscribers: 16 };
/// Who comes late sees the reward curve all the same.
pub(crate) const TRIAL_QOS: Qos =
    Qos { history: TRIAL_HISTORY, buffer: TRIAL_HISTORY, publishers: PLACES, subscribers: 8 };
pub(crate) const MEASURES_QOS: Qos =
    Qos { history: 1, buffer: 16, publishers: PLACES, subscribers: 8 };
pub(crate) const BEAT_QOS: Qos = Qos { history: 1, buffer: 2, publishers: PLACES, subscribers: 16 };

pub(crate) fn publisher<T: core::fmt::Debug + ZeroCopySend>(
    factory: &PubSub<T>,
    name: &'static str,
) -> Result<Publisher<Ipc, T, ()>, ChannelError> {
    factory
        .publisher_builder()
        .backpressure_strategy(BackpressureStrategy::DiscardData)
        .create()
        .map_err(failed(name, "creating the publisher"))
}

pub(crate) fn subscriber<T: core::fmt::Debug + ZeroCopySend>(
    factory: &PubSub<T>,
    name: &'static str,
) -> Result<Subscriber<Ipc, T, ()>, ChannelError> {
    factory.subscriber_builder().create().map_err(failed(name, "creating the subscriber"))
}
