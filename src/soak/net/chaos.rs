//! The run: session after session, while processes are killed and links are cut.

use std::collections::BTreeMap;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

use anyhow::{Result, bail};
use learner::store::Store;

use super::super::process::Process;
use super::fleet::{Fleet, Part};
use super::script::{Event, Kill, Script};
use super::tally::NetTally;
use super::wan::{Cut, Wan};
use super::witness::Witness;
use crate::stderr::say;

const STEP: Duration = Duration::from_millis(50);
const PROGRESS: Duration = Duration::from_secs(60);
/// What a service tells its manager once it is up; a bridge or a learner that waits for others is.
const UP: &str = "READY=1";

/// A link that is cut, until when, and those who watch the cells behind it.
struct CutLink {
    cut: Cut,
    since: Instant,
    until: Instant,
    witnesses: Vec<Witness>,
}

pub struct Chaos<'a> {
    fleet: &'a Fleet,
    wan: &'a Wan,
    script: Script,
    /// The session that is learnt.
    number: u64,
    running: BTreeMap<Part, Process>,
    /// What was killed, and when it comes back.
    away: BTreeMap<Part, Instant>,
    cuts: BTreeMap<usize, CutLink>,
    pub tally: NetTally,
}

impl<'a> Chaos<'a> {
    pub fn new(fleet: &'a Fleet, wan: &'a Wan, script: Script) -> Chaos<'a> {
        Chaos {
            fleet,
            wan,
            script,
            number: 0,
            running: BTreeMap::new(),
            away: BTreeMap::new(),
            cuts: BTreeMap::new(),
            tally: NetTally::default(),
        }
    }

    /// Learns session after session until `end` or `stop`; the last one is finished without kills and cuts. How many
    /// there were.
    pub fn run(&mut self, end: Instant, stop: &AtomicBool) -> Result<u64> {
        for part in self.fleet.parts() {
            self.start(part)?;
        }
        let (mut pause, mut event) = self.script.next();
        let mut next_event = Instant::now() + pause;
        let mut next_line = Instant::now() + PROGRESS;
        let mut is_over = false;
        loop {
            std::thread::sleep(STEP);
            if !is_over && (Instant::now() >= end || stop.load(Ordering::Relaxed)) {
                is_over = true;
                say("ending: the session under way is finished without kills and cuts");
                self.calm();
            }
            self.come_back()?;
            self.heal(Instant::now());
            self.look_at_cells()?;
            if self.is_session_done()? {
                if is_over {
                    return Ok(self.number + 1);
                }
                self.number += 1;
                self.start(Part::Learner)?;
            }
            if !is_over && Instant::now() >= next_event {
                self.happen(event);
                (pause, event) = self.script.next();
                next_event = Instant::now() + pause;
            }
            if Instant::now() >= next_line {
                next_line += PROGRESS;
                say(&self.tally.line(self.number, self.trials()));
            }
        }
    }

    fn happen(&mut self, event: Event) {
        match event {
            Event::Kill(kill) => self.kill(kill),
            Event::Cut { host, cut, lasts } => self.cut(host, cut, lasts),
        }
    }

    fn kill(&mut self, kill: Kill) {
        self.tally.killed(kill);
        for part in self.script.victims(kill) {
            // It may be dead already.
            let Some(mut process) = self.running.remove(&part) else { continue };
            process.kill();
            self.tally.part(part).kills += 1;
            self.away.insert(part, Instant::now() + self.script.away());
        }
    }

    fn cut(&mut self, host: usize, cut: Cut, lasts: Duration) {
        if self.cuts.contains_key(&host) {
            return;
        }
        self.wan.cut(host, cut);
        let since = Instant::now();
        let witnesses = self.fleet.behind(host).into_iter().map(Witness::of).collect();
        self.cuts.insert(host, CutLink { cut, since, until: since + lasts, witnesses });
    }

    /// Ends the cuts that are over at `now`.
    fn heal(&mut self, now: Instant) {
        let over: Vec<usize> =
            self.cuts.iter().filter(|(_, link)| link.until <= now).map(|(host, _)| *host).collect();
        for host in over {
            let Some(link) = self.cuts.remove(&host) else { continue };
            self.wan.cut(host, Cut::None);
            self.tally.was_cut(link.cut, link.since.elapsed());
            for witness in link.witnesses {
                witness.testify(&mut self.tally.alone);
            }
        }
    }

    fn look_at_cells(&mut self) -> Result<()> {
        for witness in self.cuts.values_mut().flat_map(|link| &mut link.witnesses) {
            // One that was killed does not answer.
            if self.running.contains_key(&Part::Controller(witness.cell)) {
                witness.look(&self.fleet.cell(witness.cell)?);
            }
        }
        Ok(())
    }

    /// Starts again what has been away for long enough.
    fn come_back(&mut self) -> Result<()> {
        let now = Instant::now();
        let due: Vec<Part> =
            self.away.iter().filter(|(_, at)| **at <= now).map(|(part, _)| *part).collect();
        for part in due {
            self.away.remove(&part);
            if let Some(lives) = self.script.killed_at_start() {
                let mut process = self.fleet.start(part, self.number)?;
                std::thread::sleep(lives);
                process.kill();
                let tally = self.tally.part(part);
                (tally.kills, tally.at_start) = (tally.kills + 1, tally.at_start + 1);
            }
            self.start(part)?;
        }
        Ok(())
    }

    /// From now on nothing more happens.
    fn calm(&mut self) {
        let now = Instant::now();
        self.cuts.values_mut().for_each(|link| link.until = now);
        self.away.values_mut().for_each(|at| *at = now);
    }

    /// Waits until it is up. A learner whose session was done already is gone again.
    fn start(&mut self, part: Part) -> Result<()> {
        let mut process = self.fleet.start(part, self.number)?;
        match process.said(UP)? {
            Some(up) => self.tally.part(part).restarts.push(up),
            None if part == Part::Learner => {}
            None => bail!("the {} ended by itself", part.name()),
        }
        // Of a learner that has ended it is seen like any other's.
        self.running.insert(part, process);
        Ok(())
    }

    /// Whether the learner has ended, with success. Nothing else ends by itself.
    fn is_session_done(&mut self) -> Result<bool> {
        let mut is_done = false;
        for (part, process) in &mut self.running {
            match process.exited()? {
                None => {}
                Some(status) if *part == Part::Learner && status.success() => is_done = true,
                Some(status) => bail!(process.obituary(status)),
            }
        }
        if is_done {
            self.running.remove(&Part::Learner);
        }
        Ok(is_done)
    }

    /// The trials of the session that is being learnt.
    fn trials(&self) -> u64 {
        let path = self.fleet.session(self.number).join("session.db");
        Store::open(&path).and_then(|store| store.trial_count()).unwrap_or(0)
    }

    /// Has the learner of a session that is done say once more what is durable.
    pub fn resume(&mut self, number: u64) -> Result<()> {
        self.number = number;
        self.start(Part::Learner)?;
        while !self.is_session_done()? {
            std::thread::sleep(STEP);
        }
        Ok(())
    }

    /// Ends everything cleanly: the bridges first.
    pub fn end(&mut self) -> Vec<String> {
        let mut failures = Vec::new();
        let order = |part: &Part| match part {
            Part::Learner => 0,
            Part::Join(_) => 1,
            Part::Controller(_) => 2,
            Part::Hub => 3,
        };
        let mut parts: Vec<Part> = self.running.keys().copied().collect();
        parts.sort_by_key(order);
        for part in parts {
            if let Some(Err(error)) = self.running.remove(&part).map(Process::stop) {
                failures.push(format!("{}: {error:#}", part.name()));
            }
        }
        failures
    }
}
