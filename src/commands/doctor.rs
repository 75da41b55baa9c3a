//! `skillet doctor`: grades this host and suggests fixes.

use std::path::Path;

use anyhow::Result;
use rt_controller::rt::loop_core;
use serde_json::json;

use crate::Verdict;
use crate::cli::doctor::DoctorArgs;
use crate::config::Config;
use crate::doctor::{self, Check, Grade, Subject, attempt};
use crate::host::{Host, Root};
use crate::output::{print, print_json};

pub fn run(args: &DoctorArgs) -> Result<Verdict> {
    let controller = Config::load(args.config.as_deref())?.controller;
    if args.attempt {
        attempt::answer(&controller)?;
        return Ok(Verdict::Done);
    }
    let root = Root(Path::new("/"));
    let checks = doctor::examine(&Subject {
        root,
        priority: controller.priority,
        core: loop_core(controller.cpu),
        attempt: attempt::ask(args.config.as_deref()).map_err(|error| format!("{error:#}")),
        space: doctor::shared_memory_space(root),
    });
    let (host, verdict) = (Host::here(), doctor::overall(&checks));
    if args.json {
        print_json(&json!({ "host": host, "checks": checks, "verdict": verdict }))?;
    } else {
        print(&as_text(&host, &checks, verdict))?;
    }
    Ok(if verdict == Grade::Poor { Verdict::Negative } else { Verdict::Done })
}

fn as_text(host: &Host, checks: &[Check], verdict: Grade) -> String {
    let mut text = String::new();
    for (name, value) in host.lines() {
        text += &format!("{name:<14}{value}\n");
    }
    text.push('\n');
    for Check { name, verdict, found, why, fix } in checks {
        let symbol = match verdict {
            Grade::Good => '✓',
            Grade::Fair => '~',
            Grade::Poor => '✗',
            Grade::Unknown => '?',
        };
        text += &format!("{symbol} {:<8}{name:<23}{found}\n", verdict.name());
        if *verdict != Grade::Good {
            text += &format!("          why:  {why}\n");
        }
        if let Some(fix) = fix {
            text += &format!("          fix:  {fix}\n");
        }
    }
    let count = |grade| checks.iter().filter(|check| check.verdict == grade).count();
    let meaning = match verdict {
        Grade::Good => "fit for hard real time",
        Grade::Poor => "ticks will be late until the poor checks are fixed",
        Grade::Fair | Grade::Unknown => "runs in real time, with occasional late ticks",
    };
    text += &format!(
        "\nverdict: {} – {meaning} ({} good, {} fair, {} poor, {} unknown)\n",
        verdict.name(),
        count(Grade::Good),
        count(Grade::Fair),
        count(Grade::Poor),
        count(Grade::Unknown)
    );
    text
}
