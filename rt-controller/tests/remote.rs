//! A plant at the other end of a socket: what the loop does when it misbehaves, is late, or dies.

mod common;

use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

use common::heap::{self, CountingAllocator};
use common::{referee, wam};
use physics::arm::{ArmModel, JointVector};
use physics::ideal::IdealArm;
use physics::pancake::WAM7_START_POSTURE;
use physics::plant::{Measurement, Plant};
use rand::RngExt;
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use rt_controller::remote::expected::{Expected, External};
use rt_controller::{ControllerConfig, Pace, RunSummary, Station, run_external};
use shm_types::cell::Cell;
use shm_types::command::{COMMAND_REARM, COMMAND_STOP, Command, PLANT_THERE, Status};
use shm_types::episode::FAULT_MEASUREMENT_STALE;
use shm_types::equipment::Equipment;
use shm_types::plant::line::Line;
use shm_types::plant::shared::follow;
use shm_types::plant::socket::{Buffer, Connection, Message};
use shm_types::plant::{
    MODE_RESET, PLANT_CAN_RESET, PLANT_POLLS, PLANT_SIMULATED, PlantCommand, PlantHello, PlantState,
};
use shm_types::ports::ToolPorts;

const SOON: Duration = Duration::from_secs(30);

#[global_allocator]
static ALLOCATOR: CountingAllocator = CountingAllocator;

/// A thread of this process by its name.
fn thread_named(name: &str) -> Option<i32> {
    let tasks = std::fs::read_dir("/proc/self/task").unwrap().flatten();
    let is_it = |path: &PathBuf| {
        std::fs::read_to_string(path.join("comm")).is_ok_and(|comm| comm.trim() == name)
    };
    let path = tasks.map(|task| task.path()).find(is_it)?;
    path.file_name()?.to_str()?.parse().ok()
}

/// Stops a controller when its test ends, by a panic as well: nobody waits for it for ever.
struct Stopping<'a>(&'a AtomicBool);

impl Drop for Stopping<'_> {
    fn drop(&mut self) {
        self.0.store(true, Ordering::Relaxed);
    }
}

/// A controller that waits for a plant, while `operate` goes on.
fn with_controller<T>(
    name: &str,
    pace: Pace,
    operate: impl FnOnce(&ArmModel, &Path, &ToolPorts) -> T,
) -> (RunSummary, T) {
    let (model, config) = (wam(), ControllerConfig::default());
    let cell = Cell::new(&format!("{name}-{}", std::process::id())).unwrap();
    let dir = tempfile::tempdir().unwrap();
    let socket = dir.path().join("plant.sock");
    let stop = AtomicBool::new(false);
    let result = std::thread::scope(|scope| {
        let controller = scope.spawn(|| {
            let expected = Expected::of(&model, config.period_ns(), pace != Pace::Plant);
            let external = External { socket: socket.clone(), cell: Some(cell.clone()), expected };
            let arm = (&model, WAM7_START_POSTURE, referee());
            let station = Station { cell: &cell, state: None, equipment: Equipment::UNKNOWN };
            run_external(station, &config, pace, arm, external, &stop).unwrap()
        });
        let _stopping = Stopping(&stop);
        let tool = ToolPorts::open(&cell, SOON).unwrap();
        let said = operate(&model, &socket, &tool);
        tool.request(&Command::new(COMMAND_STOP, 99), SOON).unwrap();
        (controller.join().unwrap(), said)
    });
    cell.remove_if_idle();
    result
}

/// The plant's end, in as many words as a driver has.
struct Driver<'a> {
    line: Line<PlantState, PlantCommand>,
    buffer: Buffer,
    arm: IdealArm<'a>,
    state: PlantState,
    limits: JointVector,
    last: Option<JointVector>,
}

impl<'a> Driver<'a> {
    fn connect(model: &'a ArmModel, socket: &Path, flags: u64) -> Driver<'a> {
        let link = Connection::connect(socket, SOON).unwrap();
        let q = WAM7_START_POSTURE.into();
        let (name, period_ns) = (shm_types::text::pack("driver"), 1_000_000);
        link.send(&PlantHello { name, n_joints: 7, period_ns, flags, q, ..PlantHello::EMPTY })
            .unwrap();
        let mut buffer = Buffer::new();
        let said = match link.receive(&mut buffer, SOON).unwrap() {
            Some(Message::Welcome(welcome)) => {
                let said = shm_types::text::unpack(&welcome.reason);
                assert_eq!(welcome.accepted, 1, "{said}");
                said
            }
            other => panic!("{other:?}"),
        };
        let shared = (flags & PLANT_POLLS != 0).then(|| follow(&said).unwrap());
        let line = Line::new(Arc::new(link), shared);
        let arm = IdealArm::new(model, &WAM7_START_POSTURE, 1e-3, 0.01);
        let limits = model.limits().tau_max;
        Driver { line, buffer, arm, state: PlantState::EMPTY, limits, last: None }
    }

    /// The state of the arm, as the next sample.
    fn next(&mut self) -> PlantState {
        let Measurement { q, qd, .. } = self.arm.measure();
        self.state.seq += 1;
        self.state.t_ns += 1_000_000;
        (self.state.q, self.state.qd) = (q.into(), qd.into());
        self.state
    }

    fn send(&self, state: &PlantState) -> bool {
        match state.seq {
            1 => self.line.socket().send(state).is_ok(),
            _ => self.line.send(state).is_ok(),
        }
    }

    /// A command within `patience`, whose torque must be within the limits and the rate.
    fn command(&mut self, patience: Duration) -> Option<PlantCommand> {
        let message = match self.line.is_shared() {
            true => self.line.receive_answer(&mut self.buffer, patience),
            false => self.line.socket().receive(&mut self.buffer, patience),
        };
        let command = match message.ok()?? {
            Message::Command(command) => *command,
            _ => return None,
        };
        if command.mode == shm_types::plant::MODE_HOLD {
            return self.command(patience);
        }
        let tau = JointVector::from(command.tau);
        let step = self.limits * (0.2 * (1.0 + 1e-12));
        for i in 0..7 {
            assert!(tau[i].abs() <= self.limits[i], "joint {i} gets {} N·m", tau[i]);
            let before = self.last.map_or(tau[i], |last| last[i]);
            assert!((tau[i] - before).abs() <= step[i], "joint {i}: {before} to {}", tau[i]);
        }
        self.last = Some(tau);
        Some(command)
    }

    /// Samples and answers, in lockstep or at the pace of the answers.
    fn run(&mut self, n: u64) -> u64 {
        let mut answered = 0;
        for _ in 0..n {
            let state = self.next();
            if !self.send(&state) {
                return answered;
            }
            let Some(command) = self.command(SOON) else { return answered };
            answered += u64::from(command.answers_seq == state.seq);
            if command.mode == MODE_RESET {
                self.arm.begin_reset();
                self.state.episode = command.episode;
                self.last = None;
            } else {
                self.arm.apply(&JointVector::from(command.tau));
                self.arm.advance();
            }
        }
        answered
    }
}

fn until(tool: &ToolPorts, what: &str, is_so: impl Fn(&Status) -> bool) -> Status {
    let start = Instant::now();
    while start.elapsed() < SOON {
        if let Some(status) = tool.status(SOON).filter(&is_so) {
            return status;
        }
        std::thread::sleep(Duration::from_millis(2));
    }
    panic!("{what}: not within {SOON:?}");
}

fn stale(status: &Status) -> bool {
    status.latched_fault == FAULT_MEASUREMENT_STALE
}

/// Serialises the tests: they share the allocator's count.
static TURN: std::sync::Mutex<()> = std::sync::Mutex::new(());

fn turn() -> std::sync::MutexGuard<'static, ()> {
    TURN.lock().unwrap_or_else(std::sync::PoisonError::into_inner)
}

/// Heap operations of the rt thread in `n` ticks, the first ones left out: they may write to the log.
fn heap_in(n: u64, name: &str, pace: Pace, flags: u64) -> u64 {
    let (summary, answered) = with_controller(name, pace, |model, socket, tool| {
        let mut driver = Driver::connect(model, socket, flags);
        assert!(driver.run(1000) > 990);
        heap::watch(thread_named("skillet-rt").unwrap());
        heap::forget_operations();
        let answered = driver.run(n);
        heap::watch_nobody();
        assert_eq!(tool.status(SOON).unwrap().latched_fault, 0);
        assert_eq!(driver.line.is_shared(), flags & PLANT_POLLS != 0);
        answered
    });
    assert!(answered > n * 99 / 100, "{answered} of {n} answered");
    assert!(summary.ticks >= n, "{} ticks", summary.ticks);
    heap::operations()
}

#[test]
fn the_loop_touches_no_heap_over_a_plant_that_is_the_clock() {
    let _turn = turn();
    assert_eq!(heap_in(20_000, "rheap", Pace::Plant, 0), 0);
    // The guard sees a thread that allocates.
    heap::watch(heap::this_thread());
    drop(std::hint::black_box(Box::new(1)));
    heap::watch_nobody();
    assert!(heap::operations() >= 2);
}

#[test]
fn nor_in_lockstep_through_shared_memory() {
    let _turn = turn();
    let flags = PLANT_SIMULATED | PLANT_CAN_RESET | PLANT_POLLS;
    assert_eq!(heap_in(4000, "rshared", Pace::Realtime, flags), 0);
}

/// Samples are lost, come twice, late and out of order: every torque stays within its bounds (the driver
/// asserts it), every gap is counted, and the arm is not held for it.
fn disturbed(n: u64) {
    let ((), lost) = {
        let (_, lost) = with_controller("rloss", Pace::Plant, |model, socket, tool| {
            let mut driver = Driver::connect(model, socket, 0);
            let mut rng = ChaCha8Rng::seed_from_u64(1);
            let (mut lost, mut told, mut last) = (0, 0, PlantState::EMPTY);
            for _ in 0..n {
                let state = driver.next();
                let chance: f64 = rng.random();
                match chance {
                    // It never arrives.
                    c if c < 0.01 => lost += 1,
                    c if c < 0.02 => {
                        assert!(driver.send(&state) && driver.send(&state));
                    }
                    // The one before comes once more, after it or before.
                    c if c < 0.03 && last.seq > 0 => {
                        assert!(driver.send(&state) && driver.send(&last));
                    }
                    c if c < 0.04 && last.seq > 0 => {
                        assert!(driver.send(&last) && driver.send(&state));
                    }
                    c if c < 0.0405 => {
                        std::thread::sleep(Duration::from_micros(1500));
                        assert!(driver.send(&state));
                    }
                    _ => assert!(driver.send(&state)),
                }
                if chance >= 0.01 {
                    last = state;
                    if let Some(command) = driver.command(SOON) {
                        told = command.n_lost;
                        driver.arm.apply(&JointVector::from(command.tau));
                    }
                }
                driver.arm.advance();
            }
            assert_eq!(tool.status(SOON).unwrap().latched_fault, 0);
            // The last one may have been lost, and nobody knows yet.
            assert!(lost - told <= 2, "{lost} samples were lost, the controller counts {told}");
            lost
        });
        ((), lost)
    };
    assert!(lost > n / 200, "only {lost} were lost");
}

#[test]
fn jitter_loss_duplicates_and_disorder_move_nothing_beyond_its_bounds() {
    let _turn = turn();
    disturbed(20_000);
}

#[test]
#[ignore = "a million samples: some minutes"]
fn the_same_for_a_million_samples() {
    let _turn = turn();
    disturbed(1_000_000);
}

/// Each of them ends the connection or the samples; the arm is held, and what comes next needs a re-arm.
#[test]
fn a_plant_that_lies_latches_and_the_next_one_needs_a_rearm() {
    let _turn = turn();
    type Lie = fn(&mut PlantState);
    let lies: [(&str, Lie); 4] = [
        ("must increase", |state| state.seq -= 5),
        ("must increase with every sample", |state| state.t_ns -= 3_000_000),
        ("of episode", |state| state.episode += 7),
        ("another message", |_| {}),
    ];
    let flags = PLANT_SIMULATED | PLANT_CAN_RESET;
    with_controller("rlies", Pace::Realtime, |model, socket, tool| {
        for (id, (words, lie)) in (1..).zip(lies) {
            let mut driver = Driver::connect(model, socket, flags);
            assert!(driver.run(300) >= 299, "{words}");
            if id > 1 {
                let rearmed = tool.request(&Command::new(COMMAND_REARM, id), SOON).unwrap();
                assert_eq!(rearmed.accepted, 1, "{}", rearmed.reason_text());
            }
            let mut state = driver.next();
            lie(&mut state);
            if words == "another message" {
                driver.line.socket().send(&PlantCommand::HOLD).unwrap();
            } else {
                driver.send(&state);
            }
            let said = loop {
                match driver.line.socket().receive(&mut driver.buffer, SOON).unwrap() {
                    Some(Message::Welcome(welcome)) => {
                        break shm_types::text::unpack(&welcome.reason);
                    }
                    Some(_) => {}
                    None => panic!("{words}: the controller said nothing"),
                }
            };
            assert!(said.contains(words) || words == "another message", "{said}");
            drop(driver);
            until(tool, words, stale);
            let early = tool.request(&Command::new(COMMAND_REARM, 50 + id), SOON).unwrap();
            assert_eq!(early.accepted, 0, "there is no plant");
        }
    });
}

#[test]
fn a_number_that_is_none_latches_and_the_arm_is_held() {
    let _turn = turn();
    with_controller("rnan", Pace::Plant, |model, socket, tool| {
        let mut driver = Driver::connect(model, socket, 0);
        driver.run(300);
        for spoil in [
            |state: &mut PlantState| state.qd[2] = f64::NAN,
            |state: &mut PlantState| state.object_quaternion = [0.0; 4],
        ] {
            let mut state = driver.next();
            spoil(&mut state);
            driver.send(&state);
            driver.command(SOON).expect("an answer all the same");
            until(tool, "a latch", |status| status.latched_fault != 0);
            driver.run(300);
            let rearmed = tool.request(&Command::new(COMMAND_REARM, 7), SOON).unwrap();
            assert_eq!(rearmed.accepted, 1, "{}", rearmed.reason_text());
        }
    });
}

#[test]
fn a_plant_that_says_nothing_is_told_so_and_the_next_one_is_let_in() {
    let _turn = turn();
    with_controller("rmute", Pace::Plant, |model, socket, _| {
        let mute = Connection::connect(socket, SOON).unwrap();
        let mut buffer = Buffer::new();
        match mute.receive(&mut buffer, SOON).unwrap() {
            Some(Message::Welcome(welcome)) => {
                let why = shm_types::text::unpack(&welcome.reason);
                assert_eq!((welcome.accepted, why.contains("no Hello")), (0, true), "{why}");
            }
            other => panic!("{other:?}"),
        }
        assert!(Driver::connect(model, socket, 0).run(100) > 90);
    });
}

/// A service manager starts a driver anew at once; the loop may not yet have noticed that the last one died.
#[test]
fn the_next_plant_is_let_in_however_fast_it_comes() {
    let _turn = turn();
    for (name, pace, flags) in
        [("rnext", Pace::Plant, 0), ("rnextmax", Pace::Max, PLANT_SIMULATED | PLANT_CAN_RESET)]
    {
        with_controller(name, pace, |model, socket, tool| {
            for round in 0..20 {
                // Panics when it is refused. Once it has been in the loop, it dies.
                let mut driver = Driver::connect(model, socket, flags);
                let state = driver.next();
                assert!(driver.send(&state));
                let status =
                    until(tool, "the plant in the loop", |status| status.plant == PLANT_THERE);
                assert_eq!(status.equipment.plant_name(), "driver (plant protocol 1)");
                if round > 0 {
                    until(tool, "a latch, though the next plant is there", stale);
                }
            }
        });
    }
}
