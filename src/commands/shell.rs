//! `skillet completions` and `skillet man`: both follow from the command line's definition.

use anyhow::{Context, Result};
use clap::CommandFactory;

use crate::Verdict;
use crate::cli::Cli;
use crate::cli::shell::{CompletionsArgs, ManArgs, Shell};
use crate::output::print;

pub fn completions(args: &CompletionsArgs) -> Result<Verdict> {
    let shell = match args.shell {
        Shell::Bash => clap_complete::Shell::Bash,
        Shell::Zsh => clap_complete::Shell::Zsh,
        Shell::Fish => clap_complete::Shell::Fish,
    };
    let mut script = Vec::new();
    clap_complete::generate(shell, &mut Cli::command(), "skillet", &mut script);
    print(&String::from_utf8(script)?)?;
    Ok(Verdict::Done)
}

pub fn man(args: &ManArgs) -> Result<Verdict> {
    let dir = &args.out;
    std::fs::create_dir_all(dir)
        .and_then(|()| clap_mangen::generate_to(Cli::command().name("skillet"), dir))
        .with_context(|| format!("{}: cannot write the manual pages", dir.display()))?;
    Ok(Verdict::Done)
}
