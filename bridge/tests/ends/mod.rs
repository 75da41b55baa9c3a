//! The ends of a bridge: a learner and a controller over real shared memory, each reduced to what the other can tell,
//! and both halves of the bridge as threads.

#![allow(dead_code)]

use std::collections::BTreeMap;
use std::net::TcpListener;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

use bridge::command::Accepts;
use bridge::event::Event;
use bridge::hub::{self, HubConfig};
use bridge::join::{self, JoinConfig};
use bridge::live::MAX_HZ;
use bridge::net::Keys;
use shm_types::SCHEMA;
use shm_types::cell::{Cell, Role};
use shm_types::channel::CommandRequest;
use shm_types::command::{COMMAND_STATUS, Reply, Status};
use shm_types::episode::{Ack, EpisodeHeader, TickRecord};
use shm_types::policy::PolicyMsg;
use shm_types::ports::{ControllerPorts, LearnerPorts};
use shm_types::telemetry::{Heartbeat, TELEMETRY_TICKS, Telemetry};

/// Longest wait of a test for what must happen.
const WATCHDOG: Duration = Duration::from_secs(90);
const ROUND: Duration = Duration::from_millis(2);
const BEAT: Duration = Duration::from_millis(100);
pub const SESSION: u64 = 0x5e55;
/// Where every controller says it is.
pub const TICK: u64 = 42;
pub const N_RECORDS: usize = 40;

/// A thread that ends with its handle.
pub struct Running<T> {
    stop: Arc<AtomicBool>,
    pub state: Arc<Mutex<T>>,
    thread: Option<JoinHandle<()>>,
}

impl<T: Send + 'static> Running<T> {
    pub fn start(
        state: T,
        work: impl FnOnce(&AtomicBool, &Mutex<T>) + Send + 'static,
    ) -> Running<T> {
        let (stop, state) = (Arc::new(AtomicBool::new(false)), Arc::new(Mutex::new(state)));
        let (seen, shared) = (stop.clone(), state.clone());
        let thread = Some(std::thread::spawn(move || work(&seen, &shared)));
        Running { stop, state, thread }
    }

    pub fn look<R>(&self, look: impl FnOnce(&T) -> R) -> R {
        look(&self.state.lock().unwrap())
    }

    /// Waits until `holds`.
    pub fn until(&self, what: &str, holds: impl Fn(&T) -> bool) {
        let start = Instant::now();
        while !self.look(&holds) {
            assert!(start.elapsed() < WATCHDOG, "never: {what}");
            std::thread::sleep(ROUND);
        }
    }
}

impl<T> Drop for Running<T> {
    fn drop(&mut self) {
        self.stop.store(true, Ordering::Relaxed);
        if let Some(thread) = self.thread.take()
            && thread.join().is_err()
            && !std::thread::panicking()
        {
            panic!("a thread of the test has panicked");
        }
    }
}

/// Two machines with a cell of one name on each.
pub struct Machines {
    dir: tempfile::TempDir,
    pub address: String,
}

impl Machines {
    pub fn new() -> Machines {
        let free = TcpListener::bind("127.0.0.1:0").unwrap();
        let address = free.local_addr().unwrap().to_string();
        Machines { dir: tempfile::tempdir().unwrap(), address }
    }

    pub fn path(&self) -> &Path {
        self.dir.path()
    }

    pub fn cell(&self, machine: &str, name: &str) -> Cell {
        Cell::in_dir(&self.dir.path().join(machine), name).unwrap()
    }

    pub fn hub(&self, id: u64, cells: &[&str], keys: Option<Keys>) -> Running<Vec<Event>> {
        let cells = cells.iter().map(|name| self.cell("hub", name)).collect();
        let listen = self.address.clone();
        let config = HubConfig { listen, keys, cells, world: "pancake on wam".into(), id };
        let hub = Running::start(Vec::new(), move |stop, events| {
            hub::run(&config, stop, &|event| events.lock().unwrap().push(event)).unwrap();
        });
        hub.until("the hub listens", |events| {
            events.iter().any(|event| matches!(event, Event::Serves { .. }))
        });
        hub
    }

    pub fn join(&self, id: u64, cell: Cell, keys: Option<Keys>) -> Running<Vec<Event>> {
        self.join_with(id, cell, keys, "")
    }

    pub fn join_with(
        &self,
        id: u64,
        cell: Cell,
        keys: Option<Keys>,
        world: &str,
    ) -> Running<Vec<Event>> {
        self.join_as(JoinConfig { world: world.to_string(), ..self.joins(id, cell, keys) })
    }

    /// How a cell joins that accepts no commands.
    pub fn joins(&self, id: u64, cell: Cell, keys: Option<Keys>) -> JoinConfig {
        JoinConfig {
            cell,
            connect: self.address.clone(),
            keys,
            world: String::new(),
            accepts: Accepts::default(),
            telemetry_hz: MAX_HZ,
            id,
        }
    }

    pub fn join_as(&self, config: JoinConfig) -> Running<Vec<Event>> {
        Running::start(Vec::new(), move |stop, events| {
            join::run(&config, stop, &mut |event| events.lock().unwrap().push(event)).unwrap();
        })
    }

    pub fn keys(&self, folder: &str, cells: &[&str]) -> PathBuf {
        let out = self.dir.path().join(folder);
        let cells: Vec<String> = cells.iter().map(|cell| cell.to_string()).collect();
        let learner = ["127.0.0.1".to_string()];
        let config =
            bridge::keys::KeysConfig { out: &out, learner: &learner, cells: &cells, days: 2 };
        bridge::keys::make(&config).unwrap();
        out
    }
}

pub fn has(events: &[Event], part: &str) -> bool {
    events.iter().any(|event| event.to_string().contains(part))
}

/// What came to a learner.
#[derive(Default)]
pub struct Learnt {
    /// How often the episode of each rollout came.
    pub episodes: BTreeMap<u64, u32>,
    /// Episodes of other sessions.
    pub foreign: u32,
    pub controllers: u32,
    /// Fault and pin of the controller, as it beats.
    pub latched: u64,
    pub controller_heard: Option<Instant>,
}

/// Asks for rollouts 1 to `n` in `cell`, one after the other. An episode is acknowledged `late`.
pub fn learner(cell: Cell, n: u64, late: Duration) -> Running<Learnt> {
    Running::start(Learnt::default(), move |stop, learnt| {
        let lock = cell.lock(Role::Learner).unwrap();
        let is_over = || stop.load(Ordering::Relaxed);
        let Ok(mut ports) = LearnerPorts::open(&cell, WATCHDOG, &is_over) else { return };
        learnt.lock().unwrap().controllers += 1;
        let mut student = Student { durable: 0, asked: Instant::now(), n };
        student.tell(&ports);
        let (mut next_beat, mut counter) = (Instant::now(), 0);
        while !is_over() {
            if ports.follow().unwrap() {
                learnt.lock().unwrap().controllers += 1;
                student.tell(&ports);
            }
            while let Ok(Some(episode)) = ports.episodes.receive() {
                student.take(&ports, episode.user_header(), episode.payload(), learnt, late);
            }
            if student.asked.elapsed() > Duration::from_secs(5) {
                student.tell(&ports);
            }
            while let Ok(Some(beat)) = ports.controller_beat.receive() {
                let mut learnt = learnt.lock().unwrap();
                (learnt.latched, learnt.controller_heard) = (beat.latched, Some(Instant::now()));
            }
            if Instant::now() >= next_beat {
                next_beat += BEAT;
                counter += 1;
                let _ = ports.beat.send_copy(beat(7, counter));
                ports.clean_up();
            }
            std::thread::sleep(ROUND);
        }
        drop(ports);
        drop(lock);
    })
}

pub fn beat(boot_id: u64, counter: u64) -> Heartbeat {
    Heartbeat { schema: SCHEMA, boot_id, counter, ..Heartbeat::NONE }
}

pub fn policy(rollout: u64) -> PolicyMsg {
    let policy = PolicyMsg::of_action(&[rollout as f64 * 1e-3, 0.5]);
    PolicyMsg { session: SESSION, rollout, policy_id: rollout, ..policy }.sealed()
}

struct Student {
    durable: u64,
    asked: Instant,
    n: u64,
}

impl Student {
    /// What is durable, and what is to be executed next.
    fn tell(&mut self, ports: &LearnerPorts) {
        let (durable_rollout, rollout) = (self.durable, self.durable);
        let ack = Ack { schema: SCHEMA, session: SESSION, durable_rollout, rollout, success: 1 };
        ports.acks.send_copy(ack).unwrap();
        self.asked = Instant::now();
        if self.durable < self.n {
            ports.policies.send_copy(policy(self.durable + 1)).unwrap();
        }
    }

    fn take(
        &mut self,
        ports: &LearnerPorts,
        header: &EpisodeHeader,
        records: &[TickRecord],
        learnt: &Mutex<Learnt>,
        late: Duration,
    ) {
        if header.session != SESSION {
            learnt.lock().unwrap().foreign += 1;
            return;
        }
        assert_eq!(header.policy_digest, policy(header.rollout).digest);
        let used = header.validate(records).unwrap();
        assert!(used.iter().enumerate().all(|(k, r)| r.t_s == k as f64 + header.rollout as f64));
        std::thread::sleep(late);
        *learnt.lock().unwrap().episodes.entry(header.rollout).or_default() += 1;
        self.durable = self.durable.max(header.rollout);
        self.tell(ports);
    }
}

/// What a controller did.
#[derive(Default)]
pub struct Executed {
    /// How often each rollout was executed.
    pub rollouts: BTreeMap<u64, u32>,
    /// Not acknowledged, as in a spool.
    pub spool: BTreeMap<(u64, u64), EpisodeHeader>,
    pub learner_heard: Option<Instant>,
    /// Commands that came, by their kind.
    pub commands: Vec<u64>,
    /// Set by a test: a machine fault that it tells of.
    pub latched: u64,
    /// Set by a test: commands are carried out, but not replied to.
    pub is_mute: bool,
    /// Set by a test: it tells of its ticks.
    pub shows_ticks: bool,
}

/// Commands under way, and the ticks of the loop.
#[derive(Default)]
struct Service {
    requests: Vec<CommandRequest>,
    tick: u64,
    batches: u32,
}

impl Service {
    /// As a controller does: one that comes again is the same.
    fn serve(&mut self, ports: &ControllerPorts, boot_id: u64, executed: &mut Executed) {
        while let Ok(Some(request)) = ports.commands.receive() {
            if request.kind == COMMAND_STATUS {
                let status = Status { boot_id, tick: TICK, ..Status::ZERO };
                let _ = request.send_copy(Reply::accepted(request.id, status));
                continue;
            }
            let is_new = self.requests.iter().all(|known| known.id != request.id);
            executed.commands.extend(is_new.then_some(request.kind));
            self.requests.push(request);
        }
        if !executed.is_mute {
            for request in self.requests.drain(..) {
                let reply = Reply::accepted(request.id, Status::ZERO);
                let _ = request.send_copy(Reply { applied_tick: TICK, applied_ns: 1, ..reply });
            }
        }
    }

    /// A batch every 20 ms, as a loop of 1 kHz has them.
    fn show(&mut self, ports: &ControllerPorts, began: Instant) {
        while self.batches < began.elapsed().as_millis() as u32 / TELEMETRY_TICKS as u32 {
            self.batches += 1;
            let mut batch = Telemetry { n_ticks: TELEMETRY_TICKS as u64, ..Telemetry::EMPTY };
            for tick in &mut batch.ticks {
                self.tick += 1;
                tick.record.tick = self.tick;
            }
            let _ = ports.telemetry.send_copy(batch);
        }
    }
}

fn episode_of(header: &EpisodeHeader) -> Vec<TickRecord> {
    let record =
        |k: usize| TickRecord { t_s: k as f64 + header.rollout as f64, ..TickRecord::ZERO };
    (0..N_RECORDS).map(record).collect()
}

/// Executes what it is asked to, once, and sends it again from its spool.
pub fn controller(cell: Cell, boot_id: u64, spooled: Option<EpisodeHeader>) -> Running<Executed> {
    let mut executed = Executed::default();
    executed.spool.extend(spooled.map(|header| ((header.session, header.rollout), header)));
    Running::start(executed, move |stop, executed| {
        let lock = cell.lock(Role::Controller).unwrap();
        let ports = ControllerPorts::create(&cell).unwrap();
        let (mut next_beat, mut counter, mut unsolicited) = (Instant::now(), 0, spooled);
        let (mut service, began) = (Service::default(), Instant::now());
        while !stop.load(Ordering::Relaxed) {
            while let Ok(Some(policy)) = ports.policies.receive() {
                policy.validate().unwrap();
                execute(&ports, &policy, boot_id, &mut executed.lock().unwrap());
            }
            while let Ok(Some(ack)) = ports.acks.receive() {
                let spool = &mut executed.lock().unwrap().spool;
                spool.retain(|(session, rollout), _| !ack.covers(*session, *rollout));
            }
            service.serve(&ports, boot_id, &mut executed.lock().unwrap());
            if executed.lock().unwrap().shows_ticks {
                service.show(&ports, began);
            }
            while let Ok(Some(_)) = ports.learner_beat.receive() {
                executed.lock().unwrap().learner_heard = Some(Instant::now());
                unsolicited.take().iter().for_each(|header| send(&ports, header));
            }
            if Instant::now() >= next_beat {
                next_beat += BEAT;
                counter += 1;
                let latched = executed.lock().unwrap().latched;
                let _ = ports.beat.send_copy(Heartbeat { latched, ..beat(boot_id, counter) });
                ports.meet_newcomers();
            }
            std::thread::sleep(ROUND);
        }
        drop(ports);
        drop(lock);
    })
}

fn execute(ports: &ControllerPorts, policy: &PolicyMsg, boot_id: u64, executed: &mut Executed) {
    let key = (policy.session, policy.rollout);
    if let Some(header) = executed.spool.get(&key) {
        return send(ports, header);
    }
    let header = header_of(policy, boot_id);
    *executed.rollouts.entry(policy.rollout).or_default() += 1;
    let _ = ports.in_loop.send_copy(*policy);
    let _ = ports.outcomes.send_copy(header);
    executed.spool.insert(key, header);
    send(ports, &header);
}

pub fn header_of(policy: &PolicyMsg, boot_id: u64) -> EpisodeHeader {
    EpisodeHeader {
        boot_id,
        session: policy.session,
        rollout: policy.rollout,
        policy_id: policy.policy_id,
        policy_digest: policy.digest,
        n_records: N_RECORDS as u64,
        ..EpisodeHeader::default()
    }
}

fn send(ports: &ControllerPorts, header: &EpisodeHeader) {
    let mut loan = ports.loan_episode(N_RECORDS).unwrap();
    *loan.user_header_mut() = *header;
    loan.payload_mut().copy_from_slice(&episode_of(header));
    if loan.send().is_ok_and(|receivers| receivers > 0) {
        let _ = ports.episode_sent.notify();
    }
}
