//! `skillet watch`: a running cell in the terminal, in a browser, as JSON, or for 3-D viewers.

use std::io::IsTerminal;
use std::sync::atomic::Ordering;
use std::time::Instant;

use anyhow::{Result, bail};

use crate::cell::NamedCell;
use crate::cli::record::WatchArgs;
use crate::output::is_closed;
use crate::signals::{Who, stop_flag};
use crate::watch::{self, Model, lines, serve, terminal, web};
use crate::{Verdict, tty};

pub fn run(args: &WatchArgs) -> Result<Verdict> {
    let named = NamedCell::of(&args.cell)?;
    let watcher = watch::open(&named)?;
    let (stop, start) = (stop_flag(Who::Tool)?, Instant::now());
    let is_over = || {
        let elapsed = start.elapsed().as_secs_f64();
        stop.load(Ordering::Relaxed)
            || is_closed()
            || args.duration_s.is_some_and(|limit| elapsed >= limit)
    };
    let model = || Model::new(&named.cell);
    if let Some(address) = args.serve {
        serve::run(&named, address, watcher, &is_over)?;
    } else if let Some(address) = args.web {
        web::run(&named, address, args.allow_commands, watcher, &is_over)?;
    } else if args.json {
        lines::run(model(), watcher, lines::json, &is_over)?;
    } else if tty::can_draw(&std::io::stdout()) {
        terminal::run(&named, model(), watcher, &is_over)?;
    } else if std::io::stdout().is_terminal() {
        lines::run(model(), watcher, lines::text, &is_over)?;
    } else {
        bail!("not a terminal: use --json for scripts, or `skillet status` for a snapshot");
    }
    Ok(Verdict::Done)
}
