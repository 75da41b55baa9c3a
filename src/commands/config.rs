//! `skillet config`: the configuration in effect.

use anyhow::Result;

use crate::Verdict;
use crate::cli::ConfigArgs;
use crate::config::Config;
use crate::judging;
use crate::output::{print, print_json};

/// Settings without a default, which TOML cannot show.
const OPTIONAL: &str = "\n# optional: task.demonstration (CSV), task.judge (as { reward = \"apex_m\", success = \"caught\" },\n# or { program = [\"python3\", \"my_task.py\"] }),\n# plant.arm (URDF), plant.base,\n# plant.pan (as { mass_kg = 0.5, xyz_m = [0, 0, 0.2], rpy_rad = [0, 0, 0] }), controller.cpu,\n# cell.state_dir, metrics.listen (as \"127.0.0.1:9464\");\n# learner.encoding, demonstrations_are, orientation, initial_stiffness, stiffness_range: docs/own-task.md\n";

pub fn run(args: &ConfigArgs) -> Result<Verdict> {
    let config = Config::load(args.config.as_deref())?;
    if config.task.judge.is_some() {
        judging::judge(&config)?;
    }
    if args.json {
        print_json(&config)?;
    } else {
        print(&format!("{}{OPTIONAL}", config.to_toml()?))?;
    }
    Ok(Verdict::Done)
}
