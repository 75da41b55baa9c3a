//! What ARCHITECTURE.md promises and a test can enforce: sizes, and which crate knows which.

#[path = "util/source.rs"]
mod source;

use std::fs;
use std::path::{Path, PathBuf};

use source::rust_files;

const MAX_FILE_LINES: usize = 500;
const MAX_FUNCTION_LINES: usize = 80;

fn root() -> &'static Path {
    Path::new(env!("CARGO_MANIFEST_DIR"))
}

fn sources() -> Vec<(PathBuf, String)> {
    let mut files = Vec::new();
    rust_files(root(), &mut files);
    assert!(files.len() > 50, "found only {} files", files.len());
    files.into_iter().map(|path| (path.clone(), fs::read_to_string(path).unwrap())).collect()
}

#[test]
fn files_open_with_their_purpose_and_stay_short() {
    for (path, text) in sources() {
        let lines = text.lines().count();
        assert!(lines <= MAX_FILE_LINES, "{}: {lines} lines", path.display());
        assert!(text.starts_with("//!"), "{}: no purpose on its first line", path.display());
    }
}

/// Lines of the longest function: from `fn` to the closing brace at its own indentation, which is
/// where the formatter puts it.
fn longest_function(text: &str) -> (usize, String) {
    let lines: Vec<&str> = text.lines().collect();
    let indent = |line: &str| line.len() - line.trim_start().len();
    let mut longest = (0, String::new());
    for (start, line) in lines.iter().enumerate() {
        let code = line.trim_start();
        let is_function = ["fn ", "pub fn ", "pub(crate) fn ", "pub(super) fn ", "const fn "]
            .iter()
            .any(|prefix| code.starts_with(prefix));
        if !is_function || line.trim_end().ends_with(';') || line.contains('}') {
            continue;
        }
        let closing = lines[start..]
            .iter()
            .position(|other| other.trim() == "}" && indent(other) == indent(line));
        if let Some(length) = closing.filter(|length| *length > longest.0) {
            longest = (length + 1, code.to_string());
        }
    }
    longest
}

#[test]
fn functions_stay_short() {
    for (path, text) in sources() {
        let (lines, function) = longest_function(&text);
        assert!(lines <= MAX_FUNCTION_LINES, "{}: {lines} lines: {function}", path.display());
    }
}

#[test]
fn the_function_check_can_fail() {
    let body = "    let x = 1;\n".repeat(90);
    let (lines, function) = longest_function(&format!("fn long() {{\n{body}}}\n"));
    assert_eq!((lines, function.as_str()), (92, "fn long() {"));
}

/// Dependencies point one way; see ARCHITECTURE.md.
#[test]
fn crates_know_only_what_they_may() {
    let forbidden: [(&str, &[&str]); 8] = [
        ("shm-types", &["physics", "rt-controller", "search", "learner", "nalgebra", "rapier3d"]),
        ("physics", &["shm-types", "rt-controller", "search", "learner", "iceoryx2"]),
        (
            "search",
            &[
                "shm-types",
                "physics",
                "rt-controller",
                "learner",
                "rapier3d",
                "iceoryx2",
                "rusqlite",
            ],
        ),
        (
            "imitation",
            &[
                "shm-types",
                "physics",
                "rt-controller",
                "learner",
                "rapier3d",
                "iceoryx2",
                "rusqlite",
            ],
        ),
        ("learner", &["physics", "rt-controller", "rapier3d"]),
        ("clients/plant", &["physics", "rt-controller", "search", "learner", "rapier3d"]),
        ("bridge", &["physics", "rt-controller", "search", "learner", "rapier3d"]),
        ("rt-controller", &["search", "learner", "rapier3d", "rusqlite"]),
    ];
    for (name, others) in forbidden {
        let manifest = fs::read_to_string(root().join(name).join("Cargo.toml")).unwrap();
        let dependencies = manifest.split("[dev-dependencies]").next().unwrap();
        for other in others {
            let names = |line: &str| line.split(['.', ' ', '=']).next() == Some(other);
            assert!(!dependencies.lines().any(names), "{name} must not know {other}");
        }
    }
}

#[test]
fn the_arm_knows_no_simulator_and_the_hot_path_no_ports() {
    let users_of = |word: &str| -> Vec<String> {
        let relative = |path: PathBuf| path.strip_prefix(root()).unwrap().display().to_string();
        let names = |(_, text): &(PathBuf, String)| text.lines().any(|l| l.contains(word));
        sources().into_iter().filter(names).map(|(path, _)| relative(path)).collect()
    };
    for file in users_of("rapier") {
        assert!(!file.starts_with("physics/src/arm/"), "{file} names Rapier");
    }
    for word in ["iceoryx2", "shm_types::ports", "shm_types::channel", "tracing::", "Box<", "Vec<"]
    {
        for file in users_of(word) {
            let is_hot = file.starts_with("rt-controller/src/hot/")
                || file == "rt-controller/src/executor/latch.rs";
            assert!(!is_hot, "{file} is on the hot path and names {word}");
        }
    }
}

/// A reader of standard error that has gone or stands still must end and block nobody, and a closed
/// standard output is no panic: `src/stderr.rs` and `src/output.rs` see to that.
#[test]
fn nobody_writes_to_standard_error_or_output_past_those_who_may() {
    let macros = [concat!("eprint", "ln!("), concat!("eprint", "!("), concat!("print", "ln!(")];
    for (path, text) in sources() {
        let file = path.strip_prefix(root()).unwrap().display().to_string();
        // Tests and examples sit before a person, and end when they fail.
        let is_ours = file.starts_with("src/") || file.contains("/src/");
        if is_ours && !file.starts_with("fuzz/") {
            let found = macros.iter().find(|name| text.contains(**name));
            assert!(
                found.is_none(),
                "{file}: {}: use `stderr::say` or `output::print`",
                found.unwrap()
            );
        }
    }
}

#[test]
fn unsafe_code_stays_where_it_is_declared() {
    // The derive of zero-copy messages, sched_setscheduler, the ioctl of TUN devices, the pointers of C, and the counting
    // allocator of tests.
    let allowed = [
        "shm-types/src/lib.rs",
        "rt-controller/src/rt/thread.rs",
        "src/soak/net/tun.rs",
        "clients/plant/src/c.rs",
        "rt-controller/tests/common/heap.rs",
    ];
    let marker = concat!("allow(", "unsafe_code)");
    for (path, text) in sources() {
        let file = path.strip_prefix(root()).unwrap().display().to_string();
        if text.contains(marker) {
            assert!(allowed.contains(&file.as_str()), "{file} allows unsafe code");
        }
    }
}

/// Variants of an error whose text shows a cause that the error returns as its source as well: a
/// chain of errors would print it twice.
fn causes_shown_twice(text: &str) -> Vec<String> {
    let mut found = Vec::new();
    let attribute = concat!("#[", "error(");
    for (i, _) in text.match_indices(attribute) {
        let rest = &text[i..];
        let Some(end) = rest.find(")]") else { continue };
        let (shown, variant) = rest.split_at(end + 2);
        let until = variant.find(attribute).unwrap_or(variant.len()).min(400);
        let until = (0..=until).rev().find(|i| variant.is_char_boundary(*i)).unwrap_or(0);
        let variant = variant[..until].split("\n}").next().unwrap_or_default();
        let named = shown.contains("{source}") && variant.contains("source:");
        let is_source = variant.contains("#[from]") || variant.contains("#[source]");
        let positional = shown.contains("{0}") && is_source;
        if named || positional {
            found.push(shown.to_string());
        }
    }
    found
}

#[test]
fn an_error_shows_its_cause_or_returns_it_and_not_both() {
    for (path, text) in sources().into_iter().filter(|(path, _)| !path.ends_with("tidy.rs")) {
        assert_eq!(causes_shown_twice(&text), [""; 0], "{}", path.display());
    }
    for twice in [
        "#[error(\"{path}: {source}\")]\n    Io { path: PathBuf, source: io::Error },\n}",
        "#[error(\"not readable: {0}\")]\n    Json(#[from] serde_json::Error),\n}",
    ] {
        assert_eq!(causes_shown_twice(twice).len(), 1, "{twice}");
    }
}

/// A task is its own file and a name in the list; adding one changes nothing else. Studies are about
/// tasks, and may name them.
#[test]
fn a_task_is_named_in_its_own_file_and_in_the_list() {
    let list = fs::read_to_string(root().join("src/tasks/mod.rs")).unwrap();
    let names = list.split("tasks! {").nth(1).unwrap().split('}').next().unwrap();
    let tasks: Vec<&str> =
        names.split(',').map(str::trim).filter(|name| !name.is_empty()).collect();
    // Those before are the paper's: studies, figures and tests are about them.
    let new = tasks.iter().skip_while(|name| **name != "skittles").skip(1);
    let mut checked = 0;
    for task in new {
        let spoken = [task.to_string(), task.replace('_', "-")];
        let file = format!("src/tasks/{task}.rs");
        let mut named: Vec<String> = sources()
            .into_iter()
            .map(|(path, text)| (path.strip_prefix(root()).unwrap().display().to_string(), text))
            .filter(|(path, _)| path.starts_with("src/") || path.contains("/src/"))
            .filter(|(path, _)| !path.starts_with("src/study/"))
            // A key of rosbag2's metadata, which is no task.
            .map(|(path, text)| (path, text.replace("custom_data", "")))
            .filter(|(_, text)| spoken.iter().any(|name| text.contains(name.as_str())))
            .map(|(path, _)| path)
            .collect();
        named.sort();
        let mut expected = [file.clone(), "src/tasks/mod.rs".into()];
        expected.sort();
        assert_eq!(named, expected, "{task}");
        let lines = fs::read_to_string(root().join(&file)).unwrap().lines().count();
        assert!(lines <= 250, "{file} has {lines} lines");
        checked += 1;
    }
    assert!(checked > 0);
}

/// The loop knows when a rollout is over, but not its task.
#[test]
fn the_loop_knows_no_task() {
    for (path, text) in sources() {
        let file = path.strip_prefix(root()).unwrap().display().to_string();
        if file.starts_with("rt-controller/src/hot/") {
            let is_told = |word: &&str| text.to_lowercase().contains(*word);
            let found = ["pancake", "flip", "caught", "skittle"].into_iter().find(is_told);
            assert_eq!(found, None, "{file}");
        }
    }
}

/// Sentences that were translated word by word and have been replaced, in documents, help and messages.
const REPLACED: [&str; 15] = [
    "when it needs somebody",
    "a fault of the machine",
    "that nothing was tuned on",
    "hoever watches",
    "noticed by nobody",
    "what to mend",
    "whatever a learner asks",
    "somebody asked for the hold",
    "does not wait for who counts",
    "the loop waits for no deadline",
    "what a file does not say",
    "easier had as",
    "taking up {done}",
    "NOT GOOD",
    "controller ended in order",
];

/// The first replaced sentence in `text`.
fn replaced(text: &str) -> Option<&'static str> {
    REPLACED.into_iter().find(|words| text.contains(words))
}

#[test]
fn replaced_sentences_do_not_come_back() {
    let documents = |folder: &Path| -> Vec<PathBuf> {
        let files = fs::read_dir(folder).unwrap().flatten().map(|entry| entry.path());
        files.filter(|path| path.extension().is_some_and(|ending| ending == "md")).collect()
    };
    let mut pages = documents(&root().join("docs"));
    pages.push(root().join("README.md"));
    assert!(pages.len() > 10, "found only {} documents", pages.len());
    let pages = pages.into_iter().map(|path| (path.clone(), fs::read_to_string(path).unwrap()));
    let mut checked = sources();
    checked.retain(|(path, _)| !path.ends_with("tests/tidy.rs"));
    for (path, text) in checked.into_iter().chain(pages) {
        assert_eq!(replaced(&text), None, "{}", path.display());
    }
    assert!(replaced("exit code 1 when it needs somebody").is_some());
}
