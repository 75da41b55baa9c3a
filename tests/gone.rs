//! Every view of a controller or learner shows its age: dead and stuck ones are told
//! apart from living ones, and the next one is picked up.

mod util;

use std::fs::File;
use std::path::PathBuf;
use std::process::Stdio;
use std::time::{Duration, Instant};

use serde_json::Value;
use util::{Bench, Running, eventually};

const CONTROLLER: [&str; 3] = ["controller", "--cell", "c1"];

fn learner(bench: &Bench) -> Running {
    let config = bench.write("c.toml", "[learner]\nrollouts = 4000\n");
    let learner = ["learner", "--cell", "c1", "--session", "s", "--config"];
    bench.start(&[&learner[..], &[config.to_str().unwrap()]].concat())
}

/// `watch`, writing to a file that is read while it runs.
struct Watch {
    file: PathBuf,
    _running: Running,
}

impl Watch {
    fn start(bench: &Bench, arguments: &[&str]) -> Watch {
        let file = bench.path("watch.out");
        let out = File::create(&file).unwrap();
        let mut command = bench.skillet(&[&["watch", "--cell", "c1"][..], arguments].concat());
        let err = Stdio::from(out.try_clone().unwrap());
        Watch { file, _running: Running::start(command.stdout(out).stderr(err)) }
    }

    /// The newest whole line.
    fn line(&self) -> Option<Value> {
        let text = util::text(&self.file);
        serde_json::from_str(text[..=text.rfind('\n')?].lines().last()?).ok()
    }

    fn until(&self, what: &str, is_so: impl Fn(&Value) -> bool) -> Value {
        let start = Instant::now();
        while start.elapsed() < util::WATCHDOG {
            if let Some(line) = self.line().filter(|line| is_so(line)) {
                return line;
            }
            std::thread::sleep(Duration::from_millis(10));
        }
        panic!("{what}: not within {:?}; the last line: {:?}", util::WATCHDOG, self.line());
    }

    fn says(&self, role: &str, presence: &str) -> Value {
        self.until(&format!("{role} {presence}"), |line| line[role] == presence)
    }
}

#[test]
fn a_controller_that_dies_or_stands_still_is_said_so_and_the_next_one_is_watched() {
    let bench = Bench::new();
    let mut controller = bench.start(&CONTROLLER);
    let _learner = learner(&bench);
    bench.wait_for_trials("s", 1);
    let watch = Watch::start(&bench, &["--json"]);
    for signal in ["KILL", "TERM", "KILL"] {
        let well = watch.until("a tick", |line| line["health"] == "ok" && line["tick"] != 0);
        assert_eq!((&well["controller"], &well["learner"]), (&"running".into(), &"running".into()));
        controller.signal(signal);
        controller.wait();
        let gone = watch.says("controller", "absent");
        assert_eq!(gone["health"], "bad", "{signal}: {gone}");
        assert!(gone["findings"][0].as_str().unwrap().contains("no controller"), "{gone}");
        assert!(gone["status_age_s"].is_null(), "nothing is known of what is not there: {gone}");
        // What is shown all the same gets older.
        watch.until("age", |line| line["tick_age_s"].as_f64() > gone["tick_age_s"].as_f64());
        // And the others say the same, although the watcher still holds what the dead one left.
        let status = bench.run(&["status", "--cell", "c1", "--json"]);
        assert_eq!(status.status.code(), Some(3), "{signal}");
        let status: Value = serde_json::from_slice(&status.stdout).unwrap();
        assert_eq!(status["controller"], "absent", "{signal}");
        controller = bench.start(&CONTROLLER);
    }
    watch.until("the last one", |line| line["health"] == "ok" && !line["tick_age_s"].is_null());

    controller.signal("STOP");
    let silent = watch.says("controller", "silent");
    assert_eq!(silent["health"], "bad");
    assert!(silent["findings"][0].as_str().unwrap().contains("has not responded for"), "{silent}");
    assert!(silent["status_age_s"].as_f64() >= Some(1.0), "{silent}");
    let status = bench.run(&["status", "--cell", "c1", "--json"]);
    assert_eq!(status.status.code(), Some(3));
    let status: Value = serde_json::from_slice(&status.stdout).unwrap();
    assert_eq!(status["controller"], "silent");
    controller.signal("CONT");
    // Well again, or, once the loop has told how late it woke, with the stall that it was.
    let well =
        watch.until("going on", |line| line["controller"] == "running" && line["health"] != "bad");
    let findings = well["findings"].to_string();
    assert!(well["health"] == "ok" || findings.contains("stalled"), "{well}");
}

#[test]
fn a_learner_that_dies_or_stands_still_is_said_so() {
    let bench = Bench::new();
    let port = std::net::TcpListener::bind("127.0.0.1:0").unwrap().local_addr().unwrap().port();
    let config = bench.write("m.toml", &format!("[metrics]\nlisten = \"127.0.0.1:{port}\"\n"));
    let _controller =
        bench.start(&[&CONTROLLER[..], &["--config", config.to_str().unwrap()]].concat());
    let first = learner(&bench);
    bench.wait_for_trials("s", 1);
    let watch = Watch::start(&bench, &["--json"]);
    watch.until("both", |line| line["learner"] == "running" && line["health"] == "ok");
    let metric = |name: &str| -> Option<f64> {
        let text = scrape(port);
        let line = text.lines().find(|line| line.starts_with(name))?.to_string();
        line.split(' ').next_back()?.parse().ok()
    };
    eventually("ages", || metric("skillet_tick_age_seconds"));

    first.signal("STOP");
    let silent = watch.says("learner", "silent");
    assert_eq!(silent["health"], "degraded");
    assert!(silent["learner_age_s"].as_f64() >= Some(1.0), "{silent}");
    assert_eq!(silent["controller"], "running");
    eventually("the metrics", || (metric("skillet_health{") == Some(1.0)).then_some(()));
    assert!(metric("skillet_learner_silence_seconds") >= Some(1.0));
    let status: Value =
        serde_json::from_str(&bench.ok(&["status", "--cell", "c1", "--json"])).unwrap();
    assert_eq!(status["health"], "degraded");
    first.signal("CONT");
    watch.until("going on", |line| line["learner"] == "running" && line["health"] == "ok");

    first.signal("KILL");
    first.wait();
    watch.says("learner", "absent");
    watch.until("silence", |line| line["health"] == "degraded");
    let second = learner(&bench);
    watch.until("the next", |line| line["learner"] == "running" && line["health"] == "ok");
    second.signal("TERM");
    second.wait();
    let left = watch.says("learner", "absent");
    assert_eq!(left["health"], "ok", "one that took its leave is not missed: {left}");
}

fn scrape(port: u16) -> String {
    use std::io::{Read, Write};
    let mut text = String::new();
    let Ok(mut stream) = std::net::TcpStream::connect(("127.0.0.1", port)) else { return text };
    let request = "GET /metrics HTTP/1.1\r\nHost: localhost\r\nConnection: close\r\n\r\n";
    let _ = stream.write_all(request.as_bytes()).and_then(|()| stream.read_to_string(&mut text));
    text
}

#[test]
fn viewers_are_told_of_a_controller_that_is_gone() {
    let bench = Bench::new();
    let controller = bench.start(&CONTROLLER);
    eventually("a controller", || {
        bench.run(&["status", "--cell", "c1"]).status.success().then_some(())
    });
    let watch = Watch::start(&bench, &["--serve", "127.0.0.1:0"]);
    let said = |what: &str| {
        eventually(what, || util::text(&watch.file).contains(what).then_some(()));
    };
    said("serving");
    controller.signal("STOP");
    said("has not responded for");
    controller.signal("CONT");
    said("is back");
    controller.signal("KILL");
    controller.wait();
    said("no controller for");
}
