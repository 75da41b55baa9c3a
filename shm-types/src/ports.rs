//! Both ends of every channel of a cell: what the controller, the learner and the tool hold.

use std::sync::Arc;
use std::time::{Duration, Instant};

use iceoryx2::port::update_connections::UpdateConnections;
use iceoryx2::port::{
    BackpressureAction, client::Client, listener::Listener, notifier::Notifier,
    publisher::Publisher, server::Server, subscriber::Subscriber,
};
use iceoryx2::prelude::*;

use crate::SCHEMA;
use crate::cell::Cell;
use crate::channel::*;
use crate::command::{COMMAND_STATUS, Command, Reply, Status};
use crate::episode::{Ack, EpisodeHeader, MAX_RECORDS, TickRecord};
use crate::policy::PolicyMsg;
use crate::telemetry::{Heartbeat, Telemetry};

/// A client looks for its reply without pause for this long.
const EAGER: Duration = Duration::from_millis(2);

/// A command without reply is sent again after this long.
const REPEAT: Duration = Duration::from_secs(1);

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
    node: Arc<Node<Ipc>>,
}

impl LearnerPorts {
    /// Opens the cell's services, waiting up to `timeout` for a controller. `stop` ends the wait.
    pub fn open(
        cell: &Cell,
        timeout: Duration,
        stop: &dyn Fn() -> bool,
    ) -> Result<LearnerPorts, ChannelError> {
        let node = Arc::new(node(cell)?);
        with_retry(cell, timeout, stop, || LearnerPorts::try_open(node.clone()))
    }

    fn try_open(node: Arc<Node<Ipc>>) -> Result<LearnerPorts, ChannelError> {
        let door = Door::Open;
        // First: the controller creates it last, so with it all the others are there.
        commands(&node, door)?;
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

/// The tool's end.
pub struct ToolPorts {
    pub commands: Client<Ipc, Command, (), Reply, ()>,
    _node: Arc<Node<Ipc>>,
}

impl ToolPorts {
    pub fn open(cell: &Cell, timeout: Duration) -> Result<ToolPorts, ChannelError> {
        let node = Arc::new(node(cell)?);
        with_retry(cell, timeout, &|| false, || ToolPorts::try_open(node.clone()))
    }

    fn try_open(node: Arc<Node<Ipc>>) -> Result<ToolPorts, ChannelError> {
        Ok(ToolPorts {
            commands: commands(&node, Door::Open)?
                .client_builder()
                .backpressure_strategy(BackpressureStrategy::DiscardData)
                .create()
                .map_err(failed(COMMAND, "creating the client"))?,
            _node: node,
        })
    }

    /// Sends a command and waits for its reply; `None` after `timeout`. What is lost on the way, either
    /// way, is sent again: its id makes a repetition the same command.
    pub fn request(&self, command: &Command, timeout: Duration) -> Option<Reply> {
        let start = Instant::now();
        loop {
            let left = timeout.checked_sub(start.elapsed())?;
            if let Some(reply) = self.attempt(command, left.min(REPEAT)) {
                return Some(reply);
            }
        }
    }

    fn attempt(&self, command: &Command, patience: Duration) -> Option<Reply> {
        let start = Instant::now();
        let pending = self.commands.send_copy(*command).ok();
        while start.elapsed() < patience {
            if let Some(Ok(Some(reply))) = pending.as_ref().map(|pending| pending.receive())
                && reply.schema == SCHEMA
                && reply.id == command.id
            {
                return Some(*reply);
            }
            // Most replies come at once; the others must not cost a core.
            match start.elapsed() < EAGER {
                true => std::thread::yield_now(),
                false => std::thread::sleep(Duration::from_micros(500)),
            }
        }
        None
    }

    pub fn status(&self, timeout: Duration) -> Option<Status> {
        let id = u64::from(std::process::id());
        self.request(&Command::new(COMMAND_STATUS, id), timeout).map(|reply| reply.status)
    }
}

/// An observer's end: it looks, and nobody notices.
pub struct ObserverPorts {
    pub telemetry: Subscriber<Ipc, Telemetry, ()>,
    _node: Arc<Node<Ipc>>,
}

impl ObserverPorts {
    pub fn open(cell: &Cell, timeout: Duration) -> Result<ObserverPorts, ChannelError> {
        let node = Arc::new(node(cell)?);
        with_retry(cell, timeout, &|| false, || {
            let service = latest(&node, TELEMETRY, &TELEMETRY_QOS, Door::Open)?;
            let telemetry = subscriber(&service, TELEMETRY)?;
            Ok(ObserverPorts { telemetry, _node: node.clone() })
        })
    }
}

/// Repeats `open` while services are absent, coming up or going down, up to `timeout`.
fn with_retry<T>(
    cell: &Cell,
    timeout: Duration,
    stop: &dyn Fn() -> bool,
    open: impl Fn() -> Result<T, ChannelError>,
) -> Result<T, ChannelError> {
    let start = Instant::now();
    loop {
        match open() {
            Ok(ports) => return Ok(ports),
            Err(error) if !is_transient(&error) => return Err(error),
            Err(_) if stop() || start.elapsed() >= timeout => {
                let seconds = start.elapsed().as_secs_f64();
                return Err(ChannelError::NoController { cell: cell.name().into(), seconds });
            }
            Err(_) => std::thread::sleep(Duration::from_millis(5)),
        }
    }
}

/// The service is not there, not yet or not any more, as opposed to there but foreign.
fn is_transient(error: &ChannelError) -> bool {
    let transient = ["DoesNotExist", "HangsInCreation", "IsMarkedForDestruction"];
    matches!(error, ChannelError::Service { reason, .. }
        if transient.iter().any(|word| reason.contains(word)))
}
