//! `skillet policy export | import SESSION --where`: choosing among all that a session's rollouts did.

use std::path::Path;

use anyhow::{Context, Result};
use learner::parameters::PolicyIds;
use learner::problem::Problem;
use learner::repertoire::serve;
use learner::wish::Wish;
use shm_types::policy::PolicyMsg;

use super::stored::open;
use crate::config::Config;
use crate::session_folder::SessionFolder;
use crate::setup;
use crate::stderr::say;

/// The policy of a wish that was taken from rollout n has the id n + this.
const WISH_POLICY_ID: u64 = 2_000_000;

/// The policy for a condition, from a running or finished session; the session's own condition applies too.
pub fn answer(session: &Path, wish: &str) -> Result<PolicyMsg> {
    let folder = SessionFolder::open(session)?;
    let store = open(folder.dir(), &folder.database())?;
    let config = Config::load(Some(&folder.config_path()))?;
    let meta = store.meta();
    let parse = |text: &str| Wish::parse(text, &meta.measures).context("--where");
    let wish = match (parse(wish)?, store.wishes()?.last()) {
        (alone, None) => alone,
        (alone, Some(of_session)) => {
            parse(&format!("({}) and ({})", alone.text(), of_session.text()))?
        }
    };
    let demonstrations = match config.has_arm() {
        true => setup::demonstrations(&config)?,
        false => Vec::new(),
    };
    let problem = Problem::around(&store.initial_policy()?, &meta.learner, &demonstrations)?;
    let served = serve(&problem.spaces[0], &store.trials()?, &wish).context("--where")?;
    say(&format!(
        "{} rollouts met the condition; the policy comes from rollout {} and its neighbours, with an \
         estimated chance of {:.2} to meet it again",
        served.n, served.rollout, served.chance
    ));
    let policy_id = WISH_POLICY_ID + served.rollout;
    let ids = PolicyIds { session: meta.session_id, rollout: 0, policy_id };
    Ok(problem.decode(&served.theta, ids))
}
