//! Reproduction errors on handwriting: `cargo run --release -p imitation --example lasa -- FOLDER`, which
//! `imitation/lasa.py` fills.
//!
//! Every file of the folder is a shape (m): recordings to learn from, recordings that were held out, and what
//! other programs make of their starts. Prints a JSON object a line for each shape and method: errors of
//! all by the same code, of ours besides where they lead after a push, and of the stable field what its certificate
//! says.

mod pushes;
mod time_driven;

use std::error::Error;
use std::fs;
use std::path::PathBuf;
use std::time::Instant;

use imitation::Recording;
use imitation::align::{resampled_by_length, warp};
use imitation::metrics::swept_area;
use imitation::stable::{self, StableField, StableOptions};
use nalgebra::{DMatrix, DVector};
use serde::{Deserialize, Serialize};

use pushes::{N_PUSHES, Push, Pushed, pushed, pushes};
use time_driven::{Fit, TimeDriven, on_one_clock};

/// A motion has arrived when it is as near to its end as this, m.
const ARRIVED: f64 = 0.002;
/// Points for the distance by warping.
const N_WARPED: usize = 150;
/// Step of the integration, s, and how long a motion may take, in durations of the recordings.
const PERIOD_S: f64 = 0.005;
const PATIENCE: f64 = 3.0;
const PATIENCE_PUSHED: f64 = 10.0;
const SEED: u64 = 1;

#[derive(Deserialize)]
struct Shape {
    train: Vec<Points>,
    test: Vec<Points>,
    reproductions: Vec<Reproductions>,
}

#[derive(Deserialize)]
struct Points {
    period_s: f64,
    points: Vec<Vec<f64>>,
}

/// From the starts of the recordings that were held out.
#[derive(Deserialize)]
struct Reproductions {
    method: String,
    fit_s: f64,
    paths: Vec<Vec<Vec<f64>>>,
}

#[derive(Serialize)]
struct Errors<'a> {
    shape: &'a str,
    method: &'a str,
    fit_s: f64,
    /// Mean swept area, cm².
    area_cm2: f64,
    /// Mean distance of points paired by warping, mm.
    distance_mm: f64,
    /// Share of the motions that arrive.
    arrived: f64,
    #[serde(flatten)]
    pushed: Option<Pushed>,
    #[serde(flatten)]
    proof: Option<Proof>,
}

#[derive(Serialize)]
struct Proof {
    /// Ratio of the axes of V's ellipses.
    stretch: f64,
    /// 1/s: V falls at this rate at least.
    margin: f64,
    /// 1/s: the driven motion is certified from this damping on.
    damping: f64,
    /// Share of the pushed motions that arrive as ẍ = λ(f(x) − ẋ), and how long the slowest takes, with this law
    /// or as ẋ = f(x), in durations of the recordings.
    pushed_arrived_driven: f64,
    pushed_slowest: f64,
}

fn main() -> Result<(), Box<dyn Error>> {
    let folder = std::env::args().nth(1).ok_or("give the folder that lasa.py has filled")?;
    let mut files: Vec<PathBuf> =
        fs::read_dir(folder)?.map(|entry| Ok(entry?.path())).collect::<std::io::Result<_>>()?;
    files.retain(|file| file.extension().is_some_and(|extension| extension == "json"));
    files.sort();
    for file in files {
        let name = file.file_stem().unwrap_or_default().to_string_lossy().into_owned();
        let shape: Shape = serde_json::from_str(&fs::read_to_string(&file)?)?;
        let train = recordings("train", &shape.train)?;
        let test = recordings("test", &shape.test)?;

        let began = Instant::now();
        let field = stable::fit(&train, &StableOptions::default(), SEED)
            .map_err(|error| format!("{name}: {error}"))?;
        let fit_s = began.elapsed().as_secs_f64();
        let motions: Vec<DMatrix<f64>> = test
            .iter()
            .map(|r| {
                let start = r.points.column(0).clone_owned();
                field.motion(&start, PATIENCE * r.duration_s(), PERIOD_S)
            })
            .collect();
        let pushes = pushes(&motions);
        let mut errors = errors(&name, "stable field", fit_s, &test, &motions);
        let patience_s = PATIENCE_PUSHED * longest_s(&test);
        let go_on = |start: &DVector<f64>, _| field.motion(start, patience_s, PERIOD_S);
        let target = &field.certificate.target;
        errors.pushed = Some(pushed(&pushes, &motions, target, longest_s(&test), go_on));
        errors.proof = Some(proof(&field, &test, &pushes)?);
        println!("{}", serde_json::to_string(&errors)?);
        for fit in [TimeDriven::springs, TimeDriven::dmp, TimeDriven::gmr] {
            let errors = time_driven(&name, fit, &train, &test, &pushes)?;
            println!("{}", serde_json::to_string(&errors)?);
        }
        for Reproductions { method, fit_s, paths } in &shape.reproductions {
            let motions: Vec<DMatrix<f64>> = paths.iter().map(|path| matrix(path)).collect();
            let errors = self::errors(&name, method, *fit_s, &test, &motions);
            println!("{}", serde_json::to_string(&errors)?);
        }
    }
    Ok(())
}

/// An encoding that time drives, pushed to the same places as the stable field.
fn time_driven<'a>(
    shape: &'a str,
    fit: Fit,
    train: &[Recording],
    test: &[Recording],
    pushes: &[Push],
) -> Result<Errors<'a>, Box<dyn Error>> {
    let began = Instant::now();
    let aligned = on_one_clock(train)?;
    let encoding = fit(&aligned).map_err(|error| format!("{shape}: {error}"))?;
    let fit_s = began.elapsed().as_secs_f64();
    let duration_s = aligned[0].duration_s();
    let motions: Vec<DMatrix<f64>> = test
        .iter()
        .map(|r| {
            let start = r.points.column(0).clone_owned();
            encoding.motion(&start, 0.0, duration_s, PATIENCE * r.duration_s())
        })
        .collect();
    let mut errors = errors(shape, encoding.name, fit_s, test, &motions);
    let ends: DVector<f64> = train.iter().map(end).sum();
    let pushes: Vec<Push> =
        pushes.iter().enumerate().map(|(k, push)| push.of(k, &motions)).collect();
    let patience_s = PATIENCE_PUSHED * longest_s(test);
    let target = ends / train.len() as f64;
    errors.pushed = Some(pushed(&pushes, &motions, &target, duration_s, |start, from_s| {
        encoding.motion(start, from_s, duration_s, patience_s)
    }));
    Ok(errors)
}

fn end(recording: &Recording) -> DVector<f64> {
    recording.points.column(recording.n_points() - 1).clone_owned()
}

fn longest_s(recordings: &[Recording]) -> f64 {
    recordings.iter().map(Recording::duration_s).fold(0.0, f64::max)
}

fn recordings(kind: &str, all: &[Points]) -> Result<Vec<Recording>, Box<dyn Error>> {
    let numbered = all.iter().enumerate();
    let recording = |(k, one): (usize, &Points)| {
        Ok(Recording::new(format!("{kind} {k}"), one.period_s, matrix(&one.points))?)
    };
    numbered.map(recording).collect()
}

fn matrix(points: &[Vec<f64>]) -> DMatrix<f64> {
    DMatrix::from_fn(points[0].len(), points.len(), |c, k| points[k][c])
}

/// Means over all motions (d×T) that should go as the recordings do.
fn errors<'a>(
    shape: &'a str,
    method: &'a str,
    fit_s: f64,
    recordings: &[Recording],
    motions: &[DMatrix<f64>],
) -> Errors<'a> {
    let n = motions.len() as f64;
    let mut errors = Errors {
        shape,
        method,
        fit_s,
        area_cm2: 0.0,
        distance_mm: 0.0,
        arrived: 0.0,
        pushed: None,
        proof: None,
    };
    for (recording, motion) in recordings.iter().zip(motions) {
        let arrival = arrival(motion, &end(recording));
        let motion = motion.columns(0, arrival.unwrap_or(motion.ncols() - 1) + 1).clone_owned();
        errors.area_cm2 += 1e4 * swept_area(&recording.points, &motion) / n;
        let warp = warp(
            &resampled_by_length(&recording.points, N_WARPED),
            &resampled_by_length(&motion, N_WARPED),
        );
        errors.distance_mm += 1e3 * warp.distance / warp.pairs.len() as f64 / n;
        errors.arrived += arrival.is_some() as u8 as f64 / n;
    }
    errors
}

/// The first point as near to the end as counts.
fn arrival(motion: &DMatrix<f64>, end: &DVector<f64>) -> Option<usize> {
    motion.column_iter().position(|x| (x - end).norm() < ARRIVED)
}

/// What the certificate says, and pushed motions driven by the law of the loop.
fn proof(
    field: &StableField,
    test: &[Recording],
    pushes: &[Push],
) -> Result<Proof, Box<dyn Error>> {
    let certificate = &field.certificate;
    let axes = certificate.P.symmetric_eigenvalues();
    let mut proof = Proof {
        stretch: (axes.max() / axes.min()).sqrt(),
        margin: certificate.check(&field.systems)?,
        damping: certificate.damping(&field.systems)?,
        pushed_arrived_driven: 0.0,
        pushed_slowest: 0.0,
    };
    let longest_s = longest_s(test);
    let patience_s = PATIENCE_PUSHED * longest_s;
    let lambda = StableOptions::default().damping;
    for push in pushes {
        let driven = field.driven(&push.to, lambda, patience_s, PERIOD_S);
        let arrived = arrival(&driven, &certificate.target);
        proof.pushed_arrived_driven += f64::from(arrived.is_some()) / N_PUSHES as f64;
        let free = arrival(&field.motion(&push.to, patience_s, PERIOD_S), &certificate.target);
        for k in [arrived, free].into_iter().flatten() {
            proof.pushed_slowest = proof.pushed_slowest.max(k as f64 * PERIOD_S / longest_s);
        }
    }
    Ok(proof)
}
