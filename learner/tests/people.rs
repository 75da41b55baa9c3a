//! What people say of a session counts from where it was taken on, once, and the session resumes bit for bit
//! whenever it is stopped.

mod common;

use std::fs;
use std::path::{Path, PathBuf};

use common::{episode, meta, value_judge as judge};
use learner::config::LearnerConfig;
use learner::mail::{Mail, Says};
use learner::people::PeopleConfig;
use learner::reward::RewardKind;
use learner::store::Store;
use learner::{Demonstration, Learner};
use shm_types::episode::{EpisodeHeader, TickRecord};
use shm_types::policy::PolicyMsg;
use tempfile::TempDir;

/// With a short initial batch, so that a dozen trials have updated the search.
fn config(weight: f64, wait: bool) -> LearnerConfig {
    let people = PeopleConfig { weight, wait, full_marks: 1.0, ..Default::default() };
    let mut config = LearnerConfig { people, ..Default::default() };
    config.search.power.n_initial = 5;
    config.action.start = vec![1.0, 2.0];
    config.reward.kind = RewardKind::Value;
    config
}

/// A session shown these demonstrations, or one of actions.
fn session(directory: &Path, config: &LearnerConfig, shown: &[Demonstration]) -> Learner {
    if directory.join("session.db").exists() {
        return Learner::resume(directory, "made up", config, shown, judge()).expect("it resumes");
    }
    let meta = meta("made up", 7, config.clone());
    Learner::create(directory, meta, shown, judge()).expect("a new session")
}

fn execute(policy: &PolicyMsg) -> (EpisodeHeader, Vec<TickRecord>) {
    // The nearer to (0, 1), the better; of a movement, the higher its middle.
    let [x, y] = [policy.action[0], policy.action[1] - 1.0];
    let middle = policy.components[3].attractor[2];
    let value = if policy.n_actions > 0 { (-x * x - y * y).exp() } else { middle };
    episode(policy, value)
}

fn step(learner: &mut Learner) {
    let policy = learner.next_policy().expect("the disk has space");
    let (header, records) = execute(&policy);
    learner.complete("", &header, &records).expect("the episode is its own");
}

fn thetas(learner: &Learner) -> Vec<Vec<u64>> {
    let bits = |values: &[f64]| values.iter().map(|value| value.to_bits()).collect();
    learner.trials().iter().map(|trial| bits(trial.theta.as_slice())).collect()
}

fn say(directory: &Path, rollout: u64, rating: Option<f64>) {
    Mail::of(directory).post(Says::Rating { rollout, rating }).unwrap();
}

/// What is said after so many trials: late, otherwise, and not any more.
fn say_after(directory: &Path, n: u64) {
    let mail = Mail::of(directory);
    match n {
        3 => say(directory, 2, Some(9.0)),
        8 => {
            say(directory, 2, Some(1.0));
            say(directory, 8, Some(0.0));
        }
        10 => drop(mail.post(Says::Comparison { rollout: 10, than: 9, is_better: true }).unwrap()),
        14 => {
            say(directory, 8, Some(10.0));
            say(directory, 2, None);
        }
        _ => {}
    }
}

/// A session of 20 rollouts that is stopped and resumed after those that `stops` says.
fn told(config: &LearnerConfig, stops: impl Fn(u64) -> bool) -> (Vec<Vec<u64>>, Vec<Vec<u64>>) {
    let directory = TempDir::new().unwrap();
    let mut learner = session(directory.path(), config, &[]);
    for n in 1..=20 {
        step(&mut learner);
        say_after(directory.path(), n);
        if stops(n) {
            drop(learner);
            learner = session(directory.path(), config, &[]);
        }
        learner.take_mail().unwrap();
        if stops(n + 1) {
            drop(learner);
            learner = session(directory.path(), config, &[]);
        }
    }
    let bits = learner.trials().iter().map(|trial| trial.bits()).collect();
    (thetas(&learner), bits)
}

#[test]
fn ratings_count_from_where_they_were_taken_and_a_stop_changes_nothing() {
    for weight in [0.5, 1.0] {
        let config = config(weight, false);
        let whole = told(&config, |_| false);
        assert_eq!(told(&config, |n| n % 2 == 0), whole, "weight {weight}");
        assert_eq!(told(&config, |n| n % 2 == 1), whole, "weight {weight}");
        assert_eq!(told(&config, |_| true), whole, "weight {weight}");
    }
    let (silent, heard) =
        (told(&config(0.0, false), |_| false), told(&config(0.5, false), |_| false));
    assert_eq!(silent.0[..3], heard.0[..3]);
    assert_ne!(silent.0, heard.0, "ratings are learnt from");
}

#[test]
fn what_counts_is_the_last_word() {
    let directory = TempDir::new().unwrap();
    let config = config(0.5, false);
    let mut learner = session(directory.path(), &config, &[]);
    (0..3).for_each(|_| step(&mut learner));
    let own = learner.trials()[1].own_reward;
    let shown = |learner: &Learner| (learner.trials()[1].rating, learner.trials()[1].reward);
    for (rating, reward) in
        [(Some(8.0), 0.5 * own + 0.4), (Some(2.0), 0.5 * own + 0.1), (None, own)]
    {
        say(directory.path(), 2, rating);
        assert_eq!(learner.take_mail().unwrap().len(), 1);
        assert_eq!(shown(&learner), (rating, reward));
        learner = session(directory.path(), &config, &[]);
        assert_eq!(shown(&learner), (rating, reward));
        assert_eq!(learner.store().trials().unwrap(), learner.trials());
    }
    // A rollout that is better than one without a rating.
    let says = Says::Comparison { rollout: 3, than: 1, is_better: true };
    Mail::of(directory.path()).post(says).unwrap();
    assert_eq!(learner.take_mail().unwrap()[0].rollouts, [1, 3]);
    let ratings: Vec<_> = learner.trials().iter().map(|trial| trial.rating).collect();
    assert_eq!(ratings, [Some(5.0), None, Some(6.25)]);
}

/// Between what a letter says being durable and the letter being removed, a kill leaves it there.
#[test]
fn a_letter_that_is_found_again_counts_once() {
    let directory = TempDir::new().unwrap();
    let config = config(0.5, false);
    let mut learner = session(directory.path(), &config, &[]);
    step(&mut learner);
    say(directory.path(), 1, Some(3.0));
    let letters = || -> Vec<PathBuf> {
        let entries = fs::read_dir(directory.path().join("mail")).unwrap();
        entries.map(|entry| entry.unwrap().path()).collect()
    };
    let letter = letters().remove(0);
    let text = fs::read(&letter).unwrap();
    assert_eq!(learner.take_mail().unwrap().len(), 1);
    assert!(letters().is_empty());
    drop(learner);

    fs::write(&letter, text).unwrap();
    let mut learner = session(directory.path(), &config, &[]);
    let pending = learner.next_policy().unwrap();
    assert!(learner.take_mail().unwrap().is_empty() && letters().is_empty());
    assert_eq!(learner.next_policy().unwrap(), pending);
    assert_eq!(learner.store().ratings().unwrap().all().len(), 1);
}

#[test]
fn what_cannot_be_taken_is_put_aside_and_changes_nothing() {
    let directory = TempDir::new().unwrap();
    let mut learner = session(directory.path(), &config(0.5, false), &[]);
    (0..2).for_each(|_| step(&mut learner));
    let pending = learner.next_policy().unwrap();
    let mail = Mail::of(directory.path());
    for (rollout, rating) in [(3, Some(5.0)), (0, None), (1, Some(10.5)), (1, Some(-0.5))] {
        mail.post(Says::Rating { rollout, rating }).unwrap();
    }
    mail.post(Says::Comparison { rollout: 2, than: 7, is_better: false }).unwrap();
    let shown = Says::Demonstration { file: "a.csv".into(), text: "t_s,x_m\n".into() };
    mail.post(shown).unwrap();
    assert!(learner.take_mail().unwrap().is_empty());
    assert_eq!(learner.next_policy().unwrap(), pending);
    let entries = fs::read_dir(directory.path().join("mail")).unwrap();
    let is_aside = |path: PathBuf| path.extension().is_some_and(|end| end == "refused");
    assert_eq!(entries.filter(|entry| is_aside(entry.as_ref().unwrap().path())).count(), 6);

    let silent = TempDir::new().unwrap();
    let mut learner = session(silent.path(), &config(0.0, false), &[]);
    step(&mut learner);
    say(silent.path(), 1, Some(7.0));
    assert!(learner.take_mail().unwrap().is_empty(), "no rating counts here");
}

#[test]
fn learning_waits_for_the_rating_of_each_rollout() {
    let directory = TempDir::new().unwrap();
    let config = config(1.0, true);
    let mut learner = session(directory.path(), &config, &[]);
    for n in 1..=12 {
        assert_eq!(learner.awaits_rating(), None);
        step(&mut learner);
        assert_eq!(learner.awaits_rating(), Some(n));
        assert_eq!(learner.store().in_flight().unwrap(), [], "it waits for the rating");
        if n == 6 {
            drop(learner);
            learner = session(directory.path(), &config, &[]);
            assert_eq!(learner.awaits_rating(), Some(n));
        }
        // Who says that there is no rating has said enough.
        say(directory.path(), n, (n != 7).then_some(n as f64 / 2.0));
        learner.take_mail().unwrap();
    }
    drop(learner);
    let learner = session(directory.path(), &config, &[]);
    assert_eq!(learner.summary().first_success, None, "7 is a success, and nothing was");
    let unrated: Vec<u64> =
        learner.trials().iter().filter(|trial| trial.unrated).map(|trial| trial.rollout).collect();
    assert_eq!(unrated, [7]);
    assert_eq!(learner.trials()[11].reward, 0.6);
}

#[test]
fn a_search_that_stands_still_says_so() {
    let directory = TempDir::new().unwrap();
    let mut config = config(1.0, false);
    config.people.ask_after = 3;
    let mut learner = session(directory.path(), &config, &[]);
    let mut still = Vec::new();
    for (n, rating) in [0.0, 0.0, 1.0, 1.0, 0.5, 1.0, 2.0, 9.0, 1.0, 1.0, 1.0].iter().enumerate() {
        step(&mut learner);
        say(directory.path(), n as u64 + 1, Some(*rating));
        learner.take_mail().unwrap();
        still.push(learner.stands_still());
    }
    let at: Vec<usize> = (1..).zip(&still).filter(|(_, still)| **still).map(|(n, _)| n).collect();
    assert_eq!(at, [6], "no better for three rollouts, and without a success so far");
}

fn demonstration(text: &str) -> Demonstration {
    Demonstration::parse("shown.csv", text).expect("it is valid")
}

/// The project's demonstration, and one with a part of its movement.
fn movements() -> (String, String) {
    let path = concat!(env!("CARGO_MANIFEST_DIR"), "/../demos/pancake.csv");
    let whole = fs::read_to_string(path).expect("the project's demonstration");
    let smaller = |line: &str| -> String {
        let numbers: Vec<f64> = line.split(',').map(|number| number.parse().unwrap()).collect();
        let [t_s, x, y, z, pitch]: [f64; 5] = numbers[..].try_into().unwrap();
        format!("{t_s},{},{y},{},{pitch}", 0.78 + 0.8 * (x - 0.78), 0.72 + 0.8 * (z - 0.72))
    };
    let lines = whole.lines().skip(1).map(smaller);
    let text = [whole.lines().next().unwrap().to_string()].into_iter().chain(lines);
    let other = text.collect::<Vec<_>>().join("\n");
    (whole, other)
}

#[test]
fn a_demonstration_that_is_added_is_one_more_start() {
    let (whole, other) = movements();
    let shown = [demonstration(&whole)];
    let config = config(0.0, false);
    let run = |stops: bool| {
        let directory = TempDir::new().unwrap();
        let mut learner = session(directory.path(), &config, &shown);
        for n in 1..=16 {
            step(&mut learner);
            if n == 7 {
                let says = Says::Demonstration { file: "b.csv".into(), text: other.clone() };
                Mail::of(directory.path()).post(says).unwrap();
            }
            learner.take_mail().unwrap();
            if stops && n % 3 == 1 {
                drop(learner);
                learner = session(directory.path(), &config, &shown);
            }
        }
        let added = Store::open(&directory.path().join("session.db")).unwrap().added().unwrap();
        assert_eq!((added.len(), added[0].after), (1, 7));
        assert_eq!(learner.modes().unwrap().len(), 2, "one from each start");
        thetas(&learner)
    };
    let thetas = run(false);
    assert_eq!(run(true), thetas);

    let directory = TempDir::new().unwrap();
    let mut alone = session(directory.path(), &config, &shown);
    (0..8).for_each(|_| step(&mut alone));
    let alone: Vec<Vec<u64>> = self::thetas(&alone);
    assert_eq!(alone[..7], thetas[..7]);
    assert_ne!(alone[7], thetas[7], "the new start");
    assert_eq!(alone[7], thetas[8], "and the first one goes on");
}
