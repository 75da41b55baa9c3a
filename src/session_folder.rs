//! A session folder: `session.toml`, `session.db`, logs and `report/`; complete in itself.

use std::fs::{self, File};
use std::path::{Path, PathBuf};
use std::time::Duration;

use anyhow::{Context, Result, bail};
use rustix::fs::{FlockOperation, flock};

use crate::config::{Config, JudgeConfig, PlantConfig, SESSION_FILE as CONFIG, TaskConfig};
use crate::setup;

const DATABASE: &str = "session.db";
const DEMONSTRATION: &str = "demonstration.csv";
const ARM: &str = "arm.urdf";
const TIMING: &str = "timing.json";
const PROVENANCE: &str = "provenance.json";
const RECORDS: &str = "rollout.npy";
const LOCK: &str = "session.lock";
/// A check whether the session is in use holds its lock for an instant, so a learner retries.
const TRIES: usize = 20;
const PAUSE: Duration = Duration::from_millis(5);

#[derive(Clone, Debug)]
pub struct SessionFolder {
    dir: PathBuf,
}

impl SessionFolder {
    /// The folder at `dir`, whether it exists or not.
    pub fn at(dir: &Path) -> SessionFolder {
        SessionFolder { dir: dir.to_path_buf() }
    }

    /// The first free `sessions/<task>-<n>`.
    pub fn next_free(task: &str) -> SessionFolder {
        let mut n = 1;
        loop {
            let dir = PathBuf::from(format!("sessions/{task}-{n}"));
            if !dir.exists() {
                return SessionFolder { dir };
            }
            n += 1;
        }
    }

    /// An existing session. The error says what is missing.
    pub fn open(dir: &Path) -> Result<SessionFolder> {
        let folder = SessionFolder::at(dir);
        match fs::metadata(folder.config_path()) {
            Err(error) if error.kind() == std::io::ErrorKind::PermissionDenied => {
                return Err(error).with_context(|| folder.cannot("look into it"));
            }
            _ => {}
        }
        if !folder.has_session() {
            bail!(
                "{}: no session here ({CONFIG} and {DATABASE} are missing); give the folder that \
                 `skillet learn` wrote",
                dir.display()
            );
        }
        Ok(folder)
    }

    /// A session has been started here.
    pub fn has_session(&self) -> bool {
        self.config_path().is_file()
    }

    pub fn dir(&self) -> &Path {
        &self.dir
    }

    pub fn name(&self) -> String {
        let name = self.dir.file_name().map(|name| name.to_string_lossy().into_owned());
        name.unwrap_or_else(|| self.dir.display().to_string())
    }

    pub fn config_path(&self) -> PathBuf {
        self.dir.join(CONFIG)
    }

    pub fn database(&self) -> PathBuf {
        self.dir.join(DATABASE)
    }

    pub fn log(&self, process: &str) -> PathBuf {
        self.dir.join(format!("{process}.log"))
    }

    /// How the loop of controller `k`, from 0, kept its time.
    pub fn timing(&self, k: usize) -> PathBuf {
        match k {
            0 => self.dir.join(TIMING),
            _ => self.dir.join(format!("timing-{}.json", k + 1)),
        }
    }

    /// With what, where, when and by which command it was learnt.
    pub fn provenance(&self) -> PathBuf {
        self.dir.join(PROVENANCE)
    }

    /// The records of the rollout that a judge's program was asked about last.
    pub fn records(&self) -> PathBuf {
        self.dir.join(RECORDS)
    }

    pub fn report_dir(&self) -> PathBuf {
        self.dir.join("report")
    }

    /// Writes configuration, demonstration and arm, so that the session needs no other file.
    pub fn write(&self, config: &Config) -> Result<()> {
        fs::create_dir_all(&self.dir).with_context(|| self.cannot("create the session folder"))?;
        let mut own = config.clone();
        if config.has_arm() {
            self.put(DEMONSTRATION, &demonstration_text(config)?)?;
            self.put(ARM, &setup::arm_text(config)?)?;
            own.task.demonstration = Some(DEMONSTRATION.into());
            for (i, path) in own.task.other_demonstrations.iter_mut().enumerate() {
                let name = format!("demonstration-{}.csv", i + 2);
                self.put(&name, &setup::text_of(Some(path), "")?)?;
                *path = name.into();
            }
            own.plant.arm = Some(ARM.into());
        }
        self.put(CONFIG, &own.to_toml()?)
    }

    /// By a rename: a full disk must not leave half a file behind. What is there already is left
    /// alone.
    fn put(&self, name: &str, text: &str) -> Result<()> {
        let path = self.dir.join(name);
        if fs::read_to_string(&path).is_ok_and(|there| there == text) {
            return Ok(());
        }
        let draft = self.dir.join(format!(".{name}.new"));
        fs::write(&draft, text)
            .and_then(|()| fs::rename(&draft, &path))
            .with_context(|| self.cannot("write"))
    }

    /// That the session stored here was made in the world that `config` describes: everything is
    /// equal but the number of rollouts, the cell's name, the log and the program of a judge.
    pub fn expect_same_world(&self, config: &Config) -> Result<()> {
        let stored = Config::load(Some(&self.config_path()))
            .context("written by another version, or edited: use that version or another --out")?;
        let (ours, theirs) = (texts(config)?, texts(&stored)?);
        let differing = ours.iter().zip(&theirs).find(|(ours, theirs)| ours.1 != theirs.1);
        let changed = differing.map(|(ours, _)| ours.0);
        let changed = changed.or_else(|| {
            [
                ("[task]", settled_task(config) != settled_task(&stored)),
                ("[controller]", config.controller != stored.controller),
                ("[plant]", without_arm(config) != without_arm(&stored)),
            ]
            .into_iter()
            .find_map(|(table, differs)| differs.then_some(table))
        });
        match changed {
            None => Ok(()),
            Some(what) => bail!(
                "{}: {what} differs from the session's: resume without --config, or start \
                 another session with --out",
                self.dir.display()
            ),
        }
    }

    /// Locks the session for its only learner.
    pub fn lock(&self) -> Result<File> {
        let path = self.dir.join(LOCK);
        let file = File::create(&path).with_context(|| self.cannot("write"))?;
        for _ in 0..TRIES {
            if flock(&file, FlockOperation::NonBlockingLockExclusive).is_ok() {
                return Ok(file);
            }
            std::thread::sleep(PAUSE);
        }
        bail!("{}: this session is in use: wait for it, or stop it", self.dir.display());
    }

    /// Whether a learner is using the session.
    pub fn is_in_use(&self) -> bool {
        // Shared: those who look do not see each other.
        File::open(self.dir.join(LOCK))
            .is_ok_and(|file| flock(&file, FlockOperation::NonBlockingLockShared).is_err())
    }

    fn cannot(&self, what: &str) -> String {
        format!(
            "{}: cannot {what}; check permissions and free space, or choose another folder with \
             --out",
            self.dir.display()
        )
    }
}

/// The files of a session with an arm, by the settings that name them.
fn texts(config: &Config) -> Result<Vec<(&'static str, String)>> {
    if !config.has_arm() {
        return Ok(Vec::new());
    }
    Ok(vec![
        ("task.demonstration", demonstration_text(config)?),
        ("task.other_demonstrations", other_texts(config)?),
        ("plant.arm", setup::arm_text(config)?),
    ])
}

fn demonstration_text(config: &Config) -> Result<String> {
    let built_in = config.task()?.arm()?.demonstration;
    setup::text_of(config.task.demonstration.as_deref(), built_in)
}

fn other_texts(config: &Config) -> Result<String> {
    config.task.other_demonstrations.iter().map(|path| setup::text_of(Some(path), "")).collect()
}

/// Demonstrations are compared as texts; a judge's program may be repaired and move.
fn settled_task(config: &Config) -> TaskConfig {
    let other_demonstrations = Vec::new();
    let judge = config.task.judge.as_ref().map(JudgeConfig::without_place);
    TaskConfig { demonstration: None, other_demonstrations, judge, ..config.task.clone() }
}

fn without_arm(config: &Config) -> PlantConfig {
    PlantConfig { arm: None, ..config.plant.clone() }
}
