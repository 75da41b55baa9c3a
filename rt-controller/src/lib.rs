//! The hard loop: state in, torque out, once a millisecond.
//!
//! [`hot`] is what runs every period. Around it, the rt thread ([`executor`]) keeps the pace and owns the
//! plant, and the exchange thread (`exchange`) owns everything iceoryx2. The two share wait-free rings
//! only, so that no learner, observer or tool can delay a tick.
//!
//! ```
//! use physics::arm::ArmModel;
//! use physics::pancake::{PancakeConfig, PancakePlant, WAM7_START_POSTURE};
//! use physics::plant::Plant;
//! use physics::referee::{Referee, Toss, TossConfig};
//! use rt_controller::ControllerConfig;
//! use rt_controller::admit::admission::admit;
//! use rt_controller::hot::rollout::Phase;
//! use rt_controller::hot::tick::Controller;
//! use shm_types::episode::TickRecord;
//! use shm_types::policy::{PolicyMsg, packed_index};
//!
//! let urdf = std::fs::read_to_string("../robots/wam7/wam7_pan.urdf")?;
//! let model = ArmModel::from_urdf(&urdf, "pan")?;
//! let config = ControllerConfig::default();
//!
//! // One spring that pulls the pan to x, y, z (m) at a pitch (rad), for half a second.
//! let mut message = PolicyMsg { task_dim: 4, n_components: 1, ..PolicyMsg::EMPTY };
//! (message.duration_s, message.damping) = (0.5, 28.0);
//! (message.orientation_stiffness, message.orientation_damping) = (400.0, 40.0);
//! message.components[0].attractor[..4].copy_from_slice(&[0.78, 0.0, 0.72, 0.0]);
//! message.components[0].width = 0.5;
//! (0..4).for_each(|i| message.components[0].stiffness[packed_index(i, i)] = 200.0);
//! let policy = admit(&message.sealed(), &model, &config)?;
//!
//! let mut plant = PancakePlant::new(&model, &WAM7_START_POSTURE, &PancakeConfig::default());
//! let referee = Referee::Toss(Toss::new(&TossConfig::default()));
//! let mut controller = Controller::new(&model, &WAM7_START_POSTURE, &config, &referee);
//! controller.start(&policy);
//! let mut record = TickRecord::ZERO;
//! while controller.phase() != Phase::Idle {
//!     let torque = controller.tick(&plant.measure(), &mut record);
//!     plant.apply(&torque);
//!     plant.advance();
//! }
//! assert_eq!(record.fault, 0);
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

#![allow(non_snake_case)] // monogram notation: J_WP, X_WP

#[cfg(feature = "loop")]
pub mod admit;
#[cfg(feature = "loop")]
pub mod config;
#[cfg(feature = "loop")]
pub mod disk;
#[cfg(feature = "loop")]
mod exchange;
#[cfg(feature = "loop")]
pub mod executor;
#[cfg(feature = "loop")]
pub mod fault;
#[cfg(all(fuzzing, feature = "loop"))]
pub mod fuzzing;
pub mod hot;
#[cfg(feature = "loop")]
pub mod remote;
#[cfg(feature = "loop")]
mod rings;
#[cfg(feature = "loop")]
pub mod rt;
#[cfg(feature = "loop")]
pub mod run;
#[cfg(feature = "loop")]
mod serve;
#[cfg(feature = "loop")]
pub mod simulate;
#[cfg(feature = "loop")]
mod summary;

#[cfg(feature = "loop")]
pub use config::{ControllerConfig, Pace};
#[cfg(feature = "loop")]
pub use exchange::boot_id;
#[cfg(feature = "loop")]
pub use executor::action::run_action;
#[cfg(feature = "loop")]
pub use run::{Station, run, run_external};
#[cfg(feature = "loop")]
pub use summary::{RunError, RunSummary};
