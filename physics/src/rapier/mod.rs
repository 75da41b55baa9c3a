//! The simulated world: Rapier in f64, with the arm as a reduced-coordinate multibody.
