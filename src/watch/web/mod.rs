//! A watched cell in a browser: one page on loopback with the arm, curves and buttons.

mod assets;
mod board;
mod http;
mod scene;
mod server;
mod state;
mod timing;

use std::net::SocketAddr;
use std::sync::Arc;
use std::time::{Duration, Instant};

use anyhow::{Result, bail};
use serde_json::{Value, json};
use shm_types::telemetry::TelemetryTick;

use super::Model;
use crate::cell::NamedCell;
use crate::record;
use crate::record::scribe::Scribe;
use crate::record::watcher::{Seen, Watcher, pause};
use crate::stderr::say;
use board::Kind;
use server::Page;
use timing::Timing;

/// A pose, at most so often.
const POSE: Duration = Duration::from_millis(33);
const STATE: Duration = Duration::from_millis(250);
/// The catalogue on disk is read so often.
const CATALOGUE: Duration = Duration::from_secs(1);
const CURVES: Duration = Duration::from_secs(1);

/// What is posted, and when it last was.
struct Poster<'a> {
    named: &'a NamedCell,
    page: Arc<Page>,
    model: Model,
    scribe: Scribe,
    timing: Timing,
    newest: Option<TelemetryTick>,
    catalogue: Value,
    posed: Instant,
    stated: Instant,
    listed: Option<Instant>,
    curved: Instant,
}

pub fn run(
    named: &NamedCell,
    address: SocketAddr,
    allows_commands: bool,
    mut watcher: Watcher,
    is_over: &dyn Fn() -> bool,
) -> Result<()> {
    if !address.ip().is_loopback() {
        bail!(
            "--web {address}: only loopback addresses are served; for another machine use a tunnel, such as \
             `ssh -L {port}:127.0.0.1:{port} HOST`",
            port = address.port()
        );
    }
    let scribe = record::scribe(named.config())?;
    let first = json!({
        "kind": "first",
        "cell": named.cell.name(),
        "version": env!("CARGO_PKG_VERSION"),
        "allows_commands": allows_commands,
        "scene": scene::still(&scribe),
    });
    let page = Arc::new(Page::new(&named.cell, format!("{first}\n"), allows_commands)?);
    // Nothing behind the address: a terminal would take it for a part of it.
    say(&format!("Ctrl-C ends it; open {}", page.serve(address)?));
    let now = Instant::now();
    let mut poster = Poster {
        named,
        page,
        model: Model::new(&named.cell),
        scribe,
        timing: Timing::new(),
        newest: None,
        catalogue: Value::Null,
        posed: now,
        stated: now,
        listed: None,
        curved: now,
    };
    while !is_over() {
        let round = Instant::now();
        poster.look(&mut watcher)?;
        poster.post(watcher.lost);
        pause(round);
    }
    Ok(())
}

impl Poster<'_> {
    fn look(&mut self, watcher: &mut Watcher) -> Result<()> {
        let (scribe, timing, newest) = (&mut self.scribe, &mut self.timing, &mut self.newest);
        let mut also = |seen: &Seen| match seen {
            Seen::Tick(tick, _) => {
                timing.take(tick);
                *newest = Some(**tick);
            }
            Seen::Policy(policy) => scribe.policy(policy),
            _ => {}
        };
        for change in self.model.look_and(watcher, &mut also)? {
            say(&change);
        }
        self.timing.look();
        Ok(())
    }

    fn post(&mut self, lost: u64) {
        let is_due = |last: &mut Instant, every: Duration| {
            let due = last.elapsed() >= every;
            if due {
                *last = Instant::now();
            }
            due
        };
        let post = |kind, value: Value| self.page.board.post(kind, format!("{value}\n"));
        if is_due(&mut self.posed, POSE)
            && let Some(tick) = self.newest.take()
        {
            let scene = scene::moving(&self.scribe, &tick);
            post(Kind::Pose, json!({ "kind": "pose", "scene": scene }));
        }
        if self.listed.is_none_or(|listed| listed.elapsed() >= CATALOGUE) {
            self.listed = Some(Instant::now());
            self.catalogue = state::catalogue(&self.named.state_dir());
        }
        if is_due(&mut self.stated, STATE) {
            post(Kind::State, state::state(&self.model, lost, &self.catalogue));
        }
        if is_due(&mut self.curved, CURVES) {
            post(Kind::Curves, state::curves(&self.model.session, &self.timing));
        }
    }
}
