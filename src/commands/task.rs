//! `skillet task`: the tasks there are.

mod serve;

use anyhow::Result;
use serde_json::json;

use crate::Verdict;
use crate::cli::task::{TaskArgs, TaskVerb};
use crate::config::Config;
use crate::judging;
use crate::output::{print, print_json};
use crate::tasks;

pub fn run(args: &TaskArgs) -> Result<Verdict> {
    match &args.verb {
        TaskVerb::List { json } => list(*json),
        TaskVerb::Serve(args) => serve::run(args),
    }
}

fn list(as_json: bool) -> Result<Verdict> {
    let mut text = String::new();
    let mut objects = Vec::new();
    for task in tasks::ALL {
        let measures = judging::judge(&Config::of_task(task.name))?.declared();
        let names: Vec<&str> = measures.iter().map(|(name, _)| name.as_str()).collect();
        text +=
            &format!("{:<14}{}\n{:14}measures: {}\n", task.name, task.about, "", names.join(", "));
        for (option, values) in task.options {
            text += &format!("{:14}task.options.{option}: {}\n", "", values.join(", "));
        }
        let units: serde_json::Map<_, _> =
            measures.iter().map(|(name, unit)| (name.clone(), json!(unit))).collect();
        objects.push(json!({
            "task": task.name,
            "about": task.about,
            "has_arm": task.has_arm(),
            "success": task.success,
            "measures": units,
            "options": task.options.iter().copied().collect::<std::collections::BTreeMap<_, _>>(),
        }));
    }
    if as_json {
        print_json(&json!({ "tasks": objects }))?;
    } else {
        print(&text)?;
    }
    Ok(Verdict::Done)
}
