//! `skillet rate`: a rollout that a person rates.

use anyhow::Result;
use serde_json::json;

use crate::Verdict;
use crate::cli::rate::RateArgs;
use crate::output::{print, print_json};
use crate::people;
use crate::session_folder::SessionFolder;

pub fn run(args: &RateArgs) -> Result<Verdict> {
    let rated = people::rate(&SessionFolder::open(&args.session)?, args.rollout, args.word.word())?;
    if args.json {
        let mut object = rated.answer.json();
        object["rollout"] = json!(rated.rollout);
        object["rating"] = json!(rated.rating);
        print_json(&object)?;
    } else {
        print(&format!("{}\n", rated.sentence()))?;
    }
    Ok(Verdict::Done)
}
