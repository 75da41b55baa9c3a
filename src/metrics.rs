//! The controller's Prometheus endpoint: the numbers of `skillet status` and how the learning goes, as
//! text, on loopback.
//!
//! It asks the controller like any other tool, and listens to the learner like any observer, from a
//! thread of its own: a scraper, however frequent, is one more client of the cell and nothing to
//! the loop.

mod learning;

use std::net::SocketAddr;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;

use anyhow::{Result, anyhow};
use learning::Learning;
use prometheus_client::encoding::text::encode;
use prometheus_client::metrics::counter::ConstCounter;
use prometheus_client::metrics::gauge::ConstGauge;
use prometheus_client::registry::{Registry, Unit};
use shm_types::cell::Cell;
use shm_types::command::Status;
use shm_types::measures::Measures;
use shm_types::ports::ToolPorts;
use tiny_http::{Header, Method, Response, Server};

use crate::config::MetricsConfig;
use crate::health;

/// A scraper waits a few seconds at most.
const PATIENCE: Duration = Duration::from_secs(2);
/// How soon the end of the process ends the endpoint.
const POLL: Duration = Duration::from_millis(200);
const TEXT: &str = "Content-Type: application/openmetrics-text; version=1.0.0; charset=utf-8";

/// A thread that answers until it is dropped.
pub struct Endpoint {
    over: Arc<AtomicBool>,
    thread: Option<std::thread::JoinHandle<()>>,
}

impl Endpoint {
    pub fn start(address: SocketAddr, cell: &Cell) -> Result<Endpoint> {
        MetricsConfig::check(address)?;
        let server = Server::http(address)
            .map_err(|error| anyhow!("metrics.listen {address}: {error}; choose another port"))?;
        let bound = server.server_addr();
        tracing::info!("metrics at http://{bound}/metrics");
        let over = Arc::new(AtomicBool::new(false));
        let (cell, ends) = (cell.clone(), over.clone());
        let answer = move || {
            let mut learning = Learning::of(&cell);
            while !ends.load(Ordering::Relaxed) {
                learning.listen();
                if let Ok(Some(request)) = server.recv_timeout(POLL) {
                    answer(request, &cell, &learning);
                }
            }
        };
        let thread = std::thread::Builder::new().name("skillet-metrics".into()).spawn(answer)?;
        Ok(Endpoint { over, thread: Some(thread) })
    }
}

impl Drop for Endpoint {
    fn drop(&mut self) {
        self.over.store(true, Ordering::Relaxed);
        if let Some(thread) = self.thread.take() {
            let _ = thread.join();
        }
    }
}

fn answer(request: tiny_http::Request, cell: &Cell, learning: &Learning) {
    let response = match (request.method(), request.url()) {
        (Method::Get, "/metrics") => match status(cell) {
            Some(status) => text(registry(&status, learning, cell.name())),
            None => plain("the controller does not answer\n", 503),
        },
        (Method::Get, _) => plain("see /metrics\n", 404),
        _ => plain("only GET\n", 405),
    };
    // A scraper that has gone comes again.
    let _ = request.respond(response);
}

fn status(cell: &Cell) -> Option<Status> {
    ToolPorts::open(cell, PATIENCE).ok()?.status(PATIENCE)
}

fn plain(text: &str, code: u16) -> Response<std::io::Cursor<Vec<u8>>> {
    Response::from_string(text).with_status_code(code)
}

fn text(registry: Registry) -> Response<std::io::Cursor<Vec<u8>>> {
    let mut text = String::new();
    if encode(&mut text, &registry).is_err() {
        return plain("the metrics cannot be written\n", 500);
    }
    let response = Response::from_string(text);
    match TEXT.parse::<Header>() {
        Ok(header) => response.with_header(header),
        Err(()) => response,
    }
}

/// Every number with its name, for one answer.
fn registry(status: &Status, learning: &Learning, cell: &str) -> Registry {
    let label = ("cell".into(), cell.to_string().into());
    let mut registry = Registry::with_prefix_and_labels("skillet", [label].into_iter());
    for (name, help, count) in counters(status) {
        registry.register(name, help, ConstCounter::<u64>::new(count));
    }
    for (name, help, value) in gauges(status).into_iter().chain(learning.gauges()) {
        registry.register(name, help, ConstGauge::<f64>::new(value));
    }
    for measure in learning.measures().map(Measures::iter).into_iter().flatten() {
        let help = format!("Measured of the last trial, in {}", measure.unit);
        let name = format!("measure_{}", measure.name);
        registry.register(name, help, ConstGauge::<f64>::new(measure.value));
    }
    for (name, help, ns) in durations(status) {
        registry.register_with_unit(name, help, Unit::Seconds, ConstGauge::new(ns as f64 * 1e-9));
    }
    for (name, help, age) in learning.ages() {
        registry.register_with_unit(name, help, Unit::Seconds, ConstGauge::new(age.as_secs_f64()));
    }
    registry
}

fn counters(status: &Status) -> [(&'static str, &'static str, u64); 11] {
    [
        ("ticks", "Ticks of the loop", status.tick),
        ("deadline_misses", "Deadlines missed by a period or more", status.deadline_misses),
        ("rollouts", "Rollouts requested by a learner", status.rollouts_done),
        ("rollouts_served", "Rollouts of a served policy", status.rollouts_served),
        ("swaps", "Commanded swaps applied", status.swaps_applied),
        ("swaps_torn", "Swaps that were read back damaged", status.swaps_torn),
        ("policies_refused", "Policies refused by admission", status.policies_refused),
        ("commands_refused", "Commands refused", status.commands_refused),
        ("rollbacks", "Rollbacks to an earlier policy", status.rollbacks),
        ("stalls", "Stalls of the loop", status.stalls),
        ("state_errors", "Writes to the cell's state that failed", status.state_errors),
    ]
}

fn gauges(status: &Status) -> [(&'static str, &'static str, f64); 10] {
    let health = f64::from(health::level(status) as u8);
    [
        ("health", "0 ok, 1 degraded, 2 bad", health),
        (
            "latched_fault",
            "Fault that holds the arm until re-armed, 0: none",
            status.latched_fault as f64,
        ),
        ("phase", "0 idle, 1 approach, 2 execute, 3 settle", status.phase as f64),
        ("fault", "Fault of the last tick, 0: none", status.fault as f64),
        ("pinned", "1 while a pinned policy is served", status.pinned as f64),
        ("realtime_priority", "1 when the loop has real-time priority", status.privileged as f64),
        ("spooled_episodes", "Episodes on disk that no learner holds", status.spooled as f64),
        ("spool_full", "1 while learning pauses for a full spool", status.spool_full as f64),
        ("unacknowledged_episodes", "Episodes sent, not durable", status.unacknowledged as f64),
        ("policies", "Policies in the catalogue", status.imported as f64),
    ]
}

/// ns; the silence of a learner is left out when there is none.
fn durations(status: &Status) -> Vec<(&'static str, &'static str, u64)> {
    let mut durations = vec![
        ("period", "Length of a tick", status.period_ns),
        ("wakeup_p50", "Wake-up after the deadline, median", status.wakeup_p50_ns),
        ("wakeup_p99", "Wake-up after the deadline, 99th percentile", status.wakeup_p99_ns),
        ("wakeup_max", "Wake-up after the deadline, worst", status.wakeup_max_ns),
        ("tick_p50", "Time in a tick, median", status.tick_p50_ns),
        ("tick_p99", "Time in a tick, 99th percentile", status.tick_p99_ns),
        ("tick_max", "Time in a tick, worst", status.tick_max_ns),
        ("stall_longest", "Longest stall of the loop", status.stall_longest_ns),
    ];
    if status.learner_age_ns != u64::MAX {
        durations.push((
            "learner_silence",
            "Time since the last learner heartbeat",
            status.learner_age_ns,
        ));
    }
    if status.stall_age_ns != u64::MAX {
        durations.push(("stall_age", "Time since the last stall of the loop", status.stall_age_ns));
    }
    durations
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_text_is_what_prometheus_reads() {
        let status = Status { tick: 7, wakeup_p99_ns: 30_000, ..Status::ZERO };
        let nobody = Learning::of(&Cell::new("kitchen").unwrap());
        let mut text = String::new();
        encode(&mut text, &registry(&status, &nobody, "kitchen")).unwrap();
        for line in [
            "# TYPE skillet_ticks counter",
            "skillet_ticks_total{cell=\"kitchen\"} 7",
            "# UNIT skillet_wakeup_p99_seconds seconds",
            "skillet_wakeup_p99_seconds{cell=\"kitchen\"} 0.00003",
        ] {
            assert!(text.lines().any(|found| found == line), "no `{line}` in:\n{text}");
        }
        assert!(text.ends_with("# EOF\n"));
        assert!(!text.contains("learner_silence") && !text.contains("reward"), "never heard");
    }
}
