//! Tasks without an arm, learnt live through both processes; modes chosen and forbidden.

mod util;

use learner::store::TrialRecord;
use serde_json::Value;
use util::{Bench, bits};

#[test]
fn skittles_come_out_the_same_twice_and_resumed() {
    let bench = Bench::new();
    let learn = |out: &str, rollouts: &str| {
        let arguments =
            ["learn", "skittles", "--target", "1.2,0.0", "--rollouts", rollouts, "--out", out];
        bench.ok(&[&arguments[..], &["--json"]].concat())
    };
    let summary: Value = serde_json::from_str(&learn("a", "60")).unwrap();
    assert_eq!((&summary["task"], &summary["trials"]), (&"skittles".into(), &60.into()));
    assert!(summary["modes"].as_array().is_some_and(|modes| !modes.is_empty()));
    learn("b", "25");
    learn("b", "60");
    assert_eq!(bits(&bench.trials("a")), bits(&bench.trials("b")));

    let trials = bench.trials("a");
    let distance = |trial: &TrialRecord| trial.measures.get("distance_m").unwrap();
    // The world measured a distance, the learner judged it.
    for trial in &trials {
        assert_eq!(trial.reward, (-3.0 * distance(trial)).exp());
        assert!(distance(trial) > 0.0 && trial.n_records > 100);
    }
    let page = util::text(&bench.path("a/report/index.html"));
    assert!(page.contains("<svg") && !page.contains("NaN") && !page.contains("flip"));
}

#[test]
fn the_landscape_measures_its_own_reward() {
    let bench = Bench::new();
    bench.ok(&["learn", "landscape", "--rollouts", "30", "--out", "s"]);
    for trial in bench.trials("s") {
        let theta = nalgebra::Vector2::new(trial.theta[0], trial.theta[1]);
        assert_eq!(trial.reward, physics::landscape::height(&theta));
    }
}

#[test]
fn a_forbidden_mode_gives_way_and_comes_back() {
    let bench = Bench::new();
    bench.ok(&["learn", "skittles", "--target", "1.2,0.0", "--out", "s"]);
    let modes = || -> Vec<Value> {
        bench.json(&["policy", "modes", "s"])["modes"].as_array().unwrap().clone()
    };
    let answer = |modes: &[Value]| {
        modes
            .iter()
            .find(|mode| mode["selected"] == true)
            .map(|mode| mode["mode"].as_u64().unwrap())
    };
    let found = modes();
    assert!(found.len() >= 2, "this skittle can be hit in two ways: {found:?}");
    let first = answer(&found).unwrap();
    let exported = bench.ok(&["policy", "export", "s"]);

    bench.ok(&["policy", "forbid", "s", &first.to_string()]);
    let second = answer(&modes()).unwrap();
    assert_ne!(second, first);
    assert_ne!(bench.ok(&["policy", "export", "s"]), exported);
    bench.refused(&["policy", "export", "s", "--mode", &first.to_string()], &["is forbidden"]);
    bench.refused(&["policy", "forbid", "s", "99"], &["mode 99", "modes 1 to"]);

    // Every other one, too, but for the last.
    let others = found.iter().map(|mode| mode["mode"].as_u64().unwrap()).filter(|n| *n != first);
    let others: Vec<String> = others.map(|number| number.to_string()).collect();
    let (last, rest) = others.split_last().unwrap();
    rest.iter().for_each(|mode| drop(bench.ok(&["policy", "forbid", "s", mode])));
    bench.refused(
        &["policy", "forbid", "s", last],
        &["last allowed mode", "nothing changed", "allow s"],
    );
    bench.ok(&["policy", "export", "s", "--prefer", "tolerant"]);

    let allowed = bench.ok(&["policy", "allow", "s", &first.to_string(), "--json"]);
    let allowed: Value = serde_json::from_str(&allowed).unwrap();
    assert_eq!(allowed["mode"], first);
    assert_eq!(allowed["forbidden"].as_array().unwrap().len(), rest.len());
    assert_eq!(bench.ok(&["policy", "export", "s"]), exported);
}

#[test]
fn the_only_mode_of_a_session_cannot_be_forbidden() {
    let bench = Bench::new();
    bench.ok(&["learn", "pancake", "--rollouts", "3", "--out", "s"]);
    let before = bench.ok(&["policy", "export", "s"]);
    bench.refused(&["policy", "forbid", "s", "1"], &["mode 1", "only mode", "nothing changed"]);
    assert_eq!(bench.ok(&["policy", "export", "s"]), before);
    // Undoing has one name.
    bench.refused(&["policy", "forbid", "s", "none"], &["mode 'none'", "number"]);
}

#[test]
fn what_fits_no_table_and_no_task_is_refused() {
    let bench = Bench::new();
    let off = ["learn", "skittles", "--target", "0.0,9.0"];
    bench.refused(&off, &["task.target_m", "on the table"]);
    bench.refused(&["learn", "skittles", "--target", "1.2"], &["two numbers"]);
    bench
        .refused(&["learn", "landscape", "--target", "1,1"], &["the task landscape has no target"]);
    let cases = [
        ("[task]\nname = \"landscape\"\n[learner.action]\nstart = [1.0]\n", "takes 2"),
        ("[task]\nname = \"pancake\"\n[learner.action]\nstart = [1.0, 2.0]\n", "takes 0"),
        (
            "[task]\nname = \"skittles\"\n[learner.action]\nmin = [1.0, 0.0]\nmax = [1.0, 2.0]\n",
            "empty in parameter 0",
        ),
        ("[task]\nname = \"tennis\"\n", "use pancake, landscape"),
    ];
    for (text, expected) in cases {
        bench.write("bad.toml", text);
        bench.refused(&["config", "--config", "bad.toml"], &[expected]);
    }
}
