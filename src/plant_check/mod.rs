//! `skillet plant check`: is a plant in another process what a controller needs? A verdict a line.
//!
//! It plays the controller: nothing else must serve the cell. A simulator is pushed to its limits; a real
//! arm is held softly where it is, and nothing else.

mod line;
mod real;
mod simulated;

use std::path::Path;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

use anyhow::{Context, Result, bail};
use physics::arm::{ArmModel, JointVector, dynamics};
use rt_controller::remote::expected::Expected;
use serde::Serialize;
use shm_types::cell::{Cell, Role};
use shm_types::plant::line::Line as PlantLine;
use shm_types::plant::shared::Host;
use shm_types::plant::socket::{Buffer, Connection, Listener, Message};
use shm_types::plant::{PlantHello, PlantState, PlantWelcome};

use crate::Verdict;
use crate::children::Service;
use crate::cli::plant::CheckArgs;
use crate::config::Config;
use crate::external;
use crate::output::{print, print_json};
use crate::signals::{Who, stop_flag};
use crate::stderr::say;
use crate::tasks::ArmWorld;
use line::Line;

/// Gains of the hold, s⁻² and s⁻¹: as stiff as an arm is under what its model does not know of.
const STIFFNESS: f64 = 400.0;
const DAMPING: f64 = 40.0;
/// How long the plant may take to come, and to come again.
const TO_COME: Duration = Duration::from_secs(60);
/// What a plant may take to end, or to look for a controller again, once this one is gone.
const TO_NOTICE: Duration = Duration::from_secs(10);

/// What was found.
#[derive(Debug, Serialize)]
struct Finding {
    check: &'static str,
    /// `None`: it does not apply.
    passed: Option<bool>,
    detail: String,
}

/// What the plant is compared with.
struct Bench<'a> {
    model: &'a ArmModel,
    q0: JointVector,
    period_ns: u64,
    samples: u64,
    findings: Vec<Finding>,
}

impl Bench<'_> {
    /// Holds the arm at `q_d` as the loop does in Idle, M q̈_d + C q̇ + g, within the limits, N·m.
    fn hold(&self, q_d: &JointVector, state: &PlantState) -> JointVector {
        let (q, qd) = (line::q(state), line::qd(state));
        let qdd_d = (q_d - q) * STIFFNESS - qd * DAMPING;
        let tau =
            dynamics::mass_matrix(self.model, &q) * qdd_d + dynamics::bias(self.model, &q, &qd);
        tau.zip_map(&self.model.limits().tau_max, |tau, limit| tau.clamp(-limit, limit))
    }

    fn note(&mut self, check: &'static str, passed: bool, detail: impl Into<String>) {
        self.add(Finding { check, passed: Some(passed), detail: detail.into() });
    }

    fn skip(&mut self, check: &'static str, why: &str) {
        self.add(Finding { check, passed: None, detail: why.into() });
    }

    fn add(&mut self, finding: Finding) {
        say(&text(&finding));
        self.findings.push(finding);
    }
}

fn text(finding: &Finding) -> String {
    let verdict = match finding.passed {
        Some(true) => "ok",
        Some(false) => "FAILED",
        None => "–",
    };
    format!("{verdict:<7} {:<22} {}", finding.check, finding.detail)
}

pub fn run(args: &CheckArgs) -> Result<Verdict> {
    let config = Config::load(args.config.as_deref())?;
    let arm = config.task()?.arm()?;
    let ArmWorld { model, q0, .. } = (arm.world)(&config)?;
    let expected = external::expected(&config, &model, !args.real)?;
    let stop = stop_flag(Who::Tool)?;
    let cell = Cell::new(args.cell.as_deref().unwrap_or(&config.cell.name))?;
    let _lock = cell.lock(Role::Controller)?;
    let socket = external::socket_of(&config, &cell);
    let listener = Listener::bind(&socket)?;
    let mut program =
        args.program.as_deref().map(|command| start(command, &config, &socket)).transpose()?;
    if program.is_none() {
        say(&format!("waiting for the plant at {}", socket.display()));
    }
    let period_ns = config.controller.period_ns();
    let mut bench =
        Bench { model: &model, q0, period_ns, samples: args.samples, findings: Vec::new() };
    let link = meet(&listener, &stop, program.as_mut())?;
    let mut host = Host::alone(&cell)?;
    if let Some((line, hello)) = introduce(&mut bench, &expected, &mut host, link)? {
        match args.real {
            true => real::check(&mut bench, line)?,
            false => simulated::check(&mut bench, line, &hello)?,
        }
        notices_the_end(&mut bench, &listener, program.as_mut());
    }
    drop(program);
    report(&bench.findings, args.json)
}

/// Starts the plant; what it says goes to a file that an error names.
fn start(command: &str, config: &Config, socket: &Path) -> Result<Service> {
    let log = std::env::temp_dir().join(format!("skillet-plant-{}.log", std::process::id()));
    let environment = external::environment(config, socket)?;
    Service::start_program("plant", &external::words(command)?, log, &environment)
}

/// Waits for a plant.
fn meet(
    listener: &Listener,
    stop: &AtomicBool,
    mut program: Option<&mut Service>,
) -> Result<Connection> {
    let start = Instant::now();
    while start.elapsed() < TO_COME && !stop.load(Ordering::Relaxed) {
        if let Some((link, _)) = listener.accept(Duration::from_millis(50))? {
            return Ok(link);
        }
        if let Some(program) = &mut program
            && let Some(status) = program.exited()?
        {
            bail!(program.obituary(status));
        }
    }
    bail!("no plant connected within {} s: start it with this cell's name", TO_COME.as_secs())
}

/// Hello, Welcome and the first sample.
fn introduce(
    bench: &mut Bench,
    expected: &Expected,
    host: &mut Host,
    link: Connection,
) -> Result<Option<(Line, PlantHello)>> {
    let mut buffer = Buffer::new();
    let hello = match link.receive(&mut buffer, TO_NOTICE) {
        Ok(Some(Message::Hello(hello))) => *hello,
        other => {
            bench.note("hello", false, format!("expected a Hello, got {other:?}"));
            return Ok(None);
        }
    };
    if let Err(refused) = expected.check(&hello) {
        let _ = link.send(&PlantWelcome::refused(&refused.to_string()));
        bench.note("hello", false, refused.to_string());
        return Ok(None);
    }
    let name = hello.name();
    bench.note("hello", true, format!("'{name}', {} joints, as the controller's", hello.n_joints));
    let mut welcome = PlantWelcome::accepted(1, expected.period_ns);
    let mut shared = None;
    if hello.polls() {
        let (end, invitation) = host.invite()?;
        (welcome, shared) = (welcome.inviting(&invitation), Some(end));
    }
    link.send(&welcome).context("welcoming the plant")?;
    match Line::begin(PlantLine::new(Arc::new(link), shared)) {
        Ok(line) => {
            bench.note("first sample", true, "within 5 s");
            Ok(Some((line, hello)))
        }
        Err(error) => {
            bench.note("first sample", false, error.to_string());
            Ok(None)
        }
    }
}

/// The controller has gone without a word, as one that is killed: the plant ends, or looks for another one.
fn notices_the_end(bench: &mut Bench, listener: &Listener, mut program: Option<&mut Service>) {
    let start = Instant::now();
    while start.elapsed() < TO_NOTICE {
        if matches!(listener.accept(Duration::from_millis(50)), Ok(Some(_))) {
            return bench.note("a controller that dies", true, "it reconnects to the next one");
        }
        if let Some(program) = &mut program
            && matches!(program.exited(), Ok(Some(_)))
        {
            let seconds = start.elapsed().as_secs_f64();
            return bench.note(
                "a controller that dies",
                true,
                format!("it ended after {seconds:.1} s"),
            );
        }
    }
    match program {
        Some(_) => bench.note(
            "a controller that dies",
            false,
            format!("it has not noticed after {} s", TO_NOTICE.as_secs()),
        ),
        None => bench.skip("a controller that dies", "tested only with --program"),
    }
}

fn report(findings: &[Finding], as_json: bool) -> Result<Verdict> {
    let failed = findings.iter().filter(|finding| finding.passed == Some(false)).count();
    if as_json {
        print_json(&serde_json::json!({ "passed": failed == 0, "checks": findings }))?;
    } else {
        let passed = findings.iter().filter(|finding| finding.passed == Some(true)).count();
        print(&format!("{passed} checks passed, {failed} failed\n"))?;
    }
    Ok(if failed == 0 { Verdict::Done } else { Verdict::Negative })
}
