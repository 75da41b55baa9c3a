//! What a session holds, as files for other programs, and back.

mod util;

use serde_json::Value;
use util::{Bench, eventually};

#[test]
fn trials_come_back_from_csv_bit_for_bit() {
    let bench = Bench::new();
    bench.ok(&["learn", "pancake", "--seed", "1", "--rollouts", "4", "--out", "s"]);
    let printed = bench.ok(&["trials", "s"]);
    let mut lines = printed.lines().map(|line| line.split(',').collect::<Vec<_>>());
    let header = lines.next().unwrap();
    let trials = bench.trials("s");
    assert_eq!(lines.clone().count(), trials.len());
    let objects = bench.json(&["trials", "s"])["trials"].as_array().unwrap().clone();
    for ((row, trial), object) in lines.zip(&trials).zip(&objects) {
        let text = |name: &str| row[header.iter().position(|column| *column == name).unwrap()];
        let number = |name: &str| text(name).parse::<f64>().unwrap();
        let same = |name: &str, value: f64| assert_eq!(number(name).to_bits(), value.to_bits());
        same("reward", trial.reward);
        for measure in trial.measures.iter() {
            match measure.unit {
                "bool" => assert_eq!(text(measure.name), (measure.value == 1.0).to_string()),
                _ => {
                    same(measure.name, measure.value);
                    assert_eq!(object[measure.name], measure.value);
                }
            }
        }
        for (i, value) in trial.theta.iter().enumerate() {
            same(&format!("theta_{}", i + 1), *value);
        }
        assert_eq!(text("rollout"), trial.rollout.to_string());
        assert_eq!(text("success"), trial.success.to_string());
        assert_eq!((text("set_aside"), text("fault_code")), ("false", "0"));
        assert_eq!(text("policy_digest"), format!("{:016x}", trial.policy_digest));
        assert_eq!(object["policy_id"], trial.policy_id);
    }
    assert_eq!(header.len(), 10 + trials[0].measures.len() + trials[0].theta.len());

    bench.ok(&["trials", "s", "--csv", "trials.csv"]);
    assert_eq!(util::text(&bench.path("trials.csv")), printed);
    bench.refused(&["trials", "s", "--csv", "trials.csv"], &["trials.csv", "already exists"]);
    bench.refused(&["trials", "nowhere"], &["nowhere", "no session here"]);
}

#[test]
fn actions_carry_the_units_of_their_world() {
    let bench = Bench::new();
    bench.ok(&["learn", "skittles", "--seed", "1", "--rollouts", "3", "--out", "s"]);
    let printed = bench.ok(&["trials", "s"]);
    let header = printed.lines().next().unwrap();
    for column in ["distance_m", "theta_1_rad", "theta_2_rad_s"] {
        assert!(header.split(',').any(|name| name == column), "{column} in {header}");
    }
}

#[test]
fn a_policy_goes_into_a_cell_from_either_format() {
    let bench = Bench::new();
    bench.ok(&["learn", "pancake", "--seed", "1", "--rollouts", "3", "--out", "s"]);
    let export = |format| bench.ok(&["policy", "export", "s", "--format", format]);
    let (json, toml) = (export("json"), export("toml"));
    assert_eq!(bench.ok(&["policy", "export", "s"]), json, "JSON is the default");
    assert!(toml.contains("s⁻²") && toml.contains("x, y, z in m; pitch, roll, yaw in rad"));

    let _controller = bench.start(&["controller", "--cell", "c", "--pace", "max"]);
    eventually("a controller", || {
        bench.run(&["status", "--cell", "c"]).status.success().then_some(())
    });
    for (name, text) in [("p.json", &json), ("p.toml", &toml)] {
        bench.write(name, text);
        let import = ["policy", "import", name, "--cell", "c", "--json"];
        let reply: Value = serde_json::from_str(&bench.ok(&import)).unwrap();
        let id = reply["policy_id"].to_string();
        assert_eq!(bench.ok(&["policy", "export", &id, "--cell", "c"]), json, "{name}");
    }
    bench.write("bad.toml", &toml.replacen("damping = ", "damping = -", 1));
    bench.refused(&["policy", "import", "bad.toml", "--cell", "c"], &["bad.toml", "damping is -"]);
    bench.write("bad.toml", "[policy\n");
    bench.refused(&["policy", "import", "bad.toml", "--cell", "c"], &["bad.toml", "line 1"]);
}
