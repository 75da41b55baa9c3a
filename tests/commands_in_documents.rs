//! What the documents tell people to type works: commands are run as they stand, in their order, in
//! a folder that has what they name. That all of them exist at all is tested in `src/cli/tests.rs`.

mod util;

use std::collections::BTreeSet;
use std::fs::{self, File};
use std::os::unix::fs::symlink;
use std::path::Path;
use std::process::{Command, Output};

use util::document::{Document, Line, arguments, as_typed, commands, documents};
use util::{Bench, Running, eventually};

/// Tools of others, which documents may name and this test does not run.
const OTHER_TOOLS: [&str; 7] = ["cargo", "sudo", "python3", "pip", "man", "cd", "ros2"];

/// Where a command that is not run here is tested instead. Everything else is run.
fn tested_elsewhere(arguments: &[&str]) -> Option<&'static str> {
    match arguments {
        // A hundred rollouts and more.
        ["learn", "pancake", ..] => Some("tests/learn.rs"),
        ["study", name, ..] if !name.starts_with('-') => Some("src/study"),
        ["bench", ..] => Some("tests/bench.rs"),
        // They need MuJoCo.
        ["learn", "custom", ..] => Some("tests/python.rs"),
        ["plant", ..] | ["controller", .., "external", "--pace", _] => Some("tests/plant.rs"),
        ["soak", "--hosts", ..] => Some("tests/soak_across.rs"),
        ["soak", ..] => Some("tests/soak.rs"),
        // They need the feature `bridge`.
        ["bridge", "ros2", ..] => Some("tests/ros2_live.rs"),
        ["bridge", ..] => Some("bridge/tests"),
        // Ratings count in sessions that were started so.
        ["rate", ..] => Some("tests/people.rs"),
        ["demo", "add", ..] => Some("tests/people.rs"),
        // Whether a posture fits depends on the policy that happens to be served.
        ["posture", "--joint" | "--offset", ..] => Some("tests/posture.rs"),
        // There is no fault to end.
        ["rearm" | "hold", ..] => Some("tests/rearm.rs"),
        // It wants a terminal; the other one does not end.
        ["watch", "--cell", _] => Some("src/watch/terminal.rs"),
        ["watch", "--cell", _, "--serve"] => Some("tests/watch.rs"),
        ["watch", "--cell", _, "--web", ..] => Some("tests/web.rs"),
        _ => None,
    }
}

/// Commands whose verdict is about this host.
fn may_be_negative(arguments: &[&str]) -> bool {
    matches!(arguments, ["doctor", ..])
}

/// A folder with the project's files, a learnt session under every name, and cells as they are named.
struct Stage {
    bench: Bench,
    controllers: Vec<(String, Running)>,
    learners: Vec<(String, Running)>,
    /// Cells in the background, which do not end with this test by themselves.
    up: BTreeSet<String>,
    /// Lines and the sessions that were put there for them.
    fresh: BTreeSet<(String, String)>,
}

/// Names under which documents keep sessions.
fn is_session(word: &str) -> bool {
    word == "s7" || word.starts_with("sessions/")
}

impl Stage {
    fn new(learnt: &Path) -> Stage {
        let bench = Bench::new();
        let root = Path::new(env!("CARGO_MANIFEST_DIR"));
        for folder in ["config", "demos", "docs", "robots"] {
            symlink(root.join(folder), bench.path(folder)).unwrap();
        }
        fs::create_dir(bench.path("bin")).unwrap();
        symlink(env!("CARGO_BIN_EXE_skillet"), bench.path("bin/skillet")).unwrap();
        // What readers bring themselves.
        fs::copy(root.join("demos/pancake.csv"), bench.path("recording.csv")).unwrap();
        fs::copy(root.join("demos/pancake.csv"), bench.path("my_demo.csv")).unwrap();
        fs::copy(root.join("robots/wam7/wam7_pan.urdf"), bench.path("my_arm.urdf")).unwrap();
        let primitive = root.join("tests/vectors/dmpbbo_pancake.json");
        fs::copy(primitive, bench.path("primitive.json")).unwrap();
        bench.write("my.toml", "[task]\ndemonstration = \"my_demo.csv\"\n");
        bench.write("new.toml", "[task.judge]\nsuccess = \"caught\"\nreward = \"apex_m\"\n");
        let (controllers, learners, up, fresh) = Default::default();
        let stage = Stage { bench, controllers, learners, up, fresh };
        ["s7", "sessions/pancake-1"].iter().for_each(|name| stage.learnt(learnt, name));
        stage
    }

    /// A fresh copy of the session, so that no command finds what another one did to it.
    fn learnt(&self, learnt: &Path, name: &str) {
        let to = self.bench.path(name);
        let _ = fs::remove_dir_all(&to);
        fs::create_dir_all(&to).unwrap();
        for entry in fs::read_dir(learnt).unwrap().flatten().filter(|entry| entry.path().is_file())
        {
            fs::copy(entry.path(), to.join(entry.file_name())).unwrap();
        }
    }

    /// `line` in a shell, with this build as `skillet`.
    fn shell(&self, line: &str) -> Command {
        let skillet = self.bench.skillet(&[]);
        let mut command = Command::new("bash");
        command.args(["-c", line]).current_dir(self.bench.path("."));
        for (key, value) in skillet.get_envs().filter_map(|(key, value)| Some((key, value?))) {
            command.env(key, value);
        }
        let path = std::env::var("PATH").unwrap();
        command.env("PATH", format!("{}:{path}", self.bench.path("bin").display()));
        command.env("HOME", self.bench.path("."));
        command
    }

    /// Through files: nobody would empty a pipe.
    fn run(&self, line: &str) -> Output {
        let (out, err) = (self.bench.path(".out"), self.bench.path(".err"));
        let mut command = self.shell(line);
        command.stdin(File::open("/dev/null").unwrap());
        command.stdout(File::create(&out).unwrap()).stderr(File::create(&err).unwrap());
        let output = Running::start(&mut command).wait();
        Output { stdout: fs::read(out).unwrap(), stderr: fs::read(err).unwrap(), ..output }
    }

    fn controller(&mut self, cell: &str, line: &str) {
        if self.has(cell) {
            return;
        }
        // In simulation the pace changes no number.
        let running =
            Running::start(&mut self.shell(&format!("exec {line} --pace max 2>/dev/null")));
        self.controllers.push((cell.into(), running));
        let status = format!("skillet status --cell {cell}");
        eventually(&status, || self.run(&status).status.success().then_some(()));
        self.fill(cell);
    }

    fn fill(&self, cell: &str) {
        // Documents count their policies from 1.
        for id in 1..=3 {
            self.prepare(&format!("skillet policy import s7 --id {id} --cell {cell}"));
        }
        // And have worked with another one before the one they tell of.
        self.prepare(&format!("skillet policy activate 2 --cell {cell}"));
    }

    fn prepare(&self, line: &str) {
        let output = self.run(line);
        assert!(output.status.success(), "`{line}`: {}", util::stderr(&output));
    }

    fn learner(&mut self, session: &str, line: &str) {
        let _ = fs::remove_dir_all(self.bench.path(session));
        let running = Running::start(&mut self.shell(&format!("exec {line} >/dev/null 2>&1")));
        self.learners.push((session.into(), running));
        self.bench.wait_for_trials(session, 1);
    }

    fn up(&mut self, cell: &str, line: &str) {
        self.prepare(&format!("{line} --pace max"));
        self.up.insert(cell.into());
        if line.contains("--no-learner") {
            self.fill(cell);
        }
    }

    fn has(&self, cell: &str) -> bool {
        self.up.contains(cell) || self.controllers.iter().any(|(name, _)| name == cell)
    }

    /// Runs a line of a document, and everything it needs before.
    fn play(&mut self, learnt: &Path, line: &Line, all: &[Vec<String>]) {
        for arguments in all {
            let after = |flag| {
                let at = arguments.iter().position(|word| word == flag)?;
                arguments.get(at + 1).cloned()
            };
            let service = arguments[0].as_str();
            let text = format!("skillet {}", arguments.join(" "));
            match arguments.iter().map(String::as_str).collect::<Vec<_>>()[..] {
                ["cell", "up", cell, ..] => return self.up(cell, &text),
                ["cell", "down", cell, ..] => _ = self.up.remove(cell),
                _ => {}
            }
            match (service, after("--cell"), after("--session")) {
                ("controller", cell, _) => {
                    return self.controller(&cell.unwrap_or("skillet".into()), &text);
                }
                ("learner", Some(cell), Some(session)) => {
                    self.controller(&cell, &format!("skillet controller --cell {cell}"));
                    return self.learner(&session, &text);
                }
                (_, Some(cell), _) => {
                    self.controller(&cell, &format!("skillet controller --cell {cell}"));
                }
                _ => {}
            }
            for name in arguments.iter().filter(|word| is_session(word)) {
                let is_learning = self.learners.iter().any(|(session, _)| session == name);
                // What stands in one line is typed one after the other.
                if !is_learning && self.fresh.insert((line.at.clone(), name.clone())) {
                    self.learnt(learnt, name);
                }
            }
            if let Some(out) = after("--out") {
                // A document may write the same file twice; its reader does so once.
                let _ = fs::remove_file(self.bench.path(&out));
            }
        }
        self.expect_success(line, all);
    }

    fn expect_success(&self, line: &Line, all: &[Vec<String>]) {
        let text = as_typed(&line.text);
        let last: Vec<&str> = all.last().expect("a command").iter().map(String::as_str).collect();
        eventually(&line.at, || {
            let output = self.run(&text);
            let said = util::stderr(&output);
            // One swap at a time: a reader waits for the one before, too.
            if said.contains("under way") {
                return None;
            }
            let code = output.status.code();
            let is_fine = code == Some(0) || (code == Some(1) && may_be_negative(&last));
            assert!(is_fine, "{}: `{text}` ended with {code:?}: {said}", line.at);
            Some(())
        });
    }
}

impl Drop for Stage {
    fn drop(&mut self) {
        for cell in &self.up {
            self.run(&format!("skillet cell down {cell}"));
        }
    }
}

/// What to run of a line: the arguments of its commands, unless one of them is another tool's, tested
/// elsewhere, or a mere mention.
fn to_run(line: &Line) -> Option<Vec<Vec<String>>> {
    let mut all = Vec::new();
    for words in commands(&line.text) {
        let Some(arguments) = arguments(&words) else {
            let tool = words.iter().find(|word| !word.contains('=')).map_or("", String::as_str);
            assert!(OTHER_TOOLS.contains(&tool), "{}: `{}`: what is {tool}?", line.at, line.text);
            return None;
        };
        let words: Vec<&str> = arguments.iter().map(String::as_str).collect();
        if line.text.starts_with("sudo") || tested_elsewhere(&words).is_some() {
            return None;
        }
        if !line.in_block && is_mention(&words) {
            return None;
        }
        all.push(arguments);
    }
    Some(all)
}

/// Without what the command needs, or only the name of a command.
fn is_mention(arguments: &[&str]) -> bool {
    match arguments {
        ["config" | "doctor" | "study"] => false,
        [_] => true,
        ["policy" | "demo" | "arm" | "cell" | "session", verb] => {
            !["pin", "unpin", "rollback", "list"].contains(verb)
        }
        ["learner", rest @ ..] => !rest.contains(&"--session"),
        ["policy", "activate" | "show" | "import" | "export" | "forbid" | "allow", flag, ..] => {
            flag.starts_with('-')
        }
        _ => false,
    }
}

#[test]
fn documents_say_what_works() {
    let bench = Bench::new();
    let learn = ["learn", "pancake", "--seed", "7", "--rollouts", "25", "--out", "learnt"];
    bench.ok(&[&learn[..], &["--record"]].concat());
    let learnt = bench.path("learnt");
    let mut run = 0;
    for document in documents(Path::new(env!("CARGO_MANIFEST_DIR"))) {
        let mut stage = Stage::new(&learnt);
        for line in document.lines() {
            if let Some(all) = to_run(&line) {
                stage.play(&learnt, &line, &all);
                run += 1;
            }
        }
        configurations(&stage, &document);
        python(&stage, &document);
    }
    assert!(run > 35, "only {run} command lines were run");
}

/// Every ```` ```toml ```` block is a configuration.
fn configurations(stage: &Stage, document: &Document) {
    for (line, block) in document.blocks("toml") {
        stage.bench.write("block.toml", &block);
        let output = stage.run("skillet config --config block.toml");
        let message = util::stderr(&output);
        assert!(output.status.success(), "{}, line {line}: {message}", document.name);
    }
}

/// The ```` ```python ```` blocks of a document, as one program.
fn python(stage: &Stage, document: &Document) {
    let blocks: Vec<String> = document.blocks("python").into_iter().map(|(_, text)| text).collect();
    if blocks.is_empty() {
        return;
    }
    if !stage.run("python3 --version").status.success() {
        eprintln!("SKIPPED, NOTHING SHOWN: no python3 here for {}", document.name);
        return;
    }
    stage.bench.write("document.py", &blocks.join("\n"));
    let output = stage.run("python3 document.py");
    assert!(output.status.success(), "{}: {}", document.name, util::stderr(&output));
    assert!(!output.stdout.is_empty(), "{}: its program prints something", document.name);
}

fn line(text: &str) -> Line {
    Line { at: "d.md, line 1".into(), text: text.into(), in_block: false }
}

#[test]
fn what_is_run_is_chosen_by_narrow_rules() {
    for text in [
        "skillet policy pin --cell kitchen",
        "skillet learn skittles --target 1.2,0.0",
        "skillet policy import SESSION --cell kitchen",
        "skillet status --cell kitchen",
        "cargo run --release -- config > my.toml",
    ] {
        assert!(to_run(&line(text)).is_some(), "{text}");
    }
    for text in [
        "skillet soak --minutes 5",
        "skillet policy modes",
        "cargo install --path .",
        "skillet status",
    ] {
        assert!(to_run(&line(text)).is_none(), "{text}");
    }
}

#[test]
#[should_panic(expected = "d.md, line 1: `skillet policy show s7 9999` ended with")]
fn a_command_that_fails_is_found() {
    let bench = Bench::new();
    bench.ok(&["learn", "pancake", "--seed", "7", "--rollouts", "1", "--out", "learnt"]);
    let line = line("skillet policy show s7 9999");
    let all = to_run(&line).unwrap();
    Stage::new(&bench.path("learnt")).play(&bench.path("learnt"), &line, &all);
}

#[test]
#[should_panic(expected = "what is frobnicate?")]
fn a_tool_that_nobody_declared_is_found() {
    to_run(&line("skillet config | frobnicate"));
}
