//! Plants in another process: what the configuration expects of one, and the program it may name.

use std::ffi::OsString;
use std::ops::{Deref, DerefMut};
use std::os::unix::fs::DirBuilderExt;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicU64, Ordering};
use std::time::{Duration, Instant};

use anyhow::{Context, Result, bail};
use physics::arm::ArmModel;
use rt_controller::remote::expected::{Expected, External};
use rt_controller::remote::plant::RemotePlant;
use rt_controller::{Pace, boot_id};
use sha2::{Digest, Sha256};
use shm_types::cell::Cell;
use shm_types::plant::socket;

use crate::children::{self, Service};
use crate::config::Config;
use crate::setup;

/// The variable with the table `[plant]` and `learner.seed`, as `seed`.
const SETTINGS: &str = "SKILLET_PLANT_SETTINGS";
/// How long a program may take until it has connected.
const TO_COME: Duration = Duration::from_secs(60);

/// Where a plant of this cell comes to.
pub fn socket_of(config: &Config, cell: &Cell) -> PathBuf {
    config.plant.socket.clone().unwrap_or_else(|| socket::path(cell))
}

/// The door of a controller at `pace`, and what it lets in.
pub fn of(config: &Config, cell: &Cell, model: &ArmModel, pace: Pace) -> Result<External> {
    let (socket, expected) =
        (socket_of(config, cell), expected(config, model, pace != Pace::Plant)?);
    Ok(External { socket, cell: Some(cell.clone()), expected })
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
    children::words(
        command,
        "the plant's program is empty: name one, such as \"python3 examples/plant_mujoco.py\"",
    )
}

/// What a plant that is started here is told: where its controller is, and the table `[plant]` with the session's seed, as JSON.
pub fn environment(config: &Config, socket: &Path) -> Result<[(&'static str, OsString); 2]> {
    let mut settings = serde_json::to_value(&config.plant).context("[plant] as JSON")?;
    // For a world that varies from rollout to rollout.
    settings["seed"] = config.learner.seed.into();
    Ok([(socket::PLANT_VARIABLE, socket.into()), (SETTINGS, settings.to_string().into())])
}

/// The program of a configuration's external plant, for a rollout at a time.
pub struct Started {
    plant: RemotePlant,
    program: Service,
    dir: PathBuf,
}

impl Started {
    pub fn new(config: &Config, model: &ArmModel) -> Result<Started> {
        static COUNT: AtomicU64 = AtomicU64::new(0);
        if config.plant.program.is_empty() {
            bail!(
                "plant.kind is external, and plant.program names no program to start: name the one \
                 that the session was learnt with"
            );
        }
        let number = COUNT.fetch_add(1, Ordering::Relaxed);
        let dir = std::env::temp_dir().join(format!("skillet-{}-{number}", std::process::id()));
        let failed = || format!("{}: cannot make a folder for the plant's socket", dir.display());
        std::fs::DirBuilder::new().mode(0o700).create(&dir).with_context(failed)?;
        let socket = dir.join("plant.sock");
        let expected = expected(config, model, true)?;
        let external = External { socket: socket.clone(), cell: None, expected };
        let plant = RemotePlant::open(external, &config.plant.start_posture(), boot_id())?;
        let (environment, log) = (environment(config, &socket)?, dir.join("plant.log"));
        let program = Service::start_program("plant", &config.plant.program, log, &environment)?;
        let mut started = Started { plant, program, dir };
        started.wait()?;
        Ok(started)
    }

    fn wait(&mut self) -> Result<()> {
        let start = Instant::now();
        while start.elapsed() < TO_COME {
            if self.plant.has_come(Duration::from_millis(50)) {
                return Ok(());
            }
            if let Some(status) = self.program.exited()? {
                bail!(self.program.obituary(status));
            }
        }
        bail!("the plant did not connect within {} s: run its program by hand", TO_COME.as_secs())
    }
}

impl Drop for Started {
    fn drop(&mut self) {
        // It is in the system's folder for what is temporary.
        let _ = std::fs::remove_dir_all(&self.dir);
    }
}

impl Deref for Started {
    type Target = RemotePlant;

    fn deref(&self) -> &RemotePlant {
        &self.plant
    }
}

impl DerefMut for Started {
    fn deref_mut(&mut self) -> &mut RemotePlant {
        &mut self.plant
    }
}
