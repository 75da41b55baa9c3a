//! A judge program: it gets a request per rollout, is restarted when it fails, and abandoned after a few failures.
//!
//! Its reply depends only on the request, so repeating a request changes no trial. It is a child of the
//! learner, and independent of the loop.

use std::cell::RefCell;
use std::collections::BTreeMap;
use std::path::PathBuf;
use std::time::{Duration, Instant};

use anyhow::{Context, Result};
use learner::judge::{AssessError, Assessor, Declared};
use shm_types::episode::{EpisodeHeader, TickRecord};
use shm_types::measures::Measures;

use super::answer::{Answer, parse, request};
use super::process::Process;
use super::{command, npy};
use crate::config::JudgeConfig;
use crate::config::judge::absolute;
use crate::session_folder::SessionFolder;

/// The longest wait for a reply before the learner does other work.
const STEP: Duration = Duration::from_millis(50);
/// Failures at one rollout after which the program is given up.
const ATTEMPTS: u32 = 3;
/// Time for the program to end by itself, once it is no longer needed.
const TO_END: Duration = Duration::from_secs(1);

pub struct Program {
    settings: Settings,
    state: RefCell<State>,
}

struct Settings {
    words: Vec<String>,
    folder: PathBuf,
    timeout: Duration,
    /// Its own measures with their units.
    own: BTreeMap<String, String>,
    /// Which one it was when the session was opened.
    identity: String,
    log: PathBuf,
    /// The file with the records, and its name in a request.
    records: PathBuf,
    records_name: String,
    declared: Declared,
}

#[derive(Default)]
struct State {
    process: Option<Process>,
    asked: Option<Asked>,
}

/// The rollout that is judged, or was judged last.
struct Asked {
    header: EpisodeHeader,
    request: Vec<u8>,
    failures: u32,
    /// When the process at hand was told.
    since: Option<Instant>,
    /// A disk that refuses the trial has it handed in again: the program need not be asked again.
    answer: Option<Answer>,
}

impl Program {
    /// The program of `judge` for the session in `folder`; it is not started yet.
    pub fn new(judge: &JudgeConfig, folder: &SessionFolder) -> Result<Program> {
        let records = absolute(&folder.records());
        let name = records.to_str().map(str::to_string);
        let name = name.with_context(|| {
            format!(
                "{}: a judge's program needs a session folder whose name is text",
                records.display()
            )
        })?;
        let words = judge.program.clone();
        let place = command::folder(judge);
        let settings = Settings {
            timeout: Duration::from_secs_f64(judge.timeout_s),
            own: judge.measures.clone(),
            identity: command::identity(&words, &place),
            log: absolute(&folder.log("judge")),
            records,
            records_name: name,
            declared: judge.declared(),
            words,
            folder: place,
        };
        Ok(Program { settings, state: RefCell::default() })
    }
}

impl Assessor for Program {
    fn declared(&self) -> Declared {
        self.settings.declared.clone()
    }

    fn identity(&self) -> Option<String> {
        Some(self.settings.identity.clone())
    }

    fn assess(
        &self,
        header: &EpisodeHeader,
        records: &[TickRecord],
        measures: &Measures,
    ) -> Result<Vec<f64>, AssessError> {
        let mut state = self.state.borrow_mut();
        let State { process, asked } = &mut *state;
        if asked.as_ref().is_none_or(|asked| asked.header != *header) {
            *asked = Some(self.settings.asked(header, records, measures)?);
        }
        let Some(asked) = asked else { return Err(AssessError::NotYet) };
        if asked.answer.is_none() {
            match self.settings.attempt(process, asked) {
                Ok(answer) => asked.answer = Some(answer.ok_or(AssessError::NotYet)?),
                Err(words) => return Err(self.settings.failed(process, asked, &words)),
            }
        }
        match &asked.answer {
            Some(Answer::Judged(values)) => Ok(values.clone()),
            Some(Answer::Declined(words)) => Err(AssessError::Declined(words.clone())),
            None => Err(AssessError::NotYet),
        }
    }
}

impl Settings {
    /// Writes what is to be judged.
    fn asked(
        &self,
        header: &EpisodeHeader,
        records: &[TickRecord],
        measures: &Measures,
    ) -> Result<Asked, AssessError> {
        npy::write(&self.records, records).map_err(|error| AssessError::NotWritten {
            path: self.records.clone(),
            detail: error.to_string(),
        })?;
        let request = request(header.rollout, measures, &self.records_name);
        Ok(Asked { header: *header, request, failures: 0, since: None, answer: None })
    }

    /// Sends the request, or keeps waiting briefly. The error is the program's mistake.
    fn attempt(
        &self,
        process: &mut Option<Process>,
        asked: &mut Asked,
    ) -> Result<Option<Answer>, String> {
        if asked.since.is_none() {
            // A program may end after an answer: that is no failure.
            let is_ready = process.as_mut().map_or(Ok(false), Process::is_ready)?;
            if !is_ready {
                *process = Some(self.start()?);
            }
        }
        let Some(process) = process else { return Err("it is not there".into()) };
        let since = *asked.since.get_or_insert_with(|| {
            process.tell(&asked.request);
            Instant::now()
        });
        let line = process.hear(STEP.min(self.timeout.saturating_sub(since.elapsed())))?;
        match line {
            Some(line) => parse(&line, asked.header.rollout, &self.own).map(Some),
            None if since.elapsed() >= self.timeout => Err(format!(
                "it did not reply within {} s: end every reply with a newline, flush it, and raise \
                 task.judge.timeout_s if it needs longer",
                self.timeout.as_secs_f64()
            )),
            None => Ok(None),
        }
    }

    fn start(&self) -> Result<Process, String> {
        let now = command::identity(&self.words, &self.folder);
        if now != self.identity {
            return Err(format!(
                "it was changed during the session: resume the session to use {now}"
            ));
        }
        Process::start(&self.words, &self.folder, &self.log)
            .map_err(|error| format!("it cannot be started in {}: {error}", self.folder.display()))
    }

    /// Ends the program, which is restarted when the rollout is submitted again; or abandons it.
    fn failed(&self, process: &mut Option<Process>, asked: &mut Asked, words: &str) -> AssessError {
        let last_words = process.as_mut().and_then(Process::last_words);
        let last_words =
            last_words.map_or(String::new(), |line| format!("; its last output was `{line}`"));
        *process = None;
        asked.since = None;
        asked.failures += 1;
        let (rollout, command) = (asked.header.rollout, self.words.join(" "));
        if asked.failures < ATTEMPTS {
            tracing::warn!(
                "rollout {rollout}: the judge `{command}` failed: {words}{last_words}; restarted, request \
                 repeated"
            );
            return AssessError::NotYet;
        }
        // A caller that goes on all the same begins anew.
        asked.failures = 0;
        AssessError::Broken(format!(
            "the judge `{command}` failed {ATTEMPTS} times on rollout {rollout}: {words}\
             {last_words}. Its log is {}. All earlier rollouts are saved: fix the program and \
             resume; rollout {rollout} is then judged again",
            self.log.display()
        ))
    }
}

impl Drop for Program {
    fn drop(&mut self) {
        if let Some(process) = &mut self.state.get_mut().process {
            process.dismiss(TO_END);
        }
    }
}
