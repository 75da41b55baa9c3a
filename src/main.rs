//! `skillet`: parse → run → exit code. No mathematics and no transport details in this crate.

mod arm_check;
mod bench;
mod cell;
mod children;
mod cli;
mod commands;
mod config;
mod demo;
mod doctor;
mod early;
mod health;
mod holding;
mod host;
mod log;
mod metrics;
mod output;
mod policy_file;
mod progress;
mod record;
mod reload;
mod report;
mod resume;
mod session_folder;
mod setup;
mod soak;
mod study;
mod summary;
mod watch;

use std::process::ExitCode;

use clap::Parser;
use cli::{Cli, Verb};

/// How a command ended: 0 done, 1 a negative verdict, 2 an error.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Verdict {
    Done,
    Negative,
}

fn main() -> ExitCode {
    // Whatever is written, sessions and reports included, is this user's alone.
    rustix::process::umask(rustix::fs::Mode::RWXG | rustix::fs::Mode::RWXO);
    let cli = Cli::parse();
    let result = match &cli.verb {
        Verb::Learn(args) => commands::learn::run(args),
        Verb::Controller(args) => commands::controller::run(args),
        Verb::Learner(args) => commands::learner::run(args),
        Verb::Status(args) => commands::status::run(args),
        Verb::Hold(args) => commands::rearm::hold(args),
        Verb::Rearm(args) => commands::rearm::run(args),
        Verb::Policy(args) => commands::policy::run(args),
        Verb::Watch(args) => commands::watch::run(args),
        Verb::Record(args) => commands::record::run(args),
        Verb::Replay(args) => commands::replay::run(args),
        Verb::Demo(args) => commands::demo::run(args),
        Verb::Arm(args) => commands::arm::run(args),
        Verb::Trials(args) => commands::trials::run(args),
        Verb::Report(args) => commands::report::run(args),
        Verb::Study(args) => commands::study::run(args),
        Verb::Doctor(args) => commands::doctor::run(args),
        Verb::Bench(args) => commands::bench::run(args),
        Verb::Soak(args) => commands::soak::run(args),
        Verb::Config(args) => commands::config::run(args),
        Verb::Completions(args) => commands::shell::completions(args),
        Verb::Man(args) => commands::shell::man(args),
    };
    match result {
        Ok(Verdict::Done) => ExitCode::SUCCESS,
        Ok(Verdict::Negative) => ExitCode::from(1),
        Err(error) => {
            eprintln!("skillet: {error:#}");
            ExitCode::from(2)
        }
    }
}
