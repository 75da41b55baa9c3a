//! The table `[plant]`: what turns torques into measurements, the arm, its pan and the pancake.

use std::collections::BTreeMap;
use std::path::PathBuf;

use anyhow::{Result, bail};
use nalgebra::{Isometry3, Translation3, UnitQuaternion, Vector3};
use physics::arm::urdf::Payload;
use physics::arm::{ArmSettings, JointVector};
use physics::pancake::{PancakeConfig, WAM7_START_POSTURE};
use physics::plant::Dynamics;
use serde::{Deserialize, Serialize};

/// The simulated arm, pan and pancake, or an external plant in their place.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct PlantConfig {
    /// simulated: by the controller; external: your own process, a simulator or a robot's driver, connects to
    /// the controller; see docs/plant.md.
    pub kind: PlantKind,
    /// Program and arguments of an external plant that `skillet learn` starts; without it, it waits for a plant.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub program: Vec<String>,
    /// Socket for an external plant. Default: `plant.sock` in the folder of the cell.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub socket: Option<PathBuf>,
    /// multibody: Rapier simulates the arm and everything it touches; split: our own second-order equations of
    /// motion for the arm, and Rapier only for what it touches; see docs/simulation.md.
    pub dynamics: DynamicsKind,
    /// Measures that only an external plant can take: names with their units, such as
    /// `contact_force_n = "N"`. They are added to the task's measures.
    #[serde(skip_serializing_if = "BTreeMap::is_empty")]
    pub measures: BTreeMap<String, String>,
    /// URDF of the arm. Default: the built-in WAM.
    pub arm: Option<PathBuf>,
    /// Link whose frame is the pan: origin on its surface, z its normal. With `pan`, any link that
    /// is to carry one.
    pub tip: String,
    /// Link at which the arm begins: moving joints before it are held. Default: the root.
    pub base: Option<String>,
    /// Where rollouts start; the pan must be level there.
    pub start_posture_rad: Vec<f64>,
    pub pancake_mass_kg: f64,
    pub pancake_radius_m: f64,
    /// Start of the pancake relative to the centre of the pan.
    pub pancake_offset_m: [f64; 2],
    pub friction: f64,
    pub restitution: f64,
    pub contact_frequency_hz: f64,
    pub contact_damping_ratio: f64,
    /// Sub-steps of the world per period. Default: as `dynamics` needs.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub solver_iterations: Option<usize>,
    /// One per joint, replacing the effort and velocity limits of the URDF unless empty.
    pub torque_limits_nm: Vec<f64>,
    pub speed_limits_rad_s: Vec<f64>,
    /// A pan fixed to the tip link, for a URDF without one.
    pub pan: Option<PanConfig>,
    /// Positions of held joints, rad or m. Other joints outside the arm are held at 0.
    pub held: BTreeMap<String, f64>,
}

#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum PlantKind {
    /// By the controller
    #[default]
    Simulated,
    /// By another process that connects to the controller
    External,
}

#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum DynamicsKind {
    #[default]
    Multibody,
    Split,
}

/// A frying pan, a disc, on the tip link.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct PanConfig {
    pub mass_kg: f64,
    /// Where the centre of its surface is in the link, and how it is turned there, as in a URDF.
    pub xyz_m: [f64; 3],
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

    pub(super) fn validate(&self) -> Result<()> {
        for (field, value, min, max) in [
            ("pancake_mass_kg", self.pancake_mass_kg, 1e-3, 2.0),
            ("pancake_radius_m", self.pancake_radius_m, 0.02, 0.125),
            ("pancake_offset_m[0]", self.pancake_offset_m[0], -0.1, 0.1),
            ("pancake_offset_m[1]", self.pancake_offset_m[1], -0.1, 0.1),
            ("friction", self.friction, 0.0, 2.0),
            ("restitution", self.restitution, 0.0, 1.0),
            ("contact_frequency_hz", self.contact_frequency_hz, 5.0, 500.0),
            ("contact_damping_ratio", self.contact_damping_ratio, 0.1, 20.0),
            ("solver_iterations", self.solver_iterations.unwrap_or(1) as f64, 1.0, 64.0),
        ] {
            if !(min..=max).contains(&value) {
                bail!("plant.{field} is {value}: use a value within {min}..={max}");
            }
        }
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
        if let Some(bad) = posture.iter().find(|q| !q.is_finite()) {
            bail!("plant.start_posture_rad holds {bad}: give finite angles in rad");
        }
        self.pan.as_ref().map_or(Ok(()), PanConfig::validate)
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

    fn validate(&self) -> Result<()> {
        if !(0.01..=20.0).contains(&self.mass_kg) {
            bail!("plant.pan.mass_kg is {}: use a value within 0.01..=20", self.mass_kg);
        }
        for (field, values, max) in [("xyz_m", self.xyz_m, 2.0), ("rpy_rad", self.rpy_rad, 7.0)] {
            if let Some(bad) = values.iter().find(|value| !(-max..=max).contains(*value)) {
                bail!("plant.pan.{field} holds {bad}: use values within {}..={max}", -max);
            }
        }
        Ok(())
    }
}
