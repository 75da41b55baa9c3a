//! An empty world with the integration settings the measurements support.

use nalgebra::Vector3;
use rapier3d::prelude::{IntegrationParameters, PhysicsWorld, SpringCoefficients};

use super::convert::to_glam_vector;

/// How stiffly contacts are resolved.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ContactSoftness {
    /// Natural frequency, Hz.
    pub frequency_hz: f64,
    /// Damping ratio ζ.
    pub damping_ratio: f64,
}

/// A world without bodies.
///
/// `period_s` is one step, divided into `solver_iterations` real sub-steps. Contact recycling is
/// off: with it on, a degenerate contact manifold is kept and the pancake falls through the pan.
pub fn new_world(
    gravity: &Vector3<f64>,
    period_s: f64,
    solver_iterations: usize,
    softness: ContactSoftness,
) -> PhysicsWorld {
    let spring = SpringCoefficients::new(softness.frequency_hz, softness.damping_ratio);
    PhysicsWorld {
        gravity: to_glam_vector(gravity),
        integration_parameters: IntegrationParameters {
            dt: period_s,
            num_solver_iterations: solver_iterations,
            contact_softness: spring,
            // The same against fixed bodies: a test on a fixed pan then tells of the moving one.
            static_contact_softness: spring,
            contact_recycling: false,
            ..Default::default()
        },
        ..Default::default()
    }
}
