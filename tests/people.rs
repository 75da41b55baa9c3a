//! Judges that are people: a rating reaches a learner at work, at rest or dying, counts once from a known rollout
//! on, and the session repeats bit for bit.

mod util;

use std::time::Duration;

use learner::ratings::Rating;
use serde_json::Value;
use util::{Bench, Running, bits, eventually, kill, stderr, text};

/// A folder with a configuration of the cheapest task whose search can be told anew.
fn stage(people: &str) -> Bench {
    let bench = Bench::new();
    configure(&bench, people);
    bench
}

fn configure(bench: &Bench, people: &str) {
    let task = "[task]\nname = \"archery\"\n[learner]\nseed = 5\n";
    bench.write("c.toml", &format!("{task}[learner.people]\nfull_marks = 1.0\n{people}\n"));
}

fn learn<'a>(out: &'a str, rollouts: &'a str) -> Vec<&'a str> {
    vec!["learn", "archery", "--config", "c.toml", "--out", out, "--rollouts", rollouts]
}

fn ratings(bench: &Bench, session: &str) -> Vec<Rating> {
    bench.store(session).ratings().unwrap().all().to_vec()
}

/// What the person of these tests says of a rollout.
fn opinion(bench: &Bench, session: &str, rollout: u64) -> String {
    let trial = &bench.trials(session)[rollout as usize - 1];
    assert_eq!(trial.rollout, rollout);
    format!("{:.1}", 10.0 * (1.0 - trial.own_reward).abs().min(1.0))
}

fn rate(bench: &Bench, session: &str, rollout: u64) {
    let (number, rating) = (rollout.to_string(), opinion(bench, session, rollout));
    bench.ok(&["rate", session, "--rollout", &number, &rating]);
}

/// A session of rollouts that are rated one by one, those by `first` that it cares to rate.
fn rated(bench: &Bench, out: &str, n: u64, mut first: impl FnMut(u64, &mut Running) -> bool) {
    let rollouts = n.to_string();
    let mut running = bench.start(&learn(out, &rollouts));
    for rollout in 1..=n {
        bench.wait_for_trials(out, rollout as usize);
        if !first(rollout, &mut running) {
            rate(bench, out, rollout);
        }
        eventually("the rating", || {
            ratings(bench, out).iter().any(|rating| rating.rollout == rollout).then_some(())
        });
    }
    let output = running.wait();
    assert!(output.status.success(), "{}", stderr(&output));
}

#[test]
fn learning_waits_for_each_rating_and_a_kill_loses_none_and_takes_none_twice() {
    let bench = stage("weight = 0.5");
    rated(&bench, "whole", 9, |_, _| false);
    let whole = bench.trials("whole");
    for trial in &whole {
        let rating = trial.rating.expect("everything was rated");
        assert_eq!(trial.reward, 0.5 * trial.own_reward + 0.5 * (rating / 10.0));
    }

    rated(&bench, "killed", 9, |rollout, running| {
        if ![3, 5, 7].contains(&rollout) {
            return false;
        }
        // The kill comes before the letter, while it is taken, or just after.
        let learner = running.child("learner");
        if rollout == 3 {
            kill(learner, "KILL");
        }
        let (number, rating) = (rollout.to_string(), opinion(&bench, "killed", rollout));
        let judge = ["rate", "killed", "--rollout", &number, &rating];
        let judge = bench.start(&judge);
        if rollout > 3 {
            std::thread::sleep(Duration::from_millis(17 * (rollout - 3)));
            kill(learner, "KILL");
        }
        let said = judge.wait();
        assert!(said.status.success(), "{}", stderr(&said));
        let again = bench.start(&learn("killed", "9"));
        assert!(!std::mem::replace(running, again).wait().status.success());
        true
    });
    assert_eq!(bits(&bench.trials("killed")), bits(&whole));
    assert_eq!(ratings(&bench, "killed").len(), 9, "none is lost, none counts twice");
    assert!(std::fs::read_dir(bench.path("killed/mail")).unwrap().next().is_none());

    let said = bench.ok(&["replay", "whole", "--all"]);
    assert!(said.contains("9 trials replayed, 0 different"), "{said}");
    let table = bench.ok(&["trials", "whole", "--csv", "-"]);
    assert!(table.lines().next().unwrap().contains(",rating,own_reward,"), "{table}");
}

#[test]
fn a_session_at_rest_takes_what_was_said_when_it_is_resumed() {
    let bench = stage("weight = 0.5\nwait = false");
    bench.ok(&learn("silent", "16"));
    bench.ok(&learn("s", "10"));
    let say = |arguments: &[&str]| bench.ok(&[&["rate", "s"], arguments].concat());
    let said = say(&["9", "--rollout", "3"]);
    assert!(said.contains("rollout 3, rated 9.0: recorded; takes effect when"), "{said}");
    say(&["2", "--rollout", "3"]);
    say(&["--better"]);
    // With these, what the robot itself likes best counts for less.
    let trials = bench.trials("s");
    let others = trials.iter().filter(|trial| ![3, 9, 10].contains(&trial.rollout));
    let best = others.max_by(|a, b| a.own_reward.total_cmp(&b.own_reward)).unwrap().rollout;
    say(&["0", "--rollout", &best.to_string()]);
    assert!(ratings(&bench, "s").is_empty());
    bench.ok(&learn("s", "12"));
    let shown = |rollout: usize| bench.trials("s")[rollout - 1].rating;
    assert_eq!((shown(3), shown(best as usize)), (Some(2.0), Some(0.0)), "the last word counts");
    assert_eq!((shown(9), shown(10)), (Some(5.0), Some(6.25)));
    assert!(ratings(&bench, "s").iter().all(|rating| rating.after == 10));

    say(&["--withdraw", "--rollout", "3"]);
    say(&["--worse", "--rollout", "10"]);
    bench.ok(&learn("s", "14"));
    // Every proposal of before comes out again, or it would not resume.
    bench.ok(&learn("s", "16"));
    assert_eq!((shown(3), shown(10)), (None, Some(3.75)));
    let thetas = |name: &str| -> Vec<_> {
        bench.trials(name).into_iter().map(|trial| trial.theta).collect()
    };
    let (silent, s) = (thetas("silent"), thetas("s"));
    assert_eq!(silent[..10], s[..10]);
    assert_ne!(silent[10..], s[10..], "ratings are learnt from");
}

#[test]
fn where_ratings_alone_count_nothing_else_does() {
    let bench = stage("weight = 1.0\nwait = false\nsuccess_from = 6.0");
    bench.ok(&learn("s", "4"));
    assert!(bench.trials("s").iter().all(|trial| trial.unrated && !trial.success));
    bench.ok(&["rate", "s", "--rollout", "2", "6"]);
    bench.ok(&["rate", "s", "--rollout", "3", "5.9"]);
    bench.ok(&learn("s", "5"));
    let trials = bench.trials("s");
    assert!(trials[1].success && trials[1].reward == 0.6 && !trials[2].success);
    assert!(trials[0].unrated && trials[3].unrated);
    let table = bench.ok(&["judge", "s", "--config", "s/session.toml"]);
    assert!(table.contains("5 trials re-judged: 0 with another reward"), "{table}");
}

fn status(bench: &Bench) -> Option<Value> {
    let output = bench.run(&["status", "--cell", "c1", "--json"]);
    serde_json::from_slice(&output.stdout).ok().filter(|_| output.status.success())
}

#[test]
fn who_waits_for_a_rating_says_so_and_ends_when_it_is_asked_to() {
    let bench = stage("weight = 1.0\nask_after = 2");
    let controller = ["controller", "--cell", "c1", "--pace", "max", "--config", "c.toml"];
    let _controller = bench.start(&controller);
    let learner = bench.start(&["learner", "--cell", "c1", "--session", "s", "--config", "c.toml"]);
    for rollout in 1..=3 {
        let now = eventually("a learner that waits", || {
            let waits = |now: &Value| now["notes"].to_string().contains("skillet rate");
            status(&bench).filter(waits).filter(|_| bench.trials("s").len() == rollout)
        });
        let folder = bench.path("s").display().to_string();
        assert!(now["notes"].to_string().contains(&folder), "{now}");
        let said = bench.ok(&["rate", "s", "0", "--json"]);
        let said: Value = serde_json::from_str(&said).unwrap();
        assert_eq!(
            (said["rollout"].as_u64(), said["rating"].as_f64()),
            (Some(rollout as u64), Some(0.0))
        );
        if said["taken"] == true {
            assert_eq!(said["from_rollout"], rollout + 1);
        }
    }
    bench.wait_for_trials("s", 4);
    learner.signal("TERM");
    let output = learner.wait();
    assert_eq!(output.status.code(), Some(1), "{}", stderr(&output));
    let log = stderr(&output);
    assert!(log.contains("the search is stuck") && log.contains("skillet demo add"), "{log}");
    assert_eq!(ratings(&bench, "s").len(), 3);
}

#[test]
fn what_cannot_be_said_is_refused_with_the_reason() {
    let bench = stage("weight = 0.5\nwait = false");
    bench.ok(&learn("s", "3"));
    bench.ok(&["learn", "archery", "--rollouts", "2", "--out", "deaf"]);
    for (arguments, words) in [
        (&["rate", "s", "11"][..], &["use a number from 0 to 10"][..]),
        (&["rate", "s", "-1"], &["use a number from 0 to 10"]),
        (&["rate", "s", "NaN"], &["use a number from 0 to 10"]),
        (&["rate", "s", "five"], &["use a number from 0 to 10"]),
        (&["rate", "s", "7", "--rollout", "9"], &["no rollout 9; use 1..=3"]),
        (&["rate", "s", "--better", "--rollout", "1"], &["is the first one", "0 to 10"]),
        (&["rate", "s", "--better", "--worse"], &["cannot be used with"]),
        (&["rate", "s"], &["RATING", "--better"]),
        (&["rate"], &["SESSION"]),
        (&["rate", "nowhere", "7"], &["no session here"]),
        (&["rate", "deaf", "7"], &["learner.people.weight"]),
        (&["demo", "add", "s", "c.toml"], &["no arm"]),
    ] {
        bench.refused(arguments, words);
    }
    assert!(!bench.path("s/mail").exists() && !bench.path("deaf/mail").exists());
    // A foreign letter is put aside, and the session continues.
    std::fs::create_dir(bench.path("s/mail")).unwrap();
    let letter = r#"{"id": 1, "says": {"rating": {"rollout": 1, "rating": 11.0}}}"#;
    bench.write("s/mail/1.json", letter);
    bench.ok(&learn("s", "4"));
    assert!(bench.path("s/mail/1.refused").is_file() && ratings(&bench, "s").is_empty());
    assert!(text(&bench.path("s/learner.log")).contains("use 0 to 10"));

    configure(&bench, "weight = 0.25\nwait = false");
    bench.refused(&learn("s", "5"), &["learner.people.weight is 0.25", "was started with 0.5"]);
    let other = "[task]\nname = \"landscape\"\n[learner.people]\nweight = 0.5\n";
    bench.write("other.toml", other);
    let learn = ["learn", "landscape", "--config", "other.toml", "--out", "l"];
    bench.refused(&learn, &["learner.people.weight is 0.5", "use power or aim"]);
}

/// The movement of the pancake's demonstration, smaller by this factor.
fn movement(factor: f64) -> String {
    let whole = include_str!("../demos/pancake.csv");
    let row = |line: &str| -> String {
        let numbers: Vec<f64> = line.split(',').map(|number| number.parse().unwrap()).collect();
        let [t_s, x, y, z, pitch]: [f64; 5] = numbers[..].try_into().unwrap();
        format!("{t_s},{},{y},{},{pitch}", 0.78 + factor * (x - 0.78), 0.72 + factor * (z - 0.72))
    };
    let header = whole.lines().next().unwrap().to_string();
    [header].into_iter().chain(whole.lines().skip(1).map(row)).collect::<Vec<_>>().join("\n")
}

#[test]
fn a_demonstration_that_is_added_is_tried_next_and_the_session_resumes() {
    let bench = Bench::new();
    let learn = |out, rollouts| ["learn", "pancake", "--out", out, "--rollouts", rollouts];
    bench.ok(&learn("s", "3"));
    bench.write("smaller.csv", &movement(0.9));
    let short: Vec<String> = movement(0.9).lines().take(100).map(str::to_string).collect();
    bench.write("short.csv", &short.join("\n"));
    bench.refused(&["demo", "add", "s", "absent.csv"], &["absent.csv"]);
    bench.refused(&["demo", "add", "s", "short.csv"], &["short.csv", "equally long"]);
    let said = bench.ok(&["demo", "add", "s", "smaller.csv"]);
    assert!(said.contains("smaller.csv: recorded"), "{said}");
    bench.ok(&learn("s", "5"));
    bench.ok(&learn("s", "6"));
    let added = bench.store("s").added().unwrap();
    assert_eq!((added.len(), added[0].after, added[0].file.as_str()), (1, 3, "smaller.csv"));
    bench.ok(&learn("alone", "4"));
    let (s, alone) = (bench.trials("s"), bench.trials("alone"));
    assert_eq!(bits(&s[..3]), bits(&alone[..3]));
    assert_ne!(s[3].theta, alone[3].theta, "the new start");
    assert_eq!(s[4].theta, alone[3].theta, "and the first one goes on");
    let said = bench.ok(&["replay", "s", "--all"]);
    assert!(said.contains("6 trials replayed, 0 different"), "{said}");
}
