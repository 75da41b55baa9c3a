//! The loop drives arms other than the WAM: three joints in a plane hold a pan.

use physics::arm::{ArmModel, JointVector, kinematics};
use physics::pancake::{PancakeConfig, PancakePlant};
use physics::plant::Plant;
use physics::referee::Referee;
use rt_controller::ControllerConfig;
use rt_controller::admit::admission::admit;
use rt_controller::hot::rollout::Phase;
use rt_controller::hot::tick::{Controller, Fault};
use shm_types::episode::TickRecord;
use shm_types::policy::{PolicyMsg, packed_index};

fn link(name: &str, mass: f64) -> String {
    format!(
        "<link name='{name}'><inertial><origin xyz='0.2 0 0'/><mass value='{mass}'/>\
         <inertia ixx='0.002' iyy='0.01' izz='0.01' ixy='0' ixz='0' iyz='0'/></inertial></link>"
    )
}

fn joint(name: &str, parent: &str, child: &str, x: f64) -> String {
    format!(
        "<joint name='{name}' type='revolute'><parent link='{parent}'/><child link='{child}'/>\
         <origin xyz='{x} 0 0'/><axis xyz='0 1 0'/>\
         <limit lower='-2.5' upper='2.5' effort='60' velocity='6'/></joint>"
    )
}

fn planar_arm() -> ArmModel {
    let urdf = format!(
        "<robot name='planar'><link name='base'/>{}{}{}<link name='pan'/>{}{}{}\
         <joint name='hold' type='fixed'><parent link='l3'/><child link='pan'/>\
         <origin xyz='0.3 0 0'/></joint></robot>",
        link("l1", 2.0),
        link("l2", 1.5),
        link("l3", 0.6),
        joint("j1", "base", "l1", 0.0),
        joint("j2", "l1", "l2", 0.4),
        joint("j3", "l2", "l3", 0.4),
    );
    ArmModel::from_urdf(&urdf, "pan").unwrap()
}

#[test]
fn three_joint_arm_follows_a_position_policy() {
    let model = planar_arm();
    // Elbow up, pan level: the angles add up to zero.
    let mut q0 = JointVector::zeros();
    (q0[0], q0[1], q0[2]) = (-0.8, 1.2, -0.4);
    let start = kinematics::tip_pose(&model, &q0).translation.vector;
    let target = start + nalgebra::Vector3::new(-0.03, 0.0, 0.05);

    let mut message = PolicyMsg { task_dim: 3, n_components: 1, ..PolicyMsg::EMPTY };
    message.duration_s = 1.0;
    message.damping = 28.0;
    message.orientation_stiffness = 400.0;
    message.orientation_damping = 40.0;
    message.components[0].attractor[..3].copy_from_slice(target.as_slice());
    for row in 0..3 {
        message.components[0].stiffness[packed_index(row, row)] = 200.0;
    }
    let config = ControllerConfig::default();
    let policy = admit(&message.sealed(), &model, &config).unwrap();

    let mut plant = PancakePlant::new(&model, &q0, &PancakeConfig::default());
    let mut controller = Controller::new(&model, &q0, &config, &Referee::Clock);
    controller.start(&policy);
    let mut last = TickRecord::ZERO;
    while controller.phase() != Phase::Idle {
        let tau = controller.tick(&plant.measure(), &mut last);
        plant.apply(&tau);
        plant.advance();
    }
    assert_eq!(last.fault, Fault::None as u32);
    let reached = nalgebra::Vector3::from_column_slice(&last.x[..3]);
    // The spring sags under the pancake, which the model does not know: 0.26 N on some 75 N/m.
    assert!((reached - target).norm() < 5e-3, "{reached} instead of {target}");
    assert!(last.x[3].abs() < 0.02, "the pan stays level: {} rad", last.x[3]);
    assert!(last.tau[3..].iter().all(|tau| *tau == 0.0), "no torque on joints that are not there");
}
