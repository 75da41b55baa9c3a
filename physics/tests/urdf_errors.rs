//! Every way a URDF can fail to be an arm is refused with a message that names the culprit.

mod common;

use common::OBLIQUE_ARM;
use physics::arm::{ArmModel, UrdfError, UrdfFileError};

/// Replaces `from` by `to` in a sound URDF and returns what loading it to `tool` says.
fn refused(from: &str, to: &str) -> UrdfError {
    assert!(OBLIQUE_ARM.contains(from), "the test no longer changes anything");
    let error = ArmModel::from_urdf(&OBLIQUE_ARM.replace(from, to), "tool").unwrap_err();
    println!("{error}");
    error
}

fn assert_names(error: &UrdfError, name: &str) {
    assert!(error.to_string().contains(name), "\"{error}\" does not name {name}");
}

#[test]
fn sound_urdf_loads() {
    ArmModel::from_urdf(OBLIQUE_ARM, "tool").unwrap();
}

#[test]
fn refuses_text_that_is_not_xml() {
    assert!(matches!(ArmModel::from_urdf("no robot", "tool"), Err(UrdfError::Parse(_))));
}

#[test]
fn refuses_limit_without_velocity() {
    assert!(matches!(refused(r#"effort="50" velocity="5""#, ""), UrdfError::Parse(_)));
}

#[test]
fn refuses_unknown_tip_and_lists_links() {
    let error = ArmModel::from_urdf(OBLIQUE_ARM, "hand").unwrap_err();
    assert!(matches!(error, UrdfError::UnknownTip { .. }));
    assert_names(&error, "ground, stand, one, two, camera, three, tool, blade");
}

#[test]
fn refuses_duplicate_link() {
    let error = refused(r#"<link name="tool"/>"#, r#"<link name="tool"/><link name="tool"/>"#);
    assert!(matches!(error, UrdfError::DuplicateName(name) if name == "tool"));
}

#[test]
fn refuses_joint_to_unknown_link() {
    let error = refused(r#"<child link="camera"/>"#, r#"<child link="lens"/>"#);
    assert!(matches!(&error, UrdfError::UnknownLink { link, .. } if link == "lens"));
    assert_names(&error, "camera_fixed");
}

#[test]
fn refuses_second_parent() {
    let error = refused(r#"<child link="camera"/>"#, r#"<child link="tool"/>"#);
    assert!(matches!(error, UrdfError::NotATree(_)));
    assert_names(&error, "tool");
}

#[test]
fn refuses_second_root() {
    let error = refused("</robot>", r#"<link name="island"/></robot>"#);
    assert!(matches!(error, UrdfError::NotATree(_)));
    assert_names(&error, "island");
}

#[test]
fn refuses_loop() {
    let ring = r#"<link name="x"/><link name="y"/>
        <joint name="xy" type="fixed"><parent link="x"/><child link="y"/></joint>
        <joint name="yx" type="fixed"><parent link="y"/><child link="x"/></joint></robot>"#;
    assert!(matches!(refused("</robot>", ring), UrdfError::NotATree(_)));
    let text = OBLIQUE_ARM.replace("</robot>", ring);
    assert!(matches!(ArmModel::from_urdf(&text, "x"), Err(UrdfError::NotATree(_))));
}

#[test]
fn refuses_prismatic_joint_on_chain() {
    let error = refused(r#"name="b" type="revolute""#, r#"name="b" type="prismatic""#);
    assert!(matches!(&error, UrdfError::UnsupportedJoint { joint, .. } if joint == "b"));
    assert_names(&error, "prismatic");
}

#[test]
fn refuses_continuous_joint_on_chain() {
    let error = refused(r#"name="b" type="revolute""#, r#"name="b" type="continuous""#);
    assert_names(&error, "continuous");
}

#[test]
fn refuses_mimic_joint_on_chain() {
    let error = refused(r#"<child link="two"/>"#, r#"<child link="two"/><mimic joint="a"/>"#);
    assert_names(&error, "mimic");
}

#[test]
fn refuses_moving_joint_beside_chain() {
    let error =
        refused(r#"name="camera_fixed" type="fixed""#, r#"name="camera_fixed" type="prismatic""#);
    assert!(matches!(&error, UrdfError::MovingJointOffChain { .. }));
    assert_names(&error, "camera_fixed");
}

#[test]
fn refuses_tip_that_does_not_move() {
    let text = r#"<robot name="stand"><link name="ground"/></robot>"#;
    assert!(matches!(ArmModel::from_urdf(text, "ground"), Err(UrdfError::NoMovingJoint(_))));
}

#[test]
fn refuses_eight_joints() {
    let mut text = String::from(r#"<robot name="snake"><link name="l0"/>"#);
    for i in 1..=8 {
        text += &format!(
            r#"<link name="l{i}"><inertial><mass value="1"/>
               <inertia ixx="1" ixy="0" ixz="0" iyy="1" iyz="0" izz="1"/></inertial></link>
               <joint name="j{i}" type="revolute"><parent link="l{}"/><child link="l{i}"/>
               <limit lower="-1" upper="1" effort="1" velocity="1"/></joint>"#,
            i - 1
        );
    }
    text += "</robot>";
    assert!(matches!(ArmModel::from_urdf(&text, "l8"), Err(UrdfError::TooManyJoints(8))));
    assert_eq!(
        ArmModel::from_urdf(
            &text.replace("name=\"j8\" type=\"revolute\"", "name=\"j8\" type=\"fixed\""),
            "l8"
        )
        .unwrap()
        .n_joints(),
        7
    );
}

#[test]
fn refuses_moving_link_without_inertia() {
    let start = OBLIQUE_ARM.find(r#"<link name="one">"#).unwrap();
    let end = start + OBLIQUE_ARM[start..].find("</link>").unwrap();
    let error = refused(&OBLIQUE_ARM[start..end], r#"<link name="one">"#);
    assert!(matches!(error, UrdfError::NoInertia(link) if link == "one"));
}

#[test]
fn refuses_non_positive_mass() {
    for mass in ["0", "-2"] {
        let error = refused(r#"<mass value="2"/>"#, &format!(r#"<mass value="{mass}"/>"#));
        assert!(matches!(&error, UrdfError::NonPositiveMass { link, .. } if link == "one"));
    }
}

#[test]
fn refuses_indefinite_inertia() {
    let error = refused(r#"ixx="0.002""#, r#"ixx="-0.002""#);
    assert!(matches!(&error, UrdfError::ImpossibleInertia { link, .. } if link == "three"));
}

#[test]
fn refuses_inertia_that_violates_the_triangle_inequality() {
    let error = refused(r#"ixx="0.002""#, r#"ixx="0.008""#);
    assert!(matches!(&error, UrdfError::ImpossibleInertia { link, .. } if link == "three"));
}

#[test]
fn refuses_axis_without_direction() {
    let error = refused(r#"<axis xyz="1 0 0"/>"#, r#"<axis xyz="0 0 0"/>"#);
    assert!(matches!(error, UrdfError::InvalidAxis(joint) if joint == "b"));
}

#[test]
fn refuses_missing_or_senseless_limits() {
    let limit = r#"<limit lower="-2" upper="2" effort="30" velocity="5"/>"#;
    for wrong in [
        "",
        r#"<limit lower="2" upper="2" effort="30" velocity="5"/>"#,
        r#"<limit lower="-2" upper="inf" effort="30" velocity="5"/>"#,
        r#"<limit lower="-2" upper="2" velocity="5"/>"#,
        r#"<limit lower="-2" upper="2" effort="30" velocity="0"/>"#,
    ] {
        let error = refused(limit, wrong);
        assert!(matches!(&error, UrdfError::InvalidLimit { joint, .. } if joint == "b"), "{wrong}");
    }
}

#[test]
fn refuses_numbers_that_are_not_finite() {
    for (from, to, name) in [
        (r#"<mass value="2"/>"#, r#"<mass value="NaN"/>"#, "one"),
        (r#"xyz="0 0 0.1""#, r#"xyz="0 0 inf""#, "\"a\""),
        (r#"xyz="0.02 0.03 0.04""#, r#"xyz="0.02 NaN 0.04""#, "blade"),
    ] {
        let error = refused(from, to);
        assert!(matches!(error, UrdfError::NotFinite(_)));
        assert_names(&error, name);
    }
}

#[test]
fn missing_file_is_named() {
    let error = ArmModel::from_urdf_file("no/such.urdf", "pan").unwrap_err();
    assert!(matches!(error, UrdfFileError::Read { .. }));
    assert!(error.to_string().contains("no/such.urdf"));
}
