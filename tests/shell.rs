//! Completions in a real shell, and manual pages: both follow from the command line.

mod util;

use std::os::unix::fs::symlink;
use std::process::Command;

use util::{Bench, eventually};

/// Names of the commands that `help` of `path` lists, under one heading or several.
fn subcommands(bench: &Bench, path: &[&str]) -> Vec<String> {
    let help = bench.ok(&[path, &["--help"]].concat());
    let lines = help.lines().skip_while(|line| !line.starts_with("Usage:")).skip(1);
    lines
        .take_while(|line| *line != "Options:" && *line != "Arguments:")
        .filter(|line| line.starts_with("  ") && !line.starts_with("   "))
        .filter_map(|line| line.split_whitespace().next())
        .filter(|name| *name != "help")
        .map(String::from)
        .collect()
}

/// What bash offers behind `words`, the last of which is being typed.
fn offered(bench: &Bench, words: &[&str]) -> Vec<String> {
    let script = "source completions.bash\nCOMP_WORDS=(\"$@\") COMP_CWORD=$(($# - 1)) COMP_TYPE=9\n\
                  _clap_complete_skillet \"$1\" \"${COMP_WORDS[COMP_CWORD]}\" \"\"\n\
                  printf '%s\\n' \"${COMPREPLY[@]}\"";
    let skillet = bench.skillet(&[]);
    let mut bash = Command::new("bash");
    bash.args(["-c", script, "bash", "skillet"]).args(words).current_dir(bench.path("."));
    bash.envs(skillet.get_envs().filter_map(|(key, value)| Some((key, value?))));
    let path = format!("{}:{}", bench.path("bin").display(), std::env::var("PATH").unwrap());
    let output = bash.env("PATH", path).output().unwrap();
    assert!(output.status.success(), "{}", util::stderr(&output));
    let text = String::from_utf8(output.stdout).unwrap();
    text.lines().map(String::from).collect()
}

fn with_completions() -> Bench {
    let bench = Bench::new();
    std::fs::create_dir(bench.path("bin")).unwrap();
    symlink(env!("CARGO_BIN_EXE_skillet"), bench.path("bin/skillet")).unwrap();
    bench.write("completions.bash", &bench.ok(&["completions", "bash"]));
    bench
}

#[test]
fn bash_offers_what_there_is_at_this_moment() {
    let bench = with_completions();
    assert_eq!(offered(&bench, &["status", "--cell", ""]), [""]);
    let controller = bench.start(&["controller", "--cell", "kitchen", "--pace", "max"]);
    bench.ok(&["learn", "archery", "--rollouts", "2", "--out", "sessions/arrows"]);
    eventually("the cell", || {
        (offered(&bench, &["status", "--cell", "k"]) == ["kitchen"]).then_some(())
    });
    assert_eq!(offered(&bench, &["cell", "down", ""])[0], "kitchen");
    assert_eq!(offered(&bench, &["report", "se"]), ["sessions/arrows"]);
    assert_eq!(offered(&bench, &["policy", "import", "sessions/"]), ["sessions/arrows"]);
    assert_eq!(offered(&bench, &["study", "landsc"]), ["landscape"]);
    assert!(offered(&bench, &["learn", "ball"]).contains(&"ball-in-a-cup".to_string()));
    assert_eq!(offered(&bench, &["learn", "--arm", "ii"]), ["iiwa14"]);
    drop(controller);
    eventually("its end", || (offered(&bench, &["status", "--cell", ""]) == [""]).then_some(()));
}

#[test]
fn bash_offers_nothing_internal() {
    let bench = with_completions();
    let commands = offered(&bench, &[""]);
    assert!(commands.contains(&"cell".to_string()) && !commands.contains(&"child".to_string()));
    let flags = offered(&bench, &["controller", "--"]);
    assert!(flags.contains(&"--config".to_string()), "{flags:?}");
    for internal in ["--child", "--private", "--timing", "--background"] {
        assert!(!flags.contains(&internal.to_string()), "{flags:?}");
    }
}

#[test]
fn every_shell_has_a_script() {
    let bench = Bench::new();
    for shell in ["bash", "zsh", "fish"] {
        let script = bench.ok(&["completions", shell]);
        assert!(script.contains("SKILLET_COMPLETE"), "{script}");
        let path = bench.write(shell, &script);
        // Shells that are not installed are not asked.
        if let Ok(output) = Command::new(shell).arg("-n").arg(&path).output() {
            assert!(output.status.success(), "{shell}: {}", util::stderr(&output));
        } else {
            assert_ne!(shell, "bash", "bash is needed for this test");
        }
    }
    bench.refused(&["completions", "cmd"], &["bash", "zsh", "fish"]);
}

#[test]
fn every_command_has_a_page() {
    let bench = Bench::new();
    bench.ok(&["man", "--out", "man/man1"]);
    let page = |name: &str| util::text(&bench.path(&format!("man/man1/{name}.1")));
    assert!(page("skillet").contains("skillet"));
    let commands = subcommands(&bench, &[]);
    assert!(commands.len() > 12, "{commands:?}");
    let mut pages = 1;
    for command in &commands {
        let name = format!("skillet-{command}");
        assert!(page(&name).contains(".TH"), "{name}");
        pages += 1;
        for sub in subcommands(&bench, &[command]) {
            assert!(page(&format!("{name}-{sub}")).contains(".TH"), "{name}-{sub}");
            pages += 1;
        }
    }
    assert!(pages > 30, "{pages}");
    bench.ok(&["man", "--out", "man/man1"]);
}
