//! A cell whose controller runs in a thread of the test.

use std::cell::Cell as LocalCell;
use std::path::Path;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Mutex, PoisonError};
use std::time::{Duration, Instant};

use super::referee;
use physics::arm::ArmModel;
use physics::pancake::WAM7_START_POSTURE;
use physics::plant::Plant;
use rt_controller::run::Controlled;
use rt_controller::{ControllerConfig, Pace, RunSummary, Station};
use shm_types::cell::Cell;
use shm_types::command::{
    AT_NOW, COMMAND_ACTIVATE, COMMAND_IMPORT, COMMAND_STOP, Command, Reply, Status,
};
use shm_types::equipment::Equipment;
use shm_types::policy::PolicyMsg;
use shm_types::ports::ToolPorts;

static TURN: Mutex<()> = Mutex::new(());
pub const SOON: Duration = Duration::from_secs(30);

/// How a test's controller runs.
pub struct Service<'a> {
    /// Name of the cell; each process has its own.
    pub name: &'a str,
    pub model: &'a ArmModel,
    pub config: &'a ControllerConfig,
    pub pace: Pace,
    pub state: Option<&'a Path>,
}

impl Service<'_> {
    /// Runs a controller of `plant` while `operate` goes on, then stops it.
    pub fn run<P: Plant, T>(
        &self,
        plant: &mut P,
        operate: impl FnOnce(&Operator) -> T,
    ) -> (RunSummary, T) {
        // One cell a process at a time, also after a test that failed.
        let _turn = TURN.lock().unwrap_or_else(PoisonError::into_inner);
        let cell = Cell::new(&format!("{}-{}", self.name, std::process::id())).unwrap();
        let stop = AtomicBool::new(false);
        let result = std::thread::scope(|scope| {
            let controller = scope.spawn(|| {
                let (q0, referee) = (WAM7_START_POSTURE, referee());
                let controlled = Controlled { model: self.model, plant, q0, referee };
                let (config, state) = (self.config, self.state);
                let station = Station { cell: &cell, state, equipment: Equipment::UNKNOWN };
                rt_controller::run(station, config, self.pace, controlled, &stop).unwrap()
            });
            let _stopping = Stopping(&stop);
            let tool = ToolPorts::open(&cell, SOON).unwrap();
            let operator = Operator { cell: &cell, tool, last_id: LocalCell::new(0) };
            let said = operate(&operator);
            operator.ok(Command::new(COMMAND_STOP, 0));
            (controller.join().unwrap(), said)
        });
        cell.remove_if_idle();
        result
    }
}

/// Stops a controller when its test ends, by a panic as well: nobody waits for it for ever.
struct Stopping<'a>(&'a AtomicBool);

impl Drop for Stopping<'_> {
    fn drop(&mut self) {
        self.0.store(true, Ordering::Relaxed);
    }
}

/// Who sends the commands.
pub struct Operator<'a> {
    pub cell: &'a Cell,
    tool: ToolPorts,
    last_id: LocalCell<u64>,
}

impl Operator<'_> {
    pub fn ask(&self, command: Command) -> Reply {
        self.last_id.set(self.last_id.get() + 1);
        let command = Command { id: self.last_id.get(), ..command };
        self.tool.request(&command, SOON).expect("an answer")
    }

    pub fn ok(&self, command: Command) -> Reply {
        let reply = self.ask(command);
        assert_eq!(reply.accepted, 1, "{}", reply.reason_text());
        reply
    }

    /// The reason why `kind` is refused.
    pub fn refused(&self, kind: u64) -> String {
        let reply = self.ask(Command::new(kind, 0));
        assert_eq!(reply.accepted, 0, "it was meant to be refused");
        reply.reason_text()
    }

    /// Its number.
    pub fn import(&self, policy: PolicyMsg) -> u64 {
        self.ok(Command { policy, ..Command::new(COMMAND_IMPORT, 0) }).policy.policy_id
    }

    pub fn activate(&self, policy_id: u64) {
        self.ok(Command { policy_id, at: AT_NOW, ..Command::new(COMMAND_ACTIVATE, 0) });
    }

    pub fn status(&self) -> Status {
        self.tool.status(SOON).expect("an answer")
    }

    pub fn until(&self, what: &str, is_so: impl Fn(&Status) -> bool) -> Status {
        let start = Instant::now();
        while start.elapsed() < SOON {
            let status = self.status();
            if is_so(&status) {
                return status;
            }
            std::thread::sleep(Duration::from_millis(2));
        }
        panic!("{what}: not within {SOON:?}");
    }
}
