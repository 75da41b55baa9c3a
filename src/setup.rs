//! From configuration to the parts of a cell: arm, demonstration, and whether they fit.

use std::path::Path;

use anyhow::{Context, Result, bail};
use learner::Demonstration;
use learner::encoding::FitError;
use nalgebra::Vector3;
use physics::arm::urdf::{self, LoadedArm};
use physics::arm::{ArmModel, JointVector, inverse_kinematics, kinematics};
use physics::rapier::engine;
use rt_controller::admit::admission::records_needed;
use rustix::process::Signal;
use sha2::{Digest, Sha256};
use shm_types::episode::MAX_RECORDS;
use shm_types::equipment::Equipment;
use shm_types::text;

use crate::config::Config;
use crate::demo::Effort;
use crate::holding;

/// Farthest the demonstration may begin from the pan's start, m and rad.
const START_TOLERANCE_M: f64 = 0.02;
const START_TOLERANCE_RAD: f64 = 0.05;
/// Rotation vectors jump at π; policies keep well away from it.
pub const MAX_TURN_RAD: f64 = 1.5;
/// Every so many points of a demonstration are checked for reach.
const REACH_STRIDE: usize = 5;

/// The arm as its URDF and the configuration describe it, and what was assumed.
pub fn load_arm(config: &Config) -> Result<LoadedArm> {
    let (tip, settings) = (&config.plant.tip, config.plant.arm_settings());
    let loaded = ArmModel::load(&arm_text(config)?, tip, &settings);
    let name = config.plant.arm.as_ref().map(|path| path.display().to_string());
    loaded.with_context(|| name.unwrap_or_else(|| "built-in WAM".into()))
}

/// What was assumed about the arm, each with its file, for a person to read.
pub fn arm_notes(config: &Config) -> Result<Vec<String>> {
    let Some(path) = config.plant.arm.as_ref().filter(|_| config.has_arm()) else {
        return Ok(Vec::new());
    };
    let notes = load_arm(config)?.notes;
    Ok(notes.iter().map(|note| format!("{}: {note}", path.display())).collect())
}

/// The arm, in whose start posture the tip is level.
pub fn arm(config: &Config) -> Result<ArmModel> {
    let model = load_arm(config)?.model;
    let given = config.plant.start_posture_rad.len();
    if given != model.n_joints() {
        bail!(
            "plant.start_posture_rad has {given} numbers, but the arm has {} joints: give one each; \
             `skillet arm check` finds a posture",
            model.n_joints()
        );
    }
    let (q0, limits) = (config.plant.start_posture(), model.limits());
    for (i, name) in model.joint_names().iter().enumerate() {
        if !(limits.q_min[i]..=limits.q_max[i]).contains(&q0[i]) {
            bail!(
                "plant.start_posture_rad[{i}] is {}: joint {name} moves within {}..={} rad",
                q0[i],
                limits.q_min[i],
                limits.q_max[i]
            );
        }
    }
    let tilt = (kinematics::tip_pose(&model, &q0).rotation * Vector3::z()).angle(&Vector3::z());
    if tilt > START_TOLERANCE_RAD {
        bail!(
            "plant.start_posture_rad tilts link '{}' by {tilt:.3} rad: choose a posture in which it is \
             level, or what lies on it slides off before the first rollout; `skillet arm check` finds \
             one",
            config.plant.tip
        );
    }
    let turn = kinematics::tip_pose(&model, &q0).rotation.angle();
    if turn > MAX_TURN_RAD && config.learner.orientation.is_vector() {
        bail!(
            "plant.start_posture_rad turns link '{}' by {turn:.2} rad from the world's axes; task \
             rotations are rotation vectors and must stay below {MAX_TURN_RAD} rad: turn the link \
             in the URDF, or plant.pan on it, or set learner.orientation = \"sphere\"",
            config.plant.tip
        );
    }
    Ok(model)
}

/// The URDF of the arm.
pub fn arm_text(config: &Config) -> Result<String> {
    match &config.plant.arm {
        Some(path) => Ok(urdf::read_file(path)?),
        None => Ok(config.task()?.arm()?.urdf.to_string()),
    }
}

/// What a controller of this configuration drives, and what the cells of such a session must drive. A plant in another
/// process tells its own name when it comes.
pub fn equipment(config: &Config) -> Result<Equipment> {
    let plant = match config.has_arm() {
        true if config.plant.is_external() => String::new(),
        true => format!("built-in ({})", engine()),
        false => "built-in".to_string(),
    };
    let (task, plant) = (text::pack(&config.task.name), text::pack(&plant));
    let equipment = Equipment { task, plant, ..Equipment::UNKNOWN };
    if !config.has_arm() {
        return Ok(equipment);
    }
    let urdf = arm_text(config)?;
    let arm = text::pack(&urdf::robot_name(&urdf).unwrap_or_default());
    Ok(Equipment { arm, urdf_sha256: Sha256::digest(&urdf).into(), ..equipment })
}

pub fn text_of(given: Option<&Path>, built_in: &str) -> Result<String> {
    match given {
        Some(path) => std::fs::read_to_string(path)
            .with_context(|| format!("{}: cannot read; check the path", path.display())),
        None => Ok(built_in.to_string()),
    }
}

/// Everything that can be checked before a process starts: arm, demonstrations and their fit. A
/// task without an arm has neither.
pub fn check(config: &Config) -> Result<Vec<Demonstration>> {
    if !config.has_arm() {
        return Ok(Vec::new());
    }
    let model = arm(config)?;
    holding::check_start(config, &model)?;
    let demonstrations = demonstrations(config)?;
    let first = &demonstrations[0];
    for demonstration in &demonstrations {
        check_demonstration(config, &model, demonstration)?;
        check_as_long(demonstration, first)?;
    }
    Ok(demonstrations)
}

/// Which demonstrations are too fast for the arm, and what to do. Not an error: it follows from one of the ways in
/// which the joints may move, and the loop ends a rollout in which a joint goes far beyond its limits.
pub fn too_fast(config: &Config, demonstrations: &[Demonstration]) -> Result<Vec<String>> {
    let model = arm(config)?;
    let speed = |one: &Demonstration| check_speed(config, &model, one).err();
    Ok(demonstrations.iter().filter_map(speed).map(|error| format!("{error:#}")).collect())
}

/// That a demonstration is as long as the first one of its session.
pub fn check_as_long(demonstration: &Demonstration, first: &Demonstration) -> Result<()> {
    let (found, expected) = (demonstration.duration_s(), first.duration_s());
    if (found - expected).abs() > 1e-6 {
        bail!(
            "{}: lasts {found:.2} s, {} {expected:.2} s: make them equally long, the policies \
             share their clock",
            demonstration.file(),
            first.file()
        );
    }
    Ok(())
}

/// [`check_demonstration`], and that no joint has to be faster or stronger than it is.
pub fn check_followed(
    config: &Config,
    model: &ArmModel,
    demonstration: &Demonstration,
) -> Result<()> {
    check_demonstration(config, model, demonstration)?;
    check_speed(config, model, demonstration)
}

/// That the arm can follow it from the start posture, and that a rollout of it fits into an episode.
pub fn check_demonstration(
    config: &Config,
    model: &ArmModel,
    demonstration: &Demonstration,
) -> Result<()> {
    check_duration(config, demonstration)?;
    check_orientation(config, demonstration)?;
    check_reach(model, &config.plant.start_posture(), demonstration)
}

/// The demonstration the session starts from, then the other ones.
pub fn demonstrations(config: &Config) -> Result<Vec<Demonstration>> {
    let mut all = vec![match &config.task.demonstration {
        Some(path) => read_demonstration(path)?,
        None => built_in_demonstration(config)?,
    }];
    for path in &config.task.other_demonstrations {
        all.push(read_demonstration(path)?);
    }
    Ok(all)
}

/// The demonstrations as far as they can be read: for pictures.
pub fn demonstrations_of(config: &Config) -> Vec<Demonstration> {
    if config.has_arm() { demonstrations(config).unwrap_or_default() } else { Vec::new() }
}

/// The one that the task brings along.
pub fn built_in_demonstration(config: &Config) -> Result<Demonstration> {
    let text = config.task()?.arm()?.demonstration;
    Ok(Demonstration::parse("built-in demonstration", text)?)
}

pub fn read_demonstration(path: &Path) -> Result<Demonstration> {
    let name = path.display().to_string();
    let text = std::fs::read_to_string(path)
        .with_context(|| format!("{name}: cannot read the demonstration"))?;
    Ok(Demonstration::parse(&name, &text)?)
}

/// A rollout of the demonstration's length fits into an episode.
fn check_duration(config: &Config, demonstration: &Demonstration) -> Result<()> {
    let duration = demonstration.duration_s();
    if records_needed(duration, &config.controller) > MAX_RECORDS {
        bail!(
            "{}: lasts {duration:.2} s, and at most {:.2} s fit into an episode of {MAX_RECORDS} ticks beside \
             controller.settle_s = {}: cut it (`skillet demo convert --start --end`), or lower settle_s",
            demonstration.file(),
            longest_s(config),
            config.controller.settle_s
        );
    }
    Ok(())
}

/// The longest demonstration of which a rollout fits into an episode, s.
fn longest_s(config: &Config) -> f64 {
    let controller = &config.controller;
    let records_s = controller.period_s() * controller.record_stride() as f64;
    // Two more than its duration needs.
    (MAX_RECORDS - 2) as f64 * records_s - controller.settle_s
}

/// That no joint has to be faster or stronger than it is.
fn check_speed(config: &Config, model: &ArmModel, demonstration: &Demonstration) -> Result<()> {
    let effort = Effort::of(model, &config.plant.start_posture(), demonstration)?;
    if effort.is_within_limits() {
        return Ok(());
    }
    let (duration_s, slow) = (demonstration.duration_s(), effort.slower());
    // Samples of a slower movement show more of it: only the recording tells what is enough.
    let remedy = too_long(config, duration_s, slow).unwrap_or_else(|| {
        format!(
            "convert its recording again, about {slow} times slower, with `skillet demo convert --slow`, which \
             says how much is enough"
        )
    });
    Err(effort.excess(demonstration.file(), &remedy))
}

/// What to do where a demonstration of `duration_s`, so many times slower, does not fit into an episode.
pub fn too_long(config: &Config, duration_s: f64, slow: f64) -> Option<String> {
    let (slowed, longest) = (slow * duration_s, longest_s(config));
    (slowed > longest).then(|| {
        format!(
            "{slow} times slower it would last {slowed:.3} s, and {longest:.3} s fit into an episode: use one that \
             was made for a similar arm, or another start posture (`skillet arm check --seed 2`)"
        )
    })
}

/// Quaternions may turn any way; what sees rotation vectors is given those.
fn check_orientation(config: &Config, demonstration: &Demonstration) -> Result<()> {
    if config.learner.orientation.is_vector() && !demonstration.orientation().is_vector() {
        bail!(FitError::Quaternions { file: demonstration.file().into() });
    }
    Ok(())
}

/// Follows the demonstration with the arm, posture by posture, from the start posture.
fn check_reach(model: &ArmModel, q0: &JointVector, demonstration: &Demonstration) -> Result<()> {
    let file = demonstration.file();
    let start = kinematics::tip_pose(model, q0);
    let mut q = *q0;
    for (i, (pose, target)) in demonstration.poses().iter().zip(demonstration.path()).enumerate() {
        if i == 0 {
            let gap = (target.translation.vector - start.translation.vector).norm();
            let turn = target.rotation.angle_to(&start.rotation);
            if gap > START_TOLERANCE_M || turn > START_TOLERANCE_RAD {
                bail!(
                    "{file}: begins {gap:.3} m and {turn:.3} rad from the tip in the start posture \
                     ({:.3}, {:.3}, {:.3}) m: begin there (`skillet demo convert --at-start` moves it), or \
                     change plant.start_posture_rad",
                    start.translation.x,
                    start.translation.y,
                    start.translation.z
                );
            }
        }
        if i % REACH_STRIDE != 0 {
            continue;
        }
        q = inverse_kinematics::solve(model, &target, &q).with_context(|| {
            let t = i as f64 * demonstration.period_s();
            format!(
                "{file}: the tip cannot reach ({:.3}, {:.3}, {:.3}) m at t = {t:.2} s; move the \
                 demonstration into the reach of the arm",
                pose[0], pose[1], pose[2]
            )
        })?;
        holding::check(model, &q).with_context(|| {
            format!("{file}: cannot be held at t = {:.2} s", i as f64 * demonstration.period_s())
        })?;
    }
    Ok(())
}

/// Asks the kernel to end this process when its parent, of process id `parent`, ends.
pub fn end_with_parent(parent: u32) -> Result<()> {
    follow_parent(parent, Signal::TERM)
}

/// The same without a chance to do anything about it; it holds for the program that takes its place, too.
pub fn die_with_parent(parent: u32) -> Result<()> {
    follow_parent(parent, Signal::KILL)
}

fn follow_parent(parent: u32, signal: Signal) -> Result<()> {
    rustix::process::set_parent_process_death_signal(Some(signal))
        .context("asking to end with the parent process")?;
    // It may have ended before the kernel was asked.
    if std::os::unix::process::parent_id() != parent {
        bail!("the process {parent} that started this one has ended");
    }
    Ok(())
}
