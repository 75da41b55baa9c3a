//! What goes wrong among several machines and must be defined: clocks that differ, a session that has ended. Two bridges
//! of one name, another world and another session are in `turns`, strangers in `strangers`.

mod ends;

use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};
use std::sync::atomic::AtomicBool;
use std::time::{Duration, SystemTime};

use bridge::event::Event;
use bridge::hub::{self, HubConfig};
use bridge::net::Keys;
use ends::{Machines, SESSION, controller, has, header_of, learner, policy};
use shm_types::cell::Cell;

const HOUR_S: i64 = 3600;
/// A library that puts another time of day before a process.
const SHIM: &str = "
#define _GNU_SOURCE
#include <stdlib.h>
#include <sys/syscall.h>
#include <sys/time.h>
#include <time.h>
#include <unistd.h>
static long ahead(void) { const char *s = getenv(\"BRIDGE_TEST_AHEAD_S\"); return s ? atol(s) : 0; }
int clock_gettime(clockid_t id, struct timespec *t) {
    int result = syscall(SYS_clock_gettime, id, t);
    if (result == 0 && id == CLOCK_REALTIME) t->tv_sec += ahead();
    return result;
}
time_t time(time_t *to) {
    struct timespec t;
    clock_gettime(CLOCK_REALTIME, &t);
    if (to) *to = t.tv_sec;
    return t.tv_sec;
}
int gettimeofday(struct timeval *to, void *zone) {
    struct timespec t;
    clock_gettime(CLOCK_REALTIME, &t);
    to->tv_sec = t.tv_sec;
    to->tv_usec = t.tv_nsec / 1000;
    return 0;
}
";

/// `None`, and said aloud, where there is no C compiler: the test then shows nothing.
fn shim(dir: &Path) -> Option<PathBuf> {
    let (source, library) = (dir.join("clock.c"), dir.join("clock.so"));
    std::fs::write(&source, SHIM).unwrap();
    let built = Command::new("cc")
        .args(["-shared", "-fPIC", "-o"])
        .args([&library, &source])
        .status()
        .is_ok_and(|status| status.success());
    if !built {
        eprintln!("SKIPPED, NOTHING SHOWN: no C compiler here (cc)");
    }
    built.then_some(library)
}

/// Seconds of the day and age by the clock of this process.
fn now_s() -> i64 {
    SystemTime::UNIX_EPOCH.elapsed().unwrap().as_secs().cast_signed()
}

/// A process that does not outlive its test.
struct Hub(Child);

impl Drop for Hub {
    fn drop(&mut self) {
        let _ = self.0.kill();
        let _ = self.0.wait();
    }
}

/// This test's executable once more, as a hub whose clock is `ahead_s`.
fn hub_in_another_time(machines: &Machines, keys: &Path, shim: &Path, ahead_s: i64) -> Hub {
    let hub = Command::new(std::env::current_exe().unwrap())
        .args(["--exact", "hub_process", "--ignored", "--nocapture"])
        .env("LD_PRELOAD", shim)
        .env("BRIDGE_TEST_AHEAD_S", ahead_s.to_string())
        .env("BRIDGE_TEST_HUB", machines.path().join("hub"))
        .env("BRIDGE_TEST_KEYS", keys)
        .env("BRIDGE_TEST_ADDRESS", &machines.address)
        .env("BRIDGE_TEST_TIME", machines.path().join("time"))
        .stdout(Stdio::null())
        .spawn();
    Hub(hub.unwrap())
}

#[test]
#[ignore = "the process that another test starts"]
fn hub_process() {
    let Some(dir) = std::env::var_os("BRIDGE_TEST_HUB") else { return };
    let of = |name: &str| std::env::var(name).unwrap();
    std::fs::write(of("BRIDGE_TEST_TIME"), now_s().to_string()).unwrap();
    let config = HubConfig {
        listen: of("BRIDGE_TEST_ADDRESS"),
        keys: Some(Keys::at(Path::new(&of("BRIDGE_TEST_KEYS")))),
        cells: vec![Cell::in_dir(dir.as_ref(), "kitchen").unwrap()],
        world: String::new(),
        id: 1,
    };
    hub::run(&config, &AtomicBool::new(false), &|_| {}).unwrap();
}

/// Certificates are made just now: they count from the day before.
#[test]
fn a_clock_that_is_an_hour_off_does_no_harm() {
    for ahead_s in [HOUR_S, -HOUR_S] {
        let machines = Machines::new();
        let Some(shim) = shim(machines.path()) else { return };
        let keys = machines.keys("keys", &["kitchen"]);
        let executed = controller(machines.cell("cell", "kitchen"), 11, None);
        let learnt = learner(machines.cell("hub", "kitchen"), 5, Duration::ZERO);
        let _hub = hub_in_another_time(&machines, &keys.join("learner"), &shim, ahead_s);
        let own = Some(Keys::at(&keys.join("cells/kitchen")));
        let _bridge = machines.join(2, machines.cell("cell", "kitchen"), own);
        learnt.until("all rollouts are learnt", |learnt| learnt.episodes.len() == 5);
        executed.until("all are acknowledged", |executed| executed.spool.is_empty());
        assert!(executed.look(|executed| executed.rollouts.values().all(|times| *times == 1)));
        let there: i64 =
            std::fs::read_to_string(machines.path().join("time")).unwrap().parse().unwrap();
        assert!((there - now_s() - ahead_s).abs() < HOUR_S / 2, "its clock was not off");
    }
}

/// What the session knows is acknowledged by the hub alone; what it does not know stays, and that is said.
#[test]
fn a_bridge_that_reconnects_to_a_session_that_ended_loses_nothing() {
    let machines = Machines::new();
    let executed = controller(machines.cell("cell", "kitchen"), 11, None);
    let learnt = learner(machines.cell("hub", "kitchen"), 3, Duration::ZERO);
    let _hub = machines.hub(1, &["kitchen"], None);
    let bridge = machines.join(2, machines.cell("cell", "kitchen"), None);
    learnt.until("all rollouts are learnt", |learnt| learnt.episodes.len() == 3);
    executed.until("all are acknowledged", |executed| executed.spool.is_empty());
    drop(bridge);
    drop(learnt);
    for rollout in [2, 9] {
        let header = header_of(&policy(rollout), 11);
        executed.state.lock().unwrap().spool.insert((SESSION, rollout), header);
    }
    let bridge = machines.join(3, machines.cell("cell", "kitchen"), None);
    bridge.until("it is said", |events| has(events, "no learner works in it"));
    executed.until("what is durable is let go", |executed| executed.spool.len() == 1);
    std::thread::sleep(Duration::from_secs(1));
    assert!(executed.look(|executed| executed.spool.contains_key(&(SESSION, 9))));
    assert!(!bridge.look(|events| has(events, "rollout 9")), "nothing is claimed of it");
    let learnt = learner(machines.cell("hub", "kitchen"), 3, Duration::ZERO);
    bridge.until("its learner is there again", |events| {
        events.contains(&Event::Learner { cell: "kitchen".into(), is_there: true })
    });
    learnt.until("and learns", |learnt| learnt.episodes.len() == 3);
}
