//! Every way a URDF can fail to be an arm is refused with a message that names the culprit and its
//! line; all that is wrong is named at once.

mod common;

use common::OBLIQUE_ARM;
use physics::arm::{ArmModel, ArmSettings, UrdfError, UrdfFault, UrdfFileError};

/// Replaces `from` by `to` in a sound URDF and returns what loading it to `tool` says.
fn refusal(from: &str, to: &str) -> UrdfError {
    assert!(OBLIQUE_ARM.contains(from), "the test no longer changes anything");
    let error = ArmModel::from_urdf(&OBLIQUE_ARM.replace(from, to), "tool").unwrap_err();
    println!("{error}");
    error
}

/// [`refusal`] for one reason.
fn refused(from: &str, to: &str) -> UrdfFault {
    fault(refusal(from, to))
}

fn fault(error: UrdfError) -> UrdfFault {
    assert_eq!(error.findings.len(), 1, "{error}");
    error.findings[0].fault.clone()
}

fn assert_names(error: &impl ToString, name: &str) {
    let text = error.to_string();
    assert!(text.contains(name), "\"{text}\" does not name {name}");
}

#[test]
fn sound_urdf_loads() {
    ArmModel::from_urdf(OBLIQUE_ARM, "tool").unwrap();
}

#[test]
fn refuses_text_that_is_not_xml() {
    let error = ArmModel::from_urdf("no robot", "tool").unwrap_err();
    assert!(matches!(fault(error), UrdfFault::Xml(_)));
}

#[test]
fn refuses_unknown_tip_and_lists_links() {
    let error = fault(ArmModel::from_urdf(OBLIQUE_ARM, "hand").unwrap_err());
    assert!(matches!(error, UrdfFault::NoSuchLink { .. }));
    assert_names(&error, "ground, stand, one, two, camera, three, tool, blade");
}

#[test]
fn refuses_duplicate_link() {
    let error = refused(r#"<link name="tool"/>"#, r#"<link name="tool"/><link name="tool"/>"#);
    assert!(matches!(error, UrdfFault::DuplicateName(name) if name == "tool"));
}

#[test]
fn refuses_joint_to_unknown_link() {
    let error = refused(r#"<child link="camera"/>"#, r#"<child link="lens"/>"#);
    assert!(matches!(&error, UrdfFault::UnknownLink { link, .. } if link == "lens"));
    assert_names(&error, "camera_fixed");
}

#[test]
fn refuses_second_parent() {
    let error = refused(r#"<child link="camera"/>"#, r#"<child link="tool"/>"#);
    assert!(matches!(error, UrdfFault::NotATree(_)));
    assert_names(&error, "tool");
}

#[test]
fn refuses_second_root() {
    let error = refused("</robot>", r#"<link name="island"/></robot>"#);
    assert!(matches!(error, UrdfFault::NotATree(_)));
    assert_names(&error, "island");
}

#[test]
fn refuses_loop() {
    let ring = r#"<link name="x"/><link name="y"/>
        <joint name="xy" type="fixed"><parent link="x"/><child link="y"/></joint>
        <joint name="yx" type="fixed"><parent link="y"/><child link="x"/></joint></robot>"#;
    assert!(matches!(refused("</robot>", ring), UrdfFault::NotATree(_)));
    let text = OBLIQUE_ARM.replace("</robot>", ring);
    let error = fault(ArmModel::from_urdf(&text, "x").unwrap_err());
    assert!(matches!(error, UrdfFault::NotATree(_)));
}

#[test]
fn refuses_prismatic_joint_on_chain() {
    let error = refused(r#"name="b" type="revolute""#, r#"name="b" type="prismatic""#);
    assert!(matches!(&error, UrdfFault::UnsupportedJoint { joint, .. } if joint == "b"));
    assert_names(&error, "prismatic");
}

#[test]
fn refuses_mimic_joint_on_chain() {
    let error = refused(r#"<child link="two"/>"#, r#"<child link="two"/><mimic joint="a"/>"#);
    assert_names(&error, "mimic");
}

#[test]
fn refuses_tip_that_does_not_move() {
    let text = r#"<robot name="stand"><link name="ground"/></robot>"#;
    let error = fault(ArmModel::from_urdf(text, "ground").unwrap_err());
    assert!(matches!(error, UrdfFault::NoMovingJoint(_)));
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
    let error = fault(ArmModel::from_urdf(&text, "l8").unwrap_err());
    assert!(matches!(&error, UrdfFault::TooManyJoints { n: 8, .. }));
    assert_names(&error, "base = \"l1\"");
    let settings = ArmSettings { base: Some("l1".into()), ..Default::default() };
    assert_eq!(ArmModel::load(&text, "l8", &settings).unwrap().model.n_joints(), 7);
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
fn refuses_moving_shape_without_inertia() {
    let start = OBLIQUE_ARM.find(r#"<link name="one">"#).unwrap();
    let end = start + OBLIQUE_ARM[start..].find("</link>").unwrap();
    let shape = r#"<link name="one"><visual><geometry><sphere radius="0.1"/></geometry></visual>"#;
    let error = refused(&OBLIQUE_ARM[start..end], shape);
    assert!(matches!(error, UrdfFault::NoInertia { link, .. } if link == "one"));
}

#[test]
fn refuses_arm_whose_dynamics_are_not_given_with_one_reason() {
    let mut text = OBLIQUE_ARM.to_string();
    while let (Some(start), Some(end)) = (text.find("<inertial>"), text.find("</inertial>")) {
        text.replace_range(start..end + "</inertial>".len(), "<visual/>");
    }
    let error = fault(ArmModel::from_urdf(&text, "tool").unwrap_err());
    assert!(matches!(error, UrdfFault::NoDynamics { .. }));
    assert_names(&error, "one, two, three");
}

/// Nothing resists the last joint: its body is a point on its axis.
#[test]
fn refuses_joint_that_moves_no_inertia() {
    let text = r#"<robot name="r"><link name="base"/>
      <link name="l1"><inertial><mass value="1"/>
        <inertia ixx="1" ixy="0" ixz="0" iyy="1" iyz="0" izz="1"/></inertial></link>
      <link name="l2"/>
      <joint name="j1" type="revolute"><parent link="base"/><child link="l1"/>
        <axis xyz="0 1 0"/><limit lower="-1" upper="1" effort="1" velocity="1"/></joint>
      <joint name="j2" type="revolute"><parent link="l1"/><child link="l2"/>
        <axis xyz="0 0 1"/><limit lower="-1" upper="1" effort="1" velocity="1"/></joint></robot>"#;
    let error = fault(ArmModel::from_urdf(text, "l2").unwrap_err());
    assert!(matches!(&error, UrdfFault::NoInertia { link, .. } if link == "l2"), "{error}");
}

#[test]
fn refuses_non_positive_mass() {
    for mass in ["0", "-2"] {
        let error = refused(r#"<mass value="2"/>"#, &format!(r#"<mass value="{mass}"/>"#));
        assert!(matches!(&error, UrdfFault::NonPositiveMass { link, .. } if link == "one"));
    }
}

#[test]
fn refuses_indefinite_inertia() {
    let error = refused(r#"ixx="0.002""#, r#"ixx="-0.002""#);
    assert!(matches!(&error, UrdfFault::ImpossibleInertia { link, .. } if link == "three"));
}

#[test]
fn refuses_inertia_that_violates_the_triangle_inequality() {
    let error = refused(r#"ixx="0.002""#, r#"ixx="0.008""#);
    assert!(matches!(&error, UrdfFault::ImpossibleInertia { link, .. } if link == "three"));
}

#[test]
fn refuses_axis_without_direction() {
    let error = refused(r#"<axis xyz="1 0 0"/>"#, r#"<axis xyz="0 0 0"/>"#);
    assert!(matches!(error, UrdfFault::InvalidAxis(joint) if joint == "b"));
}

#[test]
fn refuses_missing_or_senseless_position_limits() {
    let limit = r#"<limit lower="-2" upper="2" effort="30" velocity="5"/>"#;
    for wrong in [
        "",
        r#"<limit effort="30" velocity="5"/>"#,
        r#"<limit lower="2" upper="2" effort="30" velocity="5"/>"#,
        r#"<limit lower="2" upper="-2" effort="30" velocity="5"/>"#,
        r#"<limit lower="-2" upper="inf" effort="30" velocity="5"/>"#,
        r#"<limit lower="-2" upper="2" effort="nan" velocity="5"/>"#,
    ] {
        let error = refused(limit, wrong);
        assert!(matches!(&error, UrdfFault::InvalidLimit { joint, .. } if joint == "b"), "{wrong}");
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
        assert!(matches!(error, UrdfFault::NotFinite(_)));
        assert_names(&error, name);
    }
}

#[test]
fn missing_file_is_named() {
    let error = ArmModel::from_urdf_file("no/such.urdf", "pan").unwrap_err();
    assert!(matches!(error, UrdfFileError::Read { .. }));
    assert!(error.to_string().contains("no/such.urdf"));
}

#[test]
fn all_faults_are_named_at_once_each_with_its_line() {
    let text = OBLIQUE_ARM
        .replace(r#"name="b" type="revolute""#, r#"name="b" type="prismatic""#)
        .replace(r#"<mass value="2"/>"#, r#"<mass value="-2"/>"#)
        .replace(r#"lower="-2" upper="2" effort="10""#, r#"lower="2" upper="-2" effort="10""#);
    let error = ArmModel::from_urdf(&text, "tool").unwrap_err();
    println!("{error}");
    assert_eq!(error.findings.len(), 3, "{error}");
    for (finding, part) in error.findings.iter().zip([
        r#"<mass value="-2"/>"#,
        r#"name="b" type="prismatic""#,
        r#"lower="2" upper="-2""#,
    ]) {
        let line = finding.line.unwrap() as usize;
        // An element is found where it begins; its attributes may follow on the next line.
        let near = text.lines().skip(line - 1).take(2).collect::<Vec<_>>().join("\n");
        assert!(near.contains(part), "line {line} is not where {part} is");
    }
}

#[test]
fn unreadable_numbers_are_named_at_once() {
    let text = OBLIQUE_ARM
        .replace(r#"<mass value="2"/>"#, r#"<mass value="2,5"/>"#)
        .replace(r#"xyz="0 0.25 0""#, r#"xyz="0 0.25""#)
        .replace(r#"<axis xyz="1 0 0"/>"#, r#"<axis xyz="x"/>"#);
    let error = ArmModel::from_urdf(&text, "tool").unwrap_err();
    assert_eq!(error.findings.len(), 3, "{error}");
    for part in ["2,5", "0 0.25", "three numbers", "\"b\""] {
        assert_names(&error, part);
    }
}

#[test]
fn other_formats_are_named() {
    for (text, word) in [
        (r#"<sdf version="1.6"><model name="m"/></sdf>"#, "SDF"),
        ("<mujoco/>", "MJCF"),
        ("<html/>", "<html>"),
        (
            r#"<robot xmlns:xacro="http://www.ros.org/wiki/xacro"><xacro:include filename="a"/></robot>"#,
            "xacro",
        ),
        (
            r#"<robot><link name="a"/><link name="b"/><joint name="j" type="fixed"><parent link="a"/>
            <child link="b"/><origin xyz="${x} 0 0" rpy="0 0 ${pi/2}"/></joint></robot>"#,
            "xacro",
        ),
        (r#"<robot name="empty"/>"#, "<link>"),
    ] {
        let error = fault(ArmModel::from_urdf(text, "pan").unwrap_err());
        assert_names(&error, word);
    }
}

#[test]
fn held_joints_must_exist_move_and_stay_within_limits() {
    let with_held = |name: &str, position: f64| {
        let held = [(name.to_string(), position)].into();
        let settings = ArmSettings { held, ..Default::default() };
        fault(ArmModel::load(OBLIQUE_ARM, "tool", &settings).unwrap_err())
    };
    assert_names(&with_held("elbow", 0.0), "elbow");
    assert_names(&with_held("mount", 0.0), "is fixed");
    assert_names(&with_held("b", 3.0), "-2..=2");
    assert_names(&with_held("b", f64::NAN), "finite");
}

#[test]
fn limits_of_the_configuration_are_one_a_joint_and_above_zero() {
    let with_limits = |torque_limits: Vec<f64>| {
        let settings = ArmSettings { torque_limits, ..Default::default() };
        fault(ArmModel::load(OBLIQUE_ARM, "tool", &settings).unwrap_err())
    };
    assert_names(&with_limits(vec![1.0]), "torque_limits_nm has 1 numbers");
    assert_names(&with_limits(vec![1.0, 0.0, 1.0]), "\"b\"");
}
