//! URDF as vendors write it: what does not concern the dynamics of the arm is accepted, what is
//! assumed is said, and the simulated arm is the one that the mathematics computes with.

// Monogram notation.
#![allow(non_snake_case)]

mod common;

use std::collections::BTreeMap;

use common::OBLIQUE_ARM;
use nalgebra::{Isometry3, Matrix3, Vector3};
use physics::arm::urdf::{self, Payload};
use physics::arm::{ArmModel, ArmSettings, JointVector, LoadedArm, dynamics, kinematics};

fn load(text: &str, settings: &ArmSettings) -> LoadedArm {
    ArmModel::load(text, "tool", settings).unwrap_or_else(|error| panic!("{error}"))
}

/// The sound arm with `from` replaced by `to`.
fn changed(from: &str, to: &str) -> LoadedArm {
    assert!(OBLIQUE_ARM.contains(from), "the test no longer changes anything");
    load(&OBLIQUE_ARM.replace(from, to), &ArmSettings::default())
}

fn notes(arm: &LoadedArm) -> String {
    arm.notes.iter().map(|note| format!("{note}\n")).collect()
}

#[test]
fn a_sound_arm_leaves_nothing_to_say() {
    let arm = load(OBLIQUE_ARM, &ArmSettings::default());
    assert_eq!((notes(&arm).as_str(), arm.held.len()), ("", 0));
}

/// A gripper of a sliding, a mimicking and a turning finger on the tool.
fn with_gripper() -> String {
    let finger = |name: &str, kind: &str, more: &str| {
        format!(
            r#"<link name="{name}"><inertial><mass value="0.1"/>
            <inertia ixx="1e-5" ixy="0" ixz="0" iyy="1e-5" iyz="0" izz="1e-5"/></inertial></link>
            <joint name="{name}_joint" type="{kind}"><origin xyz="0 0 0.05"/><parent link="tool"/>
            <child link="{name}"/><axis xyz="0 1 0"/>{more}</joint>"#
        )
    };
    let limit = r#"<limit lower="0.01" upper="0.04" effort="1" velocity="1"/>"#;
    let mimic = format!("{limit}<mimic joint=\"left_joint\" multiplier=\"-1\" offset=\"0.1\"/>");
    let fingers = finger("left", "prismatic", limit)
        + &finger("right", "prismatic", &mimic)
        + &finger("thumb", "continuous", "");
    OBLIQUE_ARM.replace("</robot>", &(fingers + "</robot>"))
}

#[test]
fn joints_beside_the_chain_are_held_where_they_can_be_and_that_is_said_once() {
    let arm = load(&with_gripper(), &ArmSettings::default());
    assert_eq!(arm.model.n_joints(), 3);
    let held: Vec<(&str, f64)> =
        arm.held.iter().map(|held| (held.joint.as_str(), held.position)).collect();
    assert_eq!(held.len(), 3);
    assert_eq!(held[0], ("left_joint", 0.01), "the position nearest to zero");
    assert!((held[1].1 - 0.09).abs() < 1e-12, "as the mimicked one says: {held:?}");
    assert_eq!(held[2], ("thumb_joint", 0.0));
    assert_eq!(arm.notes.len(), 1, "{}", notes(&arm));

    // Its mass belongs to the body it is held on.
    let bare = load(OBLIQUE_ARM, &ArmSettings::default());
    let added = arm.model.bodies()[2].mass - bare.model.bodies()[2].mass;
    assert!((added - 0.3).abs() < 1e-12, "{added}");
}

#[test]
fn the_frames_of_the_links_lead_to_the_tip_and_to_what_is_held() {
    let arm = load(&with_gripper(), &ArmSettings::default());
    let q = JointVector::from_column_slice(&[0.4, -0.9, 1.3, 0.0, 0.0, 0.0, 0.0]);
    let mut poses = BTreeMap::from([(arm.links.root.as_str(), Isometry3::identity())]);
    for frame in &arm.links.frames {
        let parent = poses[frame.parent.as_str()];
        poses.insert(&frame.link, parent * frame.pose(&q));
    }
    let gap = kinematics::tip_pose(&arm.model, &q).inverse() * poses["tool"];
    assert!(gap.translation.vector.norm() + gap.rotation.angle() < 1e-7, "{gap}");
    let left = poses["tool"].inverse() * poses["left"];
    assert!((left.translation.vector - Vector3::new(0.0, 0.01, 0.05)).norm() < 1e-12, "{left}");
    let moving = arm.links.frames.iter().filter(|frame| frame.joint.is_some());
    assert_eq!(moving.count(), 3);
}

#[test]
fn held_joints_are_held_where_the_configuration_says() {
    let centre = |position: f64| {
        let held = [("left_joint".to_string(), position)].into();
        load(&with_gripper(), &ArmSettings { held, ..Default::default() }).model.bodies()[2].p_BBcm
    };
    let moved = (centre(0.04) - centre(0.01)).norm();
    // 0.1 kg of 1.2 kg by 0.03 m, and the mimicking finger as far the other way.
    assert!(moved < 1e-9, "{moved}");
    let held = [("thumb_joint".to_string(), 1.0)].into();
    let turned = load(&with_gripper(), &ArmSettings { held, ..Default::default() });
    assert!(!notes(&turned).contains("thumb_joint"), "what was asked for is no surprise");
}

/// A joint of the chain that is held is the same as the joint written fixed there.
#[test]
fn holding_a_joint_of_the_chain_is_fixing_it() {
    let held = [("b".to_string(), 0.3)].into();
    let two = load(OBLIQUE_ARM, &ArmSettings { held, ..Default::default() }).model;
    assert_eq!(two.joint_names(), ["a", "c"]);
    let three = load(OBLIQUE_ARM, &ArmSettings::default()).model;
    let (mut q2, mut q3) = (JointVector::zeros(), JointVector::zeros());
    (q2[0], q2[1]) = (0.4, -0.7);
    (q3[0], q3[1], q3[2]) = (0.4, 0.3, -0.7);
    let (X2, X3) = (kinematics::tip_pose(&two, &q2), kinematics::tip_pose(&three, &q3));
    assert!((X2.to_homogeneous() - X3.to_homogeneous()).amax() < 1e-12);
    let (g2, g3) = (dynamics::gravity_torque(&two, &q2), dynamics::gravity_torque(&three, &q3));
    assert!((g2[0] - g3[0]).abs() < 1e-9 && (g2[1] - g3[2]).abs() < 1e-9);
}

#[test]
fn continuous_joints_get_a_stated_finite_range() {
    let limit = r#"<limit lower="-2" upper="2" effort="30" velocity="5"/>"#;
    let without = OBLIQUE_ARM.replace(limit, r#"<limit effort="30" velocity="5"/>"#);
    let text = without.replace(r#"name="b" type="revolute""#, r#"name="b" type="continuous""#);
    let arm = load(&text, &ArmSettings::default());
    let limits = arm.model.limits();
    assert!((limits.q_max[1] - std::f64::consts::TAU).abs() < 1e-12);
    assert_eq!(limits.q_min[1], -limits.q_max[1]);
    assert!(notes(&arm).contains("\"b\"") && notes(&arm).contains("6.283"), "{}", notes(&arm));
    // Limits as large as numbers go are another way to write it.
    let large = r#"<limit lower="-1e308" upper="1e308" effort="30" velocity="5"/>"#;
    let arm = changed(limit, large);
    assert!((arm.model.limits().q_max[1] - std::f64::consts::TAU).abs() < 1e-12);
}

#[test]
fn limits_that_are_not_given_are_assumed_or_configured() {
    let limit = r#"effort="30" velocity="5""#;
    for open in [r#"effort="0" velocity="0""#, "", r#"effort="inf" velocity="-1""#] {
        let arm = changed(limit, open);
        let limits = arm.model.limits();
        assert!(limits.tau_max[1] > 1.0 && limits.tau_max[1] < 1e3, "{open}: {}", limits.tau_max);
        assert!(limits.qd_max[1] > 1.0, "{open}");
        let text = notes(&arm);
        assert!(text.contains("torque_limits_nm") && text.contains("speed_limits_rad_s"), "{text}");
        assert_eq!(
            (limits.tau_max[0], limits.tau_max[2]),
            (50.0, 10.0),
            "the others are the file's"
        );
    }
    let settings = ArmSettings {
        torque_limits: vec![1.0, 2.0, 3.0],
        speed_limits: vec![4.0, 5.0, 6.0],
        ..Default::default()
    };
    let arm = load(&OBLIQUE_ARM.replace(limit, r#"effort="0" velocity="0""#), &settings);
    assert_eq!(arm.model.limits().tau_max.as_slice()[..3], [1.0, 2.0, 3.0]);
    assert_eq!(arm.model.limits().qd_max.as_slice()[..3], [4.0, 5.0, 6.0]);
    assert_eq!(notes(&arm), "");
}

/// What is assumed holds the arm in any posture.
#[test]
fn assumed_torques_hold_the_arm() {
    let arm = load(&OBLIQUE_ARM.replace("effort=", "no_effort="), &ArmSettings::default()).model;
    for k in 0..50 {
        let q = JointVector::from_fn(|i, _| 2.0 * (1.7 * (k * (i + 1)) as f64).sin());
        let share = dynamics::gravity_torque(&arm, &q).abs();
        assert!((0..3).all(|i| share[i] <= 0.6 * arm.limits().tau_max[i]), "{share}");
    }
}

#[test]
fn the_merged_body_is_judged_and_not_its_parts() {
    let point = r#"<link name="point"><inertial><mass value="0.1"/>
        <inertia ixx="0" ixy="0" ixz="0" iyy="0" iyz="0" izz="0"/></inertial></link>
        <joint name="p" type="fixed"><origin xyz="0.3 0 0"/><parent link="two"/>
        <child link="point"/></joint></robot>"#;
    let arm = changed("</robot>", point);
    assert_eq!(notes(&arm), "");
    let bare = load(OBLIQUE_ARM, &ArmSettings::default());
    assert!((arm.model.bodies()[1].mass - bare.model.bodies()[1].mass - 0.1).abs() < 1e-12);
}

/// A frame between two joints, without a body of its own.
#[test]
fn a_massless_frame_in_the_chain_is_let_pass_with_a_note() {
    let joint = r#"<joint name="c" type="revolute"><origin xyz="0 0.25 0" rpy="1.2 0 0"/>
    <parent link="two"/>"#;
    let frame = r#"<link name="frame"/><joint name="extra" type="revolute">
    <parent link="two"/><child link="frame"/><axis xyz="0 1 0"/>
    <limit lower="-1" upper="1" effort="10" velocity="5"/></joint>"#;
    let moved = format!("{frame}{}", joint.replace("\"two\"", "\"frame\""));
    let arm = changed(joint, &moved);
    assert_eq!(arm.model.n_joints(), 4);
    assert!(notes(&arm).contains("\"frame\" moves without a mass"), "{}", notes(&arm));
}

#[test]
fn tensors_that_rounding_spoilt_are_used_with_a_note() {
    // The last body alone, so that nothing else fills it up.
    let blade = OBLIQUE_ARM.find(r#"<link name="blade">"#).unwrap();
    let end = blade + OBLIQUE_ARM[blade..].find("</link>").unwrap();
    let bare = OBLIQUE_ARM.replace(&OBLIQUE_ARM[blade..end], r#"<link name="blade">"#);
    let with = |ixx: &str| {
        let text = bare.replace(r#"ixx="0.002""#, &format!("ixx=\"{ixx}\""));
        ArmModel::load(&text, "tool", &ArmSettings::default())
    };
    // The others are 0.004 and 0.003.
    assert_eq!(notes(&with("0.00700000001").unwrap()), "");
    assert!(notes(&with("0.0072").unwrap()).contains("\"three\""));
    assert!(with("0.008").is_err());
    let arm = with("-1e-8").unwrap();
    assert!(notes(&arm).contains("\"three\""), "{}", notes(&arm));
    assert!(arm.model.bodies()[2].I_BBcm.symmetric_eigenvalues().min() > 0.0);
}

#[test]
fn cosmetic_faults_are_passed_over() {
    let sound = load(OBLIQUE_ARM, &ArmSettings::default()).model;
    let dressed = OBLIQUE_ARM
        .replace(
            r#"<robot name="oblique">"#,
            r#"<robot name="oblique" version="1.0">
            <!-- made by hand --><xacro:property name="x" value="${pi/2}"/>
            <material name="grey"/><material name="grey"/>
            <gazebo reference="one"><sensor:plugin/></gazebo>"#,
        )
        .replace(
            r#"<link name="one">"#,
            r#"<link name="one" type="x"><visual><origin rpy="a"/>
            <geometry><mesh filename="package://nowhere/one.stl" scale="bad"/></geometry></visual>
            <collision/><self_collision_checking/>"#,
        )
        .replace(
            r#"<child link="two"/>"#,
            r#"<child link="two"/><dynamics damping="x"/>
            <safety_controller k_velocity="0"/><calibration rising="0"/>"#,
        )
        .replace("</robot>", "<transmission name=\"t\"><joint name=\"a\"/></transmission></robot>");
    let dtd = "\u{feff}\n  <?xml version=\"1.0\" encoding=\"utf-8\"?>\n<!DOCTYPE robot [<!ENTITY u \"x\">]>\n";
    let arm = load(&format!("{dtd}{dressed}"), &ArmSettings::default());
    assert_eq!(arm.model, sound);

    let shouted = OBLIQUE_ARM.replace("<limit", "<Limit").replace("\"revolute\"", "\"Revolute\"");
    assert_eq!(load(&shouted, &ArmSettings::default()).model, sound);
    let default_namespace = OBLIQUE_ARM.replace("<robot ", "<robot xmlns=\"http://ros.org\" ");
    assert_eq!(load(&default_namespace, &ArmSettings::default()).model, sound);
}

#[test]
fn files_are_read_in_the_encodings_that_tools_write() {
    let text = format!("<!-- für den Arm -->\n{OBLIQUE_ARM}");
    let latin1: Vec<u8> = text.chars().map(|c| u8::try_from(c as u32).unwrap()).collect();
    assert_eq!(urdf::decode(&latin1), text);
    let mut utf16 = vec![0xFF, 0xFE];
    utf16.extend(text.encode_utf16().flat_map(u16::to_le_bytes));
    assert!(urdf::decode(&utf16).ends_with(&text));
    assert!(ArmModel::from_urdf(&urdf::decode(&utf16), "tool").is_ok());
}

/// A file cut out of a larger one hangs on a link that it does not bring along.
#[test]
fn the_link_a_part_hangs_on_is_the_world() {
    let text = OBLIQUE_ARM.replace(r#"<link name="ground"/>"#, "");
    let arm = load(&text, &ArmSettings::default());
    assert_eq!(arm.model, load(OBLIQUE_ARM, &ArmSettings::default()).model);
    assert!(notes(&arm).contains("\"ground\""), "{}", notes(&arm));
}

#[test]
fn a_payload_is_what_the_same_link_in_the_file_would_be() {
    let pan = r#"<link name="pan"><inertial><origin xyz="0 0 -0.01"/><mass value="0.5"/>
        <inertia ixx="0.002" ixy="0" ixz="0" iyy="0.003" iyz="0" izz="0.004"/></inertial></link>
        <joint name="p" type="fixed"><origin xyz="0.1 0.2 0.3" rpy="0.3 -0.4 0.5"/>
        <parent link="tool"/><child link="pan"/></joint></robot>"#;
    let text = OBLIQUE_ARM.replace("</robot>", pan);
    let in_file = ArmModel::from_urdf(&text, "pan").unwrap();
    let rotation = nalgebra::UnitQuaternion::from_euler_angles(0.3, -0.4, 0.5);
    let payload = Payload {
        X_TP: Isometry3::from_parts(Vector3::new(0.1, 0.2, 0.3).into(), rotation),
        mass: 0.5,
        p_cm: Vector3::new(0.0, 0.0, -0.01),
        I_cm: Matrix3::from_diagonal(&Vector3::new(0.002, 0.003, 0.004)),
    };
    let carried =
        load(OBLIQUE_ARM, &ArmSettings { payload: Some(payload), ..Default::default() }).model;
    let (a, b) = (in_file.bodies()[2], carried.bodies()[2]);
    assert!((a.mass - b.mass).abs() < 1e-12);
    assert!((a.p_BBcm - b.p_BBcm).amax() < 1e-12 && (a.I_BBcm - b.I_BBcm).amax() < 1e-12);
    let apart = in_file.tip_offset().inverse() * carried.tip_offset();
    assert!(apart.translation.vector.norm() < 1e-12 && apart.rotation.angle() < 1e-7);
}

#[test]
fn the_arm_of_a_robot_is_found_and_its_hand_is_not() {
    // A torso of one joint, two arms of three with hands of two fingers, a camera on the forearm.
    let mut text = String::from(r#"<robot name="r"><link name="base"/>"#);
    let mut joint = |name: &str, kind: &str, parent: &str| {
        text += &format!(
            r#"<link name="{name}_link"/><joint name="{name}" type="{kind}"><parent link="{parent}"/>
            <child link="{name}_link"/><limit lower="-1" upper="1" effort="1" velocity="1"/></joint>
            "#
        );
        format!("{name}_link")
    };
    let torso = joint("lift", "prismatic", "base");
    for side in ["left", "right"] {
        let mut parent = torso.clone();
        for part in ["shoulder", "elbow", "forearm", "wrist"] {
            parent = joint(&format!("{side}_{part}"), "revolute", &parent);
            if part == "elbow" {
                joint(&format!("{side}_camera"), "revolute", &parent);
            }
        }
        let flange = joint(&format!("{side}_flange"), "fixed", &parent);
        joint(&format!("{side}_optical"), "fixed", &flange);
        joint(&format!("{side}_thumb"), "revolute", &parent);
        joint(&format!("{side}_finger"), "revolute", &parent);
    }
    let chains = urdf::chains(&(text + "</robot>")).unwrap();
    assert_eq!(chains[0].joints, ["left_shoulder", "left_elbow", "left_forearm", "left_wrist"]);
    assert_eq!(chains[0].base.as_deref(), Some("lift_link"));
    assert_eq!(chains[0].tip, "left_flange_link");
    assert_eq!(chains[1].tip, "right_flange_link");
}
