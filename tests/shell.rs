//! Completions and manual pages follow from the command line.

mod util;

use std::process::Command;

use util::Bench;

/// Names of the commands that `help` of `path` lists.
fn subcommands(bench: &Bench, path: &[&str]) -> Vec<String> {
    let help = bench.ok(&[path, &["--help"]].concat());
    let lines = help.lines().skip_while(|line| *line != "Commands:").skip(1);
    lines
        .take_while(|line| line.starts_with("  "))
        .filter(|line| !line.starts_with("   "))
        .filter_map(|line| line.split_whitespace().next())
        .filter(|name| *name != "help")
        .map(String::from)
        .collect()
}

#[test]
fn completion_scripts_know_the_commands() {
    let bench = Bench::new();
    for shell in ["bash", "zsh", "fish"] {
        let script = bench.ok(&["completions", shell]);
        for word in ["learn", "policy", "rollouts", "export", "realtime"] {
            assert!(script.contains(word), "{shell} does not complete {word}");
        }
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
