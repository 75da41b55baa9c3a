//! Values that shells complete: cells, sessions, studies and tasks as they are at this moment.

use std::ffi::OsStr;
use std::path::{Path, PathBuf};

use clap::{Arg, Command};
use clap_complete::CompletionCandidate;
use clap_complete::engine::{ArgValueCandidates, ArgValueCompleter, PathCompleter, ValueCompleter};
use clap_complete::env::{Bash, CompleteEnv, EnvCompleter, Fish, Zsh};
use shm_types::cell::{Cell, Role, runtime_dir};

use crate::cli::families;
use crate::cli::shell::Shell;
use crate::session_folder::SessionFolder;
use crate::study::STUDIES;
use crate::tasks;

/// With it in the environment, this program answers a shell instead of doing what its arguments say.
const VARIABLE: &str = "SKILLET_COMPLETE";
/// zsh loads a script from `fpath` when it completes the first time, and expects an answer at once.
const ZSH_AUTOLOAD: &[u8] =
    b"\n[ \"$funcstack[1]\" = _skillet ] && _clap_dynamic_completer_skillet \"$@\"\n";
/// Where sessions usually are, seen from the current folder.
const PLACES: [&str; 2] = ["sessions", ""];

/// Answers a shell that completes a command line, and ends; returns if there is none.
pub fn answer_shell() {
    CompleteEnv::with_factory(|| with_values(families::command())).var(VARIABLE).complete();
}

/// The script that has `shell` ask this program.
pub fn script(shell: Shell) -> std::io::Result<Vec<u8>> {
    let completer: &dyn EnvCompleter = match shell {
        Shell::Bash => &Bash,
        Shell::Zsh => &Zsh,
        Shell::Fish => &Fish,
    };
    let (name, mut script) = (env!("CARGO_PKG_NAME"), Vec::new());
    completer.write_registration(VARIABLE, name, name, name, &mut script)?;
    if shell == Shell::Zsh {
        script.extend_from_slice(ZSH_AUTOLOAD);
    }
    Ok(script)
}

/// `command` and all below it, whose arguments know their values.
fn with_values(command: Command) -> Command {
    let name = command.get_name().to_string();
    command.mut_args(|arg| with_value(&name, arg)).mut_subcommands(with_values)
}

/// By the name of the argument, which is the same in every command.
fn with_value(command: &str, arg: Arg) -> Arg {
    match (command, arg.get_id().as_str()) {
        (_, "cell") | ("up" | "down", "name") => arg.add(ArgValueCandidates::new(cells)),
        (_, "session" | "sessions" | "again")
        | ("export" | "import", "from")
        | ("convert", "input") => arg.add(ArgValueCompleter::new(sessions)),
        ("show" | "forbid" | "allow", "policy") => arg.add(ArgValueCompleter::new(sessions)),
        ("study", "name") => arg.add(ArgValueCandidates::new(studies)),
        ("serve", "task") => arg.add(ArgValueCandidates::new(task_names)),
        _ => arg,
    }
}

/// Cells in which something runs.
fn cells() -> Vec<CompletionCandidate> {
    let is_used = |cell: &Cell| cell.has(Role::Controller) || cell.has(Role::Learner);
    let cells = Cell::all_in(&runtime_dir()).into_iter().filter(is_used);
    cells.map(|cell| CompletionCandidate::new(cell.name())).collect()
}

/// Session folders, and the folders on the way to others.
fn sessions(current: &OsStr) -> Vec<CompletionCandidate> {
    let here = |place: &&str| std::fs::read_dir(Path::new(".").join(place)).ok();
    let found = PLACES.iter().filter_map(|place| Some((place, here(place)?)));
    let paths = found.flat_map(|(place, entries)| {
        entries.flatten().map(move |entry| Path::new(place).join(entry.file_name()))
    });
    let begins = |path: &PathBuf| {
        path.as_os_str().as_encoded_bytes().starts_with(current.as_encoded_bytes())
    };
    let mut sessions: Vec<PathBuf> =
        paths.filter(begins).filter(|path| SessionFolder::at(path).has_session()).collect();
    if sessions.is_empty() {
        return PathCompleter::dir().complete(current);
    }
    sessions.sort();
    sessions.into_iter().map(CompletionCandidate::new).collect()
}

fn studies() -> Vec<CompletionCandidate> {
    let candidate = |study: &crate::study::Study| {
        CompletionCandidate::new(study.name).help(Some(study.about.into()))
    };
    STUDIES.iter().map(candidate).collect()
}

fn task_names() -> Vec<CompletionCandidate> {
    let named =
        |task: &&tasks::Task| CompletionCandidate::new(task.name).help(Some(task.about.into()));
    tasks::ALL.iter().map(named).collect()
}
