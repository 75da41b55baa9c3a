//! The arm's rigid-body mathematics and the simulated worlds.
//!
//! Two layers that know nothing of each other's types: [`arm`] is the mathematics of a serial
//! revolute arm (URDF to immutable model, kinematics, inverse dynamics), free of heap allocation
//! and of any simulator; [`rapier`] is the simulated world, and [`split`] another way to move an arm in
//! it. [`pancake`] puts both together into a [`plant::Plant`], which is all a controller sees, and says
//! what happened to the pancake; a [`referee::Referee`] says when a rollout is over.
//!
//! ```
//! use physics::arm::{ArmModel, JointVector, dynamics};
//! use physics::pancake::{PancakeConfig, PancakePlant, WAM7_START_POSTURE};
//! use physics::plant::Plant;
//!
//! let model = ArmModel::from_urdf_file("../robots/wam7/wam7_pan.urdf", "pan")?;
//! let mut plant = PancakePlant::new(&model, &WAM7_START_POSTURE, &PancakeConfig::default());
//! for _ in 0..1000 {
//!     let state = plant.measure();
//!     let tau: JointVector = dynamics::gravity_torque(&model, &state.q) - state.qd;
//!     plant.apply(&tau);
//!     plant.advance();
//! }
//! # Ok::<(), physics::arm::UrdfFileError>(())
//! ```
//!
//! Names are monogram: `p_WP` is the position of P seen from W, `R_WP` and `X_WP` the rotation and
//! pose of P in W, `J_WP` the Jacobian of P's motion in W. W is the world (z up), F the flange, P
//! the pan (the model's tip), O the tracked object, B_i the frame of moving body i.

// Monogram notation is the field's own and needs its capitals.
#![allow(non_snake_case)]
#![forbid(unsafe_code)]

pub mod action;
pub mod arm;
pub mod bare;
pub mod cup;
pub mod ideal;
pub mod landscape;
pub mod niching;
pub mod pancake;
pub mod plant;
pub mod rapier;
pub mod referee;
pub mod skittles;
pub mod split;
