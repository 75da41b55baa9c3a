//! Several arms and one learner: what it costs that rollouts are proposed before those in flight are known.
//!
//! An event queue in simulated time: every arm is asked for a rollout as soon as it is free, and tells of it when its
//! rollout is over. Judging, learning and the way between arm and learner take no time here.

use std::cmp::Reverse;
use std::collections::{BinaryHeap, VecDeque};

use anyhow::Result;
use search::AskTell;
use search::trial::Trial;

use super::Sample;
use super::runs::Came;
use super::tasks::{Rollout, Stage};
use crate::config::Config;

const ARMS: [usize; 6] = [1, 2, 4, 8, 16, 64];
/// Told trials at the end that show what the search has come to, and the share of successes that is wanted.
const LATE: usize = 20;
const WANTED: f64 = 0.9;
/// Where a session gives up.
const ROLLOUTS: u64 = 300;
/// From the end of a rollout to the beginning of the next one: the pancake is put back, the arm goes to its start.
const BETWEEN_NS: u64 = 2_000_000_000;

pub fn run_seed(seed: u64) -> Result<Vec<Sample>> {
    let mut samples = Vec::new();
    for arms in ARMS {
        let name = format!("{arms} arms");
        let session = session(arms, seed)?;
        let (first, late) = (session.first_success(), session.late());
        for (what, moment) in [("first success", first), ("90 % late", late)] {
            let (rollouts, time_s) = moment.unwrap_or((f64::INFINITY, f64::INFINITY));
            samples.push(Sample::median(&name, &format!("{what}: rollouts"), rollouts));
            samples.push(Sample::median(&name, &format!("{what}: time, s"), time_s));
        }
        samples.push(Sample::rate(&name, &format!("90 % late within {ROLLOUTS}"), late.is_some()));
    }
    Ok(samples)
}

/// When each trial was told, in that order, and whether it succeeded.
struct Session(Vec<(u64, bool)>);

impl Session {
    /// Rollouts told, and time in s, at the first success.
    fn first_success(&self) -> Option<(f64, f64)> {
        let at = self.0.iter().position(|(_, success)| *success)?;
        Some(self.moment(at))
    }

    /// The same when of the last [`LATE`] trials told so many as are wanted succeeded.
    fn late(&self) -> Option<(f64, f64)> {
        let mut last: VecDeque<bool> = VecDeque::new();
        for (at, (_, success)) in self.0.iter().enumerate() {
            last.push_back(*success);
            if last.len() > LATE {
                last.pop_front();
            }
            let successes = last.iter().filter(|success| **success).count();
            if successes as f64 >= WANTED * LATE as f64 {
                return Some(self.moment(at));
            }
        }
        None
    }

    fn moment(&self, at: usize) -> (f64, f64) {
        ((at + 1) as f64, self.0[at].0 as f64 * 1e-9)
    }
}

/// A session of the pancake with so many arms, until it has learnt it.
fn session(arms: usize, seed: u64) -> Result<Session> {
    let mut config = Config::of_task("pancake");
    config.learner.seed = seed;
    let mut stage = Stage::of(&config)?;
    let mut search = AskTell::new(stage.problem.search(&config.learner));
    let mut session = Session(Vec::new());
    // When an arm's rollout is over, its rollout, and what is told then.
    let mut under_way: BinaryHeap<Reverse<(u64, u64)>> = BinaryHeap::new();
    let mut outcomes: Vec<Option<Trial>> = Vec::new();
    let mut now_ns = 0;
    while session.late().is_none() && session.0.len() < ROLLOUTS as usize {
        while under_way.len() < arms {
            let rollout = outcomes.len() as u64 + 1;
            let theta = search.ask(rollout).theta;
            let Rollout { came, duration_ns, .. } = stage.execute(&theta)?;
            let Came { success, reward, measured } = came;
            outcomes.push(Some(Trial { rollout, theta, reward, success, measured }));
            under_way.push(Reverse((now_ns + duration_ns + BETWEEN_NS, rollout)));
        }
        let Some(Reverse((over_ns, rollout))) = under_way.pop() else { break };
        now_ns = over_ns;
        if let Some(trial) = outcomes[rollout as usize - 1].take() {
            search.tell(&trial)?;
            session.0.push((now_ns, trial.success));
        }
    }
    Ok(session)
}
