//! A watched cell for 3-D viewers: Foxglove's protocol over WebSocket, at most 50 times a second.

use std::net::SocketAddr;
use std::time::{Duration, Instant};

use anyhow::{Context, Result, bail};
use foxglove::WebSocketServerHandle;
use foxglove::websocket::Status;

use super::vitals::Vitals;
use crate::cell::NamedCell;
use crate::health::Health;
use crate::record;
use crate::record::messages::{Measures, Mixture, Trial};
use crate::record::scribe::Detail;
use crate::record::watcher::{Seen, Watcher};
use crate::stderr::say;

/// 50 Hz, whatever the pace of the loop.
const FRAME: Duration = Duration::from_millis(20);
/// Bodies again, for viewers that came later.
const BODIES: Duration = Duration::from_secs(1);
/// Names the problem that a viewer shows, so that it can be taken away again.
const PROBLEM: &str = "skillet-health";

pub fn run(
    named: &NamedCell,
    address: SocketAddr,
    mut watcher: Watcher,
    is_over: &dyn Fn() -> bool,
) -> Result<()> {
    if !address.ip().is_loopback() {
        bail!(
            "--serve {address}: only loopback addresses are served; for another machine use a tunnel, \
             such as `ssh -L 8765:127.0.0.1:8765 HOST`"
        );
    }
    let mut scribe = record::scribe(named.config())?;
    let server = scribe
        .context()
        .websocket_server()
        .name(format!("skillet {}", named.cell.name()))
        .bind(address.ip().to_string(), address.port())
        .start_blocking()
        .with_context(|| format!("--serve {address}: cannot listen there; try another port"))?;
    let port = server.port();
    say(&format!("serving ws://{}:{port}; Ctrl-C ends it", address.ip()));

    let mut newest = None;
    let mut drawn = Instant::now() - BODIES;
    let (mut vitals, mut said) = (Vitals::of(&named.cell), Instant::now());
    while !is_over() {
        let frame = Instant::now();
        while let Some(seen) = watcher.next()? {
            match seen {
                Seen::Tick(tick, at_ns) => {
                    vitals.ticked();
                    newest = Some((tick, at_ns));
                }
                Seen::Policy(policy) => scribe.policy(&policy),
                Seen::Outcome(header) => scribe.outcome(&header),
                Seen::Trial(news) => {
                    scribe.trial(&Trial::from(&*news));
                    if let Some(mixture) = Mixture::of_news(&news) {
                        scribe.mixture(&mixture);
                    }
                }
                Seen::Measures(news) => scribe.measures(&Measures::from(&*news)),
                Seen::Bridged(bridged) => {
                    say(&bridged.sentence());
                    scribe.warn(bridged.sentence());
                }
                // Told below, with those that stand still; ticks are left out on purpose.
                Seen::ControllerGone | Seen::ControllerBack | Seen::Lost(_) => {}
            }
        }
        vitals.look();
        for change in vitals.changes() {
            say(&change);
            scribe.warn(change);
        }
        // Viewers that come later are told, too: it is a state, not an event.
        if said.elapsed() >= BODIES {
            said = Instant::now();
            tell(&server, &vitals);
        }
        if let Some((tick, at_ns)) = newest.take() {
            let everything = Detail { object: true, frames: true, springs: true };
            scribe.tick(&tick, at_ns, everything);
        }
        if drawn.elapsed() >= BODIES {
            drawn = Instant::now();
            scribe.bodies();
        }
        std::thread::sleep(FRAME.saturating_sub(frame.elapsed()));
    }
    server.stop().detach_all();
    Ok(())
}

/// Shows in the viewer's list of problems what is not well, and takes away what is again.
fn tell(server: &WebSocketServerHandle, vitals: &Vitals) {
    match vitals.health() {
        Some((health, findings)) if health != Health::Ok => {
            let text = format!("{}: {}", health.name(), findings.join("; "));
            server.publish_status(Status::warning(text).with_id(PROBLEM));
        }
        _ => server.remove_status(vec![PROBLEM.into()]),
    }
}
