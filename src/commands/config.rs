//! `skillet config`: the configuration in effect.

use anyhow::Result;

use crate::Verdict;
use crate::cli::ConfigArgs;
use crate::config::Config;
use crate::output::{print, print_json};

/// Settings without a default, which TOML cannot show.
const OPTIONAL: &str = "\n# optional: task.demonstration (CSV), plant.arm (URDF), controller.cpu,\n# cell.state_dir, metrics.listen (as \"127.0.0.1:9464\")\n";

pub fn run(args: &ConfigArgs) -> Result<Verdict> {
    let config = Config::load(args.config.as_deref())?;
    if args.json {
        print_json(&config)?;
    } else {
        print(&format!("{}{OPTIONAL}", config.to_toml()?))?;
    }
    Ok(Verdict::Done)
}
