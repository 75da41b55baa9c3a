//! A recording as CSV, trimmed, smoothed and written as a demonstration.
#![no_main]

#[allow(dead_code, unused_imports)] // it belongs to a program that uses all of it
#[path = "../../src/demo/mod.rs"]
mod demo;

use std::sync::LazyLock;

use demo::Options;
use learner::Demonstration;
use learner::orientation::Orientation;
use libfuzzer_sys::fuzz_target;
use physics::arm::{ArmModel, JointVector, kinematics};
use skillet_fuzz::{split, wam};

static ARM: LazyLock<ArmModel> = LazyLock::new(wam);

fuzz_target!(|data: &[u8]| {
    let (how, text) = split(data);
    let options = Options {
        rate_hz: if how & 1 == 0 { 100.0 } else { 1000.0 },
        smooth_s: (how & 2 != 0).then_some(0.05),
        start_s: (how & 4 != 0).then_some(0.1),
        end_s: (how & 8 != 0).then_some(1.0),
        slow: if how & 16 == 0 { 1.0 } else { 2.5 },
        at_start: (how & 32 != 0).then(|| kinematics::tip_pose(&ARM, &JointVector::zeros())),
        columns: match how & 64 {
            0 => Vec::new(),
            _ => vec!["t_ms=1".parse().unwrap(), "x=x".parse().unwrap()],
        },
        orientation: if how & 128 == 0 { Orientation::Vector } else { Orientation::Sphere },
    };
    match demo::import("r.csv", text, &ARM, &options) {
        Ok(imported) => drop(Demonstration::parse("out.csv", &imported.csv())),
        Err(error) => assert!(!format!("{error:#}").is_empty()),
    }
});
