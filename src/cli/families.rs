//! The families of commands, and the help that shows them under their headings.

use clap::builder::StyledStr;
use clap::{Command, CommandFactory, FromArgMatches};

use super::Cli;

/// Heading, what it is about, and its commands in the order of the help.
type Family = (&'static str, &'static str, &'static [&'static str]);

pub const FAMILIES: [Family; 3] = [
    (
        "Sessions",
        "learn a skill, rate and replay its trials",
        &[
            "learn", "session", "trials", "policy", "rate", "judge", "demo", "replay", "convert",
            "report",
        ],
    ),
    (
        "Cells",
        "a controller and its learner as services",
        &[
            "cell",
            "status",
            "watch",
            "record",
            "hold",
            "rearm",
            "posture",
            "controller",
            "learner",
            "bridge",
        ],
    ),
    (
        "Laboratory",
        "tasks, arms, experiments and this host",
        &[
            "task",
            "arm",
            "plant",
            "study",
            "bench",
            "soak",
            "doctor",
            "config",
            "completions",
            "man",
        ],
    ),
];

/// The command line, with a list of commands by family in its help.
pub fn command() -> Command {
    let command = Cli::command();
    let list = list(&command);
    command.help_template(format!(
        "{{about-with-newline}}\n{{usage-heading}} {{usage}}\n\n{list}\n{}\n{{options}}{{after-help}}",
        heading(&Cli::command(), "Options:"),
    ))
}

/// Parses the arguments of this process.
pub fn parse() -> Result<Cli, clap::Error> {
    let mut matches = command().try_get_matches()?;
    Cli::from_arg_matches_mut(&mut matches).map_err(|error| error.format(&mut command()))
}

fn heading(command: &Command, text: &str) -> StyledStr {
    let style = command.get_styles().get_header();
    format!("{style}{text}{style:#}").into()
}

fn list(command: &Command) -> String {
    let visible = || command.get_subcommands().filter(|command| !command.is_hide_set());
    let width = visible().map(|command| command.get_name().len()).max().unwrap_or(0);
    let literal = command.get_styles().get_literal();
    let mut text = String::new();
    for (name, about, commands) in FAMILIES {
        text += &format!("{} {about}\n", heading(command, &format!("{name}:")).ansi());
        for command in commands.iter().filter_map(|name| command.find_subcommand(name)) {
            let about = command.get_about().map(ToString::to_string).unwrap_or_default();
            let name = command.get_name();
            text += &format!("  {literal}{name:<width$}{literal:#}  {about}\n");
        }
        text += "\n";
    }
    text.trim_end().to_string() + "\n"
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeSet;

    use super::*;

    #[test]
    fn every_visible_command_is_in_exactly_one_family() {
        let command = Cli::command();
        let visible = command.get_subcommands().filter(|command| !command.is_hide_set());
        let visible: BTreeSet<String> = visible.map(|command| command.get_name().into()).collect();
        let listed: Vec<&str> =
            FAMILIES.iter().flat_map(|(.., commands)| *commands).copied().collect();
        let once: BTreeSet<String> = listed.iter().map(|name| name.to_string()).collect();
        assert_eq!(once, visible);
        assert_eq!(listed.len(), once.len(), "a command is in two families");
    }

    #[test]
    fn the_help_fits_into_eighty_columns() {
        let help = command().render_help().to_string();
        for (heading, about, commands) in FAMILIES {
            let section = help.split(&format!("\n{heading}: {about}\n")).nth(1).unwrap();
            let names = section.lines().map_while(|line| line.trim().split_once("  "));
            assert_eq!(names.map(|(name, _)| name).collect::<Vec<_>>(), commands, "{help}");
        }
        assert!(!help.contains("child") && !help.contains("Commands:"), "{help}");
        for line in help.lines().take_while(|line| !line.starts_with("Exit codes")) {
            assert!(line.chars().count() <= 80, "{line}");
        }
    }
}
