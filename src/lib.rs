//! `skillet`: parse → run → exit code. No mathematics and no transport details in this crate.
//!
//! A library for the compiler's sake: it begins while what it depends on is still being optimised. The interface is the
//! command line.

// The status of a controller is one JSON object.
#![recursion_limit = "256"]

mod arm_check;
mod background;
mod bar;
mod bench;
mod cell;
mod children;
mod cli;
mod commands;
mod complete;
mod config;
mod demo;
mod doctor;
mod draw;
mod early;
mod exit;
mod external;
mod fields;
mod health;
mod holding;
mod host;
mod judging;
mod log;
mod metrics;
mod output;
mod people;
mod plant_check;
mod policy_file;
mod progress;
mod provenance;
mod record;
mod reload;
mod report;
mod resume;
mod robots;
mod ros2;
mod session_folder;
mod settings;
mod setup;
mod signals;
mod soak;
mod stderr;
mod study;
mod summary;
mod tasks;
mod tty;
mod watch;

use std::process::ExitCode;

use cli::{Verb, families};

pub use exit::Verdict;

/// Runs the command line of this process.
pub fn main() -> ExitCode {
    // Whatever is written, sessions and reports included, is this user's alone.
    rustix::process::umask(rustix::fs::Mode::RWXG | rustix::fs::Mode::RWXO);
    stderr::take_panics();
    complete::answer_shell();
    let cli = match families::parse() {
        Ok(cli) => cli,
        Err(error) => return exit::usage(&error),
    };
    let result = match &cli.verb {
        Verb::Learn(args) => commands::learn::run(args),
        Verb::Session(args) => commands::session::run(args),
        Verb::Trials(args) => commands::trials::run(args),
        Verb::Policy(args) => commands::policy::run(args),
        Verb::Judge(args) => commands::judge::run(args),
        Verb::Rate(args) => commands::rate::run(args),
        Verb::Demo(args) => commands::demo::run(args),
        Verb::Replay(args) => commands::replay::run(args),
        Verb::Convert(args) => commands::convert::run(args),
        Verb::Report(args) => commands::report::run(args),
        Verb::Cell(args) => commands::cell::run(args),
        Verb::Status(args) => commands::status::run(args),
        Verb::Watch(args) => commands::watch::run(args),
        Verb::Record(args) => commands::record::run(args),
        Verb::Hold(args) => commands::rearm::hold(args),
        Verb::Rearm(args) => commands::rearm::run(args),
        Verb::Posture(args) => commands::posture::run(args),
        Verb::Controller(args) => commands::controller::run(args),
        Verb::Learner(args) => commands::learner::run(args),
        Verb::Bridge(args) => commands::bridge::run(args),
        Verb::Task(args) => commands::task::run(args),
        Verb::Arm(args) => commands::arm::run(args),
        Verb::Plant(args) => commands::plant::run(args),
        Verb::Study(args) => commands::study::run(args),
        Verb::Bench(args) => commands::bench::run(args),
        Verb::Soak(args) => commands::soak::run(args),
        Verb::Doctor(args) => commands::doctor::run(args),
        Verb::Config(args) => commands::config::run(args),
        Verb::Completions(args) => commands::shell::completions(args),
        Verb::Man(args) => commands::shell::man(args),
        Verb::Child(args) => commands::child::run(args),
    };
    let is_service = matches!(cli.verb, Verb::Controller(_) | Verb::Learner(_));
    signals::let_it_end();
    let code = match result {
        Ok(verdict) => verdict.into(),
        Err(error) => exit::tell(&error, is_service),
    };
    stderr::finish();
    code
}
