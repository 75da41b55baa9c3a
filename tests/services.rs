//! Controller and learner as separate services of one cell.

mod util;

use serde_json::Value;
use shm_types::cell::Cell;
use shm_types::ports::ObserverPorts;
use util::{Bench, bits, eventually, kill};

const CONTROLLER: [&str; 5] = ["controller", "--cell", "c1", "--pace", "max"];

fn status(bench: &Bench) -> Option<Value> {
    let output = bench.run(&["status", "--cell", "c1", "--json"]);
    serde_json::from_slice(&output.stdout).ok().filter(|_| output.status.success())
}

#[test]
fn session_survives_the_death_of_each_service() {
    let bench = Bench::new();
    let config = bench.write("c.toml", "[learner]\nrollouts = 40\nseed = 3\n");
    let config = config.to_str().unwrap();
    let learner = ["learner", "--cell", "c1", "--session", "s"];

    // The learner may come first.
    let first_learner = bench.start(&[&learner[..], &["--config", config]].concat());
    let first_controller = bench.start(&CONTROLLER);
    bench.wait_for_trials("s", 5);
    kill(first_controller.pid(), "KILL");
    first_controller.wait();
    let _second_controller = bench.start(&CONTROLLER);
    bench.wait_for_trials("s", 12);
    kill(first_learner.pid(), "KILL");
    first_learner.wait();
    let second_learner = bench.start(&learner);
    let output = second_learner.wait();
    assert!(output.status.success(), "{}", util::stderr(&output));

    let arguments = ["learn", "pancake", "--seed", "3", "--rollouts", "40", "--out", "undisturbed"];
    bench.ok(&arguments);
    assert_eq!(bits(&bench.trials("s")), bits(&bench.trials("undisturbed")));
}

#[test]
fn status_tells_what_a_controller_does_and_that_there_is_none() {
    let bench = Bench::new();
    let absent = bench.run(&["status", "--cell", "c1"]);
    assert_eq!(absent.status.code(), Some(3));
    assert!(String::from_utf8_lossy(&absent.stdout).contains("skillet controller --cell c1"));

    let controller = bench.start(&CONTROLLER);
    let idle = eventually("status", || status(&bench));
    assert_eq!((&idle["phase"], &idle["pace"]), (&"idle".into(), &"max".into()));
    assert_eq!(idle["learner_age_s"], Value::Null);

    let config = bench.write("c.toml", "[learner]\nrollouts = 3\n");
    let learner = ["learner", "--cell", "c1", "--session", "s", "--config"];
    bench.ok(&[&learner[..], &[config.to_str().unwrap()]].concat());
    let done = eventually("acknowledgement", || {
        status(&bench).filter(|status| status["unacknowledged_episodes"] == 0)
    });
    assert_eq!(done["rollouts_done"], 3);
    let left = eventually("farewell", || status(&bench).filter(|s| s["learner_age_s"].is_null()));
    assert_eq!(left["health"], "ok", "a learner that ended cleanly is not missed");
    assert!(done["applied_tick"].as_u64().unwrap() > 0);

    controller.signal("TERM");
    assert_eq!(controller.wait().status.code(), Some(0), "SIGTERM is an orderly end");
}

#[test]
fn second_controller_in_a_cell_is_refused_and_disturbs_nobody() {
    let bench = Bench::new();
    let first = bench.start(&CONTROLLER);
    eventually("status", || status(&bench));
    bench.refused(&CONTROLLER, &["cell 'c1' has a controller already", "--cell"]);
    assert!(status(&bench).is_some(), "the first one goes on");
    first.signal("INT");
    assert!(first.wait().status.success());
}

/// At once, with one seed: each is the session it would be alone.
#[test]
fn ten_cells_do_not_meet() {
    let bench = Bench::new();
    let arguments = ["learn", "pancake", "--seed", "2", "--rollouts", "6", "--out"];
    let outs: Vec<String> = (0..10).map(|i| format!("s{i}")).collect();
    let start = |out: &String| bench.start(&[&arguments[..], &[out]].concat());
    let sessions: Vec<_> = outs.iter().map(start).collect();
    for session in sessions {
        let output = session.wait();
        assert!(output.status.success(), "{}", util::stderr(&output));
    }
    bench.ok(&[&arguments[..], &["alone"]].concat());
    let alone = bits(&bench.trials("alone"));
    for out in &outs {
        assert_eq!(bits(&bench.trials(out)), alone, "{out}");
    }
}

#[test]
fn telemetry_reaches_observers_that_come_and_go() {
    let bench = Bench::new();
    let _controller = bench.start(&["controller", "--cell", "c1", "--pace", "realtime"]);
    let cell = Cell::in_dir(&bench.path("run"), "c1").unwrap();
    let mut unseen = 0;
    for _ in 0..3 {
        let observer = ObserverPorts::open(&cell, util::WATCHDOG).unwrap();
        let sample = eventually("telemetry", || observer.telemetry.receive().unwrap());
        assert_eq!(sample.schema, shm_types::SCHEMA);
        let ticks: Vec<u64> = sample.ticks().iter().map(|tick| tick.record.tick).collect();
        assert!(ticks.windows(2).all(|pair| pair[1] > pair[0]), "{ticks:?}");
        assert!(ticks[0] >= unseen, "live, not old");
        assert!(sample.ticks[0].tick_ns > 0);
        unseen = ticks[ticks.len() - 1] + 1;
    }
}

/// A controller that refuses the demonstration itself: nothing that a search could learn from.
#[test]
fn refused_policies_end_the_session_with_the_reason_and_are_no_trials() {
    let bench = Bench::new();
    // The controller's settings leave no room for the demonstration; the learner does not know.
    let strict = bench.write("strict.toml", "[controller]\nsettle_s = 4.5\n");
    let strict = ["--config", strict.to_str().unwrap()];
    let _controller = bench.start(&[&CONTROLLER[..], &strict].concat());
    let learner = ["learner", "--cell", "c1", "--session", "s"];
    bench.refused(
        &learner,
        &["rollout 1", "refused the policy", "the demonstration", "settle_s = 4.5"],
    );
    assert!(bench.trials("s").is_empty());
}

/// An episode whose learner died before it took it outlives the controller, too, and is learnt once
/// it is asked for: as it was executed, not again.
#[test]
fn an_episode_survives_the_death_of_both() {
    let bench = Bench::new();
    let realtime = ["controller", "--cell", "c1", "--pace", "realtime"];
    let first = bench.start(&realtime);
    let boot_id = || status(&bench).map(|status| status["boot_id"].clone());
    let first_boot = eventually("a controller", boot_id);
    let config = bench.write("c.toml", "[learner]\nrollouts = 2\nseed = 3\n");
    let learner = ["learner", "--cell", "c1", "--session", "s", "--config"];
    let learner = [&learner[..], &[config.to_str().unwrap()]].concat();
    let running = bench.start(&learner);
    eventually("the second rollout", || {
        status(&bench).filter(|s| s["policy"]["rollout"] == 1 && s["rollouts_done"] == 1)?;
        status(&bench).filter(|status| status["phase"] == "execute")
    });
    kill(running.pid(), "KILL");
    running.wait();
    eventually("its end", || status(&bench).filter(|s| s["rollouts_done"] == 2));
    let spooled = || status(&bench).filter(|status| status["spooled_episodes"] == 1);
    eventually("an episode on disk", spooled);
    kill(first.pid(), "KILL");
    first.wait();

    let _second = bench.start(&realtime);
    eventually("an episode on disk", spooled);
    assert!(bench.start(&learner).wait().status.success());
    eventually("an empty spool", || status(&bench).filter(|s| s["spooled_episodes"] == 0));
    assert_eq!(status(&bench).unwrap()["rollouts_done"], 0, "nothing was executed again");
    let trials = bench.trials("s");
    assert_eq!(trials.len(), 2);
    assert!(
        trials.iter().all(|trial| first_boot == format!("{:016x}", trial.boot_id)),
        "{first_boot}"
    );
    bench.ok(&["learn", "pancake", "--seed", "3", "--rollouts", "2", "--out", "undisturbed"]);
    assert_eq!(bits(&trials), bits(&bench.trials("undisturbed")));
}

/// As systemd does it: readiness, a sign of life every second, the announced end.
#[test]
fn a_service_manager_is_told_of_readiness_life_and_end() {
    use std::os::unix::net::UnixDatagram;
    let bench = Bench::new();
    let path = bench.path("notify");
    let manager = UnixDatagram::bind(&path).unwrap();
    manager.set_read_timeout(Some(util::WATCHDOG)).unwrap();
    let said = |word: &str| {
        let mut buffer = [0; 256];
        eventually(word, || {
            let n = manager.recv(&mut buffer).ok()?;
            String::from_utf8_lossy(&buffer[..n]).contains(word).then_some(())
        });
    };
    let start = |arguments: &[&str]| {
        let mut command = bench.skillet(arguments);
        command.env("NOTIFY_SOCKET", &path).stderr(std::process::Stdio::null());
        command.spawn().unwrap()
    };
    let services = [
        vec!["controller", "--cell", "c1", "--pace", "realtime"],
        vec!["learner", "--cell", "c1", "--session", "s"],
    ];
    // The second one joins the first, and both end at the end of the test.
    let mut running = Vec::new();
    for arguments in &services {
        running.push(start(arguments));
        said("READY=1");
        said("WATCHDOG=1");
    }
    for mut service in running.into_iter().rev() {
        kill(service.id(), "TERM");
        said("STOPPING=1");
        service.wait().unwrap();
    }
}

#[test]
fn metrics_are_offered_on_loopback_when_asked_for_and_a_hangup_sets_the_log_level() {
    use std::io::{Read, Write};
    use std::net::{TcpListener, TcpStream};
    fn with(path: &std::path::Path) -> Vec<&str> {
        [&CONTROLLER[..], &["--config", path.to_str().unwrap()]].concat()
    }
    let bench = Bench::new();
    let open = "[metrics]\nlisten = \"0.0.0.0:9464\"\n";
    let open = bench.write("open.toml", open);
    bench.refused(&with(&open), &["metrics.listen", "0.0.0.0:9464", "loopback"]);

    let free = TcpListener::bind("127.0.0.1:0").unwrap().local_addr().unwrap();
    let text =
        |level: &str| format!("[metrics]\nlisten = \"{free}\"\n[log]\nlevel = \"{level}\"\n");
    let config = bench.write("c.toml", &text("error"));
    let controller = bench.start(&with(&config));
    eventually("status", || status(&bench));
    let get = |path: &str| {
        let mut stream = TcpStream::connect(free).unwrap();
        write!(stream, "GET {path} HTTP/1.0\r\n\r\n").unwrap();
        let mut answer = String::new();
        stream.read_to_string(&mut answer).unwrap();
        answer
    };
    let metrics = get("/metrics");
    assert!(metrics.starts_with("HTTP/1.0 200"), "{metrics}");
    assert!(metrics.contains("skillet_rollouts_total{cell=\"c1\"} 0"), "{metrics}");
    assert!(get("/").starts_with("HTTP/1.0 404"));
    assert!(!metrics.contains("skillet_reward"), "nobody learns: {metrics}");
    let few = bench.write("few.toml", "[learner]\nrollouts = 8\n");
    let learner = ["learner", "--cell", "c1", "--session", "s", "--config"];
    bench.ok(&[&learner[..], &[few.to_str().unwrap()]].concat());
    let last = bench.trials("s").pop().unwrap();
    // By its value: two writers of numbers may differ in the last digit of the shortest text.
    let reward = |metrics: &str| -> Option<f64> {
        let mut lines = metrics.lines();
        lines.find_map(|line| line.strip_prefix("skillet_reward{cell=\"c1\"} ")?.parse().ok())
    };
    let told = || Some(get("/metrics")).filter(|metrics| reward(metrics) == Some(last.reward));
    let metrics = eventually("the last reward", told);
    assert!(metrics.contains("skillet_session_trials{cell=\"c1\"} 8"), "{metrics}");

    bench.write("c.toml", &text("info"));
    kill(controller.pid(), "HUP");
    // It lives, and from now on says what it does.
    bench.ok(&["status", "--cell", "c1"]);
    std::thread::sleep(std::time::Duration::from_millis(300));
    controller.signal("TERM");
    let log = util::stderr(&controller.wait());
    assert!(!log.contains("controller ready"), "the level was error: {log}");
    assert!(log.contains("configuration reloaded") && log.contains("ended cleanly"), "{log}");
}

/// What a process holds that is killed while it joins is not always freed, and places are few.
#[test]
fn services_that_dead_processes_have_filled_are_made_anew() {
    let bench = Bench::new();
    let controller = bench.start(&CONTROLLER);
    let config = bench.write("c.toml", "[learner]\nrollouts = 40\nseed = 3\n");
    let learner = ["learner", "--cell", "c1", "--session", "s", "--config"];
    let learner = bench.start(&[&learner[..], &[config.to_str().unwrap()]].concat());
    bench.wait_for_trials("s", 3);
    for i in 0..6_u128 {
        // Nodes of a process number that the kernel never gives.
        let name = ((0x7fff_ffff_u128 << 64) + i).to_string();
        std::fs::create_dir(bench.path("run/c1/g1/nodes").join(name)).unwrap();
    }
    let current = bench.path("run/c1/current");
    eventually("another generation", || (util::text(&current) != "1").then_some(()));
    eventually("the old one to go", || (!bench.path("run/c1/g1").exists()).then_some(()));
    assert!(status(&bench).is_some(), "tools find the new one");
    let output = learner.wait();
    assert!(output.status.success(), "{}", util::stderr(&output));
    controller.signal("TERM");
    assert!(util::stderr(&controller.wait()).contains("services recreated"));
    bench.ok(&["learn", "pancake", "--seed", "3", "--rollouts", "40", "--out", "undisturbed"]);
    assert_eq!(bits(&bench.trials("s")), bits(&bench.trials("undisturbed")));
}

/// A process killed between creating a segment and giving it a size leaves an empty one, for which the
/// transport would wait for ever: the learner that follows must come up all the same, and the
/// controller go on.
#[test]
fn a_stillborn_connection_of_a_dead_learner_stops_nobody() {
    let bench = Bench::new();
    let _controller = bench.start(&["controller", "--cell", "c1", "--pace", "max"]);
    let config = bench.write("c.toml", "[learner]\nrollouts = 40\n");
    let learner = ["learner", "--cell", "c1", "--session", "s", "--config"];
    let learner = [&learner[..], &[config.to_str().unwrap()]].concat();
    let first = bench.start(&learner);
    bench.wait_for_trials("s", 3);
    let cell = Cell::in_dir(&bench.path("run"), "c1").unwrap();
    let mut stillborn = Vec::new();
    for path in cell.traces() {
        let name = path.display().to_string();
        // …_<sender>_<receiver>.connection: the same sender, and a receiver that nobody is.
        if let Some(name) = name.strip_suffix(".connection") {
            stillborn.push(std::path::PathBuf::from(format!("{name}1.connection")));
            std::fs::write(stillborn.last().unwrap(), "").unwrap();
        }
    }
    assert!(stillborn.len() >= 2, "{:?}", cell.traces());
    first.signal("KILL");
    first.wait();
    let second = bench.start(&learner).wait();
    assert_eq!(second.status.code(), Some(0), "{}", util::stderr(&second));
    assert_eq!(bench.trials("s").len(), 40);
    assert!(stillborn.iter().all(|path| !path.exists()));
    bench.ok(&["status", "--cell", "c1"]);
}
