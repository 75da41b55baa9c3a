//! A session that is resumed when it is done, because a controller still has its last episode in the spool.

mod common;

use std::sync::atomic::AtomicBool;
use std::sync::mpsc::channel;
use std::time::{Duration, Instant};

use common::{episode, meta, value_judge};
use learner::session::{self, Cells, End};
use learner::{Learner, LearnerConfig};
use shm_types::SCHEMA;
use shm_types::cell::{Cell, Role};
use shm_types::equipment::Equipment;
use shm_types::ports::ControllerPorts;
use shm_types::telemetry::Heartbeat;
use tempfile::TempDir;

const SESSION: u64 = 7;
const ROLLOUTS: u64 = 3;
const WATCHDOG: Duration = Duration::from_secs(30);

fn done(directory: &TempDir) -> Learner {
    let mut config = LearnerConfig { rollouts: ROLLOUTS, ..Default::default() };
    config.action.start = vec![0.4, -0.2];
    let meta = meta("landscape", SESSION, config);
    let mut learner = Learner::create(directory.path(), meta, &[], value_judge()).expect("new");
    while !learner.is_done() {
        let policy = learner.next_policy().expect("the disk has space");
        let (header, records) = episode(&policy, 0.5);
        learner.complete("kitchen", &header, &records).expect("it was asked for");
    }
    learner
}

#[test]
fn a_session_that_is_done_says_once_more_what_is_durable() {
    let (sessions, cells) = (TempDir::new().unwrap(), TempDir::new().unwrap());
    let mut learner = done(&sessions);
    let cell = Cell::in_dir(cells.path(), "kitchen").unwrap();
    let (is_up, up) = channel();
    let its = cell.clone();
    let controller = std::thread::spawn(move || {
        let _lock = its.lock(Role::Controller).unwrap();
        let ports = ControllerPorts::create(&its).unwrap();
        is_up.send(()).unwrap();
        let (start, mut counter) = (Instant::now(), 0);
        while start.elapsed() < WATCHDOG {
            counter += 1;
            let beat = Heartbeat { schema: SCHEMA, boot_id: 1, counter, ..Heartbeat::NONE };
            let _ = ports.beat.send_copy(beat);
            ports.meet_newcomers();
            while let Ok(Some(ack)) = ports.acks.receive() {
                if ack.covers(SESSION, ROLLOUTS) {
                    return true;
                }
            }
            std::thread::sleep(Duration::from_millis(5));
        }
        false
    });
    up.recv().unwrap();
    let named = vec![("kitchen".to_string(), cell)];
    let cells = Cells { named, wanted: Equipment::UNKNOWN };
    let stop = AtomicBool::new(false);
    let end = session::run(cells, &mut learner, true, &stop, &mut |_| {}).unwrap();
    assert_eq!(end, End::Done);
    assert!(controller.join().unwrap(), "the controller was told nothing");
}
