//! Pan and pancake against textbook mechanics, and the world's repeatability.

// Monogram notation.
#![allow(non_snake_case)]

mod common;

use common::{BOTH, softness, wam_with_pan};
use nalgebra::{Isometry3, Translation3, UnitQuaternion, Vector3};
use physics::arm::{ArmModel, JointVector, dynamics, kinematics};
use physics::pancake::{
    PancakeConfig, PancakePlant, WAM7_START_POSTURE, insert_pan, insert_pancake, object_state,
};
use physics::plant::{Dynamics, ObjectState, Plant};
use physics::rapier::new_world;
use rapier3d::prelude::{PhysicsWorld, RigidBodyBuilder};

/// A pan that hangs still in the world, tilted about y, with a pancake at `p_PO`.
struct FixedPan {
    world: PhysicsWorld,
    X_WP: Isometry3<f64>,
    pancake: (rapier3d::prelude::RigidBodyHandle, rapier3d::prelude::ColliderHandle),
}

impl FixedPan {
    fn new(config: &PancakeConfig, tilt: f64, p_PO: [f64; 3], R_PO: UnitQuaternion<f64>) -> Self {
        let gravity = Vector3::new(0.0, 0.0, -9.81);
        let mut world = new_world(&gravity, config.period_s, config.solver_iterations, softness());
        let X_WP = Isometry3::from_parts(
            Translation3::identity(),
            UnitQuaternion::from_axis_angle(&Vector3::y_axis(), tilt),
        );
        let body = world.bodies.insert(RigidBodyBuilder::fixed().build());
        insert_pan(&mut world, body, &X_WP, config);
        let X_PO = Isometry3::from_parts(p_PO.into(), R_PO);
        let pancake = insert_pancake(&mut world, &(X_WP * X_PO), config);
        FixedPan { world, X_WP, pancake }
    }

    fn step(&mut self) -> ObjectState {
        self.world.step();
        object_state(&self.world, self.pancake)
    }

    /// Centre of the pancake in the pan frame.
    fn p_PO(&self, object: &ObjectState) -> Vector3<f64> {
        self.X_WP.inverse_transform_point(&object.p_WO.into()).coords
    }
}

/// A pan without reachable rim.
fn wide() -> PancakeConfig {
    PancakeConfig { pan_radius: 1.0, ..PancakeConfig::default() }
}

const RESTING_HEIGHT: f64 = 0.005;

#[test]
fn slides_down_a_slope_as_coulomb_says() {
    // a = g(sin β − μ cos β).
    let beta = 25_f64.to_radians();
    for friction in [0.3, 0.4] {
        let expected = 9.81 * (beta.sin() - friction * beta.cos());
        let config = PancakeConfig { friction, ..wide() };
        let start = [0.0, 0.0, RESTING_HEIGHT + 3e-4];
        let mut pan = FixedPan::new(&config, beta, start, UnitQuaternion::identity());
        let mut x = Vec::new();
        for _ in 0..500 {
            let object = pan.step();
            x.push(pan.p_PO(&object).x);
        }
        // Three points of a parabola.
        let measured = (x[450] - 2.0 * x[300] + x[150]) / 0.15_f64.powi(2);
        println!("friction {friction}: slides at {measured:.4} m/s², theory {expected:.4}");
        assert!((measured / expected - 1.0).abs() < 0.01);
    }
}

#[test]
fn sticks_on_a_gentle_slope() {
    let mut pan = FixedPan::new(
        &wide(),
        10_f64.to_radians(),
        [0.0, 0.0, RESTING_HEIGHT + 3e-4],
        UnitQuaternion::identity(),
    );
    for _ in 0..200 {
        pan.step();
    }
    let x_settled = pan.p_PO(&object_state(&pan.world, pan.pancake)).x;
    let mut object = pan.step();
    for _ in 0..1000 {
        object = pan.step();
    }
    let creep = (pan.p_PO(&object).x - x_settled).abs();
    println!("creeps {creep:.1e} m in 1 s at 10°");
    assert!(creep < 1e-4);
}

#[test]
fn drop_rebounds_a_little_and_comes_to_rest() {
    const FALL: f64 = 0.2;
    let config = PancakeConfig::default();
    let start = [0.0, 0.0, RESTING_HEIGHT + FALL];
    let mut pan = FixedPan::new(&config, 0.0, start, UnitQuaternion::identity());
    let mut heights = vec![start[2]];
    let mut object = pan.step();
    for _ in 0..1500 {
        heights.push(object.p_WO.z);
        object = pan.step();
    }
    let speeds: Vec<f64> = heights.windows(2).map(|z| (z[1] - z[0]) / config.period_s).collect();
    let impact = -speeds.iter().copied().fold(f64::INFINITY, f64::min);
    let rebound = speeds.iter().copied().fold(f64::NEG_INFINITY, f64::max);
    let lowest = heights.iter().copied().fold(f64::INFINITY, f64::min);
    let restitution = rebound / impact;
    println!("drop: impact {impact:.3} m/s, restitution {restitution:.3}");
    println!("drop: deepest {:.3} mm", (RESTING_HEIGHT - lowest) * 1e3);
    assert!((0.05..=0.15).contains(&restitution), "{restitution}");

    let sunk = RESTING_HEIGHT - object.p_WO.z;
    let rest = object;
    for _ in 0..1000 {
        object = pan.step();
        assert!(object.in_contact, "a resting pancake touches the pan");
    }
    let drift = (object.p_WO - rest.p_WO).norm();
    println!("rest: sunk {:.4} mm, drifts {drift:.1e} m in 1 s", sunk * 1e3);
    assert!(sunk.abs() < 2e-3 && RESTING_HEIGHT - lowest < 2e-3);
    assert!(drift < 1e-6);
}

#[test]
fn tilted_drops_never_pass_the_pan_nor_gain_energy() {
    let config = wide();
    let mut deepest: f64 = 0.0;
    for i in 0..24 {
        let tilt = std::f64::consts::PI * f64::from(i) / 24.0;
        let R_PO = UnitQuaternion::from_axis_angle(&Vector3::x_axis(), tilt);
        let mut pan = FixedPan::new(&config, 0.0, [0.0, 0.0, 0.4], R_PO);
        let mut object = pan.step();
        for _ in 0..1500 {
            object = pan.step();
            assert!(object.p_WO.z < 0.4, "dropped at {tilt} rad it rises above its start");
            // Lowest point of a round-edged disc.
            let n_z = (object.R_WO * Vector3::z()).z;
            let reach = 0.077 * (1.0 - n_z * n_z).max(0.0).sqrt() + 0.002 * n_z.abs() + 0.003;
            deepest = deepest.max(reach - object.p_WO.z);
        }
        assert!((object.p_WO.z - RESTING_HEIGHT).abs() < 1e-3, "dropped at {tilt} rad: {object:?}");
    }
    println!("24 tilted drops: deepest {:.2} mm", deepest * 1e3);
    assert!(deepest < 2e-3);
}

#[test]
fn rim_holds_the_pancake() {
    let config = PancakeConfig { friction: 0.0, ..PancakeConfig::default() };
    let mut pan = FixedPan::new(
        &config,
        10_f64.to_radians(),
        [0.0, 0.0, RESTING_HEIGHT + 3e-4],
        UnitQuaternion::identity(),
    );
    let mut object = pan.step();
    for _ in 0..3000 {
        object = pan.step();
    }
    let p_PO = pan.p_PO(&object);
    println!("against the rim: x = {:.1} mm", p_PO.x * 1e3);
    assert!((0.04..0.07).contains(&p_PO.x) && (0.0..0.02).contains(&p_PO.z));
}

/// A rough scripted flick: computed torque along a dip, a rise and a turn of the wrist.
fn flick(model: &ArmModel, plant: &mut PancakePlant, ticks: usize) -> Vec<u64> {
    let mut bits = Vec::new();
    let amplitude = JointVector::from_row_slice(&[0.0, -0.25, 0.0, -0.3, 0.0, 0.5, 0.0]);
    for tick in 0..ticks {
        let state = plant.measure();
        let phase = 8.0 * tick as f64 * 1e-3;
        let q_d = WAM7_START_POSTURE + amplitude * (0.5 - 0.5 * phase.cos());
        let qd_d = amplitude * (4.0 * phase.sin());
        let qdd_c = (qd_d - state.qd) * 40.0 + (q_d - state.q) * 400.0;
        plant.apply(&dynamics::rnea(model, &state.q, &state.qd, &qdd_c));
        plant.advance();
        let object = state.object;
        let numbers = state.q.iter().chain(state.qd.iter()).chain(object.p_WO.iter());
        bits.extend(numbers.chain(object.R_WO.coords.iter()).map(|x| x.to_bits()));
    }
    bits
}

fn plant(model: &ArmModel, config: &PancakeConfig) -> PancakePlant {
    PancakePlant::new(model, &WAM7_START_POSTURE, config)
}

fn config(dynamics: Dynamics) -> PancakeConfig {
    PancakeConfig { dynamics, solver_iterations: dynamics.substeps(), ..PancakeConfig::default() }
}

/// Holds the arm at its start posture for a period; returns the torques.
fn hold(model: &ArmModel, plant: &mut PancakePlant) -> JointVector {
    let state = plant.measure();
    let qdd_c = (WAM7_START_POSTURE - state.q) * 400.0 - state.qd * 40.0;
    let tau = dynamics::rnea(model, &state.q, &state.qd, &qdd_c);
    plant.apply(&tau);
    plant.advance();
    tau
}

#[test]
fn fresh_worlds_are_bit_identical() {
    let model = wam_with_pan();
    for dynamics in BOTH {
        let new = || plant(&model, &config(dynamics));
        let (mut one, mut other) = (new(), new());
        let first = flick(&model, &mut one, 1000);
        assert!(first == flick(&model, &mut other, 1000), "two fresh worlds differ");
        one.begin_reset();
        assert!(first == flick(&model, &mut one, 1000), "a reset world differs from a fresh one");
        // The motion must be worth comparing: the pancake has left its place.
        let p_WP = kinematics::tip_pose(&model, &WAM7_START_POSTURE).translation.vector;
        assert!((one.measure().object.p_WO - p_WP).norm() > 0.02);
    }
}

#[test]
fn pancake_starts_where_configured_and_lies_still_on_the_arm() {
    let model = wam_with_pan();
    for dynamics in BOTH {
        let config = PancakeConfig { pancake_offset: [0.01, -0.02], ..config(dynamics) };
        let mut plant = plant(&model, &config);
        let p_WP = kinematics::tip_pose(&model, &WAM7_START_POSTURE).translation.vector;
        let offset = plant.measure().object.p_WO - p_WP;
        assert!((offset - Vector3::new(0.01, -0.02, 0.0053)).norm() < 1e-8);

        (0..1000).for_each(|_| _ = hold(&model, &mut plant));
        let state = plant.measure();
        assert!(state.object.in_contact);
        let X_WP = kinematics::tip_pose(&model, &state.q);
        let p_PO = X_WP.inverse_transform_point(&state.object.p_WO.into()).coords;
        println!("{dynamics:?}: on the held arm after 1 s: {p_PO:.6?}");
        assert!((p_PO - Vector3::new(0.01, -0.02, 0.005)).norm() < 1e-3);
    }
}

/// Held by stiff joints, the arm sags by the torque Jᵀ·m·g of what lies in the pan alone.
#[test]
fn weight_of_the_pancake_reaches_the_joints() {
    let model = wam_with_pan();
    for (dynamics, pancake_mass) in BOTH.into_iter().flat_map(|d| [(d, 0.026), (d, 1.0), (d, 2.0)])
    {
        let mut plant = plant(&model, &PancakeConfig { pancake_mass, ..config(dynamics) });
        (0..3000).for_each(|_| _ = hold(&model, &mut plant));
        // The contact flickers by what a step resolves; a load is judged by its mean.
        let (mut held, mut fastest) = (JointVector::zeros(), 0.0_f64);
        for _ in 0..200 {
            let gravity = dynamics::gravity_torque(&model, &plant.measure().q);
            held += (hold(&model, &mut plant) - gravity) / 200.0;
            fastest = fastest.max(plant.measure().qd.amax());
        }
        let state = plant.measure();
        let tip = physics::arm::TipKinematics::new(&model, &state.q, &JointVector::zeros());
        let mut expected = JointVector::zeros();
        for i in 0..7 {
            // The pancake lies in the centre, so its weight acts through the tip (5 mm above it).
            let (v, w) = (tip.J.fixed_view::<3, 1>(0, i), tip.J.fixed_view::<3, 1>(3, i));
            let p_PO = state.object.p_WO - tip.X_WP.translation.vector;
            let w: Vector3<f64> = w.into();
            expected[i] = pancake_mass * 9.81 * (v + w.cross(&p_PO)).z;
        }
        let worst = (held - expected).amax() / expected.amax();
        println!(
            "{dynamics:?}, {pancake_mass} kg: torques off by {worst:.1e}, {fastest:.1e} rad/s"
        );
        assert!(worst < 1e-3 && fastest < 0.01, "{dynamics:?}, {pancake_mass} kg");
    }
}

/// Dropped on the held arm, whatever its weight, a pancake comes to rest in the pan and the arm stays
/// where it is.
#[test]
fn heavy_pancakes_dropped_on_the_arm_come_to_rest() {
    let model = wam_with_pan();
    for (dynamics, pancake_mass) in BOTH.into_iter().flat_map(|d| [(d, 0.026), (d, 0.5), (d, 2.0)])
    {
        let config = PancakeConfig { pancake_mass, start_gap: 0.05, ..config(dynamics) };
        let mut plant = plant(&model, &config);
        let mut lowest = f64::INFINITY;
        for _ in 0..4000 {
            hold(&model, &mut plant);
            let state = plant.measure();
            let X_WP = kinematics::tip_pose(&model, &state.q);
            lowest = lowest.min(X_WP.inverse_transform_point(&state.object.p_WO.into()).z);
        }
        let state = plant.measure();
        let X_WP = kinematics::tip_pose(&model, &state.q);
        let p_PO = X_WP.inverse_transform_point(&state.object.p_WO.into()).coords;
        let sunk = 1e3 * (RESTING_HEIGHT - lowest);
        println!("{dynamics:?}, {pancake_mass} kg: deepest {sunk:.2} mm, rests at {p_PO:.5?}");
        assert!(sunk < 2.0 && (p_PO.z - RESTING_HEIGHT).abs() < 1e-3, "{p_PO}");
        assert!(p_PO.xy().norm() < 0.02 && state.qd.amax() < 0.02, "{state:?}");
    }
}

/// The pan at rest in zero gravity would drift with the momentum of what hits it: what the pancake loses,
/// the arm gains, as generalized momentum Jᵀ·P.
#[test]
fn what_hits_the_pan_hits_the_joints() {
    let model = wam_with_pan();
    for dynamics in BOTH {
        let config =
            PancakeConfig { start_gap: 0.05, pancake_offset: [0.03, 0.02], ..config(dynamics) };
        let far = PancakeConfig { start_gap: 10.0, ..config };
        let (mut hit, mut missed) = (plant(&model, &config), plant(&model, &far));
        let hanging = dynamics::gravity_torque(&model, &WAM7_START_POSTURE);
        let mut last = hit.measure().object;
        for _ in 0..140 {
            for plant in [&mut hit, &mut missed] {
                plant.apply(&hanging);
                plant.advance();
            }
            let now = hit.measure().object;
            if now.in_contact && last.in_contact {
                break;
            }
            last = now;
        }
        let state = hit.measure();
        let tip = physics::arm::TipKinematics::new(&model, &state.q, &state.qd);
        let M = dynamics::mass_matrix(&model, &state.q);
        let momentum = M * (state.qd - missed.measure().qd);
        // Everything went through one point, along the pan's normal.
        let at = state.object.p_WO - tip.X_WP.translation.vector;
        let normal = tip.X_WP.rotation * Vector3::z();
        let lever = at.cross(&normal);
        let unit = nalgebra::Vector6::new(normal.x, normal.y, normal.z, lever.x, lever.y, lever.z);
        let per_impulse = tip.J.tr_mul(&unit);
        let impulse = momentum.dot(&per_impulse) / per_impulse.norm_squared();
        let off = (momentum - per_impulse * impulse).norm() / momentum.norm();
        println!("{dynamics:?}: impulse {impulse:.5} N·s, off by {off:.2e}");
        assert!(impulse < -0.02 && off < 0.05, "{dynamics:?}: {impulse} {off}");
    }
}
