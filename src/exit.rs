//! Exit codes, the same for every command, and error reporting.

use std::ffi::OsStr;
use std::process::ExitCode;

use serde_json::{Value, json};
use shm_types::channel::ChannelError;

use crate::{output, stderr};

/// How a command ended, if not with an error.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Verdict {
    Done,
    Negative,
    /// Only for a command that queries this; for all others it is an error.
    NoController,
}

pub const ERROR: u8 = 2;
pub const NO_CONTROLLER: u8 = 3;

/// Every code with its meaning, as the help and docs/exit-codes.md show them.
pub const CODES: [(u8, &str); 4] = [
    (0, "done"),
    (
        1,
        "negative verdict: interrupted, health is bad, something does not fit, differs or was lost",
    ),
    (ERROR, "error: usage, input, no access, refused or failed; the message says how to fix it"),
    (NO_CONTROLLER, "no controller: there is none in the cell, or it does not respond"),
];

impl From<Verdict> for ExitCode {
    fn from(verdict: Verdict) -> ExitCode {
        match verdict {
            Verdict::Done => ExitCode::SUCCESS,
            Verdict::Negative => ExitCode::from(1),
            Verdict::NoController => ExitCode::from(NO_CONTROLLER),
        }
    }
}

/// The table, below the help of the tool.
pub fn help() -> String {
    let rows = CODES.map(|(code, meaning)| format!("  {code}  {meaning}\n"));
    format!(
        "Example: skillet learn pancake --rollouts 100 --seed 3\n\nExit codes of every command:\n{}\n\
         With --json an error is an object on standard output:\n  \
         {{\"schema\": 1, \"error\": {{\"message\": …, \"causes\": […], \"exit_code\": 2}}}}",
        rows.concat()
    )
}

/// Whether the command line has --json, even if it cannot be parsed.
fn wants_json() -> bool {
    std::env::args_os().any(|argument| argument == OsStr::new("--json"))
}

/// The object of an error.
pub fn object(error: &anyhow::Error) -> Value {
    let causes: Vec<String> = error.chain().skip(1).map(ToString::to_string).collect();
    json!({ "message": format!("{error:#}"), "causes": causes, "exit_code": code(error) })
}

/// Standard output may be closed.
fn print_object(object: &Value) {
    let _ = output::json_line(&json!({ "error": object })).and_then(|line| output::print(&line));
}

fn code(error: &anyhow::Error) -> u8 {
    let is_absence = error
        .chain()
        .any(|cause| cause.downcast_ref::<ChannelError>().is_some_and(ChannelError::is_absence));
    if is_absence { NO_CONTROLLER } else { ERROR }
}

/// Reports `error` as JSON on standard output with --json, otherwise on standard error. A service
/// also logs it.
pub fn tell(error: &anyhow::Error, is_service: bool) -> ExitCode {
    let json = wants_json();
    if json {
        print_object(&object(error));
    }
    if !json || is_service {
        stderr::say(&format!("skillet: {error:#}"));
    }
    ExitCode::from(code(error))
}

/// Reports an error in the command line, or prints the requested help.
pub fn usage(error: &clap::Error) -> ExitCode {
    if error.use_stderr() && wants_json() {
        let message = error.render().to_string();
        let message = message.trim().trim_start_matches("error: ");
        let object = json!({ "message": message, "causes": [], "exit_code": ERROR });
        print_object(&object);
        return ExitCode::from(ERROR);
    }
    let _ = error.print();
    ExitCode::from(if error.use_stderr() { ERROR } else { 0 })
}
