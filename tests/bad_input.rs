//! Bad input gets exit code 2, a message that names file, line or field and what to do, and costs
//! nothing that was there before.

mod util;

use std::fs;
use std::os::unix::fs::PermissionsExt;

use util::{Bench, bits};

const HEADER: &str = "t_s,x_m,y_m,z_m,pitch_rad\n";

/// A demonstration at rest at the start of the pan, changed line by line.
fn demonstration(change: impl Fn(usize) -> Option<String>) -> String {
    let line = |i: usize| format!("{:.2},0.78,0.0,0.72,0.0", i as f64 * 0.01);
    let lines: Vec<String> = (0..60).map(|i| change(i).unwrap_or_else(|| line(i))).collect();
    format!("{HEADER}{}\n", lines.join("\n"))
}

fn learn_with<'a>(config: &'a str, out: &'a str) -> [&'a str; 8] {
    ["learn", "pancake", "--rollouts", "2", "--config", config, "--out", out]
}

#[test]
fn configuration_mistakes_name_line_and_field() {
    let bench = Bench::new();
    let cases: [(&str, &[&str]); 10] = [
        ("[learner]\nsead = 1\n", &["line 2", "sead", "seed"]),
        ("[lerner]\nseed = 1\n", &["line 1", "lerner", "learner"]),
        ("[learner]\nseed = \"one\"\n", &["line 2", "seed"]),
        ("[learner\n", &["line 1"]),
        ("[learner]\ntask_dim = 5\n", &["learner.task_dim is 5", "3 (position)"]),
        ("[learner]\nrollouts = 0\n", &["learner.rollouts is 0"]),
        ("[controller]\nperiod_us = 10\n", &["controller.period_us is 10", "250 to 2000"]),
        ("[plant]\nfriction = nan\n", &["plant.friction is NaN", "0 to 2"]),
        ("[cell]\nname = \"../up\"\n", &["cell name '../up'", "a-z"]),
        ("[plant]\nstart_posture_rad = [0, 1]\n", &["start_posture_rad", "2 numbers", "7 joints"]),
    ];
    for (text, words) in cases {
        let config = bench.write("bad.toml", text);
        let words = [words, &["bad.toml"][..]].concat();
        // The number of joints is known only with the arm: that message names no file.
        let words = if text.contains("start_posture") { &words[..3] } else { &words[..] };
        bench.refused(&learn_with(config.to_str().unwrap(), "s"), words);
        assert!(!bench.path("s").exists(), "nothing is begun under {text}");
    }
    bench.refused(&["config", "--config", "absent.toml"], &["absent.toml", "check the path"]);
}

#[test]
fn demonstration_mistakes_name_file_and_line() {
    let bench = Bench::new();
    let far =
        |i: usize| Some(format!("{:.2},{},0.0,0.72,0.0", i as f64 * 0.01, 0.78 + 0.02 * i as f64));
    let at = |line: usize, text: &'static str| move |i| (i == line).then(|| text.to_string());
    let cases: [(String, &[&str]); 7] = [
        (demonstration(at(30, "0.30,nan,0.0,0.72,0.0")), &["demo.csv", "line 32", "x_m"]),
        (demonstration(at(30, "0.30,abc,0.0,0.72,0.0")), &["demo.csv", "line 32"]),
        (demonstration(at(30, "0.20,0.78,0.0,0.72,0.0")), &["demo.csv", "line 32", "time"]),
        (demonstration(far), &["demo.csv", "cannot reach", "t = 0."]),
        (
            demonstration(|i| Some(format!("{:.2},0.5,0.0,0.72,0.0", i as f64 * 0.01))),
            &["begins 0.280 m"],
        ),
        (format!("{HEADER}0.0,0.78,0.0,0.72,0.0\n"), &["demo.csv", "10"]),
        ("t,x,y,z\n".into(), &["demo.csv", "line 1", "t_s"]),
    ];
    let config = bench.write("c.toml", "[task]\ndemonstration = \"demo.csv\"\n");
    for (text, words) in cases {
        bench.write("demo.csv", &text);
        bench.refused(&learn_with(config.to_str().unwrap(), "s"), words);
        assert!(!bench.path("s").exists());
    }
    let long = demonstration(|i| Some(format!("{},0.78,0.0,0.72,0.0", i as f64 * 0.1)));
    bench.write("demo.csv", &long);
    bench
        .refused(&learn_with(config.to_str().unwrap(), "s"), &["lasts 5.90 s", "settle_s", "4000"]);
}

#[test]
fn urdf_mistakes_name_file_and_part() {
    let bench = Bench::new();
    let wam = include_str!("../robots/wam7/wam7_pan.urdf");
    let config = bench.write("c.toml", "[plant]\narm = \"arm.urdf\"\n");
    let remove_between = |from: &str, to: &str| {
        let start = wam.find(from).unwrap();
        let end = start + wam[start..].find(to).unwrap() + to.len();
        format!("{}{}", &wam[..start], &wam[end..])
    };
    // A frame without mass may pass; a body may not.
    let shape = "<visual/></link>";
    let shape_without_mass =
        remove_between("<inertial>", "</inertial>").replacen("</link>", shape, 1);
    let first_inertia = wam.find("ixx=\"").unwrap() + 5;
    let negative = format!("{}-{}", &wam[..first_inertia], &wam[first_inertia..]);
    let cases: [(String, &[&str]); 4] = [
        ("<robot".into(), &["arm.urdf"]),
        (wam.replacen("type=\"revolute\"", "type=\"prismatic\"", 1), &["arm.urdf", "prismatic"]),
        (shape_without_mass, &["arm.urdf: line 6", "link1", "no mass"]),
        (negative, &["arm.urdf", "link1", "inertia"]),
    ];
    for (urdf, words) in cases {
        bench.write("arm.urdf", &urdf);
        bench.refused(&learn_with(config.to_str().unwrap(), "s"), words);
    }
    bench.write("arm.urdf", wam);
    let config = bench.write("c.toml", "[plant]\narm = \"arm.urdf\"\ntip = \"spoon\"\n");
    bench.refused(&learn_with(config.to_str().unwrap(), "s"), &["spoon", "pan"]);
}

#[test]
fn a_session_is_not_continued_as_something_else() {
    let bench = Bench::new();
    bench.ok(&["learn", "pancake", "--seed", "1", "--rollouts", "3", "--out", "s"]);
    let before = bits(&bench.trials("s"));

    let other_seed = ["learn", "pancake", "--seed", "2", "--rollouts", "4", "--out", "s"];
    bench.refused(&other_seed, &["seed", "--out"]);
    let world = bench.write("w.toml", "[plant]\nfriction = 0.3\n[learner]\nseed = 1\n");
    let other_world =
        ["learn", "pancake", "--config", world.to_str().unwrap(), "--rollouts", "4", "--out", "s"];
    bench.refused(&other_world, &["[plant] differs", "--out"]);
    let config = bench.path("s/session.toml");
    let text = util::text(&config);
    let resume = ["learn", "pancake", "--rollouts", "4", "--out", "s"];

    fs::write(&config, text.replace("name = \"pancake\"", "name = \"tennis\"")).unwrap();
    bench.refused(&resume, &["session.toml", "task.name is 'tennis'"]);
    fs::write(&config, &text).unwrap();

    bench.refused(&["learn", "skittles", "--out", "s"], &["belongs to the task 'pancake'"]);

    // Of one damaged file the other one is the cure: both.
    let files = ["s/session.db", "s/session.copy.db"].map(|name| bench.path(name));
    let write = |bytes: &[u8]| files.iter().for_each(|file| fs::write(file, bytes).unwrap());
    let sound = fs::read(&files[0]).unwrap();
    let mut newer = sound.clone();
    newer[63] = 99; // user_version of the SQLite header
    write(&newer);
    bench.refused(&resume, &["s", "99"]);
    write(b"this is no database, whatever its name says, and long enough");
    bench.refused(&resume, &["session.db", "--out"]);
    write(&sound);

    assert_eq!(bits(&bench.trials("s")), before);
    bench.ok(&resume);
    assert_eq!(bits(&bench.trials("s"))[..3], before[..]);
}

#[test]
fn places_that_cannot_be_written_are_named() {
    let bench = Bench::new();
    bench.write("file", "");
    bench.refused(&["learn", "pancake", "--out", "file/s"], &["file/s", "--out"]);
    bench.refused(&["report", "nowhere"], &["nowhere", "no session here"]);
    bench.refused(&["policy", "list", "nowhere"], &["nowhere", "no session here"]);

    // Root writes wherever it likes: then there is nothing to refuse.
    let sealed = bench.path("sealed");
    fs::create_dir(&sealed).unwrap();
    fs::set_permissions(&sealed, fs::Permissions::from_mode(0o500)).unwrap();
    if fs::write(sealed.join("probe"), "").is_err() {
        bench.refused(&["learn", "pancake", "--out", "sealed/s"], &["sealed/s", "permissions"]);
    }
}

#[test]
fn a_full_disk_stops_the_session_without_losing_what_it_had() {
    let bench = Bench::new();
    bench.ok(&["learn", "pancake", "--seed", "1", "--rollouts", "25", "--out", "s"]);
    let before = bits(&bench.trials("s"));
    let config = bench.path("s/session.toml");
    fs::write(&config, util::text(&config).replace("rollouts = 25", "rollouts = 60")).unwrap();
    let _controller = bench.start(&["controller", "--cell", "full", "--pace", "max"]);

    // To a process, a limit on the size of its files is a full disk.
    let kib = fs::metadata(bench.path("s/session.db")).unwrap().len() / 1024 + 24;
    let skillet = env!("CARGO_BIN_EXE_skillet");
    // The learner of a `learn`; that of a service waits, see disk.rs.
    let child = format!("--child {} --cell full --session s", std::process::id());
    let script = format!("trap '' XFSZ; ulimit -f {kib}; exec {skillet} learner {child}");
    let output = std::process::Command::new("bash")
        .args(["-c", &script])
        .current_dir(bench.path("."))
        .env("SKILLET_RUNTIME_DIR", bench.path("run"))
        .output()
        .unwrap();
    let message = util::stderr(&output);
    assert_eq!(output.status.code(), Some(2), "{message}");
    assert!(message.contains("session.db") && message.contains("space"), "{message}");

    let after = bits(&bench.trials("s"));
    assert_eq!(after[..25], before[..]);
    bench.ok(&["learn", "pancake", "--rollouts", "60", "--out", "s"]);
    bench.ok(&["learn", "pancake", "--seed", "1", "--rollouts", "60", "--out", "undisturbed"]);
    assert_eq!(bits(&bench.trials("s")), bits(&bench.trials("undisturbed")));
}
