//! The table `[plant]`: what turns torques into measurements, the arm, its pan and the pancake.

use std::collections::BTreeMap;
use std::path::PathBuf;

use anyhow::{Result, bail};
use nalgebra::{Isometry3, Translation3, UnitQuaternion, Vector3};
use physics::arm::urdf::Payload;
use physics::arm::{ArmSettings, JointVector};
use physics::pancake::{PancakeConfig, WAM7_START_POSTURE};
use physics::plant::Dynamics;
use schemars::JsonSchema;
use search::range::{ABOVE_ZERO, ANY, Limits, Range, inside, range, within};
use serde::{Deserialize, Serialize};

/// Unit of what is held: a joint turns or slides.
const HELD: &str = "rad or m";

/// The simulated arm, pan and pancake, or an external plant in their place.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct PlantConfig {
    /// What moves the arm: the simulation, or an external plant; see docs/plant.md.
    pub kind: PlantKind,
    /// Program and arguments of an external plant that `skillet learn` starts. Default: it waits for a plant.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub program: Vec<String>,
    /// Socket for an external plant. Default: `plant.sock` in the folder of the cell.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schemars(extend("format" = "path"))]
    pub socket: Option<PathBuf>,
    /// Simulation of the arm; see docs/simulation.md.
    pub dynamics: DynamicsKind,
    /// Measures that only an external plant can take: names with their units, such as
    /// `contact_force_n = "N"`. They are added to the task's measures. Default: none.
    #[serde(skip_serializing_if = "BTreeMap::is_empty")]
    pub measures: BTreeMap<String, String>,
    /// URDF of the arm. Default: the task's own, a WAM.
    #[schemars(extend("format" = "path"))]
    pub arm: Option<PathBuf>,
    /// Link whose frame is the pan: origin on its surface, z its normal. With `pan`, any link that
    /// is to carry one.
    pub tip: String,
    /// Link at which the arm begins: moving joints before it are held. Default: the root.
    pub base: Option<String>,
    /// Joint angles where rollouts start; the pan must be level there.
    pub start_posture_rad: Vec<f64>,
    /// Mass of the pancake.
    pub pancake_mass_kg: f64,
    /// Radius of the pancake.
    pub pancake_radius_m: f64,
    /// Start of the pancake relative to the centre of the pan.
    pub pancake_offset_m: [f64; 2],
    /// Friction coefficient between pan and pancake.
    pub friction: f64,
    /// Restitution coefficient between pan and pancake.
    pub restitution: f64,
    /// Natural frequency of the contacts: higher is harder.
    pub contact_frequency_hz: f64,
    /// Damping ratio of the contacts.
    pub contact_damping_ratio: f64,
    /// Sub-steps of the world per period. Default: as `dynamics` needs.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub solver_iterations: Option<usize>,
    /// Torque limits, one per joint, that replace those of the URDF unless empty.
    pub torque_limits_nm: Vec<f64>,
    /// Speed limits, one per joint, that replace those of the URDF unless empty.
    pub speed_limits_rad_s: Vec<f64>,
    /// A pan fixed to the tip link, for a URDF without one. Default: none.
    pub pan: Option<PanConfig>,
    /// Positions of held joints by name. Other joints outside the arm are held at 0.
    pub held: BTreeMap<String, f64>,
}

#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum PlantKind {
    /// By the controller
    #[default]
    Simulated,
    /// By another process that connects to the controller
    External,
}

#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum DynamicsKind {
    /// Rapier simulates the arm and everything it touches.
    #[default]
    Multibody,
    /// Second-order equations of motion for the arm, and Rapier only for what it touches.
    Split,
}

/// A frying pan, a disc, on the tip link.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct PanConfig {
    /// Mass of the pan.
    pub mass_kg: f64,
    /// Centre of its surface in the link.
    pub xyz_m: [f64; 3],
    /// Its rotation in the link, roll, pitch and yaw as in a URDF.
    pub rpy_rad: [f64; 3],
}

impl Default for PlantConfig {
    fn default() -> Self {
        let world = PancakeConfig::default();
        PlantConfig {
            kind: PlantKind::default(),
            program: Vec::new(),
            socket: None,
            measures: BTreeMap::new(),
            dynamics: DynamicsKind::default(),
            arm: None,
            tip: "pan".into(),
            base: None,
            start_posture_rad: WAM7_START_POSTURE.iter().copied().collect(),
            pancake_mass_kg: world.pancake_mass,
            pancake_radius_m: world.pancake_radius,
            pancake_offset_m: world.pancake_offset,
            friction: world.friction,
            restitution: world.restitution,
            contact_frequency_hz: world.contact_frequency_hz,
            contact_damping_ratio: world.contact_damping_ratio,
            solver_iterations: None,
            torque_limits_nm: Vec::new(),
            speed_limits_rad_s: Vec::new(),
            pan: None,
            held: BTreeMap::new(),
        }
    }
}

impl PlantConfig {
    pub fn world(&self, period_s: f64) -> PancakeConfig {
        PancakeConfig {
            dynamics: self.dynamics(),
            period_s,
            pancake_mass: self.pancake_mass_kg,
            pancake_radius: self.pancake_radius_m,
            pancake_offset: self.pancake_offset_m,
            friction: self.friction,
            restitution: self.restitution,
            contact_frequency_hz: self.contact_frequency_hz,
            contact_damping_ratio: self.contact_damping_ratio,
            solver_iterations: self.solver_iterations.unwrap_or(self.dynamics().substeps()),
            ..PancakeConfig::default()
        }
    }

    pub fn is_external(&self) -> bool {
        self.kind == PlantKind::External
    }

    pub fn dynamics(&self) -> Dynamics {
        match self.dynamics {
            DynamicsKind::Multibody => Dynamics::Multibody,
            DynamicsKind::Split => Dynamics::Split,
        }
    }

    /// Settings of the arm in addition to its URDF.
    pub fn arm_settings(&self) -> ArmSettings {
        ArmSettings {
            base: self.base.clone(),
            held: self.held.clone(),
            torque_limits: self.torque_limits_nm.clone(),
            speed_limits: self.speed_limits_rad_s.clone(),
            payload: self.pan.as_ref().map(PanConfig::payload),
        }
    }

    pub fn start_posture(&self) -> JointVector {
        let mut q = JointVector::zeros();
        for (q, value) in q.iter_mut().zip(&self.start_posture_rad) {
            *q = *value;
        }
        q
    }

    /// Every setting with its range, as fields of the table `plant`.
    pub fn ranges(&self) -> Vec<Range> {
        let entries = |name: &'static str, values: &[f64], limits, unit| -> Vec<Range> {
            let entry =
                |(i, value): (usize, &f64)| within(&format!("{name}[{i}]"), *value, limits, unit);
            values.iter().enumerate().map(entry).collect()
        };
        let (posture, offset) = (&self.start_posture_rad, &self.pancake_offset_m);
        let substeps = self.solver_iterations.unwrap_or(1) as f64;
        let held = self.held.iter().map(|(name, q)| within(&format!("held.{name}"), *q, ANY, HELD));
        let pan = self.pan.iter().flat_map(PanConfig::ranges);
        [
            entries("start_posture_rad", posture, ANY, "rad"),
            vec![
                range("pancake_mass_kg", self.pancake_mass_kg, 1e-3, 2.0, "kg"),
                range("pancake_radius_m", self.pancake_radius_m, 0.02, 0.125, "m"),
            ],
            entries("pancake_offset_m", offset, Limits { min: -0.1, max: 0.1 }, "m"),
            vec![
                range("friction", self.friction, 0.0, 2.0, "1"),
                range("restitution", self.restitution, 0.0, 1.0, "1"),
                range("contact_frequency_hz", self.contact_frequency_hz, 5.0, 500.0, "Hz"),
                range("contact_damping_ratio", self.contact_damping_ratio, 0.1, 20.0, "1"),
                range("solver_iterations", substeps, 1.0, 64.0, "1"),
            ],
            entries("torque_limits_nm", &self.torque_limits_nm, ABOVE_ZERO, "N·m"),
            entries("speed_limits_rad_s", &self.speed_limits_rad_s, ABOVE_ZERO, "rad/s"),
            inside("pan.", pan),
            held.collect(),
        ]
        .concat()
    }

    pub(super) fn validate(&self) -> Result<()> {
        if !self.is_external() && !self.program.is_empty() {
            bail!("plant.program is given, but plant.kind is simulated: set it to external");
        }
        if !self.is_external() && !self.measures.is_empty() {
            bail!("plant.measures are those of an external plant: set plant.kind to external");
        }
        let posture = &self.start_posture_rad;
        if posture.is_empty() || posture.len() > physics::arm::MAX_JOINTS {
            bail!(
                "plant.start_posture_rad has {} numbers: give one per joint of the arm, 1 to {}",
                posture.len(),
                physics::arm::MAX_JOINTS
            );
        }
        Ok(())
    }
}

impl PanConfig {
    /// The pan's frame in the tip link.
    pub fn pose(&self) -> Isometry3<f64> {
        let [roll, pitch, yaw] = self.rpy_rad;
        let rotation = UnitQuaternion::from_euler_angles(roll, pitch, yaw);
        Isometry3::from_parts(Translation3::from(Vector3::from(self.xyz_m)), rotation)
    }

    fn payload(&self) -> Payload {
        PancakeConfig::default().pan(self.mass_kg, &self.pose())
    }

    fn ranges(&self) -> Vec<Range> {
        let [x, y, z] = self.xyz_m;
        let [roll, pitch, yaw] = self.rpy_rad;
        let place = |i: usize, value| range(&format!("xyz_m[{i}]"), value, -2.0, 2.0, "m");
        let turn = |i: usize, value| range(&format!("rpy_rad[{i}]"), value, -7.0, 7.0, "rad");
        vec![
            range("mass_kg", self.mass_kg, 0.01, 20.0, "kg"),
            place(0, x),
            place(1, y),
            place(2, z),
            turn(0, roll),
            turn(1, pitch),
            turn(2, yaw),
        ]
    }
}
