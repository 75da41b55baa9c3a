//! Whether an arm can be used: its chain, a pan on its tip, a start posture, and the configuration
//! that says all of it.

// Monogram notation.
#![allow(non_snake_case)]

mod configuration;
mod mounting;
pub mod report;

use anyhow::Result;
use learner::Demonstration;
use nalgebra::Isometry3;
use physics::arm::start_posture::{self, Attitude, StartPosture};
use physics::arm::urdf::{self, ChainCandidate, LoadedArm, UrdfError};
use physics::arm::{ArmModel, kinematics};

use crate::cli::arm::CheckArgs;
use crate::config::Config;
use crate::config::plant::PanConfig;
use crate::demo::{self, AS_IT_IS, Options};
use crate::robots;
use crate::setup::{self, MAX_TURN_RAD};
use mounting::{Mounting, mountings};

/// Pans that are tried, kg, the heaviest first.
const PAN_MASSES: [f64; 4] = [0.5, 0.3, 0.15, 0.05];
/// What a mounting is worth from whose postures no demonstration can be followed.
const MISFIT_BONUS: f64 = 0.2;
/// Share of a torque limit that holding may take; a heavier pan than that is not suggested.
const COMFORT: f64 = 0.6;
/// Room around the start that a workspace leaves, m.
const ROOM_M: f64 = 0.6;
/// Postures that each demonstration is tried from.
const TRIED: usize = 30;

const NOT_LEVEL: &str = "no posture within the joints' limits brings the pan level";

/// A usable arm.
pub struct Checked {
    pub config: Config,
    pub arm: LoadedArm,
    pub posture: StartPosture,
    /// Why the built-in demonstration, begun at the start posture, does not fit the arm.
    pub misfit: Option<String>,
    /// A demonstration that comes with the tool and fits, moved to the start.
    pub demonstration: Option<Fitting>,
    pub candidates: Vec<ChainCandidate>,
}

/// A demonstration that the arm can follow.
pub struct Fitting {
    /// Where `skillet demo convert` finds it.
    pub name: String,
    /// Lowest height of its tip, m.
    pub lowest_m: f64,
}

/// Why an arm is not usable.
pub enum Refusal {
    Urdf(UrdfError),
    /// No chain of revolute joints at all.
    NoChain,
    /// No level posture, or none that the motors can hold.
    NoPosture(String),
    Other(anyhow::Error),
}

impl From<UrdfError> for Refusal {
    fn from(error: UrdfError) -> Self {
        Refusal::Urdf(error)
    }
}

impl From<anyhow::Error> for Refusal {
    fn from(error: anyhow::Error) -> Self {
        Refusal::Other(error)
    }
}

pub fn run(text: &str, args: &CheckArgs) -> Result<Checked, Refusal> {
    let candidates = urdf::chains(text)?;
    let mut config = Config::default();
    let plant = &mut config.plant;
    plant.arm = Some(args.urdf.clone());
    plant.held = args.hold.iter().cloned().collect();
    plant.base = args.base.clone();
    plant.tip = match &args.tip {
        Some(tip) => tip.clone(),
        None if urdf::has_link(text, "pan") => "pan".into(),
        None => {
            let chosen = candidates.first().ok_or(Refusal::NoChain)?;
            plant.base = plant.base.take().or(chosen.base.clone());
            chosen.tip.clone()
        }
    };
    let is_pan = args.no_pan || plant.tip == "pan";
    let found = if is_pan { as_it_is(text, config, args)? } else { with_pan(text, config, args)? };
    let (mut config, arm, posture) = found;
    fit_workspace(&mut config, &arm.model, &posture);
    config.validate()?;
    let built_in = setup::built_in_demonstration(&config)?;
    let misfit = misfit(&config, &arm.model, &posture, &built_in).err();
    let misfit = misfit.map(|error| format!("{error:#}"));
    let demonstration = fitting(&config, &arm.model);
    Ok(Checked { config, arm, posture, misfit, demonstration, candidates })
}

/// The first demonstration that comes with the tool and that the arm can follow from its start.
fn fitting(config: &Config, model: &ArmModel) -> Option<Fitting> {
    let options = Options {
        at_start: Some(kinematics::tip_pose(model, &config.plant.start_posture())),
        ..AS_IT_IS
    };
    let fits = |name: String, text: &str| -> Result<Fitting> {
        let moved = demo::import(&name, text.as_bytes(), model, &options)?;
        let demonstration = Demonstration::parse(&name, &moved.csv())?;
        setup::check_followed(config, model, &demonstration)?;
        let heights = demonstration.poses().iter().map(|pose| pose[2]);
        Ok(Fitting { name, lowest_m: heights.fold(f64::INFINITY, f64::min) })
    };
    robots::demonstrations().find_map(|(name, text)| fits(name, text).ok())
}

type Found = (Config, LoadedArm, StartPosture);

/// The tip link is the pan.
fn as_it_is(text: &str, mut config: Config, args: &CheckArgs) -> Result<Found, Refusal> {
    let arm = ArmModel::load(text, &config.plant.tip, &config.plant.arm_settings())?;
    let aligned = start_posture::find(&arm.model, Attitude::Aligned, args.seed);
    let level = || {
        let mut level = start_posture::find(&arm.model, Attitude::Level, args.seed);
        level.retain(|posture| posture.X_WP.rotation.angle() < MAX_TURN_RAD);
        level
    };
    let postures = if aligned.is_empty() { level() } else { aligned };
    let fits = |posture: &StartPosture, demonstration: &Demonstration| {
        misfit(&config, &arm.model, posture, demonstration).is_ok()
    };
    let (posture, _) = best(&arm.model, &postures, fits).map_err(Refusal::NoPosture)?;
    config.plant.start_posture_rad = rounded(&posture, arm.model.n_joints());
    Ok((config, arm, posture))
}

/// A pan is put on the tip link: where it can be level best, as heavy as the motors hold easily.
fn with_pan(text: &str, config: Config, args: &CheckArgs) -> Result<Found, Refusal> {
    let masses = args.pan_kg.map_or(PAN_MASSES.to_vec(), |mass| vec![mass]);
    let (mut found, mut best_worth): (Option<Found>, f64) = (None, -1.0);
    let mut reason = String::new();
    for mass_kg in masses {
        // The bare tip need not have an inertia of its own; with a pan it has.
        let mut bare = config.clone();
        bare.plant.pan = Some(pan(mass_kg, &Isometry3::identity()));
        let model = ArmModel::load(text, &bare.plant.tip, &bare.plant.arm_settings())?.model;
        for mounting in mountings(&model) {
            match mounted(text, &config, mass_kg, &mounting, args) {
                Ok((new, worth)) if worth > best_worth => (found, best_worth) = (Some(new), worth),
                Ok(_) => {}
                // What a motor lacks says more than that another way does not work at all.
                Err(Refusal::NoPosture(why)) if reason.is_empty() || reason == NOT_LEVEL => {
                    reason = why;
                }
                Err(Refusal::NoPosture(_)) => {}
                Err(other) => return Err(other),
            }
        }
        let share = |found: &Found| start_posture::largest_share(&found.1.model, &found.2.holding);
        if found.as_ref().is_some_and(|found| share(found) < COMFORT) {
            break;
        }
    }
    found.ok_or(Refusal::NoPosture(reason))
}

/// The best posture with the pan there, its frame turned to the world's axes, and its worth.
fn mounted(
    text: &str,
    config: &Config,
    mass_kg: f64,
    mounting: &Mounting,
    args: &CheckArgs,
) -> Result<(Found, f64), Refusal> {
    let mut config = config.clone();
    config.plant.pan = Some(pan(mass_kg, &mounting.X_TP));
    let load =
        |config: &Config| ArmModel::load(text, &config.plant.tip, &config.plant.arm_settings());
    let model = load(&config)?.model;
    let postures = start_posture::find(&model, Attitude::Level, args.seed);
    // About its normal a pan may be turned as one likes: its x axis points ahead at the start.
    let turned = |pose: Isometry3<f64>, posture: &StartPosture| {
        let rotation = pose.rotation * posture.X_WP.rotation.inverse();
        Isometry3::from_parts(pose.translation, rotation)
    };
    let fits = |posture: &StartPosture, demonstration: &Demonstration| {
        let ahead = model.with_tip_offset(&turned(model.tip_offset(), posture));
        misfit(&config, &ahead, posture, demonstration).is_ok()
    };
    let (mut posture, fits) = best(&model, &postures, fits).map_err(Refusal::NoPosture)?;
    let worth = posture.score * mounting.bonus * if fits { 1.0 } else { MISFIT_BONUS };
    let X_TP = turned(mounting.X_TP, &posture);
    config.plant.pan = Some(pan(mass_kg, &X_TP));
    config.plant.start_posture_rad = rounded(&posture, model.n_joints());
    let arm = load(&config)?;
    posture.X_WP.rotation = nalgebra::UnitQuaternion::identity();
    Ok(((config, arm, posture), worth))
}

/// The first of the postures that the motors hold and from which the built-in demonstration can be followed, or
/// another that comes with the tool; else the best that is held. And whether one can be followed.
fn best(
    model: &ArmModel,
    postures: &[StartPosture],
    fits: impl Fn(&StartPosture, &Demonstration) -> bool,
) -> Result<(StartPosture, bool), String> {
    let Some(first) = postures.first() else {
        return Err(NOT_LEVEL.into());
    };
    let held = |p: &&StartPosture| start_posture::largest_share(model, &p.holding) < 1.0;
    let mut all = postures.iter().filter(held).take(TRIED);
    for (name, text) in robots::demonstrations() {
        let demonstration = Demonstration::parse(&name, text).map_err(|error| error.to_string())?;
        if let Some(fitting) = all.clone().find(|posture| fits(posture, &demonstration)) {
            return Ok((*fitting, true));
        }
    }
    if let Some(best) = all.next() {
        return Ok((*best, false));
    }
    Err(format!("{:#}", crate::holding::check(model, &first.q).expect_err("it cannot be held")))
}

/// Follows a demonstration, begun at the pan of the posture, at its speed.
fn misfit(
    config: &Config,
    model: &ArmModel,
    posture: &StartPosture,
    demonstration: &Demonstration,
) -> Result<()> {
    let poses = demonstration.poses();
    let p = posture.X_WP.translation.vector;
    let from_start = [p.x - poses[0][0], p.y - poses[0][1], p.z - poses[0][2]];
    let mut csv = String::from("t_s,x_m,y_m,z_m,pitch_rad\n");
    for (i, pose) in poses.iter().enumerate() {
        let [x, y, z] = [0, 1, 2].map(|k| pose[k] + from_start[k]);
        let t = i as f64 * demonstration.period_s();
        csv += &format!("{t:.6},{x:.9},{y:.9},{z:.9},{:.9}\n", pose[3]);
    }
    let name = format!("{}, begun at the start posture", demonstration.file());
    let begun = Demonstration::parse(&name, &csv)?;
    let mut config = config.clone();
    config.plant.start_posture_rad = posture.q.as_slice()[..model.n_joints()].to_vec();
    setup::check_followed(&config, model, &begun)
}

/// Lets the pan move around the start of a large arm, or of one that hangs.
fn fit_workspace(config: &mut Config, model: &ArmModel, posture: &StartPosture) {
    let p = posture.X_WP.translation.vector;
    let far = (p - model.bodies()[0].p_AB).norm() + ROOM_M;
    let controller = &mut config.controller;
    controller.workspace_radius_m = controller.workspace_radius_m.max((10.0 * far).ceil() / 10.0);
    let low = ((p.z - ROOM_M) * 10.0).floor() / 10.0;
    controller.workspace_floor_m = controller.workspace_floor_m.min(low);
}

fn pan(mass_kg: f64, X_TP: &Isometry3<f64>) -> PanConfig {
    let (roll, pitch, yaw) = X_TP.rotation.euler_angles();
    let p = X_TP.translation.vector;
    PanConfig { mass_kg, xyz_m: [p.x, p.y, p.z].map(round), rpy_rad: [roll, pitch, yaw].map(round) }
}

fn rounded(posture: &StartPosture, n: usize) -> Vec<f64> {
    posture.q.as_slice()[..n].iter().map(|q| round(*q)).collect()
}

/// Six decimals; no minus zero.
fn round(x: f64) -> f64 {
    (x * 1e6).round() / 1e6 + 0.0
}
