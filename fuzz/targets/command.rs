//! A command to the controller, and the policy an import brings: admission and dry run.
#![no_main]

use std::sync::LazyLock;

use libfuzzer_sys::fuzz_target;
use physics::arm::ArmModel;
use physics::pancake::WAM7_START_POSTURE;
use rt_controller::ControllerConfig;
use rt_controller::admit::admission::admit;
use rt_controller::fuzzing::dry_run;
use shm_types::SCHEMA;
use shm_types::command::{COMMAND_IMPORT, Command};
use skillet_fuzz::{field, patched, split, springs, wam};

/// A longer dry run costs more than it tells.
const LONGEST_S: f64 = 0.15;

static ARM: LazyLock<ArmModel> = LazyLock::new(wam);

fuzz_target!(|data: &[u8]| {
    let (mode, changes) = split(data);
    let policy = if mode & 2 == 0 { springs() } else { field() };
    let base = Command { policy, ..Command::new(COMMAND_IMPORT, 1) };
    let mut command = patched(&base, changes);
    if mode & 1 == 0 {
        command.schema = SCHEMA;
        command.policy = command.policy.sealed();
    }
    if command.validate().is_err() || command.kind != COMMAND_IMPORT {
        return;
    }
    let config = ControllerConfig { approach_s: 0.01, settle_s: 0.6, ..Default::default() };
    if let Ok(policy) = admit(&command.policy, &ARM, &config)
        && policy.duration_s <= LONGEST_S
    {
        let _ = dry_run(&policy, &ARM, &WAM7_START_POSTURE, &config);
    }
});
