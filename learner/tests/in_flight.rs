//! Several rollouts in flight: told in the order in which they come back, and a session that is the same again.

mod common;

use std::path::Path;

use common::{episode, meta, value_judge};
use learner::learner::SESSION_FILE;
use learner::mail::{Mail, Says};
use learner::people::PeopleConfig;
use learner::store::{CellRecord, Store, TrialRecord, equipment_of};
use learner::{CompleteError, Learner, LearnerConfig};
use rand::seq::IteratorRandom;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha12Rng;
use search::{Method, SearchConfig};
use shm_types::policy::PolicyMsg;
use shm_types::text;
use tempfile::TempDir;

const METHODS: [Method; 5] =
    [Method::Power, Method::Tempered, Method::Regions, Method::Niching, Method::Cem];

fn config(method: Method) -> LearnerConfig {
    let search = SearchConfig { method, ..Default::default() };
    // Only these take what others have proposed, as what people say may make it.
    let weight = if method == Method::Power { 0.5 } else { 0.0 };
    let people = PeopleConfig { weight, wait: false, ..Default::default() };
    let mut config = LearnerConfig { rollouts: 60, search, people, ..Default::default() };
    config.search.power.n_initial = 8;
    config.action.start = vec![0.4, -0.2];
    config
}

fn create(directory: &Path, method: Method) -> Learner {
    let meta = meta("landscape", 7, config(method));
    Learner::create(directory, meta, &[], value_judge()).expect("a new session")
}

fn resume(directory: &Path, method: Method) -> Learner {
    Learner::resume(directory, "landscape", &config(method), &[], value_judge()).expect("resumes")
}

/// Executes `policy` in `cell`: the nearer to (1, 1), the better.
fn complete(learner: &mut Learner, cell: &str, policy: &PolicyMsg) {
    let [x, y, ..] = policy.action;
    let height = (-(x - 1.0).powi(2) - (y - 1.0).powi(2)).exp();
    let (header, records) = episode(policy, height);
    learner.complete(cell, &header, &records).expect("it was asked for");
}

/// Asks for so many, in all, and has one of them come back, which one is a matter of chance.
fn step(learner: &mut Learner, arms: usize, random: &mut ChaCha12Rng) {
    while learner.in_flight().count() < arms && learner.another_policy("").unwrap().is_some() {}
    let policy = *learner.in_flight().choose(random).expect("there is one");
    let cell = ["left", "right"][random.random_range(0..2)];
    match random.random_range(0..8) {
        0 => drop(learner.set_aside(cell, policy.rollout, "a test").expect("it was asked for")),
        _ => complete(learner, cell, &policy),
    }
}

fn bits(trials: &[TrialRecord]) -> Vec<(Vec<u64>, u64, u64, String, bool)> {
    let bits = |t: &TrialRecord| (t.bits(), t.asked_after, t.told, t.cell.clone(), t.is_mean);
    trials.iter().map(bits).collect()
}

#[test]
fn whenever_the_learner_dies_it_goes_on_as_if_it_had_not() {
    for method in METHODS {
        let run = |dies: bool| {
            let directory = TempDir::new().unwrap();
            let mut learner = create(directory.path(), method);
            let mut random = ChaCha12Rng::seed_from_u64(3);
            while !learner.is_done() {
                step(&mut learner, 4, &mut random);
                if dies && learner.trials().len().is_multiple_of(7) {
                    let in_flight: Vec<PolicyMsg> = learner.in_flight().copied().collect();
                    drop(learner);
                    learner = resume(directory.path(), method);
                    assert_eq!(learner.in_flight().copied().collect::<Vec<_>>(), in_flight);
                }
            }
            let stored = Store::open(&directory.path().join(SESSION_FILE)).unwrap();
            let mut trials = stored.trials().unwrap();
            assert!(trials.is_sorted_by_key(|trial| trial.rollout));
            trials.sort_by_key(|trial| trial.told);
            assert_eq!(bits(&trials), bits(learner.trials()), "what is stored is what was told");
            bits(&trials)
        };
        let whole = run(false);
        assert_eq!(run(true), whole, "{method:?}");
        assert!(whole.iter().any(|(_, asked_after, told, ..)| asked_after + 2 < *told));
    }
}

#[test]
fn what_is_in_flight_is_not_acknowledged_and_what_is_told_is_not_taken_twice() {
    let directory = TempDir::new().unwrap();
    let mut learner = create(directory.path(), Method::Power);
    let asked: Vec<PolicyMsg> =
        (0..3).map(|_| learner.another_policy("").unwrap().unwrap()).collect();
    assert_eq!(asked.iter().map(|policy| policy.rollout).collect::<Vec<_>>(), [1, 2, 3]);
    complete(&mut learner, "right", &asked[2]);
    complete(&mut learner, "left", &asked[1]);
    assert_eq!((learner.durable_rollout(), learner.is_settled()), (0, false));
    let (header, records) = episode(&asked[2], 0.5);
    let twice = learner.complete("left", &header, &records).unwrap_err();
    assert!(matches!(twice, CompleteError::Duplicate { rollout: 3 }), "{twice}");
    complete(&mut learner, "left", &asked[0]);
    assert_eq!((learner.durable_rollout(), learner.is_settled()), (3, true));
    let told: Vec<_> =
        learner.trials().iter().map(|t| (t.rollout, t.asked_after, t.cell.as_str())).collect();
    assert_eq!(told, [(3, 0, "right"), (2, 0, "left"), (1, 0, "left")]);
}

/// A cell may have executed it meanwhile: it is asked first.
#[test]
fn a_learner_that_resumes_knows_which_cell_has_which_rollout() {
    let directory = TempDir::new().unwrap();
    let mut learner = create(directory.path(), Method::Power);
    let asked: Vec<PolicyMsg> =
        ["left", "right", "left"].map(|cell| learner.another_policy(cell).unwrap().unwrap()).into();
    learner.give(3, "middle").unwrap();
    complete(&mut learner, "right", &asked[1]);
    let given = |learner: &Learner| {
        let rollouts = learner.in_flight().map(|policy| policy.rollout);
        let of = |rollout| (rollout, learner.given_to(rollout).unwrap().to_string());
        rollouts.map(of).collect::<Vec<_>>()
    };
    let expected =
        [(1, "left"), (3, "middle"), (4, "right")].map(|(n, cell)| (n, cell.to_string()));
    assert_eq!(given(&learner), expected, "the next one is for the cell that is free");
    drop(learner);
    assert_eq!(given(&resume(directory.path(), Method::Power)), expected);
}

/// A trial keeps what executed it, and only what is new is stored.
#[test]
fn cells_keep_their_arm_and_plant_and_from_when_on() {
    let directory = TempDir::new().unwrap();
    let mut learner = create(directory.path(), Method::Power);
    for (cell, plant) in
        [("left", "a"), ("right", "b"), ("left", "a"), ("left", "c"), ("right", ""), ("left", "c")]
    {
        let policy = learner.next_policy().unwrap();
        let (mut header, records) = episode(&policy, 0.5);
        header.equipment.plant = text::pack(plant);
        learner.complete(cell, &header, &records).unwrap();
    }
    let known = |cells: &[CellRecord]| -> Vec<(String, u64, String)> {
        cells.iter().map(|row| (row.cell.clone(), row.since, row.plant.clone())).collect()
    };
    let expected = [("left", 1, "a"), ("right", 2, "b"), ("left", 4, "c")]
        .map(|(cell, since, plant)| (cell.to_string(), since, plant.to_string()));
    assert_eq!(known(learner.cells()), expected, "one that tells nothing changes nothing");
    drop(learner);
    let again = resume(directory.path(), Method::Power);
    assert_eq!(known(again.cells()), expected);
    let plant = |told| equipment_of(again.cells(), "left", told).map(|row| row.plant.as_str());
    assert_eq!(
        [plant(1), plant(3), plant(4), plant(9)],
        [Some("a"), Some("a"), Some("c"), Some("c")]
    );
    assert_eq!(equipment_of(again.cells(), "right", 1), None);
}

/// Letters are taken when nothing is executed; the session that they lead to is the same again.
#[test]
fn ratings_that_come_while_rollouts_are_in_flight_are_told_again() {
    let method = Method::Power;
    let directory = TempDir::new().unwrap();
    let mut learner = create(directory.path(), method);
    let mut random = ChaCha12Rng::seed_from_u64(5);
    for round in 0..8 {
        (0..5).for_each(|_| step(&mut learner, 3, &mut random));
        let newest = learner.trials().last().expect("there are some").rollout;
        let says = Says::Rating { rollout: newest, rating: Some(f64::from(round)) };
        Mail::of(directory.path()).post(says).unwrap();
        assert!(learner.has_news());
        while !learner.is_settled() {
            let policy = *learner.in_flight().next().expect("a rollout is missing");
            complete(&mut learner, "left", &policy);
        }
        assert_eq!(learner.take_mail().unwrap().len(), 1);
        assert!(!learner.has_news() && learner.in_flight().count() == 0);
    }
    let next = learner.another_policy("").unwrap().unwrap();
    let trials = bits(learner.trials());
    drop(learner);
    let again = resume(directory.path(), method);
    assert_eq!(bits(again.trials()), trials);
    assert_eq!(again.in_flight().copied().collect::<Vec<_>>(), [next]);
}
