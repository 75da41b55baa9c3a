//! A recording that turns all the way around is imported, learnt, followed, resumed, replayed and reported.
//!
//! A UR10e with its flange down turns the tool about the vertical by its last joint, which moves within ±2π.

mod util;

use std::f64::consts::TAU;

use learner::Demonstration;
use learner::orientation::Orientation;
use nalgebra::{UnitQuaternion, Vector3};
use util::Bench;

const URDF: &str = include_str!("../robots/ur10e/ur10e_pan.urdf");
/// Where the pan is mounted, and where the tool is mounted here: on the axis of the last joint, facing up.
const MOUNTED: &str =
    r#"xyz="0 0.271892 0.126785" rpy="3.141592653589793 -0.43633231 1.5707963267948966""#;
const ON_AXIS: &str = r#"xyz="0 0 0.05" rpy="3.141592653589793 0 0""#;
const DURATION_S: f64 = 3.3;

/// `settings` of the learner for an arm that starts turned by more than a rotation vector should be.
fn configuration(settings: &str) -> String {
    format!(
        "[task]\nname = \"custom\"\ndemonstration = \"turn.csv\"\n[controller]\nsettle_s = 0.6\n\
         [plant]\narm = \"arm.urdf\"\ntip = \"pan\"\n\
         start_posture_rad = [0.0, -1.570796, 1.570796, -1.570796, -1.570796, 2.4]\n\
         [learner]\ntask_dim = 6\nn_components = 12\n{settings}\
         [learner.exploration]\nrotation_amplitude = 0.03\n"
    )
}

/// A turn about the vertical by 2π with a way of 5 cm, as a tracker elsewhere saw it: quaternions of either sign.
fn recording() -> String {
    let row = |k: usize| {
        let u = k as f64 / 180.0;
        let rise = u * u * (3.0 - 2.0 * u);
        let (sin, cos) = (0.5 * TAU * rise).sin_cos();
        let sign = if k % 7 < 3 { -1.0 } else { 1.0 };
        format!("{:.6},{:.6},0,1,{},0,0,{}\n", DURATION_S * u, 0.05 * rise, sign * cos, sign * sin)
    };
    format!("t_s,x_m,y_m,z_m,qw,qx,qy,qz\n{}", (0..=180).map(row).collect::<String>())
}

/// Sum of all turns about the vertical from row to row, rad, and the largest of them.
fn turned(rotations: &[UnitQuaternion<f64>]) -> (f64, f64) {
    let steps = rotations.windows(2).map(|pair| (pair[1] * pair[0].inverse()).scaled_axis());
    steps.fold((0.0, 0.0), |(sum, largest), step| (sum + step.z, f64::max(largest, step.norm())))
}

#[test]
fn a_full_turn_is_learnt_from_its_recording() {
    let bench = Bench::new();
    assert!(URDF.contains(MOUNTED), "the tool of the arm");
    bench.write("arm.urdf", &URDF.replace(MOUNTED, ON_AXIS));
    bench.write("recording.csv", &recording());
    bench.write("vector.toml", &configuration(""));
    bench.write("turn.toml", &configuration("orientation = \"sphere\"\n"));
    let import = |config, out| {
        ["demo", "import", "recording.csv", "--at-start", "--config", config, "--out", out]
    };
    bench.refused(&import("vector.toml", "no.csv"), &["turns link 'pan' by 2.31 rad", "sphere"]);
    let said = bench.ok(&import("turn.toml", "turn.csv"));
    assert!(said.contains("the arm reaches all of it"), "{said}");

    let text = util::text(&bench.path("turn.csv"));
    assert!(text.starts_with("t_s,x_m,y_m,z_m,qw,qx,qy,qz\n"), "{text}");
    let demonstration = Demonstration::parse("turn.csv", &text).unwrap();
    assert_eq!(demonstration.orientation(), Orientation::Sphere);
    assert!((turned(&demonstration.rotations()).0 - TAU).abs() < 1e-6);

    bench.ok(&["learn", "custom", "--config", "turn.toml", "--rollouts", "4", "--out", "s"]);
    bench.ok(&["learn", "custom", "--rollouts", "6", "--out", "s"]);
    let trials = bench.trials("s");
    assert_eq!(trials.len(), 6);
    let store = bench.store("s");
    for trial in &trials {
        assert_eq!((trial.fault, trial.set_aside), (0, false), "rollout {}", trial.rollout);
        let path = store.path(trial.rollout).unwrap().expect("a rollout has a path");
        let rotations: Vec<_> = path
            .iter()
            .map(|row| {
                // Pitch, roll and yaw.
                let [y, x, z] = row.pan_rotation.map(f64::from);
                UnitQuaternion::from_scaled_axis(Vector3::new(x, y, z))
            })
            .collect();
        let (sum, largest) = turned(&rotations);
        // The first executes the demonstration; the others alter it.
        let near = if trial.rollout == 1 { 0.02 } else { 1.0 };
        assert!((sum - TAU).abs() < near, "rollout {}: {sum} rad", trial.rollout);
        // 10 ms at 3 rad/s: a jump to the other side would be seen.
        assert!(largest < 0.04, "rollout {}: {largest} rad from row to row", trial.rollout);
    }
    let said = bench.ok(&["replay", "s", "--all"]);
    assert!(said.contains("6 trials replayed, 0 different"), "{said}");
    let page = util::text(&bench.path("s/report/index.html"));
    assert!(page.contains("<svg") && !page.contains("NaN"));
}

#[test]
fn quaternions_are_for_sessions_on_the_sphere() {
    let bench = Bench::new();
    let row = |k: usize| format!("{:.2},0.78,0,0.72,1,0,0,0\n", 0.01 * k as f64);
    let rows: String = (0..=100).map(row).collect();
    bench.write("still.csv", &format!("t_s,x_m,y_m,z_m,qw,qx,qy,qz\n{rows}"));
    let learn = |settings: &str| {
        let text = format!(
            "[task]\nname = \"custom\"\ndemonstration = \"still.csv\"\n[learner]\n{settings}"
        );
        bench.write("c.toml", &text);
        ["learn", "custom", "--config", "c.toml", "--out", "s"]
    };
    bench.refused(&learn(""), &["still.csv has quaternions", "learner.orientation"]);
    let gmr = learn("orientation = \"sphere\"\nencoding = \"gmr\"\n");
    bench.refused(&gmr, &["learner.orientation is sphere: use rotation_vector", "gmr"]);
    bench.refused(&learn("orientation = \"euler\"\n"), &["euler", "rotation_vector", "sphere"]);
}
