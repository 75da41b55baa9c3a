//! Plants in another process: the same bits, real deaths, and refusals.

mod util;

use std::path::Path;
use std::process::Command;

use physics::arm::{ArmModel, JointVector};
use physics::pancake::{PancakeConfig, PancakePlant, WAM7_START_POSTURE};
use physics::plant::{Measurement, Plant};
use serde_json::Value;
use shm_types::measures::{Measure, Measures};
use skillet_plant::{Answer, Description, Object, Sample};
use util::{Bench, Running, bits, eventually, kill, stderr};

const CONTROLLER: [&str; 7] =
    ["controller", "--cell", "c1", "--pace", "max", "--plant", "external"];
const PLANT: [&str; 4] = ["plant", "serve", "--cell", "c1"];

fn status(bench: &Bench) -> Option<Value> {
    let output = bench.run(&["status", "--cell", "c1", "--json"]);
    // A latched arm is a negative verdict.
    serde_json::from_slice(&output.stdout).ok().filter(|_| output.status.code() < Some(2))
}

/// The executable under test as a plant's program.
fn serve() -> String {
    format!("{} plant serve", env!("CARGO_BIN_EXE_skillet"))
}

#[test]
fn our_simulation_in_another_process_leads_to_the_same_trials_bit_for_bit() {
    let bench = Bench::new();
    let learn = ["learn", "pancake", "--seed", "2", "--rollouts", "12", "--out"];
    bench.ok(&[&learn[..], &["inside"]].concat());
    let inside = bench.trials("inside");
    assert_eq!(inside.len(), 12);
    for (session, serve) in [("socket", serve()), ("shared", format!("{} --poll", serve()))] {
        bench.ok(&[&learn[..], &[session, "--plant-program", &serve]].concat());
        assert_eq!(bits(&inside), bits(&bench.trials(session)), "{session}");
        // Nothing is left: no process, no shared memory of theirs.
        let log = std::fs::read_to_string(bench.path(session).join("plant.log")).unwrap();
        assert!(log.contains("connected to the controller"), "{log}");
    }
}

/// Latched, held and refused a re-arm while it is gone; then the session goes on as if nothing had been.
#[test]
fn a_plant_that_is_killed_latches_and_the_next_one_goes_on_after_a_rearm() {
    let bench = Bench::new();
    let config = bench.write("c.toml", "[learner]\nrollouts = 16\nseed = 3\n");
    let config = config.to_str().unwrap();
    let _controller = bench.start(&CONTROLLER);
    let polling = [&PLANT[..], &["--poll"]].concat();
    let mut plant = bench.start(&polling);
    let learner = bench.start(&["learner", "--cell", "c1", "--session", "s", "--config", config]);
    for n in [4, 9] {
        bench.wait_for_trials("s", n);
        kill(plant.pid(), "KILL");
        plant.wait();
        let held = eventually("the latch", || {
            status(&bench).filter(|status| status["latched_fault"].is_string())
        });
        let fault = held["latched_fault"].to_string();
        assert!(fault.contains("stale"), "{fault}");
        let early = bench.run(&["rearm", "--cell", "c1"]);
        assert_eq!(early.status.code(), Some(2), "there is no plant: {}", stderr(&early));
        plant = bench.start(if n == 4 { &PLANT } else { &polling });
        eventually("a re-arm", || {
            bench.run(&["rearm", "--cell", "c1"]).status.success().then_some(())
        });
    }
    let output = learner.wait();
    assert!(output.status.success(), "{}", stderr(&output));
    bench.ok(&["learn", "pancake", "--seed", "3", "--rollouts", "16", "--out", "undisturbed"]);
    assert_eq!(bits(&bench.trials("s")), bits(&bench.trials("undisturbed")));
}

#[test]
fn a_plant_whose_controller_is_killed_says_so_and_ends() {
    let bench = Bench::new();
    let controller = bench.start(&CONTROLLER);
    let plant = bench.start(&PLANT);
    eventually("status", || status(&bench));
    std::thread::sleep(std::time::Duration::from_millis(300));
    kill(controller.pid(), "KILL");
    controller.wait();
    let output = plant.wait();
    assert_eq!(output.status.code(), Some(2));
    assert!(stderr(&output).contains("the controller has ended or died"), "{}", stderr(&output));
}

#[test]
fn a_plant_that_differs_is_refused_on_both_sides_with_both_values() {
    let bench = Bench::new();
    let controller = bench.start(&CONTROLLER);
    let waiting = eventually("a controller without a plant", || {
        status(&bench).filter(|status| status["plant"] == "absent")
    });
    assert!(waiting["findings"].to_string().contains("no plant has connected yet"), "{waiting:#}");
    for (settings, words) in [
        ("[controller]\nperiod_us = 500\n", ["500000 ns", "1000000"]),
        (
            "[plant]\ntorque_limits_nm = [150, 125, 40, 60, 5, 5, 2.5]\n",
            ["takes 2.5 N·m", "controller's 2"],
        ),
    ] {
        let config = bench.write("other.toml", settings);
        let config = config.to_str().unwrap();
        let refused = bench.run(&[&PLANT[..], &["--config", config]].concat());
        let said = stderr(&refused);
        assert_eq!(refused.status.code(), Some(2), "{said}");
        assert!(words.iter().all(|word| said.contains(word)), "{said}");
    }
    let plant = bench.start(&PLANT);
    eventually("a plant", || status(&bench).filter(|status| status["plant"] == "there"));
    eventually("the plant in the loop", || {
        let second = bench.run(&PLANT);
        (second.status.code() == Some(2) && stderr(&second).contains("has a plant already"))
            .then_some(())
    });
    drop(plant);
    controller.signal("TERM");
    let log = stderr(&controller.wait());
    assert!(log.contains("plant refused") && log.contains("500000 ns"), "{log}");
}

#[test]
fn a_real_plant_and_a_simulated_one_are_told_apart() {
    let bench = Bench::new();
    bench.refused(&["controller", "--cell", "c1", "--pace", "plant"], &["--plant external"]);
    let controller = [&CONTROLLER[..4], &["plant", "--plant", "external"]].concat();
    let _controller = bench.start(&controller);
    let refused = bench.run(&PLANT);
    assert!(stderr(&refused).contains("--pace max or realtime"), "{}", stderr(&refused));
}

#[test]
fn check_passes_our_simulation_and_finds_another_arm() {
    let bench = Bench::new();
    let serve = serve();
    let found = bench.run(&["plant", "check", "--json", "--samples", "200", "--program", &serve]);
    let checks: Value = serde_json::from_slice(&found.stdout).unwrap();
    assert_eq!(found.status.code(), Some(0), "{checks:#}");
    assert_eq!(checks["passed"], true);
    assert!(checks["checks"].as_array().unwrap().len() >= 12, "{checks:#}");

    // The same arm with three times the pan: names and limits agree, what it does under torques does not.
    let urdf = include_str!("../robots/wam7/wam7_pan.urdf");
    let heavy = urdf.replacen(r#"<mass value="0.5""#, r#"<mass value="6.5""#, 1);
    assert_ne!(urdf, heavy, "the pan's mass is written otherwise");
    bench.write("heavy.urdf", &heavy);
    let config = bench.write("heavy.toml", "[plant]\narm = \"heavy.urdf\"\n");
    let other = format!("{serve} --config {}", config.display());
    let found = bench.run(&["plant", "check", "--samples", "200", "--program", &other]);
    assert_eq!(found.status.code(), Some(1));
    assert!(stderr(&found).contains("FAILED  hello"), "{}", stderr(&found));
}

/// The header and the library are what a C compiler takes them for.
#[test]
fn a_plant_in_c_is_stepped() {
    let bench = Bench::new();
    let root = env!("CARGO_MANIFEST_DIR");
    // Where `cargo test` leaves it; `cargo build` links it beside the executable.
    let built = &Path::new(env!("CARGO_BIN_EXE_skillet")).parent().unwrap().join("deps");
    let library = built.join("libskillet_plant.so");
    assert!(library.is_file(), "{} is built with the workspace", library.display());
    let output = Command::new("cc")
        .args(["-Wall", "-Wextra", "-Werror", "-std=c11"])
        .arg(format!("{root}/examples/plant.c"))
        .arg(format!("-I{root}/clients/plant/include"))
        .arg(format!("-L{}", built.display()))
        .args(["-lskillet_plant", "-o"])
        .arg(bench.path("plant"))
        .output()
        .unwrap();
    assert!(output.status.success(), "{}", stderr(&output));
    let start = |cell: &str| {
        let mut command = Command::new(bench.path("plant"));
        command
            .arg(cell)
            .env("LD_LIBRARY_PATH", built)
            .env("SKILLET_RUNTIME_DIR", bench.path("run"))
            .stderr(std::process::Stdio::piped());
        Running::start(&mut command)
    };
    // All at zero the WAM stands upright: the pan of the example's arm is far from its start posture.
    let controller = bench.start(&CONTROLLER);
    let plant = start("c1");
    eventually("status", || status(&bench));
    std::thread::sleep(std::time::Duration::from_millis(300));
    controller.signal("TERM");
    assert!(controller.wait().status.success());
    let output = plant.wait();
    assert_eq!(output.status.code(), Some(0), "{}", stderr(&output));
    // It is another arm than the model, and the check says where.
    let mut check = bench.skillet(&["plant", "check", "--samples", "200", "--program"]);
    check.arg(bench.path("plant")).env("LD_LIBRARY_PATH", built);
    let found = check.output().unwrap();
    assert_eq!(found.status.code(), Some(1));
    for line in
        ["ok      numbers and time", "FAILED  reset", "FAILED  torque", "ok      determinism"]
    {
        assert!(stderr(&found).contains(line), "{line}: {}", stderr(&found));
    }
    let bad = start("NO").wait();
    assert_eq!(bad.status.code(), Some(1));
    assert!(stderr(&bad).contains("cell name"), "{}", stderr(&bad));
}

/// `learn` prints why there are no more trials, and what to do.
#[test]
fn learn_says_that_the_arm_is_held() {
    let bench = Bench::new();
    let serve = serve();
    let learn = ["learn", "pancake", "--rollouts", "40", "--out", "s", "--plant-program", &serve];
    let running = bench.start(&learn);
    bench.wait_for_trials("s", 2);
    let cell = format!("learn-{}", running.pid());
    bench.ok(&["hold", "--cell", &cell]);
    std::thread::sleep(std::time::Duration::from_secs(5));
    bench.ok(&["rearm", "--cell", &cell]);
    let output = running.wait();
    let said = stderr(&output);
    assert!(output.status.success(), "{said}");
    assert!(said.contains("the arm is held: held by operator"), "{said}");
    assert!(said.contains(&format!("skillet rearm --cell {cell}")), "{said}");
    assert_eq!(bench.trials("s").len(), 40);
}

/// From the store alone, in the plant's own process.
#[test]
fn a_trial_of_an_external_plant_is_replayed_in_it() {
    let bench = Bench::new();
    let serve = serve();
    bench.ok(&["learn", "pancake", "--rollouts", "3", "--out", "s", "--plant-program", &serve]);
    let said = bench.ok(&["replay", "s", "--trial", "2"]);
    assert!(said.contains("identical, bit for bit"), "{said}");
}

/// The pancake's world in this process, which tells of each episode what nobody else can measure.
fn serve_and_tell(socket: &Path, polls: bool) {
    let urdf = include_str!("../robots/wam7/wam7_pan.urdf");
    let model = ArmModel::from_urdf(urdf, "pan").unwrap();
    let mut world = PancakePlant::new(&model, &WAM7_START_POSTURE, &PancakeConfig::default());
    let description = Description {
        has_object: true,
        polls,
        q: WAM7_START_POSTURE.into(),
        ..Description::simulated(0.001)
    };
    let mut line = skillet_plant::Plant::connect(socket, &description).unwrap();
    loop {
        let Measurement { q, qd, object, .. } = world.measure();
        let [i, j, k, w] = object.R_WO.coords.into();
        let object = Object {
            position: object.p_WO.into(),
            quaternion: [w, i, j, k],
            in_contact: object.in_contact,
        };
        let sample =
            Sample { q: q.into(), qd: qd.into(), object: Some(object), ..Sample::default() };
        match line.exchange(&sample) {
            Ok(Answer::Torque(tau)) => {
                world.apply(&JointVector::from(tau));
                world.advance();
            }
            Ok(Answer::Reset(_)) => {
                world.begin_reset();
                line.has_reset();
                // A world that varies would draw by it.
                let value = line.rollout() as f64;
                let force = Measure { name: "contact_force_n", unit: "N", value };
                line.tell(&Measures::of([force]).unwrap()).unwrap();
            }
            _ => return,
        }
    }
}

#[test]
fn what_only_the_plant_can_measure_joins_the_measures() {
    let bench = Bench::new();
    let socket = bench.path("p.sock");
    let settings = format!(
        "[plant]\nkind = \"external\"\nsocket = \"{}\"\n[plant.measures]\ncontact_force_n = \"N\"\n\
         [learner]\nrollouts = 3\n",
        socket.display()
    );
    let config = bench.write("c.toml", &settings);
    let config = config.to_str().unwrap();
    for (session, polls) in [("socket", false), ("shared", true)] {
        let controller =
            bench.start(&["controller", "--cell", "c1", "--pace", "max", "--config", config]);
        let there = socket.clone();
        let plant = std::thread::spawn(move || serve_and_tell(&there, polls));
        bench.ok(&["learner", "--cell", "c1", "--session", session, "--config", config]);
        let trials = bench.trials(session);
        let forces: Vec<_> = trials.iter().map(|t| t.measures.get("contact_force_n")).collect();
        assert_eq!(forces, [Some(1.0), Some(2.0), Some(3.0)], "{session}");
        assert!(trials.iter().all(|trial| trial.measures.get("apex_m").is_some()));
        controller.signal("TERM");
        controller.wait();
        plant.join().unwrap();
    }
}
