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

/// What `reach` does, off by `off` mm in y in its first half.
fn off(off: f64) -> String {
    let reach = reach();
    let line = |(k, line): (usize, &str)| {
        let mut cells: Vec<String> = line.split(',').map(String::from).collect();
        if k > 0 {
            let y: f64 = cells[2].parse().unwrap();
            let room = 1.0 / (1.0 + (0.2 * (k as f64 - 71.0)).exp());
            cells[2] =
                format!("{:.6}", y + 1e-3 * off * (0.01 + room) * (k as f64 / 30.0).min(1.0));
        }
        cells.join(",") + "\n"
    };
    reach.lines().enumerate().map(line).collect()
}

#[test]
fn springs_begin_stiff_where_repetitions_agree() {
    let bench = Bench::new();
    let files = ["a.csv", "b.csv", "c.csv", "d.csv"];
    for (file, by) in files.iter().zip([-12.0, -3.0, 4.0, 11.0]) {
        bench.write(file, &off(by));
    }
    let config = |others: &str| {
        format!(
            "initial_stiffness = \"variability\"\ndemonstrations_are = \"repetitions\"\n[task]\n\
             name = \"custom\"\ndemonstration = \"a.csv\"\nother_demonstrations = [{others}]\n"
        )
    };
    let others = "\"b.csv\", \"c.csv\", \"d.csv\"";
    learns(&bench, "custom", "springs", &config(others));
    let initial = bench.store("springs").initial_policy().unwrap();
    let of_y = |component: usize| initial.components[component].stiffness_at(1, 1);
    assert!(of_y(2) < 200.0 && of_y(6) > 300.0, "{} {}", of_y(2), of_y(6));

    let text = format!("[learner]\n{}", config("\"b.csv\""));
    let two = bench.write("two.toml", &text);
    let learn = ["learn", "custom", "--config", two.to_str().unwrap(), "--out", "two"];
    bench.refused(&learn, &["b.csv: 2 recordings", "at least 3", "other_demonstrations"]);
    assert!(!bench.path("two").exists(), "nothing is begun");
}

#[test]
fn a_number_of_components_is_chosen_and_said() {
    let bench = Bench::new();
    let text = "[learner]\nencoding = \"gmr\"\nn_components = \"bic\"\n";
    bench.write("c.toml", text);
    let learn = ["learn", "pancake", "--config", "c.toml", "--rollouts", "2", "--out", "bic"];
    let output = bench.run(&learn);
    let said = util::stderr(&output);
    assert_eq!(output.status.code(), Some(0), "{said}");
    let chosen = bench.store("bic").initial_policy().unwrap().n_systems;
    assert!(said.contains(&format!("the criterion chose {chosen} components")), "{said}");
    bench.ok(&["learn", "pancake", "--rollouts", "3", "--out", "bic"]);
    assert!(
        bench.ok(&["config", "--config", "bic/session.toml"]).contains("n_components = \"bic\"")
    );
    bench.write("bad.toml", "[learner]\nn_components = \"aic\"\n");
    let learn = ["learn", "pancake", "--config", "bad.toml", "--out", "bad"];
    bench.refused(&learn, &["a number of components, or \"bic\""]);
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
