//! `skillet arm check`: from a vendor's URDF to a configuration that works where it is pasted; and an
//! arm that cannot hold itself is refused before anything starts.

mod util;

use std::f64::consts::PI;
use std::fs;

use util::{Bench, stderr};

fn link(name: &str, mass: f64, x: f64) -> String {
    format!(
        "<link name='{name}'><visual/><inertial><origin xyz='{x} 0 0'/><mass value='{mass}'/>\
         <inertia ixx='0.001' ixy='0' ixz='0' iyy='0.004' iyz='0' izz='0.004'/></inertial></link>\n"
    )
}

fn joint(name: &str, kind: &str, parent: &str, child: &str, origin: &str, more: &str) -> String {
    format!(
        "<joint name='{name}' type='{kind}'><origin xyz='{origin}'/><parent link='{parent}'/>\
         <child link='{child}'/>{more}</joint>\n"
    )
}

/// A vendor's arm: six joints, one of them without stops, a gripper, no pan.
fn vendor_arm(effort: f64) -> String {
    let limits = |axis: &str| {
        format!(
            "<axis xyz='{axis}'/><limit lower='-2.8' upper='2.8' effort='{effort}' velocity='4'/>"
        )
    };
    let finger = "<axis xyz='0 1 0'/><limit lower='0' upper='0.04' effort='5' velocity='1'/>";
    [
        "<robot name='vendor'><link name='base'/>\n".to_string(),
        link("l1", 2.0, 0.0),
        link("l2", 1.0, 0.15),
        link("l3", 0.5, 0.05),
        link("l4", 0.3, 0.05),
        link("l5", 0.2, 0.02),
        link("l6", 0.1, 0.02),
        "<link name='flange'/>".to_string(),
        link("f1", 0.02, 0.0),
        link("f2", 0.02, 0.0),
        joint("yaw", "continuous", "base", "l1", "0 0 0.3", &limits("0 0 1")),
        joint("shoulder", "revolute", "l1", "l2", "0 0 0.1", &limits("0 1 0")),
        joint("elbow", "revolute", "l2", "l3", "0.3 0 0", &limits("0 1 0")),
        joint("forearm", "revolute", "l3", "l4", "0.15 0 0", &limits("1 0 0")),
        joint("wrist", "revolute", "l4", "l5", "0.15 0 0", &limits("0 1 0")),
        joint("roll", "revolute", "l5", "l6", "0.05 0 0", &limits("1 0 0")),
        joint("mount", "fixed", "l6", "flange", "0.05 0 0", ""),
        joint("left", "prismatic", "flange", "f1", "0 0.02 0", finger),
        joint("right", "prismatic", "flange", "f2", "0 -0.02 0", finger),
        "</robot>".to_string(),
    ]
    .concat()
}

fn check(bench: &Bench, arguments: &[&str], code: i32) -> serde_json::Value {
    let output = bench.run(&[&["arm", "check", "--json"], arguments].concat());
    assert_eq!(output.status.code(), Some(code), "{}", stderr(&output));
    serde_json::from_slice(&output.stdout).unwrap()
}

#[test]
fn a_vendors_arm_gets_a_configuration_that_works_where_it_is_pasted() {
    let bench = Bench::new();
    bench.write("arm.urdf", &vendor_arm(60.0));
    let checked = check(&bench, &["arm.urdf"], 0);
    assert_eq!(checked["tip"], "flange");
    assert_eq!(checked["joints"].as_array().unwrap().len(), 6);
    assert_eq!(checked["held"].as_array().unwrap().len(), 2, "{checked}");
    assert!(checked["holding_share_max"].as_f64().unwrap() < 0.6);
    let again = check(&bench, &["arm.urdf"], 0);
    assert_eq!(again, checked, "same arm, same posture");

    // What is printed is what --out writes, and what the other commands take.
    bench.ok(&["arm", "check", "arm.urdf", "--out", "my.toml"]);
    let written = fs::read_to_string(bench.path("my.toml")).unwrap();
    assert_eq!(checked["configuration"], written.as_str());
    assert!(bench.ok(&["arm", "check", "arm.urdf"]).contains(&written));
    bench.ok(&["config", "--config", "my.toml"]);
    bench.refused(&["arm", "check", "arm.urdf", "--out", "my.toml"], &["my.toml", "exists"]);

    let [x, y, z] = [0, 1, 2].map(|i| checked["start_m"][i].as_f64().unwrap());
    let rows: String = (0..60)
        .map(|i| {
            let (t, lift) = (f64::from(i) * 0.01, 0.02 * (f64::from(i) * PI / 59.0).sin().powi(2));
            format!("{t:.2},{x:.6},{y:.6},{:.6},0\n", z + lift)
        })
        .collect();
    bench.write("my_demo.csv", &format!("t_s,x_m,y_m,z_m,pitch_rad\n{rows}"));
    let output =
        bench.run(&["learn", "pancake", "--config", "my.toml", "--rollouts", "2", "--out", "s"]);
    let message = stderr(&output);
    assert_eq!(output.status.code(), Some(0), "{message}");
    let held = message.lines().filter(|line| line.contains("not on the chain and held")).count();
    assert_eq!(held, 1, "said once: {message}");
    assert!(message.contains("arm.urdf: line"), "{message}");
    let copied = fs::read_to_string(bench.path("s/session.toml")).unwrap();
    assert!(copied.contains("[plant.pan]") && copied.contains("mass_kg"), "{copied}");
}

#[test]
fn verdicts_have_their_exit_codes_and_name_everything_at_once() {
    let bench = Bench::new();
    let slide = "<joint name='elbow' type='prismatic'>";
    let arm = vendor_arm(60.0)
        .replace("<joint name='elbow' type='revolute'>", slide)
        .replace("<mass value='0.3'/>", "<mass value='-0.3'/>");
    bench.write("arm.urdf", &arm);
    let refused = check(&bench, &["arm.urdf", "--tip", "flange"], 1);
    let findings = refused["findings"].as_array().unwrap();
    assert_eq!(findings.len(), 2, "{refused}");
    for (finding, words) in findings.iter().zip([["l4", "-0.3"], ["elbow", "held"]]) {
        let text = finding["text"].as_str().unwrap();
        assert!(words.iter().all(|word| text.contains(word)), "{text}");
        let line = finding["line"].as_u64().unwrap() as usize;
        assert!(arm.lines().nth(line - 1).unwrap().contains(words[0]), "line {line}: {text}");
    }
    // The remedy it names.
    let held = ["arm.urdf", "--tip", "flange", "--hold", "elbow=0.1"];
    let text = arm.replace("<mass value='-0.3'/>", "<mass value='0.3'/>");
    bench.write("arm.urdf", &text);
    assert_eq!(check(&bench, &held, 0)["joints"].as_array().unwrap().len(), 5);

    bench.write("shape.urdf", "<robot name='r'><link name='a'/></robot>");
    assert_eq!(check(&bench, &["shape.urdf"], 1)["usable"], false);
    bench.refused(&["arm", "check", "absent.urdf"], &["absent.urdf", "check the path"]);
    bench.write("broken.urdf", "<robot>\n<link name='a'>\n</robot>");
    bench.refused(&["arm", "check", "broken.urdf"], &["broken.urdf", "line 3"]);
    bench.write("world.urdf", "<sdf version='1.6'/>");
    bench.refused(&["arm", "check", "world.urdf"], &["world.urdf", "SDF"]);
}

#[test]
fn a_reason_is_printed_once() {
    let bench = Bench::new();
    bench.write("arm.urdf", &vendor_arm(60.0).replace("lower='-2.8'", "lower='2.9'"));
    bench.write("my.toml", "[plant]\narm = \"arm.urdf\"\ntip = \"flange\"\n");
    let output = bench.run(&["learn", "pancake", "--config", "my.toml", "--out", "s"]);
    let message = stderr(&output);
    assert_eq!(output.status.code(), Some(2), "{message}");
    for joint in ["shoulder", "elbow", "wrist"] {
        assert_eq!(message.matches(&format!("joint \"{joint}\"")).count(), 1, "{message}");
    }
}

#[test]
fn an_arm_that_cannot_hold_itself_is_refused_before_anything_starts() {
    let bench = Bench::new();
    bench.write("arm.urdf", &vendor_arm(60.0));
    bench.ok(&["arm", "check", "arm.urdf", "--pan-kg", "0.5", "--out", "my.toml"]);
    bench.write("arm.urdf", &vendor_arm(1.0));
    let words = ["shoulder", "N·m", "its limit is 1 N·m", "plant.torque_limits_nm"];
    let learner = ["learner", "--cell", "weak", "--config", "my.toml", "--session", "s"];
    for arguments in [
        &["learn", "pancake", "--config", "my.toml", "--out", "s"][..],
        &["controller", "--cell", "weak", "--config", "my.toml"],
        &learner,
    ] {
        bench.refused(arguments, &words);
        assert!(!bench.path("s").exists());
    }
    // Standing upright it can balance a pan, but not move it.
    let balanced = check(&bench, &["arm.urdf", "--pan-kg", "3"], 0);
    assert!(balanced["demonstration_misfit"].is_string(), "{balanced}");
}

/// The WAM's own demonstration is too fast for it, and slowed down it is too long.
#[test]
fn an_arm_gets_the_demonstration_that_it_can_follow_and_learns_from_it() {
    let bench = Bench::new();
    bench.write("panda.urdf", include_str!("../robots/panda/panda_pan.urdf"));
    let checked = check(&bench, &["panda.urdf"], 0);
    assert!(checked["demonstration_misfit"].as_str().unwrap().contains("fit into an episode"));
    let name = checked["demonstration"].as_str().expect("one that comes with the tool");
    let said = bench.ok(&["arm", "check", "panda.urdf", "--out", "my.toml"]);
    let convert =
        ["demo", "convert", name, "--at-start", "--config", "my.toml", "--out", "my_demo.csv"];
    assert!(said.contains(&convert.join(" ")), "{said}");
    // There is no such folder here: the tool brings it along.
    bench.ok(&convert);
    bench.ok(&["config", "--check", "my.toml"]);
    bench.ok(&["learn", "pancake", "--config", "my.toml", "--rollouts", "2", "--out", "s"]);
    bench.refused(&["demo", "convert", "demos/none.csv", "--out", "d.csv"], &["demos/none.csv"]);
}

/// The start is easy, the demonstration leads where the arm cannot be held.
#[test]
fn a_demonstration_that_cannot_be_held_is_refused_with_its_place() {
    let bench = Bench::new();
    let wam = include_str!("../robots/wam7/wam7_pan.urdf");
    bench.write("arm.urdf", wam);
    let rows: String = (0..60)
        .map(|i| {
            format!("{:.2},{:.5},0,0.72,0\n", f64::from(i) * 0.01, 0.78 + 0.002 * f64::from(i))
        })
        .collect();
    bench.write("demo.csv", &format!("t_s,x_m,y_m,z_m,pitch_rad\n{rows}"));
    let limits = "torque_limits_nm = [150, 16.5, 40, 60, 5, 5, 2]";
    let task = "[task]\ndemonstration = \"demo.csv\"\n[plant]\narm = \"arm.urdf\"\n";
    bench.write("my.toml", &format!("{task}{limits}\n"));
    bench.refused(
        &["learn", "pancake", "--config", "my.toml", "--out", "s"],
        &["demo.csv", "cannot be held at t = 0.", "j2_shoulder_pitch", "16.5 N·m"],
    );
}
