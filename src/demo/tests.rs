//! Recordings made from the built-in demonstration come back as it; bad ones are refused by line.

use std::f64::consts::PI;

use learner::Demonstration;
use learner::trajectory::sample;
use nalgebra::{Isometry3, Translation3, UnitQuaternion, Vector3};
use physics::arm::inverse_kinematics;
use physics::pancake::WAM7_START_POSTURE;
use rand::RngExt;
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::SeedableRng;

mod dialects;
mod recorders;

use super::*;

fn import(file: &str, text: &str, model: &ArmModel, options: &Options) -> Result<Imported> {
    super::import(file, text.as_bytes(), model, options)
}

const WAM7_URDF: &str = include_str!("../../robots/wam7/wam7_pan.urdf");
const PANCAKE_DEMONSTRATION: &str = include_str!("../../demos/pancake.csv");

fn arm() -> ArmModel {
    ArmModel::from_urdf(WAM7_URDF, "pan").unwrap()
}

fn built_in() -> Demonstration {
    Demonstration::parse("built-in", PANCAKE_DEMONSTRATION).unwrap()
}

fn read_back(imported: &Imported) -> Demonstration {
    Demonstration::parse("out.csv", &imported.csv()).unwrap()
}

/// Largest deviation from the built-in demonstration, in coordinates `from..to`.
fn deviation(poses: &[Pose], from: usize, to: usize) -> f64 {
    let expected = built_in();
    assert_eq!(poses.len(), expected.poses().len());
    let pairs = poses.iter().zip(expected.poses());
    pairs.flat_map(|(a, b)| (from..to).map(|c| (a[c] - b[c]).abs())).fold(0.0, f64::max)
}

#[test]
fn a_demonstration_comes_back_unchanged() {
    let imported = import("d.csv", PANCAKE_DEMONSTRATION, &arm(), &AS_IT_IS).unwrap();
    assert_eq!(read_back(&imported).poses(), built_in().poses());
    assert!(imported.warnings.is_empty() && imported.ignored.is_empty());
}

#[test]
fn joints_come_back_through_the_kinematics() {
    let (arm, mut q) = (arm(), WAM7_START_POSTURE);
    let mut text = "t_ms,q1_rad,q2_rad,q3_rad,q4_deg,q5_rad,q6_rad,q7_rad,qd1_rad_s\n".to_string();
    for (k, pose) in built_in().poses().iter().enumerate() {
        let rotation = UnitQuaternion::from_scaled_axis(Vector3::new(0.0, pose[3], 0.0));
        let target = Isometry3::from_parts(Translation3::new(pose[0], pose[1], pose[2]), rotation);
        q = inverse_kinematics::solve(&arm, &target, &q).unwrap();
        let mut row = q;
        row[3] *= 180.0 / PI;
        text += &format!("{}", 5000 + 10 * k);
        (0..7).for_each(|i| text += &format!(",{}", row[i]));
        text += ",0.1\n";
    }
    let imported = import("joints.csv", &text, &arm, &AS_IT_IS).unwrap();
    assert_eq!(imported.ignored, ["qd1_rad_s"]);
    let back = read_back(&imported);
    assert!(deviation(back.poses(), 0, 6) < 1e-7, "{}", deviation(back.poses(), 0, 6));
}

#[test]
fn jittered_noisy_millimetres_with_a_quaternion_come_back_within_tolerance() {
    let expected = built_in();
    let times: Vec<f64> = (0..expected.poses().len()).map(|k| 0.01 * k as f64).collect();
    let end = times[times.len() - 1];
    // About 250 Hz, jittered by up to a third of a period, with ±0.2 mm of noise.
    let mut recorded: Vec<f64> = (0..=(end / 0.004) as usize)
        .map(|k| (0.004 * k as f64 + 0.0013 * (1.7 * k as f64).sin()).clamp(0.0, end))
        .collect();
    (recorded[0], *recorded.last_mut().unwrap()) = (0.0, end);
    let mut text = "t_s,x_mm,y_mm,z_mm,qw,qx,qy,qz\n".to_string();
    for (k, pose) in sample(&times, expected.poses(), &recorded).iter().enumerate() {
        let noise = if k % 2 == 0 { 0.2 } else { -0.2 };
        let [x, y, z] = [pose[0] * 1e3 + noise, pose[1] * 1e3, pose[2] * 1e3 - noise];
        let (sin, cos) = (0.5 * pose[3]).sin_cos();
        text += &format!("{},{x},{y},{z},{cos},0,{sin},0\n", 3.0 + recorded[k]);
    }
    let smooth = Options { smooth_s: Some(0.012), ..AS_IT_IS };
    let back = read_back(&import("poses.csv", &text, &arm(), &smooth).unwrap());
    assert!(deviation(back.poses(), 0, 3) < 2e-3, "{} m", deviation(back.poses(), 0, 3));
    assert!(deviation(back.poses(), 3, 6) < 0.02, "{} rad", deviation(back.poses(), 3, 6));

    let rough = read_back(&import("poses.csv", &text, &arm(), &AS_IT_IS).unwrap());
    let acceleration =
        |d: &Demonstration| d.derivatives().1.iter().map(|a| a[2].abs()).fold(0.0, f64::max);
    assert!(acceleration(&back) < acceleration(&rough), "smoothing takes noise out of ẍ");
}

#[test]
fn trims_resamples_and_writes_roll_and_yaw_only_when_there_are_any() {
    let rows: String = (0..21).map(|k| format!("{},{k},0,-0,10\n", 0.1 * k as f64)).collect();
    let text = format!("t_s,x_cm,y_m,z_m,yaw_deg\n{rows}");
    let part = Options { rate_hz: 50.0, start_s: Some(0.51), end_s: Some(1.5), ..AS_IT_IS };
    let csv = import("r.csv", &text, &arm(), &part).unwrap().csv();
    let lines: Vec<&str> = csv.lines().collect();
    assert_eq!(lines[0], "t_s,x_m,y_m,z_m,pitch_rad,roll_rad,yaw_rad");
    assert_eq!(
        lines[1],
        "0.000000,0.051000000,0.000000000,0.000000000,0.000000000,0.000000000,0.174532925"
    );
    // The last sample is the first at or after the end, and holds it.
    assert!(lines.last().unwrap().starts_with("1.000000,0.150000000"), "{}", lines.last().unwrap());
    assert_eq!(lines.len(), 1 + 51);
}

/// A turn by 1.4 revolutions about the vertical of a tip that tilts meanwhile.
fn turning(t_s: f64) -> UnitQuaternion<f64> {
    let about = |axis: Vector3<f64>, angle: f64| UnitQuaternion::from_scaled_axis(axis * angle);
    about(Vector3::z(), 1.4 * 2.0 * PI * t_s / 2.0) * about(Vector3::x(), 0.5 * t_s)
}

#[test]
fn full_turns_are_imported_on_the_sphere_and_refused_as_rotation_vectors() {
    let times: Vec<f64> = (0..=100).map(|k| 0.02 * k as f64).collect();
    let row = |t: &f64| {
        let q = turning(*t);
        format!("{t},{},0,0,{},{},{},{}\n", 0.1 * t, q.w, q.i, q.j, q.k)
    };
    let rows: String = times.iter().map(row).collect();
    let text = format!("t_s,x_m,y_m,z_m,qw,qx,qy,qz\n{rows}");
    let refused = import("r.csv", &text, &arm(), &AS_IT_IS).err().expect("it turns").to_string();
    assert!(refused.contains("jump at π") && refused.contains("learner.orientation"), "{refused}");

    let sphere = Options { orientation: Orientation::Sphere, ..AS_IT_IS };
    let part = Options { start_s: Some(0.4), smooth_s: Some(0.03), ..sphere.clone() };
    for (options, begin_s, tolerance) in [(sphere, 0.0, 1e-3), (part, 0.4, 5e-3)] {
        let imported = import("r.csv", &text, &arm(), &options).unwrap();
        assert!(imported.csv().starts_with("t_s,x_m,y_m,z_m,qw,qx,qy,qz\n"));
        let back = read_back(&imported);
        for (k, rotation) in back.rotations().iter().enumerate() {
            let error = rotation.angle_to(&turning(begin_s + 0.01 * k as f64));
            assert!(error < tolerance, "{k}: {error} rad");
        }
        let [first, last] = [back.poses()[0], *back.poses().last().unwrap()];
        let turned = last[5] - first[5];
        let expected = 1.4 * PI * (2.0 - begin_s);
        assert!((turned - expected).abs() < 0.01, "{turned} rad instead of {expected}");
    }
}

#[test]
fn rotation_vectors_of_any_length_are_full_turns_on_the_sphere() {
    let row = |k: usize| format!("{},0,0,0,{}\n", 0.02 * k as f64, 0.1 * k as f64);
    let rows: String = (0..=100).map(row).collect();
    let text = format!("t_s,x_m,y_m,z_m,yaw_rad\n{rows}");
    let sphere = Options { orientation: Orientation::Sphere, ..AS_IT_IS };
    let back = read_back(&import("r.csv", &text, &arm(), &sphere).unwrap());
    let last = back.poses().last().unwrap();
    assert!((last[5] - 10.0).abs() < 1e-6 && last[3].abs() < 1e-6, "{last:?}");
}

#[test]
fn a_pause_is_a_warning_with_its_line() {
    let row = |t: f64| format!("{t},0,0,0\n");
    let rows: String =
        (0..30).map(|k| row(0.01 * k as f64 + if k >= 20 { 0.3 } else { 0.0 })).collect();
    let imported = import("r.csv", &format!("t_s,x_m,y_m,z_m\n{rows}"), &arm(), &AS_IT_IS).unwrap();
    assert_eq!(imported.warnings.len(), 1);
    assert!(imported.warnings[0].contains("r.csv, line 22: 0.310 s"), "{}", imported.warnings[0]);
}

#[test]
fn refuses_each_bad_row_and_names_its_line() {
    let with = |header: &str, row: &str| {
        let values = row.split_once(',').unwrap().1;
        format!("{header}\n0,{values}\n0.1,{values}\n0.2,{values}\n")
    };
    let poses = |row: &str| format!("t_s,x_m,y_m,z_m\n0.0,1,2,3\n0.1,1,2,3\n{row}\n0.3,1,2,3\n");
    let q = "t_s,qw,qx,qy,qz,x_m,y_m,z_m";
    let joints = "t_s,q1_rad,q2_rad,q3_rad,q4_rad,q5_rad,q6_rad,q7_rad";
    for (text, words) in [
        (String::new(), vec!["r.csv", "is empty"]),
        (poses("0.2,inf,2,3"), vec!["line 4", "x_m is `inf`", "finite number"]),
        (poses("0.2,1,two,3"), vec!["line 4", "y_m is `two`"]),
        (poses("0.2,1,-,3"), vec!["line 4", "y_m is `-`"]),
        (poses("0.2,1,2"), vec!["line 4", "3 values instead of 4"]),
        (poses("0.05,1,2,3"), vec!["line 4", "must increase", "sort"]),
        ("t_s,x_m,y_m,z_m\n0,1,2,3\n".into(), vec!["1 rows", "at least 3"]),
        (poses("0.1,1,2,3").replace("\n0.3,1,2,3", ""), vec!["2 rows", "at least 3"]),
        (
            poses("0.02,1,2,3").replace("\n0.1,", "\n0.01,").replace("\n0.3,", "\n0.03,"),
            vec!["r.csv: 0.030 s", "at least 0.1 s"],
        ),
        (poses("1e15,1,2,3").replace("0.3,", "1e16,"), vec!["r.csv", "at most 30 s", "unit"]),
        (with(q, "0,2,0,0,0,1,2,3"), vec!["line 2", "norm 2.000"]),
        (with(q, "0,0,1,0,0,1,2,3"), vec!["line 2", "jump at π"]),
        (with(joints, "0,0,45,0,0,0,0,0"), vec!["line 2", "q2_rad is 45", "_deg"]),
    ] {
        let message = import("r.csv", &text, &arm(), &AS_IT_IS).err().expect(&text).to_string();
        for word in words {
            assert!(message.contains(word), "no '{word}' in: {message}");
        }
    }
    let good = poses("0.2,1,2,3");
    for (options, word) in [
        (Options { start_s: Some(0.9), ..AS_IT_IS }, "--start 0.9"),
        (Options { end_s: Some(-1.0), ..AS_IT_IS }, "--end -1"),
        (Options { start_s: Some(0.2), end_s: Some(0.1), ..AS_IT_IS }, "nothing would be left"),
        (Options { smooth_s: Some(0.01), ..AS_IT_IS }, "at least that"),
    ] {
        let message = import("r.csv", &good, &arm(), &options).err().expect(word).to_string();
        assert!(message.contains(word), "no '{word}' in: {message}");
    }
}

#[test]
fn no_damage_to_a_recording_makes_the_import_panic_or_take_forever() {
    let arm = arm();
    let mut random = ChaCha8Rng::seed_from_u64(1);
    let header = "t_ms,q1_rad,q2_rad,q3_rad,q4_deg,q5_rad,q6_rad,q7_rad";
    let row = |k: usize| format!("\n{},0,0.2,0,117,0,-0.6,{}", 10 * k, 0.01 * k as f64);
    let joints: String = (0..20).map(row).collect();
    let sound = [PANCAKE_DEMONSTRATION[..600].to_string(), format!("{header}{joints}")];
    let smooth = Options { smooth_s: Some(0.05), ..AS_IT_IS };
    let mut refused = 0;
    for _ in 0..4000 {
        let mut bytes = sound[random.random_range(0..2)].clone().into_bytes();
        for _ in 0..random.random_range(1..4) {
            let at = random.random_range(0..bytes.len());
            bytes[at] = b"0123456789.,-+einfa\n\"; _"[random.random_range(0..24)];
        }
        let text = String::from_utf8(bytes).unwrap();
        match import("r.csv", &text, &arm, &smooth) {
            Ok(imported) => {
                let _ = Demonstration::parse("out.csv", &imported.csv());
            }
            Err(error) => {
                assert!(error.to_string().contains("r.csv"), "{error:#}");
                refused += 1;
            }
        }
    }
    assert!(refused > 1000, "{refused}");
}
