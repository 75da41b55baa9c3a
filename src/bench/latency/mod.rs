//! `skillet bench latency`: a controller in real time while policies are swapped, learners work and
//! die, and observers come and go; a bare loop beside it.

mod load;
mod reference;

use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

use anyhow::{Context, Result};
use shm_types::ports::ObserverPorts;

use super::service::BenchCell;
use super::{Bench, Plan, Row};
use crate::config::Config;
use crate::stderr::say;
use load::Load;
use reference::{bare_loop, cyclictest};

pub const BENCH: Bench = Bench {
    name: "latency",
    title: "The loop under swaps, load and kills",
    about: "A controller service runs at 1 kHz in a private cell, with the simulated plant. Each \
            round puts it under one kind of disturbance after another. Wake-up is the time from \
            the deadline until the loop runs; tick is the time from the measurement to the \
            torque. Swap is the time from sending the command to the start of the first tick in \
            which the new policy acts; swaps are blended over 5 ms. Each whole period that a loop \
            sleeps through is a miss. A swap is a miss if it is not acknowledged, or if the \
            policy is read back different. The bare loop only sleeps to absolute deadlines and \
            records how late it wakes, at the same time, on the same core and at the same \
            priority, half a period away. cyclictest, if installed, runs alone between the \
            slices. The storm combines all disturbances and takes half of the time.",
    seconds: 120.0,
    run,
};

/// A swap every 10 ms must find the last one faded in.
const BLEND_S: f64 = 0.005;
/// Part of the time that the storm takes.
const STORM_SHARE: f64 = 0.5;
const SOON: Duration = Duration::from_secs(5);

/// A kind of disturbance.
struct Scenario {
    name: &'static str,
    swaps: bool,
    learner: bool,
    observers: bool,
    kills: bool,
}

const SCENARIOS: [Scenario; 6] = {
    let idle = Scenario { name: "", swaps: false, learner: false, observers: false, kills: false };
    [
        Scenario { name: "idle", ..idle },
        Scenario { name: "100 swaps a second", swaps: true, ..idle },
        Scenario { name: "learner at full load", learner: true, ..idle },
        Scenario { name: "10 observers come and go", observers: true, ..idle },
        Scenario { name: "learner killed every second", kills: true, ..idle },
        Scenario { name: "storm", swaps: true, learner: true, observers: true, kills: true },
    ]
};

/// What one scenario gave.
struct Rows {
    wakeup: Row,
    bare: Row,
    tick: Row,
    swap: Option<Row>,
    cyclictest: Option<Row>,
}

impl Rows {
    fn new(scenario: &Scenario) -> Rows {
        let name = scenario.name;
        let wakeup = format!("Wake-up after the deadline, {name}");
        let row = |what| Row::time(&wakeup, what, name).with_misses();
        Rows {
            wakeup: row("wake-up, controller"),
            bare: row("wake-up, bare loop"),
            tick: Row::time("Tick", "tick", name),
            swap: scenario.swaps.then(|| {
                let group = "Swap, published to applied";
                Row::time(group, "published to applied", name).with_misses()
            }),
            cyclictest: (name == "idle").then(|| row("wake-up, cyclictest")),
        }
    }

    fn into_rows(self) -> impl Iterator<Item = Row> {
        let filled = |row: &Row| row.n() > 0;
        [
            Some(self.wakeup),
            Some(self.bare),
            self.cyclictest.filter(filled),
            Some(self.tick),
            self.swap,
        ]
        .into_iter()
        .flatten()
    }
}

fn run(plan: &Plan) -> Result<Vec<Row>> {
    let mut config = Config::default();
    config.controller.blend_s = BLEND_S;
    // More than any bench lasts.
    config.learner.rollouts = 100_000;
    let bench = BenchCell::create(&config)?;
    let mut all: Vec<Rows> = SCENARIOS.iter().map(Rows::new).collect();
    let round = plan.seconds / f64::from(plan.rounds);
    // cyclictest has a slice of its own.
    let others = SCENARIOS.len() as f64;
    for _ in 0..plan.rounds {
        for (scenario, rows) in SCENARIOS.iter().zip(&mut all) {
            let is_storm = scenario.name == "storm";
            let share = if is_storm { STORM_SHARE } else { (1.0 - STORM_SHARE) / others };
            let slice = Duration::from_secs_f64(round * share);
            measure(&bench, &config, scenario, slice, rows)
                .with_context(|| format!("scenario '{}'", scenario.name))?;
            if let Some(row) = &mut rows.cyclictest {
                cyclictest(&config.controller, slice, row)?;
            }
        }
    }
    Ok(all.into_iter().flat_map(Rows::into_rows).collect())
}

/// One slice of one scenario, with a controller of its own.
fn measure(
    bench: &BenchCell,
    config: &Config,
    scenario: &Scenario,
    slice: Duration,
    rows: &mut Rows,
) -> Result<()> {
    let mut controller = bench.controller("realtime")?;
    let load = Load::start(bench, scenario)?;
    let over = AtomicBool::new(false);
    let result = std::thread::scope(|scope| {
        let bare = scope.spawn(|| bare_loop(&config.controller, &over, &mut rows.bare));
        let swapper = rows.swap.as_mut().map(|row| {
            let (cell, over) = (&bench.cell, &over);
            scope.spawn(move || load::swap_every_10_ms(cell, over, row))
        });
        let result = observe(bench, slice, &mut rows.wakeup, &mut rows.tick);
        over.store(true, Ordering::Relaxed);
        let swapped = swapper.map_or(Ok(Ok(())), |thread| thread.join());
        bare.join().ok().context("the bare loop panicked")?;
        swapped.ok().context("the swaps panicked")??;
        result
    });
    load.stop()?;
    controller.stop()?;
    result
}

/// Takes every tick of the controller in, from its telemetry.
fn observe(bench: &BenchCell, slice: Duration, wakeup: &mut Row, tick: &mut Row) -> Result<()> {
    let observer = ObserverPorts::open(&bench.cell, SOON)?;
    let (start, mut missed_before, mut missed) = (Instant::now(), None, 0);
    let mut lost = 0;
    while start.elapsed() < slice {
        let Some(sample) = observer.telemetry.receive()? else {
            std::thread::sleep(Duration::from_millis(5));
            continue;
        };
        let ticks = sample.ticks();
        let (Some(first), Some(last)) = (ticks.first(), ticks.last()) else { continue };
        for seen in ticks {
            wakeup.add_time(Duration::from_nanos(seen.wakeup_ns));
            tick.add_time(Duration::from_nanos(seen.tick_ns));
        }
        // What happened before the first sample is another slice's, or the start's.
        missed = last.missed;
        missed_before.get_or_insert(first.missed);
        lost += sample.lost;
    }
    wakeup.misses = Some(wakeup.misses.unwrap_or(0) + missed - missed_before.unwrap_or(missed));
    if lost > 0 {
        say(&format!("skillet: {lost} ticks were not seen by the bench; they are in no row"));
    }
    Ok(())
}
