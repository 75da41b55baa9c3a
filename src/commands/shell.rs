//! `skillet completions` and `skillet man`: both follow from the command line's definition.

use anyhow::{Context, Result};

use crate::Verdict;
use crate::cli::families;
use crate::cli::shell::{CompletionsArgs, ManArgs};
use crate::complete;
use crate::output::print;

pub fn completions(args: &CompletionsArgs) -> Result<Verdict> {
    print(&String::from_utf8(complete::script(args.shell)?)?)?;
    Ok(Verdict::Done)
}

pub fn man(args: &ManArgs) -> Result<Verdict> {
    let dir = &args.out;
    std::fs::create_dir_all(dir)
        .and_then(|()| clap_mangen::generate_to(families::command().name("skillet"), dir))
        .with_context(|| format!("{}: cannot write the manual pages", dir.display()))?;
    Ok(Verdict::Done)
}
