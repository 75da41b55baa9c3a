//! `skillet plant`: plants in another process.

use std::sync::atomic::Ordering;

use anyhow::{Context, Result};
use physics::arm::JointVector;
use physics::plant::{Measurement, Plant as _};
use shm_types::cell::Cell;
use shm_types::service_manager::{Notice, notify};
use skillet_plant::{Answer, Description, Object, Plant, Sample};

use crate::Verdict;
use crate::cli::plant::{PlantArgs, PlantVerb, ServeArgs};
use crate::config::Config;
use crate::external::{self, expected};
use crate::plant_check;
use crate::signals::{Who, stop_flag};
use crate::stderr::say;
use crate::tasks::ArmWorld;

pub fn run(args: &PlantArgs) -> Result<Verdict> {
    match &args.verb {
        PlantVerb::Serve(args) => serve(args),
        PlantVerb::Check(args) => plant_check::run(args),
    }
}

/// The simulated world of the task, as another process has it.
fn serve(args: &ServeArgs) -> Result<Verdict> {
    let config = Config::load(args.config.as_deref())?;
    let arm = config.task()?.arm()?;
    let ArmWorld { model, q0, mut plant, .. } = (arm.world)(&config)?;
    let expected = expected(&config, &model, true)?;
    let names: Vec<&str> = expected.joint_names.iter().map(String::as_str).collect();
    let description = Description {
        name: "skillet plant serve",
        n_joints: model.n_joints(),
        has_object: expected.needs_object,
        is_deterministic: true,
        polls: args.poll,
        joint_names: &names,
        torque_limits: &expected.tau_max,
        urdf_sha256: Some(expected.urdf_sha256),
        q: q0.into(),
        ..Description::simulated(config.controller.period_s())
    };
    let stop = stop_flag(Who::Tool)?;
    let cell = Cell::new(args.cell.as_deref().unwrap_or(&config.cell.name))?;
    let socket = match std::env::var_os(shm_types::plant::socket::PLANT_VARIABLE) {
        Some(path) => path.into(),
        None => external::socket_of(&config, &cell),
    };
    let mut line = Plant::connect(&socket, &description).context("skillet plant serve")?;
    notify(&[Notice::Ready]);
    say("connected to the controller");
    while !stop.load(Ordering::Relaxed) {
        match line.exchange_unless(&sample(&plant.measure()), &stop)? {
            Answer::Torque(tau) => {
                plant.apply(&JointVector::from(tau));
                plant.advance();
            }
            Answer::Reset(_) => {
                plant.begin_reset();
                // The new world is at its start, a period later: the plant's time goes on.
                line.has_reset();
            }
            Answer::Hold => {}
            Answer::Stop => break,
        }
    }
    Ok(Verdict::Done)
}

fn sample(measured: &Measurement) -> Sample {
    let object = &measured.object;
    let [i, j, k, w] = object.R_WO.coords.into();
    let object = Object {
        position: object.p_WO.into(),
        quaternion: [w, i, j, k],
        in_contact: object.in_contact,
    };
    Sample {
        // A world that was made anew shows itself at the same time as the one before.
        t_ns: None,
        q: measured.q.into(),
        qd: measured.qd.into(),
        object: Some(object),
        ..Sample::default()
    }
}
