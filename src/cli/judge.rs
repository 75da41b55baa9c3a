//! `skillet judge`: its flags.

use std::path::PathBuf;

use clap::Args;
use learner::people::BEST;

use crate::people::Word;

#[derive(Args)]
#[command(after_help = "\
Examples:
  skillet judge sessions/pancake-1 --rate 7
  skillet judge sessions/pancake-1 --worse --rollout 12
  skillet judge sessions/pancake-1 --withdraw
  skillet judge --again sessions/pancake-1 --config new.toml

A rating is weighted by learner.people.weight and takes effect from the next rollout. It may arrive late;
a later rating of the same rollout replaces it. Without a running learner it is stored and takes effect
when the session is resumed.

--again re-judges every stored trial from its measures with another configuration's judge (task.judge or
learner.reward). No program is started: a program's results are among the measures. The output lists the
trials whose success or reward would differ; the session is not changed.")]
pub struct JudgeArgs {
    /// Session folder with the rollout to rate
    #[arg(requires = "word", required_unless_present = "again", conflicts_with = "again")]
    pub session: Option<PathBuf>,
    #[command(flatten)]
    pub word: WordArgs,
    /// Rollout to rate [default: the newest]
    #[arg(long, value_name = "N", requires = "session")]
    pub rollout: Option<u64>,
    /// Session folder whose trials are re-judged
    #[arg(long, value_name = "SESSION", requires = "config")]
    pub again: Option<PathBuf>,
    /// Configuration (TOML) with the other judge
    #[arg(long, requires = "again")]
    pub config: Option<PathBuf>,
    /// Print JSON; with --again, every trial with both verdicts
    #[arg(long)]
    pub json: bool,
}

/// The rating: exactly one of these.
#[derive(Args)]
#[group(id = "word", multiple = false)]
pub struct WordArgs {
    /// Rate the rollout, from 0 to 10
    #[arg(long, value_name = "RATING", value_parser = rating, requires = "session")]
    pub rate: Option<f64>,
    /// The rollout is better than the one before it
    #[arg(long, requires = "session")]
    pub better: bool,
    /// The rollout is worse than the one before it
    #[arg(long, requires = "session")]
    pub worse: bool,
    /// Withdraw the rating of the rollout
    #[arg(long, requires = "session")]
    pub withdraw: bool,
}

impl WordArgs {
    pub fn word(&self) -> Option<Word> {
        let said = |is_said: bool, word| is_said.then_some(word);
        let rate = self.rate.map(Word::Rate).or(said(self.better, Word::Better));
        rate.or(said(self.worse, Word::Worse)).or(said(self.withdraw, Word::Withdraw))
    }
}

fn rating(text: &str) -> Result<f64, String> {
    let rating: Option<f64> = text.parse().ok();
    rating
        .filter(|rating| (0.0..=BEST).contains(rating))
        .map(|rating| rating + 0.0)
        .ok_or(format!("use a number from 0 to {BEST}"))
}
