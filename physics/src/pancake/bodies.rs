//! Shapes and masses of pan and pancake, and how the pancake is read back.

use std::f64::consts::{FRAC_PI_2, TAU};

use nalgebra::{Isometry3, Translation3, UnitQuaternion, Vector3};
use rapier3d::prelude::{
    ColliderBuilder, ColliderHandle, MassProperties, PhysicsWorld, Pose, RigidBodyBuilder,
    RigidBodyHandle, Rotation, SharedShape, Vector,
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
    let disc = ColliderBuilder::new(disc(config));
    insert_part(world, body, disc, &(X_BP * disc_pose(config)), config);
    for (X_PC, part) in rim(config) {
        insert_part(world, body, ColliderBuilder::new(part), &(X_BP * X_PC), config);
    }
}

/// The same with the frame of `body` as the pan frame and the rim as one shape, which costs less and
/// gives another order of contacts.
pub fn insert_pan_in_two(world: &mut PhysicsWorld, body: RigidBodyHandle, config: &PancakeConfig) {
    insert_part(world, body, ColliderBuilder::new(disc(config)), &disc_pose(config), config);
    let parts = rim(config).map(|(X_PC, part)| (to_glam_pose(&X_PC), part)).collect();
    insert_part(world, body, ColliderBuilder::compound(parts), &Isometry3::identity(), config);
}

fn insert_part(
    world: &mut PhysicsWorld,
    body: RigidBodyHandle,
    part: ColliderBuilder,
    X_BC: &Isometry3<f64>,
    config: &PancakeConfig,
) {
    let part = part
        .density(0.0)
        .friction(config.friction)
        .restitution(config.restitution)
        .position(to_glam_pose(X_BC));
    world.colliders.insert_with_parent(part.build(), body, &mut world.bodies);
}

fn disc(config: &PancakeConfig) -> SharedShape {
    SharedShape::cylinder(config.pan_thickness / 2.0, config.pan_radius)
}

fn disc_pose(config: &PancakeConfig) -> Isometry3<f64> {
    let below = Translation3::new(0.0, 0.0, -config.pan_thickness / 2.0);
    Isometry3::from_parts(below, y_to_z())
}

/// The boxes of the rim and where they are in the pan.
fn rim(config: &PancakeConfig) -> impl Iterator<Item = (Isometry3<f64>, SharedShape)> {
    // In the radial plane the rim rises along (sin, cos) and is thick along (cos, −sin).
    let (sin, cos) = config.rim_tilt.sin_cos();
    let (height, thickness) = (config.rim_height / 2.0, config.rim_thickness / 2.0);
    let centre_radius = config.pan_radius + height * sin + thickness * cos;
    let centre_z = height * cos - thickness * sin;
    let outer_radius = centre_radius + height * sin + thickness * cos;
    // Wide enough for neighbours to meet on the outside.
    let half_width = outer_radius * (TAU / 2.0 / config.rim_segments as f64).tan();
    let n = config.rim_segments;
    let outward = UnitQuaternion::from_axis_angle(&Vector3::y_axis(), config.rim_tilt);
    (0..n).map(move |segment| {
        let angle = TAU * segment as f64 / n as f64;
        let around = UnitQuaternion::from_axis_angle(&Vector3::z_axis(), angle);
        let centre = around * Vector3::new(centre_radius, 0.0, centre_z);
        let X_PC = Isometry3::from_parts(centre.into(), around * outward);
        (X_PC, SharedShape::cuboid(thickness, half_width, height))
    })
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
