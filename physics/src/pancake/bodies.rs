//! Shapes and masses of pan and pancake, and how the pancake is read back.

use std::f64::consts::{FRAC_PI_2, TAU};

use nalgebra::{Isometry3, Translation3, UnitQuaternion, Vector3};
use rapier3d::prelude::{
    ColliderBuilder, ColliderHandle, MassProperties, PhysicsWorld, Pose, RigidBodyBuilder,
    RigidBodyHandle, Rotation, Vector,
};

use super::PancakeConfig;
use crate::plant::ObjectState;
use crate::rapier::convert::{from_glam_rotation, from_glam_vector, to_glam_pose};

/// Fixes the pan's shapes to `body`, the pan frame lying at `X_BP` in it. They have no mass.
///
/// The disc lies below the pan's top surface; the rim is a ring of boxes whose inner faces start
/// at the disc's edge and lean outwards.
pub fn insert_pan(
    world: &mut PhysicsWorld,
    body: RigidBodyHandle,
    X_BP: &Isometry3<f64>,
    config: &PancakeConfig,
) {
    let mut insert = |shape: ColliderBuilder, X_PC: &Isometry3<f64>| {
        let shape = shape
            .density(0.0)
            .friction(config.friction)
            .restitution(config.restitution)
            .position(to_glam_pose(&(X_BP * X_PC)));
        world.colliders.insert_with_parent(shape.build(), body, &mut world.bodies);
    };

    let half_thickness = config.pan_thickness / 2.0;
    let disc = ColliderBuilder::cylinder(half_thickness, config.pan_radius);
    let below = Translation3::new(0.0, 0.0, -half_thickness);
    insert(disc, &Isometry3::from_parts(below, y_to_z()));

    // In the radial plane the rim rises along (sin, cos) and is thick along (cos, −sin).
    let (sin, cos) = config.rim_tilt.sin_cos();
    let (height, thickness) = (config.rim_height / 2.0, config.rim_thickness / 2.0);
    let centre_radius = config.pan_radius + height * sin + thickness * cos;
    let centre_z = height * cos - thickness * sin;
    let outer_radius = centre_radius + height * sin + thickness * cos;
    // Wide enough for neighbours to meet on the outside.
    let half_width = outer_radius * (TAU / 2.0 / config.rim_segments as f64).tan();
    for segment in 0..config.rim_segments {
        let angle = TAU * segment as f64 / config.rim_segments as f64;
        let around = UnitQuaternion::from_axis_angle(&Vector3::z_axis(), angle);
        let outward = UnitQuaternion::from_axis_angle(&Vector3::y_axis(), config.rim_tilt);
        let centre = around * Vector3::new(centre_radius, 0.0, centre_z);
        insert(
            ColliderBuilder::cuboid(thickness, half_width, height),
            &Isometry3::from_parts(centre.into(), around * outward),
        );
    }
}

/// Puts the pancake into the world with its centre and orientation at `X_WO`, at rest.
///
/// O is the centre, z the pancake's normal. The inertia is that of the full cylinder.
pub fn insert_pancake(
    world: &mut PhysicsWorld,
    X_WO: &Isometry3<f64>,
    config: &PancakeConfig,
) -> (RigidBodyHandle, ColliderHandle) {
    let (m, r, h) = (config.pancake_mass, config.pancake_radius, config.pancake_thickness);
    let across = m * (3.0 * r * r + h * h) / 12.0;
    let inertia = Vector::new(across, across, m * r * r / 2.0);
    let body = RigidBodyBuilder::dynamic()
        .pose(to_glam_pose(X_WO))
        .additional_mass_properties(MassProperties::new(Vector::ZERO, m, inertia))
        .can_sleep(false);
    let body = world.bodies.insert(body.build());

    let border = config.pancake_border;
    let shape = ColliderBuilder::round_cylinder(h / 2.0 - border, r - border, border)
        .density(0.0)
        .friction(config.friction)
        .restitution(config.restitution)
        .position(Pose::from_rotation(Rotation::from_rotation_x(FRAC_PI_2)));
    let collider = world.colliders.insert_with_parent(shape.build(), body, &mut world.bodies);
    (body, collider)
}

/// Did the pancake press on anything during the last step?
pub fn is_touching(world: &PhysicsWorld, pancake: ColliderHandle) -> bool {
    world.contact_pairs_with(pancake).any(|pair| pair.total_impulse_magnitude() > 0.0)
}

/// What a tracking system would see of the pancake.
pub fn object_state(
    world: &PhysicsWorld,
    (body, collider): (RigidBodyHandle, ColliderHandle),
) -> ObjectState {
    let X_WO = world.bodies[body].position();
    ObjectState {
        p_WO: from_glam_vector(X_WO.translation),
        R_WO: from_glam_rotation(X_WO.rotation),
        in_contact: is_touching(world, collider),
    }
}

/// Rapier's cylinders stand along y, our pan's normal is z.
fn y_to_z() -> UnitQuaternion<f64> {
    UnitQuaternion::from_axis_angle(&Vector3::x_axis(), FRAC_PI_2)
}
