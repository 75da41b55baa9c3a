//! What an arm looks like: capsules that follow from its URDF and move with its links.

// Monogram notation.
#![allow(non_snake_case)]

mod common;

use common::OBLIQUE_ARM;
use nalgebra::Vector3;
use physics::arm::{ArmModel, ArmSettings, JointVector, LoadedArm, kinematics};

fn load(text: &str) -> LoadedArm {
    ArmModel::load(text, "tool", &ArmSettings::default()).unwrap_or_else(|error| panic!("{error}"))
}

fn posture() -> JointVector {
    JointVector::from_fn(|i, _| [0.7, -0.4, 1.1, 0.0, 0.0, 0.0, 0.0][i])
}

#[test]
fn links_without_shapes_run_from_joint_to_joint() {
    let arm = load(OBLIQUE_ARM);
    assert!(!arm.appearance.has_shapes);
    let placed = arm.appearance.placed(&arm.model, &posture());
    let frames = kinematics::body_poses(&arm.model, &posture());
    // From the second joint to the third, and from the third to the tool; the camera is beside them.
    let joins = |a: Vector3<f64>, b: Vector3<f64>| {
        placed.iter().any(|[from, to]| (from - a).norm() < 1e-9 && (to - b).norm() < 1e-9)
    };
    let at = |i: usize| frames[i].translation.vector;
    assert!(joins(at(0), at(1)) && joins(at(1), at(2)), "{placed:?}");
    let tip = kinematics::tip_pose(&arm.model, &posture()).translation.vector;
    assert!(joins(at(2), tip), "{placed:?}");
    // I = ½ m r² of the thickest that is allowed, and none thicker than the one before it.
    let radii: Vec<f64> = arm.appearance.capsules.iter().map(|capsule| capsule.radius).collect();
    assert!(radii.iter().all(|radius| (0.01..=0.08).contains(radius)), "{radii:?}");
}

#[test]
fn shapes_of_the_file_are_drawn_and_meshes_and_nonsense_are_not() {
    let shaped = |geometry: &str| {
        let visual = format!(
            "<link name=\"three\"><visual><origin xyz=\"0.1 0 0\" rpy=\"0 1.5707963267948966 0\"/>\
             <geometry>{geometry}</geometry></visual>"
        );
        load(&OBLIQUE_ARM.replace("<link name=\"three\">", &visual)).appearance.capsules
    };
    let cylinder = shaped("<cylinder radius=\"0.03\" length=\"0.2\"/>");
    let found = cylinder.iter().find(|capsule| capsule.radius == 0.03).expect("the cylinder");
    let [a, b] = found.ends;
    // Its round ends reach as far as its flat ones.
    assert!(((a - b).norm() - 0.14).abs() < 1e-9, "{found:?}");
    let ball = shaped("<sphere radius=\"0.05\"/>");
    assert!(
        ball.iter().any(|capsule| capsule.radius == 0.05 && capsule.ends[0] == capsule.ends[1])
    );
    let bar = shaped("<box size=\"0.3 0.04 0.06\"/>");
    let found = bar.iter().find(|capsule| (capsule.radius - 0.025).abs() < 1e-12).expect("the box");
    assert!(((found.ends[0] - found.ends[1]).norm() - 0.25).abs() < 1e-9);
    let plain = load(OBLIQUE_ARM).appearance.capsules;
    for other in ["<mesh filename=\"three.stl\"/>", "<cylinder radius=\"${r}\" length=\"1\"/>", ""]
    {
        assert_eq!(shaped(other), plain, "{other}");
    }
}
