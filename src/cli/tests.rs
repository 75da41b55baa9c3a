//! Every command line in the documents and in the help is one that this tool understands.

use std::path::Path;

use clap::error::ErrorKind;
use clap::{Command, CommandFactory, Parser};

use super::Cli;

#[path = "../../tests/util/document.rs"]
mod document;

use document::{Document, Line, arguments, commands, documents};

/// Why the tool would refuse a line.
fn refusal(line: &Line) -> Option<String> {
    commands(&line.text).iter().filter_map(|words| arguments(words)).find_map(|arguments| {
        let words = ["skillet".to_string()].into_iter().chain(arguments);
        let error = Cli::try_parse_from(words).err()?;
        let is_fine = match error.kind() {
            ErrorKind::DisplayHelp | ErrorKind::DisplayVersion => true,
            // In a sentence a command may be named without everything it needs.
            ErrorKind::MissingRequiredArgument
            | ErrorKind::MissingSubcommand
            | ErrorKind::TooFewValues
            | ErrorKind::DisplayHelpOnMissingArgumentOrSubcommand => !line.in_block,
            _ => false,
        };
        (!is_fine).then(|| format!("{}: `{}`: {error}", line.at, line.text))
    })
}

#[test]
fn documents_name_commands_and_flags_that_exist() {
    let mut found = 0;
    for document in documents(Path::new(env!("CARGO_MANIFEST_DIR"))) {
        for line in document.lines() {
            assert_eq!(refusal(&line), None);
            found += 1;
        }
    }
    assert!(found > 60, "only {found} command lines");
}

/// Examples stand behind `Example:` or on lines of their own; two spaces end them.
#[test]
fn examples_in_the_help_are_commands() {
    fn visit(command: &Command, found: &mut usize) {
        let help = command.get_after_help().map(ToString::to_string).unwrap_or_default();
        for text in help.lines().map(|line| line.trim().trim_start_matches("Example: ")) {
            if text.starts_with("skillet ") {
                let text = text.split("  ").next().unwrap_or_default().to_string();
                let at = format!("help of {}", command.get_name());
                assert_eq!(refusal(&Line { at, text, in_block: true }), None);
                *found += 1;
            }
        }
        command.get_subcommands().for_each(|command| visit(command, found));
    }
    let mut found = 0;
    visit(&Cli::command(), &mut found);
    assert!(found > 40, "only {found} examples");
}

fn lines_of(text: &str) -> Vec<Line> {
    Document { name: "d.md".into(), text: text.into() }.lines()
}

#[test]
fn a_command_that_does_not_exist_is_found() {
    for (text, word) in [
        ("```sh\nskillet learn pancake --fast\n```", "--fast"),
        ("```sh\ncargo run --release -- teach pancake\n```", "teach"),
        ("```sh\nskillet config | tee my.toml && skillet status --cel kitchen\n```", "--cel"),
        ("```sh\nskillet learn pancake \\\n  --rollouts many\n```", "many"),
        ("```sh\nskillet learner --cell kitchen\n```", "--session"),
        ("say `skillet policy frobnicate` or", "frobnicate"),
        ("| a | `sudo -u skillet env A=b skillet status --sell x` |", "--sell"),
        ("`skillet learn pancake\n--seed one`", "one"),
    ] {
        let found: Vec<String> = lines_of(text).iter().filter_map(refusal).collect();
        assert_eq!(found.len(), 1, "{text}");
        assert!(found[0].contains(word) && found[0].contains("d.md, line"), "{}", found[0]);
    }
}

#[test]
fn what_is_no_command_of_ours_is_left_alone() {
    let text = "`skillet` stands for `cargo run --release --`, a user `skillet`.\n\n```text\nskillet \
                nonsense\n```\n```sh\n# skillet nonsense\nsudo useradd --system skillet\nskillet config \
                > my.toml     # skillet nonsense\n```\nsee `skillet policy modes` and `skillet policy …`";
    let lines = lines_of(text);
    let texts: Vec<&str> = lines.iter().map(|line| line.text.as_str()).collect();
    assert_eq!(texts.len(), 4, "{texts:?}");
    assert_eq!(texts[0], "sudo useradd --system skillet");
    assert_eq!(commands(texts[1]), [["skillet", "config"]]);
    assert_eq!(commands("skillet config 2> c.log &"), [["skillet", "config"]]);
    assert_eq!(lines[1].at, "d.md, line 9");
    assert!(lines.iter().all(|line| refusal(line).is_none()));
}
