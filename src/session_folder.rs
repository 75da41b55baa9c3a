//! A session folder: `session.toml`, `session.db`, logs and `report/`; complete in itself.

use std::fs;
use std::path::{Path, PathBuf};

use anyhow::{Context, Result, bail};

use crate::config::Config;
use crate::setup;

const CONFIG: &str = "session.toml";
const DATABASE: &str = "session.db";
const DEMONSTRATION: &str = "demonstration.csv";
const ARM: &str = "arm.urdf";

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
        let free = (1..).map(|n| PathBuf::from(format!("sessions/{task}-{n}")));
        let dir = free.into_iter().find(|dir| !dir.exists());
        SessionFolder { dir: dir.unwrap_or_else(|| PathBuf::from("sessions")) }
    }

    /// An existing session. The error says what is missing.
    pub fn open(dir: &Path) -> Result<SessionFolder> {
        let folder = SessionFolder::at(dir);
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

    pub fn report_dir(&self) -> PathBuf {
        self.dir.join("report")
    }

    /// Writes configuration, demonstration and arm, so that the session needs no other file.
    pub fn write(&self, config: &Config) -> Result<()> {
        fs::create_dir_all(&self.dir).with_context(|| self.cannot("create the session folder"))?;
        let copy = |given: &Option<PathBuf>, built_in: &str, to: &str| -> Result<()> {
            let text = match given {
                Some(path) => fs::read_to_string(path)
                    .with_context(|| format!("{}: cannot read", path.display()))?,
                None => built_in.to_string(),
            };
            fs::write(self.dir.join(to), text).with_context(|| self.cannot("write"))
        };
        // A resumed session reads the copies it is about to write: read before writing.
        copy(&config.task.demonstration, setup::PANCAKE_DEMONSTRATION, DEMONSTRATION)?;
        copy(&config.plant.arm, setup::WAM7_URDF, ARM)?;
        let mut own = config.clone();
        own.task.demonstration = Some(DEMONSTRATION.into());
        own.plant.arm = Some(ARM.into());
        // By a rename: a full disk must not leave half a configuration behind.
        let draft = self.dir.join(".session.toml.new");
        fs::write(&draft, own.to_toml()?).with_context(|| self.cannot("write"))?;
        fs::rename(&draft, self.config_path()).with_context(|| self.cannot("write"))
    }

    fn cannot(&self, what: &str) -> String {
        format!(
            "{}: cannot {what}; check permissions and free space, or choose another folder with \
             --out",
            self.dir.display()
        )
    }
}
