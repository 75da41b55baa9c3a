//! Every task there is, learnt live through both processes, as its list says it is.

mod util;

use serde_json::Value;
use util::Bench;

#[test]
fn every_task_is_learnt_measured_and_replayed_bit_for_bit() {
    let bench = Bench::new();
    let tasks = bench.json(&["task", "list"])["tasks"].as_array().unwrap().clone();
    assert!(tasks.iter().any(|task| task["has_arm"] == true) && tasks.len() > 5, "{tasks:?}");
    for task in tasks {
        let name = task["task"].as_str().unwrap();
        bench.ok(&["learn", name, "--rollouts", "3", "--out", name]);
        let trials = bench.trials(name);
        assert_eq!(trials.len(), 3, "{name}");
        for trial in trials {
            let measured: serde_json::Map<String, Value> = trial
                .measures
                .declared()
                .iter()
                .map(|(name, unit)| (name.clone(), unit.as_str().into()))
                .collect();
            assert_eq!(Value::Object(measured), task["measures"], "{name}");
            assert_eq!((trial.fault, trial.set_aside), (0, false), "{name}");
        }
        let said = bench.ok(&["replay", name, "--all"]);
        assert!(said.contains("3 trials replayed, 0 different"), "{name}: {said}");
        let page = util::text(&bench.path(&format!("{name}/report/index.html")));
        assert!(page.contains("<svg") && !page.contains("NaN"), "{name}");
    }
}
