//! `skillet config`: the reference page is current, ready files and everything they name are checked, and what is
//! wrong with a file is said in a line each.

mod util;

use std::fs;
use std::path::{Path, PathBuf};

use serde_json::Value;
use util::Bench;

fn root() -> &'static Path {
    Path::new(env!("CARGO_MANIFEST_DIR"))
}

/// `SKILLET_WRITE_SETTINGS=1 cargo test --test settings` writes the page.
#[test]
fn the_reference_page_is_current() {
    let (printed, path) =
        (Bench::new().ok(&["config", "--markdown"]), root().join("docs/settings.md"));
    if std::env::var_os("SKILLET_WRITE_SETTINGS").is_some() {
        fs::write(&path, &printed).unwrap();
    }
    let written = fs::read_to_string(&path).unwrap();
    let difference = printed.lines().zip(written.lines()).find(|(new, old)| new != old);
    assert_eq!(difference, None, "docs/settings.md is old: run with SKILLET_WRITE_SETTINGS=1");
    assert_eq!(printed, written);
}

fn toml_files(folder: &Path) -> Vec<PathBuf> {
    let files = fs::read_dir(folder).unwrap().flatten().map(|entry| entry.path());
    files.filter(|path| path.extension().is_some_and(|extension| extension == "toml")).collect()
}

#[test]
fn ready_files_name_what_is_there() {
    let bench = Bench::new();
    let mut n_checked = 0;
    for folder in ["config", "examples/peg", "examples/push"] {
        for path in toml_files(&root().join(folder)) {
            // The program of a plant is found from where `skillet` starts.
            let mut command = bench.skillet(&["config", "--check", path.to_str().unwrap()]);
            let output = command.current_dir(root().join(folder)).output().unwrap();
            let said = String::from_utf8(output.stdout).unwrap();
            assert_eq!(output.status.code(), Some(0), "{}: {said}", path.display());
            assert!(said.lines().all(|line| line.starts_with("ok  ")), "{said}");
            n_checked += 1;
        }
    }
    assert!(n_checked > 20, "only {n_checked} files");
}

/// A ready file for every task, and for every arm whose demonstration there is.
#[test]
fn every_task_and_every_arm_has_a_ready_file() {
    let bench = Bench::new();
    let listed: Value = serde_json::from_str(&bench.ok(&["task", "list", "--json"])).unwrap();
    let tasks = listed["tasks"].as_array().unwrap();
    for task in tasks.iter().map(|task| task["task"].as_str().unwrap()) {
        assert!(root().join(format!("config/{task}.toml")).is_file(), "{task}");
    }
    for arm in ["panda", "iiwa14", "xarm7", "ur10e"] {
        for task in ["pancake", "custom"] {
            assert!(root().join(format!("config/{task}-{arm}.toml")).is_file(), "{task} on {arm}");
        }
    }
}

/// What is checked with `text` as my.toml: the exit code, and what is printed.
fn check(bench: &Bench, text: &str) -> (Option<i32>, String) {
    let path = bench.write("my.toml", text);
    let output = bench.run(&["config", "--check", path.to_str().unwrap()]);
    (output.status.code(), String::from_utf8(output.stdout).unwrap())
}

#[test]
fn every_file_that_is_wrong_has_a_line() {
    let bench = Bench::new();
    bench.write("broken.urdf", "<robot name=\"r\"><link name=\"base\"/></robot>");
    bench.write("short.csv", "t_s,x_m,y_m,z_m,pitch_rad\n0,0.8,0,0.7,0\n");
    for (text, words) in [
        ("[task]\ndemonstration = \"absent.csv\"\n", &["task.demonstration", "absent.csv"][..]),
        ("[task]\ndemonstration = \"short.csv\"\n", &["task.demonstration", "short.csv"]),
        ("[task]\nother_demonstrations = [\"absent.csv\"]\n", &["task.other_demonstrations"]),
        ("[plant]\narm = \"absent.urdf\"\n", &["plant.arm", "absent.urdf"]),
        ("[plant]\narm = \"broken.urdf\"\n", &["plant.arm", "broken.urdf"]),
        (
            "[plant]\nstart_posture_rad = [0, 0, 0, 0, 0, 0, 0]\n",
            &["plant.start_posture_rad", "level"],
        ),
        ("[task.judge]\nprogram = [\"no-such-judge\"]\n", &["task.judge.program", "no-such-judge"]),
        ("[task.judge]\nprogram = [\"sh\", \"absent.py\"]\n", &["task.judge.program", "absent.py"]),
        ("[task.judge]\nreward = \"apex_meters\"\n", &["task.judge.reward", "apex_meters"]),
        (
            "[plant]\nkind = \"external\"\nprogram = [\"sh\", \"absent.py\"]\n",
            &["plant.program", "absent.py", "in which `skillet` is started"],
        ),
        ("[controller]\npriority = 99\n", &["controller.priority is 99", "1 to 98"]),
        ("[controller]\nprioritty = 9\n", &["line 2", "prioritty", "priority"]),
        ("[learner\n", &["my.toml", "line 1"]),
    ] {
        let (code, said) = check(&bench, text);
        assert_eq!(code, Some(1), "{text}: {said}");
        let is_line =
            |line: &str| line.starts_with("FAILED") && words.iter().all(|word| said.contains(word));
        assert!(said.lines().any(is_line), "{text}: {said}");
    }
    let (code, said) = check(
        &bench,
        "[task]\ndemonstration = \"absent.csv\"\n[plant]\narm = \"broken.urdf\"\n[task.judge]\nprogram = [\"./a\"]\n",
    );
    let n_failed = said.lines().filter(|line| line.starts_with("FAILED")).count();
    assert_eq!((code, n_failed), (Some(1), 3), "each fault is found in one run: {said}");
}

#[test]
fn what_is_right_is_listed_with_what_was_found() {
    let bench = Bench::new();
    bench.write("my_judge.py", "pass\n");
    fs::copy(root().join("demos/pancake.csv"), bench.path("my_demo.csv")).unwrap();
    let text = "[task]\ndemonstration = \"my_demo.csv\"\n[task.judge]\nprogram = [\"sh\", \"my_judge.py\"]\n";
    let (code, said) = check(&bench, text);
    assert_eq!(code, Some(0), "{said}");
    for word in ["my.toml", "7 joints", "my_demo.csv", "112 numbers", "my_judge.py: can be read"] {
        assert!(said.contains(word), "{word}: {said}");
    }
    let path = bench.path("my.toml");
    let json = bench.ok(&["config", "--check", path.to_str().unwrap(), "--json"]);
    let json: Value = serde_json::from_str(&json).unwrap();
    assert_eq!(json["valid"], true);
    let checks = json["checks"].as_array().unwrap();
    assert!(
        checks.iter().any(|check| check["setting"] == "task.demonstration" && check["ok"] == true)
    );
    bench.refused(&["config", "--check", "absent.toml"], &["absent.toml", "check the path"]);
}

#[test]
fn another_task_has_other_defaults() {
    let bench = Bench::new();
    let printed = bench.ok(&["config", "landscape"]);
    assert!(printed.contains("name = \"landscape\"") && printed.contains("method = \"tempered\""));
    bench.refused(&["config", "tennis"], &["tennis", "landscape"]);
}

/// The schema knows every key of every ready file.
#[test]
fn the_schema_describes_the_ready_files() {
    let bench = Bench::new();
    let schema: Value = serde_json::from_str(&bench.ok(&["config", "--schema"])).unwrap();
    assert_eq!(schema["$schema"], "http://json-schema.org/draft-07/schema#");
    let priority = &schema["properties"]["controller"]["properties"]["priority"];
    assert_eq!((&priority["minimum"], &priority["maximum"]), (&1.into(), &98.into()));
    for path in toml_files(&root().join("config")) {
        let table: toml::Table = fs::read_to_string(&path).unwrap().parse().unwrap();
        known(&toml::Value::Table(table), &schema, &path);
    }
}

fn known(value: &toml::Value, schema: &Value, path: &Path) {
    match value {
        toml::Value::Table(table) => {
            for (key, inner) in table {
                let entry = schema["properties"].get(key).or(schema.get("additionalProperties"));
                let entry = entry.filter(|entry| entry.is_object());
                let entry = entry.unwrap_or_else(|| panic!("{}: {key}", path.display()));
                known(inner, entry, path);
            }
        }
        toml::Value::Array(list) => {
            list.iter().for_each(|item| known(item, &schema["items"], path))
        }
        toml::Value::Integer(_) => assert!(schema.to_string().contains("minimum"), "{schema}"),
        _ => assert!(schema["description"].is_string() || schema["type"].is_string(), "{schema}"),
    }
}
