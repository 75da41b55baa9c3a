//! The simulated world: Rapier in f64, with the arm as a reduced-coordinate multibody.

mod arm;
pub mod convert;
mod plant;
mod world;

pub use arm::RapierArm;
pub use plant::{Scene, ScenePlant};
/// Name and version of the engine.
pub fn engine() -> String {
    format!("Rapier {}", rapier3d::VERSION)
}

pub use world::{ContactSoftness, new_world};
