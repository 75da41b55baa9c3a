//! `skillet study`: many seeds in this process, tables with intervals, the paper's figures.

mod aim;
mod arms;
mod circumstances;
#[cfg(feature = "baselines")]
mod cmaes;
mod comparison;
mod compliance;
mod contender;
mod cost;
mod disturbance;
mod drift;
mod encodings;
mod figures;
mod imitation;
mod landscape;
mod literal;
mod niching;
mod pancake;
mod peaks;
mod peers;
mod posture;
mod python;
mod ratings;
mod repertoire;
mod robots;
mod run;
mod runner;
mod runs;
mod sample;
mod simulation;
mod skittles;
mod statistics;
mod table;
mod tasks;
mod textbook;
mod transfer;
mod tune;
mod world;

use std::path::{Path, PathBuf};
use std::sync::atomic::AtomicBool;

use anyhow::{Context, Result};

use crate::draw::figure::Figure;
use figures::{fig1, fig3, fig5, fig6, fig7, fig8};
pub use sample::Sample;
pub use statistics::Row;

/// What `skillet study NAME` does.
pub struct Study {
    pub name: &'static str,
    pub about: &'static str,
    pub kind: Kind,
}

pub enum Kind {
    /// Numbers over many seeds.
    Table {
        /// Raised whenever the same seed gives other numbers than before.
        version: u32,
        run_seed: fn(u64) -> Result<Vec<Sample>>,
    },
    /// A figure of one run, that of the first seed.
    Figure(fn(u64) -> Result<Figure>),
}

const fn table_of(
    name: &'static str,
    about: &'static str,
    version: u32,
    run_seed: fn(u64) -> Result<Vec<Sample>>,
) -> Study {
    Study { name, about, kind: Kind::Table { version, run_seed } }
}

const fn figure_of(
    name: &'static str,
    about: &'static str,
    draw: fn(u64) -> Result<Figure>,
) -> Study {
    Study { name, about, kind: Kind::Figure(draw) }
}

/// Every study, in the order of `--help`.
pub const STUDIES: &[Study] = &[
    table_of(
        "pancake",
        "pancake flipping from 100 rollouts, and the robustness of the selected policy",
        2,
        pancake::run_seed,
    ),
    table_of(
        "pancake-variants",
        "the same with other noise, another reward, a wrong model, another pancake each time",
        1,
        pancake::run_variants,
    ),
    table_of(
        "aim",
        "pancake flipping learnt from measures, with good and bad predictions and with none",
        1,
        aim::run_seed,
    ),
    table_of(
        "ratings",
        "pancake flipping from a person's ratings alone, some of them wrong",
        2,
        ratings::run_seed,
    ),
    table_of(
        "repertoire",
        "flips of every height from one demonstration, chosen by height",
        1,
        repertoire::run_seed,
    ),
    table_of(
        "circumstances",
        "a repertoire under a ceiling, with a weak joint, with a heavier pan",
        1,
        circumstances::run_seed,
    ),
    table_of(
        "aim-tasks",
        "tasks without an arm that have targets, learnt from measures",
        1,
        tasks::run_aim_seed,
    ),
    table_of(
        "aim-arm-tasks",
        "tasks with an arm that have targets, learnt from measures",
        1,
        tasks::run_aim_arm_seed,
    ),
    table_of(
        "compliance",
        "which stiffnesses are learnt, and their benefit: heavy pancakes, pushes",
        2,
        compliance::run_seed,
    ),
    table_of(
        "compliance-varying",
        "the same learnt on pancakes of 20 to 120 g that bounce or not, under pushes",
        2,
        compliance::run_varying_seed,
    ),
    table_of(
        "compliance-table",
        "ball-in-a-cup beside a table on whose edge the cup catches",
        1,
        table::run_seed,
    ),
    table_of(
        "posture",
        "a learnt flip while the posture moves: the effect on the pan",
        2,
        posture::run_seed,
    ),
    table_of(
        "dynamics",
        "pancake flipping with both ways to simulate the arm",
        1,
        pancake::run_dynamics,
    ),
    table_of(
        "transfer",
        "pancake flipping learnt in Rapier and tried in MuJoCo, and vice versa",
        1,
        transfer::run_seed,
    ),
    table_of(
        "tasks",
        "tasks without an arm that define success, with their defaults",
        2,
        tasks::run_seed,
    ),
    table_of("arm-tasks", "tasks with an arm, with their defaults", 1, tasks::run_arm_seed),
    table_of(
        "simulation",
        "accuracy of the simulation step: learnt policies against a converged world",
        2,
        simulation::run_seed,
    ),
    table_of("landscape", "the mixtures on the landscape, without a box", 2, landscape::run_seed),
    table_of("drift", "a landscape that changes, with and without forgetting", 2, drift::run_seed),
    table_of("literal", "Algorithm 1 as printed, on the landscape", 2, literal::run_seed),
    table_of(
        "comparison",
        "every method with tuned settings, on landscape and skittles",
        4,
        comparison::run_seed,
    ),
    table_of("cost", "cost of an update, by trials, components and parameters", 2, cost::run_seed),
    table_of("tune", "the settings drawn for each method of the comparison", 2, tune::run_seed),
    table_of(
        "robots",
        "every method with tuned settings, on tasks with an arm and on the obstacle",
        1,
        robots::run_seed,
    ),
    table_of(
        "robots-tune",
        "the settings drawn for each method of the study robots",
        1,
        robots::run_tuning_seed,
    ),
    table_of(
        "encodings",
        "every encoding of a skill on tasks with an arm and on the obstacle",
        1,
        encodings::run_seed,
    ),
    table_of(
        "arms",
        "1 to 64 arms that feed one learner: rollouts, and time, until the flip is learnt",
        1,
        arms::run_seed,
    ),
    table_of(
        "peers",
        "our searches against pycma, pyribs, Optuna and nevergrad, through the Python package",
        1,
        peers::run_seed,
    ),
    table_of(
        "imitation",
        "stable fields against encodings driven by time on handwriting, with pushes, through Python",
        2,
        imitation::run_seed,
    ),
    table_of("niching", "all optima of the CEC 2013 functions F1 to F10", 2, niching::run_seed),
    table_of(
        "regions",
        "solution regions of landscape and skittles, in their boxes",
        1,
        peaks::run_default_seed,
    ),
    table_of("peaks", "methods that count the peaks of a known box", 2, peaks::run_seed),
    figure_of("fig1", "a movement as a weighted sum of linear systems, Eq. (2)", fig1::figure),
    figure_of("fig3", "stiffness over time of the selected policies of 20 seeds", fig3::figure),
    figure_of("fig5", "several optima and what a gradient finds", fig5::figure),
    figure_of("fig6", "splitting a Gaussian, Eq. (9)", |_| fig6::figure()),
    figure_of("fig7", "a run on the landscape", fig7::figure),
    figure_of("fig8", "runs on the skittles", fig8::figure),
];

/// The table of a study.
#[derive(Debug)]
pub struct Table {
    pub study: String,
    pub seeds: u64,
    pub first_seed: u64,
    pub rows: Vec<Row>,
}

/// What came out of a study.
pub enum Outcome {
    Table {
        table: Table,
        figure: PathBuf,
    },
    Figure {
        figure: PathBuf,
    },
    /// Stopped before the last seed.
    Stopped,
}

/// Which seeds, where to and how.
pub struct Request<'a> {
    pub first_seed: u64,
    pub seeds: u64,
    pub threads: usize,
    pub out: &'a Path,
}

/// Runs a study and writes its figure into the folder of the results.
pub fn run(study: &Study, request: &Request, stop: &AtomicBool) -> Result<Outcome> {
    let Request { first_seed, seeds, threads, out } = *request;
    std::fs::create_dir_all(out)
        .with_context(|| format!("{}: cannot create the folder", out.display()))?;
    let (version, run_seed) = match &study.kind {
        Kind::Figure(draw) => {
            return Ok(Outcome::Figure { figure: write(out, &draw(first_seed)?)? });
        }
        Kind::Table { version, run_seed } => (*version, run_seed),
    };
    let plan = runner::Plan {
        study: study.name,
        version,
        seeds: first_seed..first_seed + seeds,
        threads,
        results: out.join(format!("{}.jsonl", study.name)),
        run_seed,
    };
    let Some(samples) = runner::run(&plan, stop)? else { return Ok(Outcome::Stopped) };
    let rows = statistics::rows(&samples);
    let table = Table { study: study.name.into(), seeds, first_seed, rows };
    let figure = write(out, &figures::rates::figure(&table, study.name, study.about))?;
    Ok(Outcome::Table { table, figure })
}

fn write(out: &Path, figure: &Figure) -> Result<PathBuf> {
    let path = out.join(format!("{}.svg", figure.stem));
    let svg = figure.svg().with_context(|| format!("{} could not be drawn", figure.stem))?;
    std::fs::write(&path, svg).with_context(|| format!("{}: cannot write", path.display()))?;
    Ok(path)
}
