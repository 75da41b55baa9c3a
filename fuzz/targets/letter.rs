//! A letter to a session, of anybody's making: it is taken or put aside, and the session goes on.
#![no_main]

use std::fs;
use std::sync::LazyLock;

use learner::learner::SESSION_FILE;
use learner::people::PeopleConfig;
use learner::{Learner, LearnerConfig};
use libfuzzer_sys::fuzz_target;
use search::Method;
use skillet_fuzz::{action_session, folder, judge, session};
use tempfile::TempDir;

static FOLDER: LazyLock<TempDir> = LazyLock::new(folder);
static SOUND: LazyLock<Vec<u8>> = LazyLock::new(sound);

fn config() -> LearnerConfig {
    let mut config = action_session();
    config.search.method = Method::Power;
    config.people = PeopleConfig { weight: 0.5, wait: false, ..PeopleConfig::default() };
    config
}

/// A session of three trials.
fn sound() -> Vec<u8> {
    let folder = folder();
    drop(session(folder.path(), config(), &[0.5, 0.1, 0.9]));
    fs::read(folder.path().join(SESSION_FILE)).expect("it was written")
}

fuzz_target!(|data: &[u8]| {
    for entry in fs::read_dir(FOLDER.path()).expect("it is there").flatten() {
        let _ = fs::remove_file(entry.path());
    }
    fs::write(FOLDER.path().join(SESSION_FILE), &*SOUND).expect("there is space");
    let mail = FOLDER.path().join("mail");
    fs::create_dir_all(&mail).expect("there is space");
    fs::write(mail.join("1.json"), data).expect("there is space");
    let resume = || Learner::resume(FOLDER.path(), "landscape", &config(), &[], judge());
    let mut learner = resume().expect("it is sound");
    learner.take_mail().expect("whatever the letter says");
    assert!(!mail.join("1.json").exists());
    let next = learner.next_policy().expect("there is space");
    drop(learner);
    let mut learner = resume().expect("it resumes with what was said");
    assert_eq!(learner.next_policy().expect("there is space"), next);
    let _ = fs::remove_file(mail.join("1.refused"));
});
