//! `skillet judge`: stored trials, judged once more.

use anyhow::{Result, bail};
use learner::judge::{Verdict as Judging, list};
use learner::store::TrialRecord;
use serde_json::json;

use super::stored::open;
use crate::Verdict;
use crate::cli::judge::JudgeArgs;
use crate::config::judge::REWARD;
use crate::config::{Config, JudgeConfig};
use crate::judging;
use crate::output::{print, print_json};
use crate::session_folder::SessionFolder;

/// Trials listed one by one; the others are counted.
const LISTED: usize = 20;

pub fn run(args: &JudgeArgs) -> Result<Verdict> {
    let JudgeArgs { session, config: config_path, json: as_json } = args;
    let folder = SessionFolder::open(session)?;
    let config = Config::load(Some(config_path.as_path()))?;
    let store = open(folder.dir(), &folder.database())?;
    let task = &store.meta().task;
    if config.task.name != *task {
        bail!(
            "{}: task.name is {}, but the session is for task {task}",
            config_path.display(),
            config.task.name
        );
    }
    let measures = &store.meta().measures;
    let has_program = config.task.judge.as_ref().is_some_and(JudgeConfig::has_program);
    if has_program && !measures.iter().any(|(name, _)| name == REWARD) {
        bail!(
            "{}: task.judge.program does not run on stored trials, and this session has no stored \
             program results: write task.judge.reward over its measures ({})",
            config_path.display(),
            list(measures)
        );
    }
    let judge = judging::verdict(&config, measures)?;
    let trials = store.trials()?;
    let measured = trials.iter().filter(|trial| !trial.measures.is_empty());
    let judged: Vec<Again> = measured.map(|trial| Again::of(trial, judge.as_ref())).collect();
    if *as_json {
        let trials: Vec<_> = judged.iter().map(Again::json).collect();
        print_json(&json!({ "session": folder.dir(), "trials": trials }))?;
    } else {
        print(&text(&judged, trials.len() - judged.len()))?;
    }
    Ok(Verdict::Done)
}

/// A trial with both verdicts.
struct Again<'a> {
    trial: &'a TrialRecord,
    /// Success and reward, or why there is none.
    now: Result<(bool, f64), String>,
}

impl Again<'_> {
    fn of<'a>(trial: &'a TrialRecord, judge: &dyn Judging) -> Again<'a> {
        let now = judge.judge(&trial.measures).map_err(|error| error.to_string());
        Again { trial, now }
    }

    /// The earlier verdict, if the trial was judged before.
    fn before(&self) -> Option<(bool, f64)> {
        (!self.trial.set_aside).then_some((self.trial.own_success, self.trial.own_reward))
    }

    fn is_same_success(&self) -> bool {
        self.now.as_ref().ok().map(|now| now.0) == self.before().map(|before| before.0)
    }

    fn is_same_reward(&self) -> bool {
        let bits = |(_, reward): (bool, f64)| reward.to_bits();
        self.now.as_ref().ok().map(|now| bits(*now)) == self.before().map(bits)
    }

    fn json(&self) -> serde_json::Value {
        let verdict = |verdict: Option<(bool, f64)>| {
            verdict.map(|(success, reward)| json!({ "success": success, "reward": reward }))
        };
        json!({
            "rollout": self.trial.rollout,
            "before": verdict(self.before()),
            "now": verdict(self.now.as_ref().ok().copied()),
            "error": self.now.as_ref().err(),
        })
    }
}

fn text(judged: &[Again], not_measured: usize) -> String {
    let count = |is: fn(&Again) -> bool| judged.iter().filter(|again| is(again)).count();
    let other_reward = count(|again| !again.is_same_reward());
    let other_success = count(|again| !again.is_same_success());
    let successes = |verdicts: &mut dyn Iterator<Item = (bool, f64)>| {
        verdicts.filter(|(success, _)| *success).count()
    };
    let before = successes(&mut judged.iter().filter_map(Again::before));
    let now = successes(&mut judged.iter().filter_map(|again| again.now.clone().ok()));
    let mut text = format!(
        "{} trials re-judged: {other_reward} with another reward, {other_success} with another \
         verdict; successes {before} before, {now} now\n",
        judged.len()
    );
    if not_measured > 0 {
        text += &format!(
            "{not_measured} trials have no measures and were not judged: they were not executed, or their \
             judge declined\n"
        );
    }
    let best = |verdict: &dyn Fn(&Again) -> Option<(bool, f64)>| {
        let rewards =
            judged.iter().filter_map(|again| Some((verdict(again)?.1, again.trial.rollout)));
        let best = rewards.reduce(|a, b| if b.0 > a.0 { b } else { a });
        best.map_or("none".into(), |(reward, rollout)| format!("{reward:.3} at rollout {rollout}"))
    };
    text += &format!("best reward {} before, ", best(&|again| again.before()));
    text += &format!("{} now\n", best(&|again| again.now.clone().ok()));
    let changed: Vec<&Again> = judged.iter().filter(|again| !again.is_same_success()).collect();
    for again in changed.iter().take(LISTED) {
        let verdict = |verdict: Option<bool>| match verdict {
            Some(true) => "success",
            Some(false) => "no success",
            None => "not judged",
        };
        let (before, now) = (again.before().map(|v| v.0), again.now.as_ref().ok().map(|v| v.0));
        let why = again.now.as_ref().err().map_or(String::new(), |error| format!(" ({error})"));
        let rollout = again.trial.rollout;
        text += &format!("  trial {rollout}: {} → {}{why}\n", verdict(before), verdict(now));
    }
    if changed.len() > LISTED {
        text += &format!("  and {} more, see --json\n", changed.len() - LISTED);
    }
    text
}
