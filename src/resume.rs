//! Resumes a stored session by telling its search every trial.

use std::time::{Duration, Instant};

use anyhow::{Context, Result};
use learner::Learner;
use learner::judge::Judge;
use learner::replay::Told;

use crate::config::Config;
use crate::session_folder::SessionFolder;
use crate::setup;

/// Interval of progress messages for long sessions.
const EVERY: Duration = Duration::from_secs(3);

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
