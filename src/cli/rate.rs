//! `skillet rate`: its flags.

use std::path::PathBuf;

use clap::Args;
use learner::people::BEST;

use crate::people::Word;

#[derive(Args)]
#[command(after_help = "\
Examples:
  skillet rate sessions/pancake-1 7
  skillet rate sessions/pancake-1 --worse --rollout 12
  skillet rate sessions/pancake-1 --withdraw

A rating is weighted by learner.people.weight and takes effect from the next rollout. It may arrive late;
a later rating of the same rollout replaces it. Without a running learner it is stored and takes effect
when the session is resumed.")]
pub struct RateArgs {
    /// Session folder with the rollout to rate
    pub session: PathBuf,
    #[command(flatten)]
    pub word: WordArgs,
    /// Rollout to rate [default: the newest]
    #[arg(long, value_name = "N")]
    pub rollout: Option<u64>,
    /// Print JSON
    #[arg(long)]
    pub json: bool,
}

/// The rating: exactly one of these.
#[derive(Args)]
#[group(id = "word", required = true, multiple = false)]
pub struct WordArgs {
    /// The rating, from 0 to 10
    #[arg(allow_negative_numbers = true, value_parser = rating)]
    pub rating: Option<f64>,
    /// The rollout is better than the one before it
    #[arg(long)]
    pub better: bool,
    /// The rollout is worse than the one before it
    #[arg(long)]
    pub worse: bool,
    /// Withdraw the rating of the rollout
    #[arg(long)]
    pub withdraw: bool,
}

impl WordArgs {
    /// One of them, as clap sees to it.
    pub fn word(&self) -> Word {
        match self.rating {
            Some(rating) => Word::Rate(rating),
            None if self.better => Word::Better,
            None if self.worse => Word::Worse,
            None => Word::Withdraw,
        }
    }
}

fn rating(text: &str) -> Result<f64, String> {
    let rating: Option<f64> = text.parse().ok();
    rating
        .filter(|rating| (0.0..=BEST).contains(rating))
        .map(|rating| rating + 0.0)
        .ok_or(format!("use a number from 0 to {BEST}"))
}
