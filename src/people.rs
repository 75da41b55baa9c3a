//! Ratings and demonstrations from a person: a letter to the learner, and its result.

use std::path::Path;
use std::time::{Duration, Instant};

use anyhow::{Context, Result, bail};
use learner::mail::{Mail, Post, Says};
use learner::store::{Store, TrialRecord};
use serde_json::json;

use crate::session_folder::SessionFolder;

/// How long to wait for a running learner to accept a letter.
const PATIENCE: Duration = Duration::from_secs(2);
const LOOK: Duration = Duration::from_millis(20);

/// A rating of a rollout.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Word {
    /// 0 to 10.
    Rate(f64),
    /// Than the one before.
    Better,
    Worse,
    Withdraw,
}

/// The result of a letter.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Answer {
    /// It takes effect from this rollout on.
    Taken { from: u64 },
    /// A rollout is running; it takes effect afterwards.
    Recorded,
    /// No learner is running; the next one applies it.
    AtRest,
}

impl Answer {
    pub fn sentence(self) -> String {
        match self {
            Answer::Taken { from } => format!("accepted; takes effect from rollout {from}"),
            Answer::Recorded => "recorded; takes effect after the current rollout".into(),
            Answer::AtRest => "recorded; takes effect when the session is resumed".into(),
        }
    }

    pub fn json(self) -> serde_json::Value {
        match self {
            Answer::Taken { from } => json!({ "taken": true, "from_rollout": from }),
            _ => json!({ "taken": false, "from_rollout": null }),
        }
    }
}

/// A rating that was given: its rollout, and its value if it is already known.
pub struct Rated {
    pub rollout: u64,
    pub rating: Option<f64>,
    pub answer: Answer,
}

impl Rated {
    pub fn sentence(&self) -> String {
        let (rollout, answer) = (self.rollout, self.answer.sentence());
        match self.rating {
            Some(rating) => format!("rollout {rollout}, rated {rating:.1}: {answer}"),
            None => format!("rollout {rollout}: {answer}"),
        }
    }
}

/// Rates `rollout` of a session, or its newest one.
pub fn rate(folder: &SessionFolder, rollout: Option<u64>, word: Word) -> Result<Rated> {
    let store = open(folder)?;
    let people = store.meta().learner.people;
    if !people.takes_ratings() {
        bail!(
            "{}: ratings do not count in this session: start one with learner.people.weight above 0, the \
             share of ratings in the reward",
            folder.dir().display()
        );
    }
    let trials = store.trials()?;
    let executed = trials.iter().filter(|trial| trial.was_executed());
    let last = executed.clone().next_back().map(|trial| trial.rollout);
    let Some(rollout) = rollout.or(last) else {
        bail!("{}: no rollout has been executed yet", folder.dir().display());
    };
    expect_executed(folder, &trials, rollout)?;
    let before = || {
        let before = executed.clone().rfind(|trial| trial.rollout < rollout);
        before.with_context(|| {
            format!("rollout {rollout} is the first one: give a number from 0 to 10")
        })
    };
    let compared = |is_better: bool| -> Result<Says> {
        Ok(Says::Comparison { rollout, than: before()?.rollout, is_better })
    };
    let says = match word {
        Word::Rate(rating) => Says::Rating { rollout, rating: Some(rating) },
        Word::Withdraw => Says::Rating { rollout, rating: None },
        Word::Better => compared(true)?,
        Word::Worse => compared(false)?,
    };
    drop(store);
    let post = post(folder, says)?;
    let id = post.letter.id;
    let taken = await_taken(folder, &post, |store| {
        let ratings = store.ratings()?;
        let own = ratings.of_letter(id).filter(|rating| rating.rollout == rollout).last().copied();
        Ok(own.map(|rating| (rating.after, rating.rating)))
    })?;
    let known = match word {
        Word::Rate(rating) => Some(rating),
        _ => None,
    };
    Ok(match taken {
        Ok((after, rating)) => Rated { rollout, rating, answer: Answer::Taken { from: after + 1 } },
        Err(answer) => Rated { rollout, rating: known, answer },
    })
}

/// Adds a demonstration, `text` of the file `file`.
pub fn show(folder: &SessionFolder, file: &Path, text: String) -> Result<Answer> {
    let file = file
        .file_name()
        .map_or_else(|| file.display().to_string(), |name| name.to_string_lossy().into_owned());
    let post = post(folder, Says::Demonstration { file, text })?;
    let id = post.letter.id;
    let taken = await_taken(folder, &post, |store| {
        Ok(store.added()?.iter().find(|added| added.letter == id).map(|added| added.after))
    })?;
    Ok(taken.map_or_else(|answer| answer, |after| Answer::Taken { from: after + 1 }))
}

fn open(folder: &SessionFolder) -> Result<Store> {
    Store::open(&folder.database()).with_context(|| format!("session {}", folder.dir().display()))
}

fn expect_executed(folder: &SessionFolder, trials: &[TrialRecord], rollout: u64) -> Result<()> {
    match trials.iter().find(|trial| trial.rollout == rollout) {
        Some(trial) if trial.was_executed() => Ok(()),
        Some(_) => bail!(
            "rollout {rollout} was not executed: it was refused or set aside, see `skillet trials`"
        ),
        None => {
            bail!("{}: no rollout {rollout}; use 1..={}", folder.dir().display(), trials.len())
        }
    }
}

fn post(folder: &SessionFolder, says: Says) -> Result<Post> {
    Mail::of(folder.dir()).post(says).with_context(|| {
        format!(
            "{}: cannot write to its mailbox; check permissions and free space",
            folder.dir().display()
        )
    })
}

/// Waits briefly for the learner; `found` reads the stored result of the letter by its id.
fn await_taken<T>(
    folder: &SessionFolder,
    post: &Post,
    found: impl Fn(&Store) -> Result<Option<T>>,
) -> Result<Result<T, Answer>> {
    let start = Instant::now();
    let mut is_at_work = true;
    while post.waits() && is_at_work && start.elapsed() < PATIENCE {
        std::thread::sleep(LOOK);
        is_at_work = folder.is_in_use();
    }
    if post.waits() {
        return Ok(Err(if is_at_work { Answer::Recorded } else { Answer::AtRest }));
    }
    match found(&open(folder)?)? {
        Some(found) => Ok(Ok(found)),
        None => bail!(
            "{}: refused by the learner; see learner.log in the session folder, or the log of its service, for \
             the reason",
            folder.dir().display()
        ),
    }
}
