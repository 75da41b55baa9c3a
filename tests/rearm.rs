//! A hardware fault under a learner's session: it waits, `skillet rearm` lets it go on, and nothing
//! of it is lost or changed.

mod util;

use std::sync::atomic::{AtomicBool, Ordering};

use physics::arm::{ArmModel, JointVector};
use physics::pancake::{PancakeConfig, PancakePlant, WAM7_START_POSTURE};
use physics::plant::{Measurement, Plant};
use physics::referee::{Referee, Toss, TossConfig};
use rt_controller::run::Controlled;
use rt_controller::{ControllerConfig, Pace, Station};
use serde_json::Value;
use shm_types::cell::Cell;
use shm_types::equipment::Equipment;
use util::{Bench, bits, eventually};

/// A pancake world whose samples stop when it is told.
struct Cut<'a> {
    world: PancakePlant,
    shown: Measurement,
    is_cut: &'a AtomicBool,
}

impl Cut<'_> {
    fn show(&mut self) {
        if !self.is_cut.load(Ordering::Relaxed) {
            self.shown = self.world.measure();
        }
    }
}

impl Plant for Cut<'_> {
    fn is_simulated(&self) -> bool {
        true
    }

    fn begin_reset(&mut self) {
        self.world.begin_reset();
        self.show();
    }

    fn is_ready(&self) -> bool {
        true
    }

    fn measure(&self) -> Measurement {
        self.shown
    }

    fn apply(&mut self, tau: &JointVector) {
        self.world.apply(tau);
    }

    fn advance(&mut self) {
        self.world.advance();
        self.show();
    }
}

/// Stops the controller when the test ends, by a panic as well.
struct Stopping<'a>(&'a AtomicBool);

impl Drop for Stopping<'_> {
    fn drop(&mut self) {
        self.0.store(true, Ordering::Relaxed);
    }
}

fn run(bench: &Bench, is_cut: &AtomicBool, stop: &AtomicBool) {
    let urdf = include_str!("../robots/wam7/wam7_pan.urdf");
    let model = ArmModel::from_urdf(urdf, "pan").unwrap();
    let world = PancakePlant::new(&model, &WAM7_START_POSTURE, &PancakeConfig::default());
    let mut plant = Cut { shown: world.measure(), world, is_cut };
    let cell = Cell::in_dir(&bench.path("run"), "c1").unwrap();
    let referee = Referee::Toss(Toss::new(&TossConfig::default()));
    let q0 = WAM7_START_POSTURE;
    let controlled = Controlled { model: &model, plant: &mut plant, q0, referee };
    let (config, state) = (ControllerConfig::default(), bench.path("state/c1"));
    let equipment = Equipment::UNKNOWN;
    let station = Station { cell: &cell, state: Some(&state), equipment };
    rt_controller::run(station, &config, Pace::Max, controlled, stop).unwrap();
}

fn status(bench: &Bench) -> Value {
    serde_json::from_slice(&bench.run(&["status", "--cell", "c1", "--json"]).stdout).unwrap()
}

#[test]
fn a_session_waits_for_the_rearm_and_comes_out_the_same() {
    let bench = Bench::new();
    let (is_cut, stop) = (AtomicBool::new(false), AtomicBool::new(false));
    std::thread::scope(|scope| {
        scope.spawn(|| run(&bench, &is_cut, &stop));
        let _stopping = Stopping(&stop);
        let config = bench.write("c.toml", "[learner]\nrollouts = 25\nseed = 3\n");
        let learner = ["learner", "--cell", "c1", "--session", "s", "--config"];
        let learner = bench.start(&[&learner[..], &[config.to_str().unwrap()]].concat());
        bench.wait_for_trials("s", 5);
        bench.refused(&["rearm", "--cell", "c1"], &["no fault is latched"]);

        is_cut.store(true, Ordering::Relaxed);
        let held = eventually("the latch", || {
            Some(status(&bench)).filter(|status| !status["latched_fault"].is_null())
        });
        assert_eq!(held["latched_fault"], "the measurement is stale");
        assert!(held["latched_s"].is_number());
        assert_eq!(held["fault_records"], 1);
        bench.refused(&["rearm", "--cell", "c1"], &["the measurement is stale", "fix it"]);
        let n = bench.trials("s").len();
        std::thread::sleep(std::time::Duration::from_millis(500));
        assert!(bench.trials("s").len() <= n + 1, "the learner waits");
        let output = bench.run(&["status", "--cell", "c1"]);
        assert_eq!(output.status.code(), Some(1), "it needs attention");
        let text = String::from_utf8(output.stdout).unwrap();
        assert!(text.contains("health      bad; the arm is held"), "{text}");
        assert!(text.contains("held  ") && text.contains("1 flight records in"), "{text}");

        is_cut.store(false, Ordering::Relaxed);
        eventually("a cause that is gone", || {
            (status(&bench)["latched_cause_present"] == false).then_some(())
        });
        assert!(bench.ok(&["rearm", "--cell", "c1"]).contains("re-armed"));
        let output = learner.wait();
        let log = util::stderr(&output);
        assert!(output.status.success(), "{log}");
        assert!(log.contains("waiting for `skillet rearm`") && log.contains("re-armed"), "{log}");
    });
    let undisturbed =
        ["learn", "pancake", "--seed", "3", "--rollouts", "25", "--out", "undisturbed"];
    bench.ok(&undisturbed);
    assert_eq!(bits(&bench.trials("s")), bits(&bench.trials("undisturbed")));
}

/// A hold is a person's latch: over a kill of the controller, until a person ends it.
#[test]
fn a_hold_lasts_until_the_rearm_and_changes_no_trial() {
    let bench = Bench::new();
    let start = || bench.start(&["controller", "--cell", "c1", "--pace", "max"]);
    let controller = start();
    let config = bench.write("c.toml", "[learner]\nrollouts = 25\nseed = 3\n");
    let learner = ["learner", "--cell", "c1", "--session", "s", "--config"];
    let learner = bench.start(&[&learner[..], &[config.to_str().unwrap()]].concat());
    bench.wait_for_trials("s", 5);
    assert!(bench.ok(&["hold", "--cell", "c1"]).contains("is held"));
    let is_held = || {
        let output = bench.run(&["status", "--cell", "c1", "--json"]);
        let status: Value = serde_json::from_slice(&output.stdout).ok()?;
        (status["latched_fault"] == "held by operator").then_some(())
    };
    eventually("the hold", is_held);
    controller.signal("KILL");
    controller.wait();
    let _controller = start();
    eventually("the hold of before", is_held);
    let n = bench.trials("s").len();
    std::thread::sleep(std::time::Duration::from_millis(500));
    assert_eq!(bench.trials("s").len(), n, "the learner waits");
    eventually("a re-arm", || bench.run(&["rearm", "--cell", "c1"]).status.success().then_some(()));
    assert!(learner.wait().status.success());
    let undisturbed =
        ["learn", "pancake", "--seed", "3", "--rollouts", "25", "--out", "undisturbed"];
    bench.ok(&undisturbed);
    assert_eq!(bits(&bench.trials("s")), bits(&bench.trials("undisturbed")));
}
