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
    bench.refused(&import("there.csv"), &["there.csv", "already exists"]);
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
    bench.write("recording.csv", DEMONSTRATION);
    bench.refused(&import("far.csv"), &["far.csv", "already exists", "--force"]);
    bench.ok(&[&import("far.csv")[..], &["--force"]].concat());
    let left: Vec<_> = std::fs::read_dir(bench.path(".")).unwrap().flatten().collect();
    let drafts = left.iter().filter(|file| file.file_name().to_string_lossy().ends_with(".new"));
    assert_eq!(drafts.count(), 0);
}

/// Trained with dmpbbo on the demonstration above: its `origin` says how.
const PRIMITIVE: &str = include_str!("vectors/dmpbbo_pancake.json");

#[test]
fn a_primitive_of_dmpbbo_becomes_a_demonstration_that_is_learnt_as_a_primitive() {
    let bench = Bench::new();
    bench.write("primitive.json", PRIMITIVE);
    let import = ["demo", "import", "primitive.json", "--out", "my_demo.csv"];
    let printed: Value =
        serde_json::from_str(&bench.ok(&[&import[..], &["--json"]].concat())).unwrap();
    assert_eq!((&printed["fits_arm"], &printed["samples"]), (&true.into(), &141.into()));
    assert_eq!(printed["format"]["recorder"], "dmpbbo");
    // What it was trained on, as near as its twenty basis functions come.
    let values = |text: &str| -> Vec<f64> {
        text.lines()
            .skip(1)
            .flat_map(|row| row.split(',').map(|cell| cell.parse().unwrap()))
            .collect()
    };
    let found = values(&util::text(&bench.path("my_demo.csv")));
    let worst = found.iter().zip(values(DEMONSTRATION)).map(|(a, b)| (a - b).abs());
    assert!(worst.clone().fold(0.0, f64::max) < 5e-3, "{:?}", worst.fold(0.0, f64::max));

    let config = "[task]\ndemonstration = \"my_demo.csv\"\n[learner]\nencoding = \"dmp\"\n";
    bench.write("my.toml", config);
    bench.ok(&["learn", "pancake", "--config", "my.toml", "--rollouts", "3", "--out", "mine"]);
    assert!(bench.trials("mine").iter().all(|trial| trial.fault == 0));
}

#[test]
fn what_a_primitive_lacks_is_named_with_what_to_do() {
    let bench = Bench::new();
    let import = ["demo", "import", "primitive.json", "--out", "d.csv"];
    let refused = |from: &str, to: &str, more: &[&str], words: &[&str]| {
        assert!(PRIMITIVE.contains(from), "{from}");
        bench.write("primitive.json", &PRIMITIVE.replacen(from, to, 1));
        bench.refused(&[&import[..], more].concat(), words);
    };
    refused("_phase_system", "_phase", &[], &["primitive.json", "missing field `_phase_system`"]);
    refused(
        "\"damping_coefficient\":20.0",
        "\"damping_coefficient\":0",
        &[],
        &["damping_coefficient"],
    );
    refused("_tau\":1.4", "_tau\":400.0", &[], &["primitive.json", "400 s", "--start and --end"]);
    refused("_tau", "_tau", &["--columns", "x=y1,y=y2,z=y5"], &["y5", "y1, y2, y3, y4"]);
    refused("_tau", "_tau", &["--columns", "x_deg=y1"], &["no unit `deg`"]);
}

/// Three joints: it cannot turn its pan as it likes.
const SMALL_ARM: &str = r#"<robot name="small"><link name="base"/>
  <link name="a"><inertial><origin xyz="0 0 0.1"/><mass value="0.3"/><inertia ixx="0.001" ixy="0" ixz="0" iyy="0.001" iyz="0" izz="0.0003"/></inertial></link>
  <link name="b"><inertial><origin xyz="0.1 0 0"/><mass value="0.2"/><inertia ixx="0.0002" ixy="0" ixz="0" iyy="0.0008" iyz="0" izz="0.0008"/></inertial></link>
  <link name="c"><inertial><origin xyz="0.1 0 0"/><mass value="0.1"/><inertia ixx="0.0001" ixy="0" ixz="0" iyy="0.0004" iyz="0" izz="0.0004"/></inertial></link>
  <link name="pan"><inertial><origin xyz="0 0 0"/><mass value="0.5"/><inertia ixx="0.002" ixy="0" ixz="0" iyy="0.002" iyz="0" izz="0.004"/></inertial></link>
  <joint name="yaw" type="revolute"><origin xyz="0 0 0.2"/><parent link="base"/><child link="a"/><axis xyz="0 0 1"/><limit lower="-3" upper="3" effort="20" velocity="5"/></joint>
  <joint name="shoulder" type="revolute"><origin xyz="0 0 0.2"/><parent link="a"/><child link="b"/><axis xyz="0 1 0"/><limit lower="-2" upper="2" effort="20" velocity="5"/></joint>
  <joint name="elbow" type="revolute"><origin xyz="0.25 0 0"/><parent link="b"/><child link="c"/><axis xyz="0 1 0"/><limit lower="-2" upper="2" effort="20" velocity="5"/></joint>
  <joint name="wrist" type="fixed"><origin xyz="0.25 0 0"/><parent link="c"/><child link="pan"/></joint>
</robot>"#;

#[test]
fn an_arm_with_few_joints_follows_what_it_recorded_itself() {
    let bench = Bench::new();
    bench.write("arm.urdf", SMALL_ARM);
    bench.write(
        "my.toml",
        "[task]\ndemonstration = \"d.csv\"\n[plant]\narm = \"arm.urdf\"\ntip = \"pan\"\n\
         start_posture_rad = [0.0, -0.5, 0.5]\n",
    );
    // With six decimals, at the rate of a slow bus.
    let row = |k: usize| {
        let (t, lift) = (0.008 * k as f64, 1.0 - (0.05 * k as f64).cos());
        format!("{t:.3},{:.6},{:.6},{:.6}\n", 0.1 * lift, -0.5 - 0.12 * lift, 0.5 + 0.09 * lift)
    };
    let rows: String = (0..126).map(row).collect();
    bench.write("joints.csv", &format!("t_s,q1_rad,q2_rad,q3_rad\n{rows}"));
    let import = |more: &[&str]| {
        let all = [&["demo", "import", "joints.csv", "--config", "my.toml"][..], more].concat();
        let said = bench.ok(&all);
        assert!(said.contains("the arm reaches all of it"), "{said}");
    };
    import(&["--smooth-s", "0.03", "--out", "smooth.csv"]);
    import(&["--rate-hz", "30", "--out", "coarse.csv"]);
    import(&["--out", "d.csv"]);
    // Its own poses, as another tool would have recorded them: rounded to the micrometre.
    let poses = util::text(&bench.path("d.csv"));
    let rounded = |cell: &str| match cell.parse::<f64>() {
        Ok(number) => format!("{number:.6}"),
        Err(_) => cell.to_string(),
    };
    let line = |line: &str| line.split(',').map(rounded).collect::<Vec<_>>().join(",");
    bench.write("poses.csv", &poses.lines().map(line).collect::<Vec<_>>().join("\n"));
    bench.ok(&["demo", "import", "poses.csv", "--config", "my.toml", "--out", "e.csv"]);
    bench.ok(&["learn", "pancake", "--config", "my.toml", "--rollouts", "3", "--out", "few"]);

    // What it cannot do is refused with numbers that say how far it is.
    let sideways = poses.lines().enumerate().map(|(i, line)| {
        let mut cells: Vec<String> = line.split(',').map(Into::into).collect();
        if i > 20 {
            cells[5] = "0.06".into();
        }
        cells.join(",")
    });
    bench.write("tilted.csv", &sideways.collect::<Vec<_>>().join("\n"));
    let output =
        bench.run(&["demo", "import", "tilted.csv", "--config", "my.toml", "--out", "f.csv"]);
    let said = String::from_utf8(output.stdout).unwrap();
    assert_eq!(output.status.code(), Some(1), "{said}");
    let reason = said.split("not within reach").nth(1).expect("a reason");
    assert!(reason.contains("0.0592 rad remain") && reason.contains("controls only 3"), "{said}");
}

/// The built-in demonstration, so many times quicker.
fn quicker(factor: f64) -> String {
    let line = |line: &str| match line.split_once(',') {
        Some((t, rest)) if t != "t_s" => {
            format!("{:.6},{rest}\n", t.parse::<f64>().unwrap() / factor)
        }
        _ => format!("{line}\n"),
    };
    DEMONSTRATION.lines().map(line).collect()
}

#[test]
fn a_demonstration_too_fast_for_the_arm_is_refused_with_the_place_and_a_factor() {
    let bench = Bench::new();
    bench.write("rec.csv", &quicker(6.0));
    let import = |more: &[&str]| bench.run(&[&["demo", "import", "rec.csv"][..], more].concat());
    let output = import(&["--out", "fast.csv", "--json"]);
    assert_eq!(output.status.code(), Some(1));
    let printed: Value = serde_json::from_slice(&output.stdout).unwrap();
    assert_eq!((&printed["fits_arm"], &printed["file"]), (&false.into(), &"fast.csv".into()));
    let torque = &printed["joint_torque_peak"];
    assert!(torque["value"].as_f64() > torque["limit"].as_f64(), "{torque}");
    assert!(torque["joint"].is_string() && torque["t_s"].as_f64() > Some(0.0));
    let misfit = printed["misfit"].as_str().unwrap();
    for word in ["too fast", "joint ", "at t = 0.", "its limit is", "--slow "] {
        assert!(misfit.contains(word), "no '{word}' in: {misfit}");
    }
    // Where it is used all the same, the same is said.
    bench.write("fast.toml", "[task]\ndemonstration = \"fast.csv\"\n");
    let checked = bench.run(&["config", "--check", "fast.toml"]);
    assert_eq!(checked.status.code(), Some(1));
    let said = String::from_utf8(checked.stdout).unwrap();
    assert!(said.contains("FAILED  task.demonstration") && said.contains("too fast"), "{said}");
    let learn = ["learn", "pancake", "--config", "fast.toml", "--rollouts", "1", "--out", "s"];
    let said = util::stderr(&bench.run(&learn));
    let warned = |said: &str| said.contains("warning: ") && said.contains("too fast for this arm");
    assert!(warned(&said) && said.contains("fast.csv"), "{said}");
    let said = util::stderr(&bench.run(&["learn", "pancake", "--rollouts", "2", "--out", "s"]));
    assert!(!warned(&said), "once, where the session begins: {said}");

    // The factor it gives is enough.
    let factor = misfit.split("--slow ").nth(1).unwrap().split(',').next().unwrap();
    let output = import(&["--out", "slow.csv", "--slow", factor]);
    let said = String::from_utf8(output.stdout).unwrap();
    assert_eq!(output.status.code(), Some(0), "{said}");
    assert!(said.contains("the arm reaches all of it"), "{said}");
    bench.refused(&["demo", "import", "rec.csv", "--out", "e.csv", "--slow", "0"], &["0.1 to 100"]);
}

#[test]
fn a_demonstration_from_elsewhere_is_moved_to_the_start() {
    let bench = Bench::new();
    let line = |line: &str| {
        let cells: Vec<&str> = line.split(',').collect();
        match cells[1].parse::<f64>() {
            Ok(x) => format!("{},{},7.0,{},{}\n", cells[0], x + 2.0, cells[3], cells[4]),
            Err(_) => format!("{line}\n"),
        }
    };
    bench.write("rec.csv", &DEMONSTRATION.lines().map(line).collect::<String>());
    let import = |more: &[&str]| bench.run(&[&["demo", "import", "rec.csv"][..], more].concat());
    let output = import(&["--out", "far.csv"]);
    assert_eq!(output.status.code(), Some(1));
    assert!(String::from_utf8(output.stdout).unwrap().contains("--at-start"));
    assert_eq!(import(&["--out", "near.csv", "--at-start"]).status.code(), Some(0));
    assert_eq!(util::text(&bench.path("near.csv")).lines().count(), 142);
}

#[test]
fn tables_as_others_write_them_are_read_and_other_files_named() {
    let bench = Bench::new();
    let rows: String =
        (0..60).map(|k| format!("{},{:02};0,78;0;0,72;0\r\n", k / 100, k % 100)).collect();
    bench.write("rec.csv", &format!("t_s;x_m;y_m;z_m;pitch_rad\r\n{rows}"));
    fn import<'a>(more: &[&'a str]) -> Vec<&'a str> {
        [&["demo", "import"][..], more].concat()
    }
    let said = bench.ok(&import(&["rec.csv", "--out", "d.csv"]));
    assert!(said.contains("UTF-8, semicolons, decimal comma"), "{said}");

    let utf16: Vec<u8> = std::fs::read_to_string(bench.path("rec.csv"))
        .unwrap()
        .replace("t_s;x_m", "Zeit;X")
        .encode_utf16()
        .flat_map(u16::to_le_bytes)
        .collect();
    std::fs::write(bench.path("utf16.csv"), utf16).unwrap();
    bench.refused(
        &import(&["utf16.csv", "--out", "e.csv"]),
        &["no time", "Zeit, X, y_m", "--columns"],
    );
    bench.ok(&import(&["utf16.csv", "--out", "e.csv", "--columns", "t_s=Zeit,x_m=X"]));
    assert_eq!(util::text(&bench.path("d.csv")), util::text(&bench.path("e.csv")));

    std::fs::write(bench.path("rec.npy"), b"\x93NUMPY\x01\x00v\x00{'descr'").unwrap();
    bench.refused(&import(&["rec.npy", "--out", "f.csv"]), &["rec.npy", "NumPy", "savetxt"]);
    bench.refused(&import(&["rec.csv", "--out", "f.csv", "--columns", "w=a"]), &["`w`", "use t"]);
}
