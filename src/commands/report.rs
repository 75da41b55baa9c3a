//! `skillet report`: figures and one HTML page of a session, or of several.

mod films;
mod gather;
mod robustness;

use std::fs;
use std::path::{Path, PathBuf};

use anyhow::{Context, Result, bail};
use serde_json::json;

use crate::Verdict;
use crate::cli::ReportArgs;
use crate::draw::figure::Figure;
use crate::output::{print, print_json};
use crate::report;
use crate::session_folder::SessionFolder;
use gather::Effort;

/// Where the page of several sessions goes.
const OF_SEVERAL: &str = "report";

pub fn run(args: &ReportArgs) -> Result<Verdict> {
    let folders = args.sessions.iter().map(|dir| SessionFolder::open(dir));
    let page = match &folders.collect::<Result<Vec<SessionFolder>>>()?[..] {
        [folder] => {
            let dir = args.out.clone().unwrap_or_else(|| folder.report_dir());
            write_to(&dir, folder, &[], Effort::Whole)?
        }
        folders => {
            let dir = args.out.clone().unwrap_or_else(|| OF_SEVERAL.into());
            if SessionFolder::at(&dir).has_session() {
                bail!("{}: this is a session; choose another folder with --out", dir.display());
            }
            let sessions = gather::sessions(folders, &dir)?;
            let figures = report::figures_of_several(&sessions);
            write_page(&dir, &figures, &report::render_several(&sessions, &figures))?
        }
    };
    if args.json {
        print_json(&json!({ "report": page }))?;
    } else {
        print(&format!("{}\n", page.display()))?;
    }
    Ok(Verdict::Done)
}

/// Writes `report/index.html` of a session and the files beside it; returns the page.
pub fn write(folder: &SessionFolder, notes: &[(String, String)]) -> Result<PathBuf> {
    write_to(&folder.report_dir(), folder, notes, Effort::Quick)
}

fn write_to(
    dir: &Path,
    folder: &SessionFolder,
    notes: &[(String, String)],
    effort: Effort,
) -> Result<PathBuf> {
    fs::create_dir_all(dir)
        .with_context(|| format!("{}: cannot create the report folder", dir.display()))?;
    let data = gather::session(folder, notes, effort, dir)?;
    let figures = report::figures(&data);
    write_page(dir, &figures, &report::render(&data, &figures))
}

/// The page and its figures; a figure of an earlier report is removed where there is none now.
fn write_page(dir: &Path, figures: &[Figure], page: &str) -> Result<PathBuf> {
    fs::create_dir_all(dir)
        .with_context(|| format!("{}: cannot create the report folder", dir.display()))?;
    for figure in figures {
        let path = dir.join(format!("{}.svg", figure.stem));
        match figure.svg() {
            Some(svg) => write_file(&path, &svg)?,
            None => drop(fs::remove_file(&path)),
        }
    }
    let path = dir.join("index.html");
    write_file(&path, page)?;
    Ok(path)
}

fn write_file(path: &Path, text: &str) -> Result<()> {
    fs::write(path, text).with_context(|| format!("{}: cannot write the report", path.display()))
}
