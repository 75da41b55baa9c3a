//! A full turn of the tip: on the sphere it is followed without a jump, as rotation vectors it is not.
//!
//! No arm turns its tip about the vertical all the way, so the policy drives a body that does what it asks
//! for: an ideal double integrator on positions and rotations.

#![allow(non_snake_case)] // R is a rotation

mod common;

use std::f64::consts::{PI, TAU};

use common::wam;
use nalgebra::{UnitQuaternion, Vector3, Vector6};
use rt_controller::ControllerConfig;
use rt_controller::admit::admission::admit;
use rt_controller::hot::policy::Policy;
use rt_controller::hot::task_space::{TaskState, from_world, to_world};
use shm_types::policy::{ORIENTATION_SPHERE, ORIENTATION_VECTOR, PolicyMsg, packed_index};

const DT: f64 = 1e-3;
const TURN_S: f64 = 4.0;
const SETTLE_S: f64 = 1.0;

/// `n` springs in six coordinates whose yaw goes from 0 to 2π, about an axis that leans by `lean` rad.
fn full_turn(n: u32, orientation: u32, lean: f64) -> Policy {
    let mut message = PolicyMsg { task_dim: 6, n_components: n, ..PolicyMsg::EMPTY };
    (message.duration_s, message.orientation) = (TURN_S, orientation);
    message.damping = 2.0 * 200_f64.sqrt();
    let spacing = TURN_S / f64::from(n - 1);
    for (i, component) in message.components[..n as usize].iter_mut().enumerate() {
        let angle = TAU * i as f64 / f64::from(n - 1);
        (component.center, component.width) = (i as f64 * spacing, 0.5 * spacing);
        // x, y, z, pitch, roll, yaw.
        component.attractor = [0.6, 0.0, 0.7, angle * lean.sin(), 0.0, angle * lean.cos()];
        (0..6).for_each(|k| component.stiffness[packed_index(k, k)] = 200.0);
    }
    let config = ControllerConfig { settle_s: 0.6, period_us: 2000, ..Default::default() };
    admit(&message.sealed(), &wam(), &config).unwrap()
}

/// What a body did that follows a policy.
struct Followed {
    /// Largest change of the commanded acceleration from tick to tick, m/s² and rad/s².
    jump: f64,
    /// Angle turned about the vertical, all turns counted, rad.
    turned: f64,
    /// Angle between the last orientation and the last attractor's, rad.
    error: f64,
}

/// One turn of the policy, from the first attractor on.
fn follow(policy: &Policy) -> Followed {
    let (mut p, mut v) = (Vector3::new(0.6, 0.0, 0.7), Vector3::zeros());
    let (mut R, mut omega) = (UnitQuaternion::identity(), Vector3::<f64>::zeros());
    let (mut last, mut jump, mut turned) = (None::<Vector6<f64>>, 0.0_f64, 0.0);
    for tick in 0..((TURN_S + SETTLE_S) / DT) as usize {
        let rotation = R.scaled_axis();
        let world = |a: &Vector3<f64>, b: &Vector3<f64>| Vector6::new(a.x, a.y, a.z, b.x, b.y, b.z);
        let task = TaskState {
            x: from_world(&world(&p, &rotation)),
            xd: from_world(&world(&v, &omega)),
            R_WP: R,
        };
        let xdd = to_world(&policy.command(tick as f64 * DT, &task).xdd);
        jump = last.map_or(jump, |last| jump.max((xdd - last).amax()));
        last = Some(xdd);
        v += Vector3::new(xdd[0], xdd[1], xdd[2]) * DT;
        omega += Vector3::new(xdd[3], xdd[4], xdd[5]) * DT;
        p += v * DT;
        R = UnitQuaternion::from_scaled_axis(omega * DT) * R;
        turned += omega.z * DT;
    }
    // The last attractor is a whole turn from the first: the same orientation.
    Followed { jump, turned, error: R.angle() }
}

#[test]
fn springs_on_the_sphere_follow_a_full_turn_without_a_jump() {
    for n in [8, 12, 16] {
        let followed = follow(&full_turn(n, ORIENTATION_SPHERE, 0.0));
        assert!((followed.turned - TAU).abs() < 0.02, "{n} springs: {} rad", followed.turned);
        assert!(followed.error < 0.02, "{n} springs end {} rad off", followed.error);
        // The steepest a smooth command gets here; a jump is hundreds.
        assert!(followed.jump < 3.0, "{n} springs: {} rad/s² in a tick", followed.jump);
    }
    let leaning = follow(&full_turn(12, ORIENTATION_SPHERE, 0.4));
    assert!((leaning.turned - TAU * 0.4_f64.cos()).abs() < 0.02, "{} rad", leaning.turned);
    assert!(leaning.error < 0.02 && leaning.jump < 3.0, "{} {}", leaning.error, leaning.jump);
}

#[test]
fn rotation_vectors_jump_at_half_a_turn() {
    let followed = follow(&full_turn(12, ORIENTATION_VECTOR, 0.0));
    assert!(followed.jump > 200.0 * PI, "a jump of {} rad/s²", followed.jump);
    assert!((followed.turned - TAU).abs() > 1.0, "it turns {} rad", followed.turned);
}
