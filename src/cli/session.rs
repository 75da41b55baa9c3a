//! `skillet session`: its verbs and flags.

use std::path::PathBuf;

use clap::{Args, Subcommand};

#[derive(Args)]
pub struct SessionArgs {
    #[command(subcommand)]
    pub verb: SessionVerb,
}

#[derive(Subcommand)]
pub enum SessionVerb {
    /// List the sessions in a folder, most recently changed first
    #[command(after_help = "\
Examples:
  skillet session list
  skillet session list studies --json")]
    List {
        /// Folder with session folders
        #[arg(default_value = "sessions")]
        dir: PathBuf,
        /// Print JSON
        #[arg(long)]
        json: bool,
    },
    /// Show what one session has learnt so far
    #[command(after_help = "Example: skillet session show sessions/pancake-1")]
    Show {
        /// Session folder
        session: PathBuf,
        /// Print JSON
        #[arg(long)]
        json: bool,
    },
}
