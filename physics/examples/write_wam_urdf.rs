//! Writes the URDF files of the Barrett WAM, bare, with the frying pan and with the cup, from the numbers in
//! `tests/vectors/wam_parameters.json`.
//!
//! ```text
//! cargo run -p physics --example write_wam_urdf
//! ```

// Monogram notation.
#![allow(non_snake_case)]

use std::fmt::Write as _;
use std::path::{Path, PathBuf};

use nalgebra::{Matrix3, Rotation3};
use serde_json::Value;

fn main() -> Result<(), Box<dyn std::error::Error>> {
    for (name, text) in urdf_files()? {
        let path = robot_directory().join(name);
        std::fs::write(&path, text)?;
        println!("wrote {}", path.display());
    }
    Ok(())
}

/// Where the files live.
pub fn robot_directory() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../robots/wam7")
}

/// Name and content of the files.
pub fn urdf_files() -> Result<[(&'static str, String); 3], Box<dyn std::error::Error>> {
    let vectors = Path::new(env!("CARGO_MANIFEST_DIR")).join("../tests/vectors");
    let path = vectors.join("wam_parameters.json");
    let parameters: Value = serde_json::from_str(&std::fs::read_to_string(path)?)?;
    let text = |load: &str, tool: &str, with_mass: bool| urdf(&parameters, load, tool, with_mass);
    Ok([
        ("wam7.urdf", text("; the pan link has no mass", "pan", false)),
        ("wam7_pan.urdf", text(" with a frying pan", "pan", true)),
        ("wam7_cup.urdf", text(" with a cup", "cup", true)),
    ])
}

fn urdf(parameters: &Value, load: &str, tool: &str, with_mass: bool) -> String {
    let mut out = String::new();
    writeln!(out, "<?xml version=\"1.0\"?>").unwrap();
    writeln!(out, "<!-- Barrett WAM, 7 joints{load}. SI units. Sources: SOURCES.md.").unwrap();
    writeln!(out, "     Written by physics/examples/write_wam_urdf.rs; do not edit. -->").unwrap();
    writeln!(out, "<robot name=\"wam7\">\n  <link name=\"base\"/>").unwrap();

    let joints = parameters["joints"].as_array().expect("\"joints\" is a list");
    // Link i+1 sits at the end of joint i's Denavit-Hartenberg transform. From there come the
    // origins, because the alphas have every digit of π/2.
    let mut origin_xyz = vector(&parameters["joints"][0]["origin_xyz"]);
    let mut origin_rpy = [0.0; 3];
    for (i, joint) in joints.iter().enumerate() {
        let body = &joint["link"];
        write_link(
            &mut out,
            &format!("link{}", i + 1),
            number(&body["mass"]),
            vector(&body["com_in_joint_frame"]),
            matrix(&body["inertia_about_com_in_joint_frame_axes_rowmajor"]),
        );
        let parent = if i == 0 { "base".into() } else { format!("link{i}") };
        write_origin(&mut out, &joint["name"], "revolute", &parent, origin_xyz, origin_rpy);
        writeln!(out, "    <child link=\"link{}\"/>", i + 1).unwrap();
        let [x, y, z] = vector(&joint["axis"]);
        writeln!(out, "    <axis xyz=\"{x} {y} {z}\"/>").unwrap();
        let limit = |key: &str| number(&joint[key]);
        writeln!(
            out,
            "    <limit lower=\"{}\" upper=\"{}\" effort=\"{}\" velocity=\"{}\"/>\n  </joint>",
            limit("q_min"),
            limit("q_max"),
            limit("torque_limit_default"),
            limit("velocity_limit_derived"),
        )
        .unwrap();
        let dh = |key: &str| number(&joint["dh"][key]);
        origin_xyz = [dh("a"), 0.0, dh("d")];
        origin_rpy = [dh("alpha"), 0.0, 0.0];
    }
    let last_link = format!("link{}", joints.len());
    writeln!(out, "  <link name=\"flange\"/>").unwrap();
    write_origin(&mut out, &"flange_fixed".into(), "fixed", &last_link, origin_xyz, origin_rpy);
    writeln!(out, "    <child link=\"flange\"/>\n  </joint>").unwrap();
    write_tool(&mut out, tool, &parameters[tool], with_mass);
    writeln!(out, "</robot>").unwrap();
    out
}

/// What the arm carries: its frame in the flange and, with a mass, its inertia.
fn write_tool(out: &mut String, name: &str, tool: &Value, with_mass: bool) {
    let of = |key: String| &tool[key.as_str()];
    if with_mass {
        let inertia = matrix(of(format!("inertia_about_com_{name}_axes_rowmajor")));
        let centre = vector(of(format!("com_in_{name}_frame")));
        write_link(out, name, number(&tool["mass"]), centre, inertia);
    } else {
        writeln!(out, "  <link name=\"{name}\"/>").unwrap();
    }
    let R_FP = matrix(of(format!("{name}_frame_R_in_flange_rowmajor")));
    let (roll, pitch, yaw) = Rotation3::from_matrix_unchecked(R_FP).euler_angles();
    let xyz = vector(of(format!("{name}_frame_origin_in_flange")));
    let joint = format!("{name}_fixed").into();
    write_origin(out, &joint, "fixed", "flange", xyz, [roll + 0.0, pitch, yaw]);
    writeln!(out, "    <child link=\"{name}\"/>\n  </joint>").unwrap();
}

fn write_link(out: &mut String, name: &str, mass: f64, [x, y, z]: [f64; 3], I_cm: Matrix3<f64>) {
    writeln!(out, "  <link name=\"{name}\">\n    <inertial>").unwrap();
    writeln!(out, "      <origin xyz=\"{x} {y} {z}\" rpy=\"0 0 0\"/>").unwrap();
    writeln!(out, "      <mass value=\"{mass}\"/>").unwrap();
    writeln!(
        out,
        "      <inertia ixx=\"{}\" ixy=\"{}\" ixz=\"{}\" iyy=\"{}\" iyz=\"{}\" izz=\"{}\"/>",
        I_cm[(0, 0)],
        I_cm[(0, 1)],
        I_cm[(0, 2)],
        I_cm[(1, 1)],
        I_cm[(1, 2)],
        I_cm[(2, 2)],
    )
    .unwrap();
    writeln!(out, "    </inertial>\n  </link>").unwrap();
}

fn write_origin(
    out: &mut String,
    joint: &Value,
    kind: &str,
    parent: &str,
    [x, y, z]: [f64; 3],
    [roll, pitch, yaw]: [f64; 3],
) {
    let name = joint.as_str().expect("a joint name is text");
    writeln!(out, "  <joint name=\"{name}\" type=\"{kind}\">").unwrap();
    writeln!(out, "    <origin xyz=\"{x} {y} {z}\" rpy=\"{roll} {pitch} {yaw}\"/>").unwrap();
    writeln!(out, "    <parent link=\"{parent}\"/>").unwrap();
}

fn number(value: &Value) -> f64 {
    value.as_f64().expect("a number in wam_parameters.json")
}

fn vector(value: &Value) -> [f64; 3] {
    [number(&value[0]), number(&value[1]), number(&value[2])]
}

fn matrix(value: &Value) -> Matrix3<f64> {
    let numbers: Vec<f64> =
        value.as_array().expect("nine numbers, row by row").iter().map(number).collect();
    Matrix3::from_row_slice(&numbers)
}
