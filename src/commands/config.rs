//! `skillet config`: the configuration in effect.

use anyhow::Result;

use crate::Verdict;
use crate::cli::ConfigArgs;
use crate::config::Config;

pub fn run(args: &ConfigArgs) -> Result<Verdict> {
    let config = Config::load(args.config.as_deref())?;
    if args.json {
        println!("{}", serde_json::to_string_pretty(&config)?);
    } else {
        print!("{}", config.to_toml()?);
    }
    Ok(Verdict::Done)
}
