//! Every encoding is learnt through both processes, resumed and replayed bit for bit.

mod util;

use util::Bench;

/// A way from where the pan starts, the least jerk: 1.4 s at 100 Hz.
fn reach() -> String {
    let row = |k: usize| {
        let u = k as f64 / 140.0;
        let u = u * u * u * (10.0 - 15.0 * u + 6.0 * u * u);
        let (x, y, z) = (0.78 - 0.1 * u, 0.12 * u, 0.72 + 0.08 * u * u);
        format!("{:.2},{x:.6},{y:.6},{z:.6},{:.6}\n", k as f64 * 0.01, 0.2 * u)
    };
    format!("t_s,x_m,y_m,z_m,pitch_rad\n{}", (0..=140).map(row).collect::<String>())
}

fn learns(bench: &Bench, task: &str, encoding: &str, settings: &str) {
    let text = format!("[learner]\nencoding = \"{encoding}\"\n{settings}");
    let config = bench.write(&format!("{encoding}.toml"), &text);
    let config = config.to_str().unwrap();
    bench.ok(&["learn", task, "--config", config, "--rollouts", "3", "--out", encoding]);
    bench.ok(&["learn", task, "--rollouts", "5", "--out", encoding]);
    for trial in bench.trials(encoding) {
        assert_eq!((trial.fault, trial.set_aside), (0, false), "{encoding}");
    }
    let said = bench.ok(&["replay", encoding, "--all"]);
    assert!(said.contains("5 trials replayed, 0 different"), "{encoding}: {said}");
    let page = util::text(&bench.path(&format!("{encoding}/report/index.html")));
    assert!(page.contains("<svg") && !page.contains("NaN"), "{encoding}");
}

#[test]
fn encodings_driven_by_time_are_learnt_resumed_and_replayed() {
    let bench = Bench::new();
    for encoding in ["dmp", "gmr", "tsm"] {
        learns(&bench, "pancake", encoding, "");
    }
}

#[test]
fn a_field_of_the_state_is_learnt_where_the_movement_does_not_come_back() {
    let bench = Bench::new();
    bench.write("reach.csv", &reach());
    let task = "[task]\nname = \"custom\"\ndemonstration = \"reach.csv\"\n";
    learns(&bench, "custom", "seds", task);

    let config = bench.write("toss.toml", "[learner]\nencoding = \"seds\"\n");
    let learn = ["learn", "pancake", "--config", config.to_str().unwrap(), "--out", "toss"];
    bench.refused(&learn, &["built-in demonstration leads away from its end", "learner.encoding"]);
    assert!(!bench.path("toss").exists(), "nothing is begun");
}

#[test]
fn an_encoding_needs_a_movement_and_a_file_may_not_ask_for_what_it_lacks() {
    let bench = Bench::new();
    let refused = |task: &str, text: &str, words: &[&str]| {
        let config = bench.write("bad.toml", text);
        let config = config.to_str().unwrap();
        bench.refused(&["learn", task, "--config", config, "--out", "s"], words);
    };
    let landscape = "[task]\nname = \"landscape\"\n[learner]\nencoding = \"dmp\"\n";
    refused("landscape", landscape, &["learner.encoding is dmp", "no arm"]);
    let paid = "[learner]\nencoding = \"gmr\"\n[learner.compliance]\nweight = 1.0\n";
    refused("pancake", paid, &["learner.compliance.weight is 1", "use 0", "gmr"]);
    let unknown = "[learner]\nencoding = \"splines\"\n";
    refused("pancake", unknown, &["splines", "springs", "seds"]);
}
