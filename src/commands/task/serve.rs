//! `skillet task serve`: rollouts of a task for a program in another language, one JSON object a line.

use std::collections::BTreeMap;
use std::io::BufRead;

use anyhow::{Context, Result, bail};
use learner::judge::Judge;
use learner::parameters::PolicyIds;
use learner::path::decimate;
use learner::problem::Problem;
use nalgebra::DVector;
use serde::Deserialize;
use serde_json::{Value, json};
use shm_types::policy::PolicyMsg;
use shm_types::policy_json;

use crate::Verdict;
use crate::cli::task::ServeArgs;
use crate::config::Config;
use crate::output::{is_closed, json_line, print};
use crate::tasks::executor::{Executor, executor};
use crate::{judging, setup};

pub fn run(args: &ServeArgs) -> Result<Verdict> {
    let config = configure(args)?;
    let mut served = Served::new(&config)?;
    say(&served.about(&config)?)?;
    for line in std::io::stdin().lock().lines() {
        let line = line.context("reading standard input")?;
        if !line.trim().is_empty() {
            // What is refused is an answer: the program on the other side decides what it means.
            say(&served
                .answer(&line)
                .unwrap_or_else(|error| json!({ "refused": format!("{error:#}") })))?;
        }
        if is_closed() {
            break;
        }
    }
    Ok(Verdict::Done)
}

fn configure(args: &ServeArgs) -> Result<Config> {
    let config = match &args.config {
        Some(path) => Config::load(Some(path))?,
        None => {
            let options: BTreeMap<String, String> = args.options.iter().cloned().collect();
            Config::of_options(&args.task, options)
        }
    };
    config.validate()?;
    if config.task.name != args.task {
        bail!(
            "task.name is '{}' in the configuration: serve {0}, or give another configuration",
            config.task.name
        );
    }
    Ok(config)
}

/// Names and texts of the demonstrations; none without an arm.
fn demonstrations(config: &Config) -> Result<Vec<(String, String)>> {
    if !config.has_arm() {
        return Ok(Vec::new());
    }
    let (first, built_in) = (&config.task.demonstration, config.task()?.arm()?.demonstration);
    let mut all = vec![("demonstration.csv".into(), setup::text_of(first.as_deref(), built_in)?)];
    for path in &config.task.other_demonstrations {
        all.push((path.display().to_string(), setup::text_of(Some(path), "")?));
    }
    Ok(all)
}

fn say(value: &Value) -> Result<()> {
    print(&json_line(value)?)
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Request {
    theta: Option<Vec<f64>>,
    policy: Option<Value>,
    decode: Option<Vec<f64>>,
    /// Whether the answer holds the path.
    #[serde(default)]
    path: bool,
}

/// A task with everything a rollout needs.
struct Served {
    problem: Problem,
    judge: Judge,
    execute: Box<Executor>,
}

impl Served {
    fn new(config: &Config) -> Result<Served> {
        let problem = match config.has_arm() {
            true => Problem::new(&config.learner, &setup::check(config)?)?,
            false => {
                let start = PolicyMsg::of_action(&config.learner.action.start).sealed();
                Problem::around(&start, &config.learner, &[])?
            }
        };
        Ok(Served { problem, judge: judging::judge(config)?, execute: executor(config)? })
    }

    /// What is searched: start (D), directions (D×k, by rows) and box of the first demonstration, or of the
    /// action; and what a program needs to search it as a session does.
    fn about(&self, config: &Config) -> Result<Value> {
        let space = &self.problem.spaces[0];
        let rows = space.exploration.row_iter();
        let directions: Vec<Vec<f64>> = rows.map(|row| row.iter().copied().collect()).collect();
        let bounds =
            space.bounds.as_ref().map(|bounds| [bounds.min.as_slice(), bounds.max.as_slice()]);
        let units: serde_json::Map<String, Value> =
            self.judge.declared().iter().map(|(name, unit)| (name.clone(), json!(unit))).collect();
        Ok(json!({
            "task": config.task.name,
            "about": config.task()?.about,
            "start": space.theta_0.as_slice(),
            "directions": directions,
            "box": bounds,
            "measures": units,
            "learner": config.learner,
            "demonstrations": demonstrations(config)?,
        }))
    }

    fn answer(&mut self, line: &str) -> Result<Value> {
        let request: Request = serde_json::from_str(line).context("not a request")?;
        match request {
            Request { theta: Some(theta), policy: None, decode: None, path } => {
                let policy = self.decode(theta)?;
                self.rollout(&policy, path)
            }
            Request { policy: Some(policy), theta: None, decode: None, path } => {
                self.rollout(&policy_json::from_json(&policy.to_string())?, path)
            }
            Request { decode: Some(theta), theta: None, policy: None, .. } => {
                let text = policy_json::to_json(&self.decode(theta)?)?;
                Ok(json!({ "policy": serde_json::from_str::<Value>(&text)? }))
            }
            _ => bail!("a request has one of theta, policy and decode"),
        }
    }

    /// The policy of θ, which is brought into the box as a search's proposals are.
    fn decode(&self, theta: Vec<f64>) -> Result<PolicyMsg> {
        let space = &self.problem.spaces[0];
        if theta.len() != space.dim() || theta.iter().any(|value| !value.is_finite()) {
            bail!("theta has {} numbers: give {} finite ones", theta.len(), space.dim());
        }
        let theta = space.inside(DVector::from_vec(theta));
        Ok(self.problem.decode(&theta, PolicyIds::default()))
    }

    fn rollout(&mut self, policy: &PolicyMsg, with_path: bool) -> Result<Value> {
        let (header, records) = (self.execute)(policy)?;
        let (measures, success, reward) = self.judge.judge(policy, &header, &records)?;
        let measured: serde_json::Map<String, Value> =
            measures.iter().map(|m| (m.name.to_string(), json!(m.value))).collect();
        let path = with_path.then(|| {
            let rows = decimate(&records);
            rows.iter().flat_map(|row| row.columns()).collect::<Vec<f32>>()
        });
        Ok(json!({
            "reward": reward,
            "success": success,
            "measures": measured,
            "fault_code": header.fault,
            "path": path,
        }))
    }
}
