//! A session against a made-up controller: deterministic, resumable at any point, and deaf to
//! episodes that are not its own.

mod common;

use std::path::Path;

use common::meta;
use learner::config::LearnerConfig;
use learner::judge::Judge;
use learner::learner::SESSION_FILE;
use learner::modes::MODE_POLICY_ID;
use learner::reward::{RewardConfig, RewardKind};
use learner::{CompleteError, Demonstration, Learner, LearnerError};
use search::power::PowerConfig;
use search::{Method, SearchConfig};
use shm_types::episode::{EpisodeHeader, TickRecord};
use shm_types::measures::{Measure, Measures, TRUTH};
use shm_types::policy::PolicyMsg;
use tempfile::TempDir;

const SESSION: u64 = 0xfeed_0000_0000_0001;

fn demonstration() -> Demonstration {
    let path = concat!(env!("CARGO_MANIFEST_DIR"), "/../demos/pancake.csv");
    let text = std::fs::read_to_string(path).expect("the project's demonstration");
    Demonstration::parse("pancake.csv", &text).expect("it is valid")
}

fn config(seed: u64) -> LearnerConfig {
    // A short initial batch, so that a dozen trials have updated the search.
    let power = PowerConfig { n_initial: 10, ..Default::default() };
    let search = SearchConfig { power, ..Default::default() };
    let reward = RewardConfig { kind: RewardKind::Paper, ..Default::default() };
    LearnerConfig { seed, search, reward, ..Default::default() }
}

fn create(directory: &Path, config: LearnerConfig) -> Learner {
    let meta = meta("pancake", SESSION, config);
    Learner::create(directory, meta, &[demonstration()], judge()).expect("a new session")
}

/// By the paper's reward, of which this world measures the height.
fn judge() -> Judge {
    let reward = RewardConfig { kind: RewardKind::Paper, ..Default::default() };
    Judge::of_plant(&[("caught", TRUTH), ("apex_m", "m")], reward)
}

/// The made-up controller: the pancake rises the higher, the higher the attractors in the middle.
fn execute(policy: &PolicyMsg) -> (EpisodeHeader, Vec<TickRecord>) {
    assert_eq!(policy.validate(), Ok(()));
    let apex_m = (policy.components[3].attractor[2] - 0.5).max(0.0);
    let caught = f64::from(u8::from(apex_m > 0.7));
    let measures = [
        Measure { name: "caught", unit: TRUTH, value: caught },
        Measure { name: "apex_m", unit: "m", value: apex_m },
    ];
    let header = EpisodeHeader {
        boot_id: 77,
        session: policy.session,
        rollout: policy.rollout,
        policy_id: policy.policy_id,
        policy_digest: policy.digest,
        applied_tick: 1000 * policy.rollout,
        n_records: 30,
        measures: Measures::of(measures).unwrap(),
        ..Default::default()
    };
    (header, vec![TickRecord::ZERO; 32])
}

fn run(learner: &mut Learner, until: u64) {
    while learner.durable_rollout() < until {
        let policy = learner.next_policy().expect("the disk has space");
        let (header, records) = execute(&policy);
        let report = learner.complete("", &header, &records).expect("the episode is its own");
        assert_eq!(report.reward, 0.5 * header.measures.get("apex_m").unwrap());
    }
}

/// The policy of the only mode of PoWER.
fn mode_policy(learner: &mut Learner) -> PolicyMsg {
    let modes = learner.modes().expect("the disk has space");
    assert_eq!(modes.len(), 1);
    modes[0].1
}

fn theta_bits(learner: &Learner) -> Vec<Vec<u64>> {
    let bits = |values: &[f64]| values.iter().map(|value| value.to_bits()).collect();
    learner.trials().iter().map(|trial| bits(trial.theta.as_slice())).collect()
}

#[test]
fn same_seed_same_bits() {
    for method in [Method::Power, Method::Random, Method::Algorithm1, Method::Tempered] {
        let run_once = |seed| {
            let directory = TempDir::new().unwrap();
            let mut config = config(seed);
            config.search.method = method;
            let mut learner = create(directory.path(), config);
            run(&mut learner, 30);
            theta_bits(&learner)
        };
        assert_eq!(run_once(1), run_once(1));
        assert_ne!(run_once(1), run_once(2));
    }
}

#[test]
fn resuming_after_40_trials_equals_100_without_a_stop() {
    let whole = TempDir::new().unwrap();
    let mut reference = create(whole.path(), config(5));
    run(&mut reference, 100);
    assert!(reference.is_done());

    let split = TempDir::new().unwrap();
    let mut learner = create(split.path(), config(5));
    run(&mut learner, 40);
    drop(learner);
    let mut learner =
        Learner::resume(split.path(), "pancake", &config(5), &[demonstration()], judge())
            .expect("resumes");
    assert_eq!(learner.durable_rollout(), 40);
    run(&mut learner, 100);

    assert_eq!(theta_bits(&learner), theta_bits(&reference));
    assert_eq!(learner.summary(), reference.summary());
    assert_eq!(mode_policy(&mut learner), mode_policy(&mut reference));
    assert_eq!(learner.store().searches().unwrap(), reference.store().searches().unwrap());
    assert!(learner.summary().best_reward > learner.trials()[0].reward);
}

#[test]
fn a_crash_after_publishing_loses_no_rollout() {
    let directory = TempDir::new().unwrap();
    let mut learner = create(directory.path(), config(2));
    run(&mut learner, 15);
    let published = learner.next_policy().unwrap();
    drop(learner);

    let mut learner =
        Learner::resume(directory.path(), "pancake", &config(2), &[demonstration()], judge())
            .unwrap();
    // The controller finished the rollout meanwhile: its episode counts without asking again.
    let (header, records) = execute(&published);
    assert_eq!(learner.complete("", &header, &records).unwrap().rollout, 16);
    assert_eq!(learner.next_policy().unwrap().rollout, 17);
    drop(learner);

    let mut learner =
        Learner::resume(directory.path(), "pancake", &config(2), &[demonstration()], judge())
            .unwrap();
    let again = learner.next_policy().unwrap();
    assert_eq!(again, learner.next_policy().unwrap());
    assert_eq!(learner.store().policy(17).unwrap(), Some(again));
    let kinds: Vec<_> = learner.store().events().unwrap().into_iter().map(|e| e.kind).collect();
    assert_eq!(kinds, ["created", "resumed", "resumed"]);
}

#[test]
fn the_first_rollout_is_the_demonstration() {
    let directory = TempDir::new().unwrap();
    let mut learner = create(directory.path(), config(2));
    let first = learner.next_policy().unwrap();
    let initial = learner.store().initial_policy().unwrap();
    assert_eq!((first.session, first.rollout, first.policy_id), (SESSION, 1, 1));
    assert_eq!((initial.session, initial.rollout, initial.policy_id), (SESSION, 0, 0));
    for (a, b) in first.components().iter().zip(initial.components()) {
        for (a, b) in
            a.attractor.iter().chain(&a.stiffness).zip(b.attractor.iter().chain(&b.stiffness))
        {
            assert!((a - b).abs() < 1e-9 * b.abs().max(1.0));
        }
    }
}

#[test]
fn refuses_episodes_that_are_not_its_own_and_changes_nothing() {
    let directory = TempDir::new().unwrap();
    let mut learner = create(directory.path(), config(3));
    run(&mut learner, 12);
    let duplicate = execute(&learner.store().policy(12).unwrap().unwrap());
    let policy = learner.next_policy().unwrap();
    let (header, records) = execute(&policy);
    let mut refused = |header: EpisodeHeader, records: &[TickRecord]| {
        learner.complete("", &header, records).expect_err("not its own")
    };

    let foreign = refused(EpisodeHeader { session: 1, ..header }, &records);
    assert!(matches!(foreign, CompleteError::ForeignSession { found: 1, expected: SESSION }));
    let late = refused(duplicate.0, &duplicate.1);
    assert!(matches!(late, CompleteError::Duplicate { rollout: 12 }));
    for rollout in [0, 14, u64::MAX] {
        let early = refused(EpisodeHeader { rollout, ..header }, &records);
        assert!(matches!(early, CompleteError::NotAsked { .. }), "{early}");
    }
    let other = refused(EpisodeHeader { policy_digest: 1, ..header }, &records);
    assert!(matches!(other, CompleteError::OtherPolicy { rollout: 13 }));
    let other = refused(EpisodeHeader { policy_id: 1, ..header }, &records);
    assert!(matches!(other, CompleteError::OtherPolicy { rollout: 13 }));
    let short = refused(header, &records[..3]);
    assert!(matches!(short, CompleteError::Invalid(_)));

    assert_eq!(learner.store().trial_count().unwrap(), 12);
    assert_eq!(learner.next_policy().unwrap(), policy);
    learner.complete("", &header, &records).expect("the right one still counts");
    assert_eq!(learner.store().path(13).unwrap().map(|rows| rows.len()), Some(3));
}

#[test]
fn a_trial_that_could_not_be_stored_was_not_learnt() {
    let directory = TempDir::new().unwrap();
    let mut learner = create(directory.path(), config(3));
    run(&mut learner, 20);
    let policy = learner.next_policy().unwrap();
    let mean = mode_policy(&mut learner);
    let (header, records) = execute(&policy);
    // Another program put a row where the trial's search state belongs.
    let database = rusqlite::Connection::open(directory.path().join(SESSION_FILE)).unwrap();
    database.execute_batch("PRAGMA foreign_keys = OFF").unwrap();
    database.execute_batch("INSERT INTO searches VALUES (21, 0, x'', x'', 0)").unwrap();
    let error = learner.complete("", &header, &records).expect_err("the row is taken");
    assert!(matches!(error, CompleteError::Learner(LearnerError::Store(_))), "{error}");
    assert_eq!(mode_policy(&mut learner), mean);
    database.execute_batch("DELETE FROM searches WHERE rollout = 21").unwrap();
    learner.complete("", &header, &records).expect("it can be stored now");

    let reference_directory = TempDir::new().unwrap();
    let mut reference = create(reference_directory.path(), config(3));
    run(&mut reference, 21);
    assert_eq!(learner.next_policy().unwrap(), reference.next_policy().unwrap());
}

/// A process that dies after the trial has left the next proposal, too: nobody has to ask for it.
#[test]
fn a_trial_is_stored_with_the_proposal_after_it() {
    let directory = TempDir::new().unwrap();
    let mut learner = create(directory.path(), config(3));
    run(&mut learner, 20);
    let pending = |learner: &Learner| learner.store().in_flight().unwrap();
    assert_eq!(pending(&learner)[0].proposal.rollout, 21);
    let policy = learner.next_policy().unwrap();
    let (header, records) = execute(&policy);
    // Another program put a row where the next proposal belongs.
    let database = rusqlite::Connection::open(directory.path().join(SESSION_FILE)).unwrap();
    database.execute_batch("INSERT INTO proposals VALUES (22, 0, x'')").unwrap();
    let before = mode_policy(&mut learner);
    learner.complete("", &header, &records).expect_err("the row is taken");
    learner.set_aside("", 21, "neither").expect_err("the row is taken");
    assert_eq!((learner.durable_rollout(), learner.store().trial_count().unwrap()), (20, 20));
    assert_eq!((learner.next_policy().unwrap(), mode_policy(&mut learner)), (policy, before));
    database.execute_batch("DELETE FROM proposals WHERE rollout = 22").unwrap();
    learner.complete("", &header, &records).expect("it can be stored now");
    let events = learner.store().events().unwrap();
    assert!(events.iter().all(|event| event.kind == "created"), "{events:?}");

    let next = learner.store().policy(22).unwrap();
    drop(learner);
    let resume = |rollouts| {
        let config = LearnerConfig { rollouts, ..config(3) };
        Learner::resume(directory.path(), "pancake", &config, &[demonstration()], judge()).unwrap()
    };
    let mut learner = resume(23);
    assert_eq!(Some(learner.next_policy().unwrap()), next);
    run(&mut learner, 23);
    assert!(learner.is_done() && pending(&learner).is_empty(), "nothing after the last one");
    drop(learner);
    let mut learner = resume(25);
    assert!(pending(&learner).is_empty());
    assert_eq!(learner.next_policy().unwrap().rollout, 24);
    assert_eq!(pending(&learner)[0].proposal.rollout, 24);
    run(&mut learner, 25);

    let reference_directory = TempDir::new().unwrap();
    let mut reference = create(reference_directory.path(), config(3));
    run(&mut reference, 25);
    assert_eq!(theta_bits(&learner), theta_bits(&reference));
}

#[test]
fn a_rollout_set_aside_is_counted_and_not_learnt_and_the_session_resumes() {
    let directory = TempDir::new().unwrap();
    let mut learner = create(directory.path(), config(3));
    run(&mut learner, 12);
    let before = mode_policy(&mut learner);
    let policy = learner.next_policy().unwrap();
    let (header, records) = execute(&policy);
    let mut spoilt = header;
    spoilt.measures.values[1] = f64::NAN;
    let error = learner.complete("", &spoilt, &records);
    assert!(matches!(error, Err(CompleteError::Invalid(_))));
    assert!(learner.set_aside("", 13, "apex_m is NaN").unwrap().set_aside);

    assert_eq!((learner.durable_rollout(), learner.summary().set_aside), (13, 1));
    let after = mode_policy(&mut learner);
    assert_eq!(after.digest, before.digest, "nothing was learnt");
    run(&mut learner, 20);
    let next = learner.next_policy().unwrap();
    drop(learner);
    let mut resumed =
        Learner::resume(directory.path(), "pancake", &config(3), &[demonstration()], judge())
            .unwrap();
    assert_eq!(resumed.next_policy().unwrap(), next);
    let events = resumed.store().events().unwrap();
    assert!(events.iter().any(|event| event.text == "rollout 13: apex_m is NaN"));
}

#[test]
fn other_measures_than_the_sessions_are_refused_with_both_lists() {
    let directory = TempDir::new().unwrap();
    let mut learner = create(directory.path(), config(3));
    run(&mut learner, 2);
    let policy = learner.next_policy().unwrap();
    let (header, records) = execute(&policy);
    let height = Measure { name: "height_m", unit: "m", value: 0.5 };
    let other = EpisodeHeader { measures: Measures::of([height]).unwrap(), ..header };
    let error = learner.complete("", &other, &records).unwrap_err();
    assert!(matches!(error, CompleteError::Learner(LearnerError::Judge(_))), "{error:?}");
    let message = error.to_string();
    assert!(message.contains("height_m (m)") && message.contains("caught (bool), apex_m (m)"));
    // Nothing is lost: the plant it began with goes on.
    learner.complete("", &header, &records).unwrap();
    drop(learner);

    let judge = Judge::of_plant(&[("height_m", "m")], RewardConfig::default());
    let resumed =
        Learner::resume(directory.path(), "pancake", &config(3), &[demonstration()], judge);
    let message = resumed.err().unwrap().to_string();
    assert!(message.contains("height_m (m)") && message.contains("apex_m (m)"), "{message}");
}

#[test]
fn resumes_only_with_its_own_task_configuration_and_history() {
    let directory = TempDir::new().unwrap();
    let mut learner = create(directory.path(), config(3));
    run(&mut learner, 12);
    learner.next_policy().unwrap();
    drop(learner);
    let resume = |task: &str, config: &LearnerConfig| {
        Learner::resume(directory.path(), task, config, &[demonstration()], judge())
    };
    let refused = |task: &str, config: &LearnerConfig| resume(task, config).err().unwrap();

    let error = refused("skittles", &config(3)).to_string();
    assert!(error.contains("task `pancake`"), "{error}");
    let error = refused("pancake", &config(4)).to_string();
    assert!(error.contains("learner.seed is 4, but the session was started with 3"), "{error}");
    let error = refused("pancake", &LearnerConfig { kappa_p: -1.0, ..config(3) }).to_string();
    assert!(error.contains("learner.kappa_p is -1"), "{error}");
    assert!(resume("pancake", &LearnerConfig { rollouts: 12, ..config(3) }).unwrap().is_done());

    // Changed by another program, and restored from the second copy.
    for change in [
        "UPDATE proposals SET theta = (SELECT theta FROM trials WHERE rollout = 1) \
         WHERE rollout = 13",
        "UPDATE trials SET reward = reward + 1 WHERE rollout = 4",
    ] {
        let database = rusqlite::Connection::open(directory.path().join(SESSION_FILE)).unwrap();
        database.execute_batch(change).unwrap();
        drop(database);
        let learner = resume("pancake", &config(3)).unwrap();
        let events = learner.store().events().unwrap();
        assert!(events.iter().any(|event| event.kind == "restored"));
    }
}

#[test]
fn the_mean_is_stored_as_a_policy_of_no_rollout() {
    let directory = TempDir::new().unwrap();
    let mut learner = create(directory.path(), config(3));
    run(&mut learner, 15);
    let mean = mode_policy(&mut learner);
    assert_eq!((mean.rollout, mean.policy_id), (0, MODE_POLICY_ID + 1501));
    assert_eq!(mode_policy(&mut learner), mean);
    assert_eq!(learner.store().policy(mean.policy_id).unwrap(), Some(mean));
}

/// Resumed with a wish, a session goes on with what its repertoire has for it, and the search with what the
/// trials so far look like under it; stopped again, it is the same.
#[test]
fn a_wish_holds_from_where_a_session_is_resumed_with_it() {
    let (split, directory) = (TempDir::new().unwrap(), TempDir::new().unwrap());
    let (mut whole, mut parts) =
        (create(split.path(), config(5)), create(directory.path(), config(5)));
    run(&mut whole, 40);
    run(&mut parts, 40);
    let successes = |learner: &Learner| learner.trials().iter().filter(|t| t.success).count();
    let highest = parts.trials().iter().filter(|trial| trial.success);
    let heights: Vec<f64> = highest.map(|trial| trial.measures.get("apex_m").unwrap()).collect();
    let middle = heights.iter().sum::<f64>() / heights.len() as f64;
    let (wish, before) = (format!("apex_m < {middle}"), successes(&parts));
    let mode = mode_policy(&mut parts);
    let pending = parts.next_policy().unwrap();

    let wished = |wish: &str| LearnerConfig { wish: wish.into(), ..config(5) };
    drop((whole, parts));
    let resumed = |directory: &TempDir, wish: &str| {
        let (path, of) = (directory.path(), [demonstration()]);
        Learner::resume(path, "pancake", &wished(wish), &of, judge()).unwrap()
    };
    let (mut whole, mut parts) = (resumed(&split, &wish), resumed(&directory, &wish));
    assert_ne!(parts.next_policy().unwrap(), pending, "that was made without a wish");
    let (wished_mode, id) = (mode_policy(&mut parts), mode.policy_id);
    assert!(wished_mode.policy_id == id && wished_mode != mode, "the mode is another one, too");
    assert_eq!(parts.store().policy(id).unwrap(), Some(wished_mode));
    let text = format!("from rollout 41 on a success must meet: `{wish}`");
    assert!(parts.store().events().unwrap().iter().any(|event| event.text == text));

    run(&mut whole, 80);
    run(&mut parts, 41);
    let first = parts.trials()[40].clone();
    assert!(first.success && first.measures.get("apex_m").unwrap() < middle, "from the repertoire");
    assert_eq!(successes(&parts), before + 1, "what was a success stays one");
    run(&mut parts, 55);
    drop(parts);
    let mut parts = resumed(&directory, &wish);
    run(&mut parts, 80);
    assert_eq!(theta_bits(&parts), theta_bits(&whole));
    let missed = |trial: &&learner::store::TrialRecord| trial.judged_success && !trial.success;
    let under: Vec<_> = parts.trials()[40..].iter().collect();
    let as_wished = |n: &f64| *n < middle;
    for trial in &under {
        let apex_m = trial.measures.get("apex_m").unwrap();
        assert_eq!(trial.success, trial.judged_success && as_wished(&apex_m));
    }
    assert_eq!(parts.trials()[..40].iter().filter(missed).count(), 0);
    drop(parts);

    // Without a wish again, it learns from all of them.
    let mut free = resumed(&directory, "");
    assert_eq!(free.trials().iter().filter(missed).count(), under_missed(&free));
    run(&mut free, 90);
    assert!(free.trials()[80..].iter().all(|trial| trial.success == trial.judged_success));
}

fn under_missed(learner: &Learner) -> usize {
    learner.trials()[40..80].iter().filter(|t| t.judged_success && !t.success).count()
}

#[test]
fn a_wish_that_cannot_be_is_refused_and_changes_nothing() {
    let directory = TempDir::new().unwrap();
    let mut learner = create(directory.path(), config(5));
    run(&mut learner, 12);
    drop(learner);
    let resume = |config: &LearnerConfig| {
        Learner::resume(directory.path(), "pancake", config, &[demonstration()], judge())
    };
    let with = |wish: &str| LearnerConfig { wish: wish.into(), ..config(5) };
    let error = resume(&with("height < 1")).err().unwrap().to_string();
    assert!(error.contains("learner.where: there is no measure `height`"), "{error}");
    assert!(resume(&with("apex_m + 1")).err().unwrap().to_string().contains("learner.where"));
    let mut by_batch = with("apex_m < 1");
    by_batch.search.method = Method::Cem;
    let error = by_batch.validate().unwrap_err().to_string();
    assert!(
        error.contains("learner.where is apex_m < 1") && error.contains("use power"),
        "{error}"
    );
    assert!(resume(&with("")).unwrap().store().wishes().unwrap().last().is_none());
}
