//! The URDF files in `robots/wam7` are what the example writes, and both describe the WAM.

mod common;

// The example's main is not called here.
#[allow(dead_code)]
#[path = "../examples/write_wam_urdf.rs"]
mod write_wam_urdf;

use common::wam;

#[test]
fn files_are_what_the_example_writes() {
    for (name, expected) in write_wam_urdf::urdf_files().unwrap() {
        let path = write_wam_urdf::robot_directory().join(name);
        let found = std::fs::read_to_string(&path).unwrap();
        assert!(
            found == expected,
            "{} is out of date: cargo run -p physics --example write_wam_urdf",
            path.display()
        );
    }
}

#[test]
fn pan_adds_half_a_kilogram_to_the_last_body() {
    let (bare, with_pan) = (wam("wam7.urdf", "pan"), wam("wam7_pan.urdf", "pan"));
    assert_eq!(with_pan.n_joints(), 7);
    assert_eq!(with_pan.joint_names()[3], "j4_elbow_pitch");
    assert_eq!(with_pan.limits().tau_max.as_slice(), [150.0, 125.0, 40.0, 60.0, 5.0, 5.0, 2.0]);
    assert_eq!(with_pan.tip_offset(), bare.tip_offset());
    let added = with_pan.bodies()[6].mass - bare.bodies()[6].mass;
    assert!((added - 0.5).abs() < 1e-15);
}
