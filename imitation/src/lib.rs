//! Learns movements from demonstrations: mixtures, regression, stable fields and primitives.
//! It knows no robot, transport or database.
//!
//! A movement is a [`Recording`]: points in any coordinates at a uniform rate. From recordings come the forms
//! of Sec. 3 of Calinon, Kormushev and Caldwell (2013), all of which are weighted linear systems, Eq. (2):
//!
//! | module | from | to |
//! |---|---|---|
//! | [`demonstrations`] | recordings | what is wrong with them |
//! | [`align`] | recordings of unequal timing | a common clock |
//! | [`gmm`] | points | a Gaussian mixture |
//! | [`regression`] | a mixture | Eq. (2): position or velocity over time, velocity over position |
//! | [`dmp`], [`dmpbbo`] | recordings, or a file | Eq. (3), and its attractors, Eq. (4) |
//! | [`attractors`], [`variability`] | recordings | Eq. (5), stiff where they agree |
//! | [`sphere`] | orientations | means, mixtures, turns of any size |
//! | [`metrics`] | two paths | how far apart they are |
//!
//! ```
//! use imitation::align::{Alignment, align};
//! use imitation::demonstrations::{DrivenBy, problems};
//! use imitation::{Recording, variability};
//! use nalgebra::DMatrix;
//!
//! // Three demonstrations (m) in the plane at 100 Hz: they differ on the way and agree at the end.
//! let demonstrate = |name: &str, n: usize, off: f64| {
//!     let points = DMatrix::from_fn(2, n, |c, k| {
//!         let u = k as f64 / (n - 1) as f64;
//!         let rise = u * u * (3.0 - 2.0 * u);
//!         if c == 0 { 0.4 * rise } else { off * (1.0 - rise) + 0.001 * off }
//!     });
//!     Recording::new(name, 0.01, points)
//! };
//! let recordings =
//!     [demonstrate("a", 200, 0.0)?, demonstrate("b", 230, 0.03)?, demonstrate("c", 180, -0.04)?];
//! assert_eq!(problems(&recordings, DrivenBy::Time), []);
//!
//! let aligned = align(&recordings, Alignment::Warped)?;
//! let policy = variability::attractors(&aligned, &Default::default())?;
//! let duration_s = aligned[0].duration_s();
//! assert!(policy.stiffness(duration_s).trace() > policy.stiffness(0.0).trace());
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

#![allow(non_snake_case)] // matrices
#![forbid(unsafe_code)]

pub mod activations;
pub mod align;
pub mod attractors;
pub mod demonstrations;
pub mod dmp;
pub mod dmpbbo;
mod gaussian;
pub mod gmm;
mod integrate;
mod least_squares;
mod lists;
pub mod metrics;
pub mod mixture;
pub mod recording;
pub mod regression;
pub mod sphere;
pub mod systems;
pub mod variability;

pub use attractors::Attractors;
pub use dmp::Dmp;
pub use mixture::Mixture;
pub use recording::Recording;
pub use systems::Systems;
