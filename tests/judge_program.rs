//! Judges that are programs: what they say is stored, whatever becomes of them costs no trial, and what is
//! wrong with one is said.

mod util;

use std::path::Path;
use std::process::Command;
use std::time::Duration;

use serde_json::Value;
use util::{Bench, bits, eventually, is_alive, kill, stderr, text};

/// A judge of heights that misbehaves at the third rollout as it is told.
const JUDGE: &str = r#"
import json, os, sys, time

kind = sys.argv[1]
with open("pid", "w") as file:
    file.write(str(os.getpid()))


def say(answer):
    print(json.dumps(answer), flush=True)


for line in sys.stdin:
    asked = json.loads(line)
    n, height = asked["rollout"], asked["measures"]["height"]
    answer = {"rollout": n, "reward": height, "success": height > 0.5, "measures": {"gap": 1 - height}}
    if kind == "once":
        say(answer)
        break
    if kind == "slow":
        # A kill may come before, within and after an answer.
        time.sleep(0.03)
        written = json.dumps(answer)
        sys.stdout.write(written[:9])
        sys.stdout.flush()
        time.sleep(0.03)
        print(written[9:], flush=True)
        continue
    if n != 3 or kind == "good":
        say(answer)
    elif kind == "declines":
        say({"rollout": n, "error": "the camera was covered"})
    elif kind == "hangs":
        time.sleep(600)
    elif kind == "exits":
        print("I give up", file=sys.stderr)
        sys.exit(3)
    elif kind == "dies":
        os.kill(os.getpid(), 9)
    elif kind == "closes":
        os.close(1)
        time.sleep(600)
    elif kind == "chats":
        print("hello", flush=True)
    elif kind == "floods":
        print("x" * 70000, flush=True)
    elif kind == "mistakes":
        say({**answer, "rollout": 4})
    elif kind == "repeats":
        sys.stdout.write(2 * (json.dumps(answer) + "\n"))
        sys.stdout.flush()
    elif kind == "forgets":
        say({"rollout": n, "reward": 1.0})
    elif kind == "adds":
        say({**answer, "measures": {"gap": 0.0, "more": 1.0}})
    elif kind == "divides":
        say({**answer, "reward": float("nan")})
    elif kind == "misspells":
        say({**answer, "sucess": True})
"#;

/// A folder with the judge, and a configuration that declares its measure.
fn stage(timeout_s: f64) -> Bench {
    let bench = Bench::new();
    bench.write("judge.py", JUDGE);
    let config = format!(
        "[task]\nname = \"landscape\"\n[task.judge]\nprogram = [\"python3\", \"judge.py\", \"hangs\"]\n\
         timeout_s = {timeout_s:?}\nmeasures = {{ gap = \"1\" }}\n[learner]\nseed = 5\nrollouts = 5\n"
    );
    bench.write("c.toml", &config);
    bench
}

/// Longer than any load on this host makes an answer take.
const PATIENT: f64 = 60.0;

fn command(kind: &str) -> String {
    format!("python3 judge.py {kind}")
}

fn learn<'a>(out: &'a str, rollouts: &'a str, judge: &'a str) -> Vec<&'a str> {
    let learn = ["learn", "landscape", "--config", "c.toml", "--out", out];
    [&learn[..], &["--rollouts", rollouts, "--judge", judge]].concat()
}

/// What the session's diary says of its judges.
fn judges(bench: &Bench, session: &str) -> Vec<String> {
    let events = bench.store(session).events().unwrap();
    events.into_iter().filter(|event| event.kind == "judge").map(|event| event.text).collect()
}

#[test]
fn what_a_program_says_is_stored_and_it_is_needed_no_more() {
    let bench = stage(PATIENT);
    bench.ok(&learn("whole", "24", &command("good")));
    let whole = bench.trials("whole");
    for trial in &whole {
        let measured = |name: &str| trial.measures.get(name).unwrap();
        assert_eq!(trial.reward.to_bits(), measured("height").to_bits());
        assert_eq!(trial.reward.to_bits(), measured("reward").to_bits());
        assert_eq!(measured("gap"), 1.0 - trial.reward);
        assert_eq!(
            (trial.success, trial.measures.has("success")),
            (trial.reward > 0.5, trial.success)
        );
    }
    bench.ok(&learn("split", "10", &command("good")));
    bench.ok(&learn("split", "24", &command("good")));
    assert_eq!(bits(&bench.trials("split")), bits(&whole));
    let said = judges(&bench, "split");
    assert_eq!(said.len(), 1, "{said:?}");
    assert!(said[0].starts_with("from rollout 1 on: python3 judge.py good (sha256 "), "{said:?}");
    // One that ends after each answer is as good as any.
    bench.ok(&learn("once", "24", &command("once")));
    assert_eq!(bits(&bench.trials("once")), bits(&whole));

    std::fs::remove_file(bench.path("judge.py")).unwrap();
    let said = bench.ok(&["replay", "whole", "--all"]);
    assert!(said.contains("24 trials replayed, 0 different"), "{said}");
    let said = bench.ok(&["judge", "whole", "--config", "whole/session.toml"]);
    assert!(said.contains("24 trials re-judged: 0 with another reward, 0 with another"), "{said}");
    let table = bench.ok(&["trials", "whole", "--csv", "-"]);
    let header = table.lines().next().unwrap();
    assert!(header.contains("height,judge_reward,judge_success,gap"), "{header}");
    bench.ok(&["policy", "modes", "whole"]);
    bench.refused(&learn("whole", "30", &command("good")), &["judge.py was not found in"]);
}

#[test]
fn a_session_says_from_which_rollout_on_its_judge_is_another_one() {
    let bench = stage(PATIENT);
    bench.ok(&learn("s", "3", &command("good")));
    bench.write("judge.py", &format!("{JUDGE}# repaired\n"));
    let output = bench.run(&learn("s", "5", &command("good")));
    let said = stderr(&output);
    assert!(output.status.success(), "{said}");
    assert!(said.contains("the judge has changed after rollout 3"), "{said}");
    let said = judges(&bench, "s");
    assert_eq!(said.len(), 2, "{said:?}");
    assert!(said[1].starts_with("from rollout 4 on: "), "{said:?}");
}

#[test]
fn a_program_that_is_killed_at_any_moment_costs_no_trial() {
    let bench = stage(PATIENT);
    bench.ok(&learn("undisturbed", "60", &command("good")));
    let running = bench.start(&learn("s", "60", &command("slow")));
    bench.wait_for_trials("s", 1);
    let mut kills = 0;
    loop {
        let n = bench.trials("s").len();
        if n + 4 > 60 {
            break;
        }
        // No rollout is hit thrice.
        bench.wait_for_trials("s", n + 3);
        std::thread::sleep(Duration::from_millis(11 * kills % 60));
        // A file that is just written, or a process that has just died, is left alone.
        let _ = Command::new("kill").args(["-KILL", text(&bench.path("pid")).trim()]).output();
        kills += 1;
    }
    let output = running.wait();
    assert!(output.status.success(), "{}", stderr(&output));
    assert!(kills >= 3, "{kills}");
    let log = text(&bench.path("s/learner.log"));
    assert!(log.contains("was killed by signal 9; restarted, request repeated"), "{log}");
    assert_eq!(bits(&bench.trials("s")), bits(&bench.trials("undisturbed")));
}

#[test]
fn what_is_no_answer_ends_the_session_by_name_and_a_better_program_goes_on_with_it() {
    let bench = stage(PATIENT);
    bench.ok(&learn("undisturbed", "5", &command("good")));
    let undisturbed = bits(&bench.trials("undisturbed"));
    for (kind, words) in [
        ("exits", &["ended with exit code 3", "its last output was `I give up`"][..]),
        ("dies", &["was killed by signal 9"]),
        ("closes", &["closed its standard input or output"]),
        ("chats", &["it replied `hello`, which is not valid"]),
        ("floods", &["a line of more than 65536 bytes"]),
        ("mistakes", &["for rollout 4 instead of 3"]),
        ("repeats", &["after its reply: write exactly one line"]),
        ("forgets", &["lacks the measure gap"]),
        ("adds", &["has a measure `more`"]),
        ("divides", &["NaN", "which is not valid"]),
        ("misspells", &["unknown field `sucess`"]),
    ] {
        let named = [command(kind), "failed 3 times on rollout 3".into(), "judge.log".into()];
        let named: Vec<&str> =
            named.iter().map(String::as_str).chain(words.iter().copied()).collect();
        bench.refused(&learn(kind, "5", &command(kind)), &named);
        assert_eq!(bits(&bench.trials(kind)), undisturbed[..2], "{kind}");
        bench.ok(&learn(kind, "5", &command("good")));
        assert_eq!(bits(&bench.trials(kind)), undisturbed, "{kind}");
    }
}

#[test]
fn a_rollout_that_a_program_declines_is_set_aside_with_its_words() {
    let bench = stage(PATIENT);
    bench.ok(&learn("s", "5", &command("declines")));
    let trials = bench.trials("s");
    let aside: Vec<u64> = trials.iter().filter(|t| t.set_aside).map(|t| t.rollout).collect();
    assert_eq!((aside, trials.len()), (vec![3], 5));
    assert!(trials[2].measures.is_empty());
    let events = bench.store("s").events().unwrap();
    let is_noted = |text: &str| events.iter().any(|event| event.text == text);
    assert!(is_noted("rollout 3: the camera was covered"), "{events:?}");
}

fn status(bench: &Bench) -> Option<Value> {
    let output = bench.run(&["status", "--cell", "c1", "--json"]);
    serde_json::from_slice(&output.stdout).ok().filter(|_| output.status.success())
}

const CONTROLLER: [&str; 7] = ["controller", "--cell", "c1", "--pace", "max", "--config", "c.toml"];
const LEARNER: [&str; 7] = ["learner", "--cell", "c1", "--session", "s", "--config", "c.toml"];

/// While it hangs the learner is there: its note is heard by the controller, which goes on after its end.
#[test]
fn a_program_that_hangs_is_given_up_and_nothing_else_hangs() {
    let bench = stage(2.5);
    let _controller = bench.start(&CONTROLLER);
    let learner = bench.start(&LEARNER);
    eventually("a learner that waits and beats", || {
        status(&bench)
            .filter(|now| now["notes"].to_string().contains("learner waits for its judge"))
    });
    let output = learner.wait();
    let said = stderr(&output);
    assert_eq!(output.status.code(), Some(2), "{said}");
    let words =
        ["failed 3 times on rollout 3", "did not reply within 2.5 s", "task.judge.timeout_s"];
    assert!(words.iter().all(|word| said.contains(word)), "{said}");
    assert_eq!(bench.trials("s").len(), 2);
    assert!(status(&bench).is_some(), "the controller goes on");

    bench.write("judge.py", &JUDGE.replace("time.sleep(600)", "say(answer)"));
    bench.ok(&LEARNER[..5]);
    bench.ok(&learn("undisturbed", "5", &command("good")));
    assert_eq!(bits(&bench.trials("s")), bits(&bench.trials("undisturbed")));
    assert_eq!(judges(&bench, "s").len(), 2);
}

#[test]
fn a_program_dies_with_its_learner() {
    let bench = stage(PATIENT);
    let _controller = bench.start(&CONTROLLER);
    let learner = bench.start(&LEARNER);
    bench.wait_for_trials("s", 2);
    // It sleeps, and does not see that its input has ended.
    let judge: u32 = text(&bench.path("pid")).parse().unwrap();
    assert!(is_alive(judge));
    kill(learner.pid(), "KILL");
    learner.wait();
    eventually("the end of the judge", || (!is_alive(judge)).then_some(()));
}

#[test]
fn what_cannot_judge_is_refused_before_it_starts() {
    let bench = stage(PATIENT);
    let judged_by = |judge: &str, words: &[&str]| {
        bench.refused(&learn("s", "5", judge), words);
        assert!(!bench.path("s").exists(), "nothing began");
    };
    judged_by("no-such-program-anywhere", &["no-such-program-anywhere was not found", "PATH"]);
    bench.write("judge", "print()");
    judged_by("./judge", &["./judge is not executable", "python3"]);
    judged_by("", &["the judge's program is empty"]);
    for (judge, words) in [
        ("measures = { gap = \"m\" }", &["task.judge.measures", "task.judge.program"][..]),
        ("success = \"height > 1\"", &["task.judge.reward is missing"]),
        (
            "program = [\"sh\"]\nmeasures = { height = \"m\" }",
            &["task.judge.measures", "height", "twice"],
        ),
        (
            "program = [\"sh\"]\nmeasures = { a = \"kilometre\" }",
            &["task.judge.measures", "kilometre"],
        ),
        ("program = [\"sh\"]\nreward = \"2*rewart\"", &["task.judge.reward", "rewart", "reward"]),
    ] {
        bench.write("bad.toml", &format!("[task]\nname = \"landscape\"\n[task.judge]\n{judge}\n"));
        bench.refused(&["learn", "landscape", "--config", "bad.toml", "--out", "s"], words);
    }
    // A session is not judged again by a program that it never had.
    bench.ok(&["learn", "landscape", "--rollouts", "2", "--out", "plain"]);
    let again = ["judge", "plain", "--config", "c.toml"];
    bench.refused(&again, &["task.judge.program does not run on stored trials", "height (1)"]);
}

/// Reads the file as its format says, without NumPy.
const READER: &str = r#"
import ast, json, struct, sys

SIZES = {"<f8": 8, "<u4": 4, "|b1": 1}
for line in sys.stdin:
    asked = json.loads(line)
    with open(asked["path"], "rb") as file:
        data = file.read()
    assert data[:8] == b"\x93NUMPY\x01\x00" and data.find(b"\n") % 64 == 63
    start = 10 + struct.unpack("<H", data[8:10])[0]
    header = ast.literal_eval(data[10:start].decode())
    places, width = {}, 0
    for name, kind, *shape in header["descr"]:
        places[name] = width
        width += SIZES[kind] * (shape[0][0] if shape else 1)
    (rows,) = header["shape"]
    assert len(data) == start + rows * width and not header["fortran_order"]
    number = lambda name, i: struct.unpack_from("<d", data, start + 10 * width + places[name] + 8 * i)[0]
    measures = {"rows": rows, "t_s": number("t_s", 0), "pan_m": number("p_m", 2), "high_m": number("object_m", 2)}
    print(json.dumps({"rollout": asked["rollout"], "reward": 1.0, "measures": measures}))
"#;

#[test]
fn the_path_is_a_file_as_numpy_writes_them() {
    let bench = Bench::new();
    bench.write("reader.py", READER);
    let measures = "rows = \"1\", t_s = \"s\", pan_m = \"m\", high_m = \"m\"";
    let judge = format!("program = [\"python3\", \"reader.py\"]\nmeasures = {{ {measures} }}");
    bench.write("c.toml", &format!("[task.judge]\n{judge}\n"));
    bench.ok(&["learn", "pancake", "--config", "c.toml", "--rollouts", "3", "--out", "s"]);
    for trial in bench.trials("s") {
        let measured = |name: &str| trial.measures.get(name).unwrap();
        assert_eq!(measured("rows"), trial.n_records as f64);
        // The stored path has every tenth record, in single precision.
        let stored = bench.store("s").path(trial.rollout).unwrap().unwrap()[1];
        let same = |name: &str, single: f32| assert_eq!(measured(name) as f32, single, "{name}");
        same("t_s", stored.t_s);
        same("pan_m", stored.pan_position[2]);
        same("high_m", stored.object_position[2]);
    }
    assert!(bench.path("s/rollout.npy").is_file());
}

#[test]
fn the_example_judges_pancakes() {
    let named = std::env::var("SKILLET_PYTHON").ok();
    let python = named.clone().unwrap_or_else(|| "python3".into());
    let import = Command::new(&python).args(["-c", "import numpy"]).output();
    let has_numpy = import.is_ok_and(|output| output.status.success());
    assert!(has_numpy || named.is_none(), "{python} lacks the package numpy");
    let bench = Bench::new();
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let config = root.join("config/pancake-judge.toml");
    let judge = format!("{python} {}", root.join("examples/judge.py").display());
    let learn = ["learn", "pancake", "--rollouts", "3", "--out", "s", "--judge", &judge];
    bench.ok(&[&learn[..], &["--config", config.to_str().unwrap()]].concat());
    for trial in bench.trials("s") {
        let measured = |name: &str| trial.measures.get(name).unwrap();
        let turn = measured("turn_rad").abs().min(std::f64::consts::PI) / std::f64::consts::PI;
        let caught = f64::from(u8::from(trial.measures.has("caught")));
        let paid = 1.5 * measured("apex_m").min(0.55) + turn + 2.0 * caught;
        assert!((trial.reward - (paid - measured("sway_m"))).abs() < 1e-12);
        assert_eq!(measured("sway_m") > 0.0, has_numpy);
        assert_eq!(trial.success, trial.measures.has("caught"));
    }
    if !has_numpy {
        eprintln!("nothing shown of numpy: {python} has no such package");
    }
}
