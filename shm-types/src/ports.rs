//! Both ends of every channel of a cell: what the controller, the learner and the tool hold.

use std::sync::Arc;
use std::time::{Duration, Instant};

use iceoryx2::port::update_connections::UpdateConnections;
use iceoryx2::port::{
    BackpressureAction, listener::Listener, notifier::Notifier, publisher::Publisher,
    server::Server, subscriber::Subscriber,
};
use iceoryx2::prelude::*;

use crate::cell::{Cell, Role};
use crate::channel::*;
use crate::command::{Command, Reply};
use crate::episode::{Ack, EpisodeHeader, MAX_RECORDS, TickRecord};
use crate::generation::sweep;
use crate::news::{MeasuresNews, TrialNews};
pub use crate::observer::ObserverPorts;
use crate::policy::PolicyMsg;
use crate::telemetry::{Heartbeat, Telemetry};
pub use crate::tool::ToolPorts;

/// The controller's ends; owned by its exchange thread.
pub struct ControllerPorts {
    pub policies: Subscriber<Ipc, PolicyMsg, ()>,
    pub episodes: Publisher<Ipc, [TickRecord], EpisodeHeader>,
    pub episode_sent: Notifier<Ipc>,
    pub acks: Subscriber<Ipc, Ack, ()>,
    pub telemetry: Publisher<Ipc, Telemetry, ()>,
    telemetry_service: PubSub<Telemetry>,
    /// Every policy that goes into the loop, before it does.
    pub in_loop: Publisher<Ipc, PolicyMsg, ()>,
    /// The header of every rollout that has ended.
    pub outcomes: Publisher<Ipc, EpisodeHeader, ()>,
    pub commands: Server<Ipc, Command, (), Reply, ()>,
    pub beat: Publisher<Ipc, Heartbeat, ()>,
    pub learner_beat: Subscriber<Ipc, Heartbeat, ()>,
    /// Between learner and observers: here it only exists.
    _trials: PubSub<TrialNews>,
    _measures: PubSub<MeasuresNews>,
    cell: Cell,
    // Last, so that it is dropped after the ports: it owns their liveness.
    member: Member,
}

impl ControllerPorts {
    /// Whether a learner is in the cell, heard or not.
    pub fn has_learner(&self) -> bool {
        self.cell.has(Role::Learner)
    }

    /// Whether anybody looks at the loop, though it may stand still.
    pub fn has_observers(&self) -> bool {
        self.telemetry_service.dynamic_config().number_of_subscribers() > 0
    }

    /// Creates every service of the cell. Call with the cell's controller lock held.
    pub fn create(cell: &Cell) -> Result<ControllerPorts, ChannelError> {
        let member = Member::first(cell)?;
        let ports = ControllerPorts::create_in(member, cell)?;
        ports.member.generation.publish()?;
        Ok(ports)
    }

    fn create_in(member: Member, cell: &Cell) -> Result<ControllerPorts, ChannelError> {
        let (node, door) = (&member.node, Door::Create);
        let telemetry_service = latest(node, TELEMETRY, &TELEMETRY_QOS, door)?;
        let episodes = episodes(node, door)?
            .publisher_builder()
            .initial_max_slice_len(MAX_RECORDS)
            .max_loaned_samples(EPISODE_LOANS)
            .backpressure_strategy(BackpressureStrategy::DiscardData)
            // A full learner must be noticed: the episode is then asked for again.
            .set_backpressure_handler(|_| BackpressureAction::DiscardDataAndFail)
            .create()
            .map_err(failed(EPISODE, "creating the publisher"))?;
        Ok(ControllerPorts {
            policies: subscriber(&latest(node, POLICY, &POLICY_QOS, door)?, POLICY)?,
            episodes,
            episode_sent: episode_events(node, door)?
                .notifier_builder()
                .create()
                .map_err(failed(EPISODE, "creating the notifier"))?,
            acks: subscriber(&latest(node, ACK, &ACK_QOS, door)?, ACK)?,
            telemetry: publisher(&telemetry_service, TELEMETRY)?,
            telemetry_service,
            in_loop: publisher(&latest(node, IN_LOOP, &IN_LOOP_QOS, door)?, IN_LOOP)?,
            outcomes: publisher(&latest(node, OUTCOME, &OUTCOME_QOS, door)?, OUTCOME)?,
            _trials: latest(node, TRIAL, &TRIAL_QOS, door)?,
            _measures: latest(node, MEASURES, &MEASURES_QOS, door)?,
            beat: publisher(&latest(node, CONTROLLER_BEAT, &BEAT_QOS, door)?, CONTROLLER_BEAT)?,
            learner_beat: subscriber(&latest(node, LEARNER_BEAT, &BEAT_QOS, door)?, LEARNER_BEAT)?,
            commands: commands(node, door)?
                .server_builder()
                .create()
                .map_err(failed(COMMAND, "creating the server"))?,
            cell: cell.clone(),
            member,
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

    /// The same services anew, in a generation of their own. Everybody moves over.
    pub fn renewed(&self) -> Result<ControllerPorts, ChannelError> {
        ControllerPorts::create(&self.cell)
    }

    /// Frees what dead processes held, and what they left. Returns how many of the dead could not be
    /// cleared away.
    pub fn clean_up(&self) -> usize {
        let _ = self.member.node.try_cleanup_dead_nodes();
        sweep(&self.cell);
        self.member.generation.leaked()
    }

    /// Gives late subscribers what was sent before they came: that happens only when the publisher acts.
    pub fn meet_newcomers(&self) {
        let _ = self.beat.update_connections();
        let _ = self.in_loop.update_connections();
    }
}

/// The learner's ends.
pub struct LearnerPorts {
    pub policies: Publisher<Ipc, PolicyMsg, ()>,
    pub episodes: Subscriber<Ipc, [TickRecord], EpisodeHeader>,
    pub episode_sent: Listener<Ipc>,
    pub acks: Publisher<Ipc, Ack, ()>,
    /// What was learnt, for observers.
    pub trials: Publisher<Ipc, TrialNews, ()>,
    pub measures: Publisher<Ipc, MeasuresNews, ()>,
    pub beat: Publisher<Ipc, Heartbeat, ()>,
    pub controller_beat: Subscriber<Ipc, Heartbeat, ()>,
    cell: Cell,
    member: Arc<Member>,
}

impl LearnerPorts {
    /// Opens the cell's services, waiting up to `timeout` for a controller. `stop` ends the wait.
    pub fn open(
        cell: &Cell,
        timeout: Duration,
        stop: &dyn Fn() -> bool,
    ) -> Result<LearnerPorts, ChannelError> {
        with_retry(cell, timeout, stop, |member| LearnerPorts::try_open(cell, member))
    }

    fn try_open(cell: &Cell, member: &Arc<Member>) -> Result<LearnerPorts, ChannelError> {
        let (node, door) = (&member.node, Door::Open);
        Ok(LearnerPorts {
            policies: publisher(&latest(node, POLICY, &POLICY_QOS, door)?, POLICY)?,
            episodes: episodes(node, door)?
                .subscriber_builder()
                .create()
                .map_err(failed(EPISODE, "creating the subscriber"))?,
            episode_sent: episode_events(node, door)?
                .listener_builder()
                .create()
                .map_err(failed(EPISODE, "creating the listener"))?,
            acks: publisher(&latest(node, ACK, &ACK_QOS, door)?, ACK)?,
            trials: publisher(&latest(node, TRIAL, &TRIAL_QOS, door)?, TRIAL)?,
            measures: publisher(&latest(node, MEASURES, &MEASURES_QOS, door)?, MEASURES)?,
            beat: publisher(&latest(node, LEARNER_BEAT, &BEAT_QOS, door)?, LEARNER_BEAT)?,
            controller_beat: subscriber(
                &latest(node, CONTROLLER_BEAT, &BEAT_QOS, door)?,
                CONTROLLER_BEAT,
            )?,
            cell: cell.clone(),
            member: member.clone(),
        })
    }

    /// Moves over to the services of a controller that has started since; true when it has. Nothing
    /// that was sent to the old ones has arrived.
    pub fn follow(&mut self) -> Result<bool, ChannelError> {
        if self.member.generation.is_current() {
            return Ok(false);
        }
        match LearnerPorts::open(&self.cell, Duration::ZERO, &|| false) {
            Ok(ports) => {
                *self = ports;
                Ok(true)
            }
            Err(ChannelError::NoController { .. }) => Ok(false),
            Err(error) => Err(error),
        }
    }

    /// Frees what dead processes held.
    pub fn clean_up(&self) {
        let _ = self.member.node.try_cleanup_dead_nodes();
        let _ = self.policies.update_connections();
        let _ = self.acks.update_connections();
        let _ = self.trials.update_connections();
        let _ = self.measures.update_connections();
    }
}

/// Waits until an episode is sent in one of these cells, or for `timeout`. False if it cannot wait.
pub fn wait_for_episode(cells: &[&LearnerPorts], timeout: Duration) -> bool {
    // Not a listener's own timed wait, not even of one cell: it polls, at first busily, then every 10 ms.
    let disabled = SignalHandlingMode::Disabled;
    let Ok(all) = WaitSetBuilder::new().signal_handling_mode(disabled).create::<Ipc>() else {
        return false;
    };
    let attached: Vec<_> =
        cells.iter().filter_map(|cell| all.attach_notification(&cell.episode_sent).ok()).collect();
    let on_any = |_| CallbackProgression::Stop;
    let woken = all.wait_and_process_once_with_timeout(on_any, timeout).is_ok();
    for cell in cells {
        let _ = cell.episode_sent.try_wait(|_| {});
    }
    woken && attached.len() == cells.len()
}

/// Repeats `open` in the current generation while services are absent, coming up or going down, up
/// to `timeout`.
pub(crate) fn with_retry<T>(
    cell: &Cell,
    timeout: Duration,
    stop: &dyn Fn() -> bool,
    open: impl Fn(&Arc<Member>) -> Result<T, ChannelError>,
) -> Result<T, ChannelError> {
    let start = Instant::now();
    let mut joined: Option<Arc<Member>> = None;
    loop {
        if joined.as_ref().is_none_or(|member| !member.generation.is_current()) {
            joined = Member::join(cell)?.map(Arc::new);
        }
        let is_over = stop() || start.elapsed() >= timeout;
        match joined.as_ref().map(&open) {
            Some(Ok(ports)) => return Ok(ports),
            Some(Err(error)) if !is_transient(&error) => return Err(error),
            Some(Err(error)) if is_over && has_no_place(&error) => return Err(error),
            _ if is_over => {
                let seconds = start.elapsed().as_secs_f64();
                return Err(ChannelError::NoController { cell: cell.name().into(), seconds });
            }
            _ => {
                // Their places may be what is missing.
                if let Some(member) = &joined {
                    let _ = member.node.try_cleanup_dead_nodes();
                }
                std::thread::sleep(Duration::from_millis(5));
            }
        }
    }
}

/// The service is not there, not yet or not any more, or its places are taken by the dead, as opposed to
/// there but foreign.
fn is_transient(error: &ChannelError) -> bool {
    let transient = ["DoesNotExist", "HangsInCreation", "IsMarkedForDestruction"];
    has_no_place(error)
        || matches!(error, ChannelError::Service { reason, .. }
            if transient.iter().any(|word| reason.contains(word)))
}

/// As many as a service takes are in it already.
fn has_no_place(error: &ChannelError) -> bool {
    matches!(error, ChannelError::Service { reason, .. } if reason.contains("ExceedsMax"))
}
