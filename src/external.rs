//! Plants in another process: what the configuration expects of one, and the program it may name.

use std::ffi::OsString;
use std::path::PathBuf;

use anyhow::{Result, bail};
use physics::arm::ArmModel;
use rt_controller::Pace;
use rt_controller::remote::expected::Expected;
use rt_controller::run::External;
use sha2::{Digest, Sha256};
use shm_types::cell::Cell;
use shm_types::plant::socket;

use crate::config::Config;
use crate::setup;

/// Where a plant of this cell comes to.
pub fn socket_of(config: &Config, cell: &Cell) -> PathBuf {
    config.plant.socket.clone().unwrap_or_else(|| socket::path(cell))
}

/// The door of a controller at `pace`, and what it lets in.
pub fn of(config: &Config, cell: &Cell, model: &ArmModel, pace: Pace) -> Result<External> {
    let socket = socket_of(config, cell);
    Ok(External { socket, expected: expected(config, model, pace != Pace::Plant)? })
}

/// What a plant must be; in lockstep when it is simulated.
pub fn expected(config: &Config, model: &ArmModel, is_simulated: bool) -> Result<Expected> {
    let digest = Sha256::digest(setup::arm_text(config)?);
    Ok(Expected {
        urdf_sha256: digest.into(),
        needs_object: !(config.task()?.arm()?.solids)(config).object.1.is_empty(),
        ..Expected::of(model, config.controller.period_ns(), is_simulated)
    })
}

/// Program and arguments of `command`, words apart by spaces.
pub fn words(command: &str) -> Result<Vec<String>> {
    let words: Vec<String> = command.split_whitespace().map(str::to_string).collect();
    if words.is_empty() {
        bail!("the plant's program is empty: name one, as \"python3 examples/plant_mujoco.py\"");
    }
    Ok(words)
}

/// What a plant that is started here finds its controller by.
pub fn environment(socket: &std::path::Path, cell: &Cell) -> [(&'static str, OsString); 2] {
    [(socket::PLANT_VARIABLE, socket.into()), ("SKILLET_CELL", cell.name().into())]
}
