//! `skillet demo import`: from a recording to a session that learns from it.

mod util;

use serde_json::Value;
use util::Bench;

const DEMONSTRATION: &str = include_str!("../demos/pancake.csv");

#[test]
fn a_recording_becomes_a_demonstration_that_is_learnt_from() {
    let bench = Bench::new();
    bench.write("recording.csv", DEMONSTRATION);
    let import = ["demo", "import", "recording.csv", "--out", "my_demo.csv", "--json"];
    let printed: Value = serde_json::from_str(&bench.ok(&import)).unwrap();
    assert_eq!(printed["fits_arm"], true);
    assert_eq!(printed["samples"], 141);
    assert!((printed["duration_s"].as_f64().unwrap() - 1.4).abs() < 1e-9);
    assert!(printed["speed_max_m_s"].as_f64().unwrap() > 0.1);

    bench.write("my.toml", "[task]\ndemonstration = \"my_demo.csv\"\n");
    let learn = ["learn", "pancake", "--seed", "1", "--rollouts", "3", "--out"];
    bench.ok(&[&learn[..], &["mine", "--config", "my.toml"]].concat());
    bench.ok(&[&learn[..], &["built-in"]].concat());
    assert_eq!(util::bits(&bench.trials("mine")), util::bits(&bench.trials("built-in")));
}

#[test]
fn nothing_is_overwritten_and_what_the_arm_cannot_do_is_said() {
    let bench = Bench::new();
    bench.write("recording.csv", DEMONSTRATION);
    bench.write("there.csv", "mine");
    let import = |out| ["demo", "import", "recording.csv", "--out", out];
    bench.refused(&import("there.csv"), &["there.csv", "exists already"]);
    assert_eq!(util::text(&bench.path("there.csv")), "mine");
    bench.refused(&import("nowhere/d.csv"), &["nowhere/d.csv", "folder"]);
    bench.refused(&["demo", "import", "absent.csv", "--out", "d.csv"], &["absent.csv", "path"]);

    bench.write("skittles.toml", "[task]\nname = \"skittles\"\n");
    let other_task = [&import("d.csv")[..], &["--config", "skittles.toml"]].concat();
    bench.refused(&other_task, &["skittles", "no arm"]);
    let rows: String = (0..60).map(|k| format!("{},0.5,0,0.72\n", 0.01 * k as f64)).collect();
    bench.write("recording.csv", &format!("t_s,x_m,y_m,z_m\n{rows}"));
    let output = bench.run(&import("far.csv"));
    assert_eq!(output.status.code(), Some(1));
    let said = String::from_utf8(output.stdout).unwrap();
    assert!(said.contains("NOT FOR THIS ARM") && said.contains("begins 0.280 m"), "{said}");
    assert!(bench.path("far.csv").exists(), "written all the same");
    let left: Vec<_> = std::fs::read_dir(bench.path(".")).unwrap().flatten().collect();
    let drafts = left.iter().filter(|file| file.file_name().to_string_lossy().ends_with(".new"));
    assert_eq!(drafts.count(), 0);
}
