//! Opens the folder of a session, and resumes a stored session by telling its search every trial.

use std::time::{Duration, Instant};

use anyhow::{Context, Result};
use learner::Learner;
use learner::judge::Judge;
use learner::replay::Told;

use crate::config::Config;
use crate::session_folder::SessionFolder;
use crate::{judging, setup};

/// Interval of progress messages for long sessions.
const EVERY: Duration = Duration::from_secs(3);

/// Checks that an existing session was made in the world of `given`, or writes a new one, by default that of the
/// built-in configuration. Returns the session's own configuration.
pub fn open_or_create(folder: &SessionFolder, given: Option<&Config>) -> Result<Config> {
    if folder.has_session() {
        given.map_or(Ok(()), |config| folder.expect_same_world(config))?;
    } else {
        let config = given.cloned().map_or_else(|| Config::load(None), Ok)?;
        setup::check(&config)?;
        judging::judge(&config)?;
        folder.write(&config)?;
    }
    Config::load(Some(&folder.config_path()))
}

/// Resumes the session with `judge`; `say` receives the progress of a long one.
pub fn resume(
    folder: &SessionFolder,
    config: &Config,
    judge: Judge,
    say: impl Fn(&str),
) -> Result<Learner> {
    let demonstrations = setup::check(config)?;
    let mut said = Instant::now();
    let mut show = |told: Told| {
        if said.elapsed() >= EVERY {
            said = Instant::now();
            say(&format!("{} of {} stored trials told again", told.trials, told.of));
        }
    };
    let (dir, task) = (folder.dir(), &config.task.name);
    Learner::resume_showing(dir, task, &config.learner, &demonstrations, judge, &mut show)
        .with_context(|| format!("session {}", dir.display()))
}
