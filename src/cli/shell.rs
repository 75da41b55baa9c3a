//! `skillet completions` and `skillet man`: their flags.

use std::path::PathBuf;

use clap::{Args, ValueEnum};

#[derive(Clone, Copy, Debug, PartialEq, ValueEnum)]
pub enum Shell {
    Bash,
    Zsh,
    Fish,
}

#[derive(Args)]
#[command(after_help = "\
Examples:
  skillet completions bash > ~/.local/share/bash-completion/completions/skillet
  skillet completions fish > ~/.config/fish/completions/skillet.fish

The script queries `skillet`: it completes commands and flags, running cells, sessions, studies and tasks.")]
pub struct CompletionsArgs {
    pub shell: Shell,
}

#[derive(Args)]
#[command(after_help = "\
Example: skillet man --out ~/.local/share/man/man1     then: man skillet-learn

Writes one page per command, rendered from the command-line definition. Existing pages are replaced.")]
pub struct ManArgs {
    /// Folder for the pages
    #[arg(long)]
    pub out: PathBuf,
}
