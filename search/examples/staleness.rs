//! What it costs a search that several rollouts are in flight: `cargo run --release -p search --example staleness`.
//!
//! A simulated clock and `c` arms: an arm asks, executes for one unit of time (or for 𝒩(1, 0.2²)), and tells. Printed
//! are medians over seeds of the rollouts told and of the time until the first success, and until 18 of the last 20
//! rollouts told were successes. Arguments: the first seed (1), the number of seeds (20), and names of methods or
//! landscapes to keep to.

use std::collections::BTreeSet;

use nalgebra::DVector;
use rand::RngExt;
use search::normals::{standard_normal, stream};
use search::trial::Trial;
use search::{AskTell, Bounds, Direction, Known, Method, SearchConfig, Space, build};

const ARMS: [usize; 6] = [1, 2, 4, 8, 16, 64];
const BUDGET: u64 = 400;
/// The share that counts as late: successes of the last trials told.
const RECENT: usize = 20;
const ENOUGH: usize = 18;

/// What a rollout comes to, and where the search begins.
trait Landscape: Sync {
    fn space(&self, seed: u64) -> Space;
    fn config(&self, method: Method) -> SearchConfig;
    /// Reward, success and measures.
    fn execute(&self, theta: &DVector<f64>, seed: u64) -> (f64, bool, Vec<Option<f64>>);
}

/// A unit vector for a seed.
fn direction(dim: usize, seed: u64) -> DVector<f64> {
    let mut rng = stream(seed, u64::MAX);
    DVector::from_fn(dim, |_, _| standard_normal(&mut rng)).normalize()
}

/// exp(−‖θ − θ*‖²/2w²) in twelve dimensions, θ* three units away; a success from 0.8 on.
struct Hill;

impl Landscape for Hill {
    fn space(&self, _seed: u64) -> Space {
        Space::white(DVector::zeros(12))
    }

    fn config(&self, method: Method) -> SearchConfig {
        SearchConfig { method, ..SearchConfig::default() }
    }

    fn execute(&self, theta: &DVector<f64>, seed: u64) -> (f64, bool, Vec<Option<f64>>) {
        let far = (theta - direction(12, seed) * 3.0).norm_squared();
        let reward = (-far / (2.0 * 2.5_f64.powi(2))).exp();
        (reward, reward > 0.8, Vec::new())
    }
}

/// A task as the pancake is one: five directions decide whether it succeeds, six late ones how compliant it is, which is
/// known; a twentieth of the good places fails all the same.
struct Shaped;

const LATE: usize = 6;

impl Landscape for Shaped {
    fn space(&self, _seed: u64) -> Space {
        let opens = |i| Direction { grows: i == 0, late: i >= 5 };
        let gradients = nalgebra::DMatrix::from_fn(LATE, 11, |i, j| f64::from(j == 5 + i));
        let known = Known {
            weights: DVector::repeat(LATE, 0.05),
            offsets: DVector::zeros(LATE),
            gradients,
            least: -2.0,
        };
        let white = Space::white(DVector::zeros(11));
        Space { directions: (0..11).map(opens).collect(), known: Some(known), ..white }
    }

    fn config(&self, method: Method) -> SearchConfig {
        SearchConfig { method, ..SearchConfig::default() }
    }

    fn execute(&self, theta: &DVector<f64>, seed: u64) -> (f64, bool, Vec<Option<f64>>) {
        let mut best = direction(5, seed) * 1.8;
        best[0] = best[0].abs();
        let (far, late) = ((theta.rows(0, 5) - best).norm(), theta.rows(5, LATE));
        // Too compliant is not exact any more.
        let closeness = (-far * far / 2.0).exp() - 0.05 * late.map(|x| x.min(0.0).powi(2)).sum();
        let mut hash = stream(theta.iter().fold(seed, |h, x| h.rotate_left(7) ^ x.to_bits()), 0);
        let success = closeness > 0.75 && hash.random::<f64>() > 0.05;
        let known = -0.05 * late.map(|x| x.max(-2.0)).sum();
        (closeness + known + f64::from(success), success, vec![Some(theta[0]), Some(theta[1])])
    }
}

/// Three measures, each a curve of the parameters, and a window for each.
struct Windows;

impl Landscape for Windows {
    fn space(&self, _seed: u64) -> Space {
        Space::white(DVector::zeros(10))
    }

    fn config(&self, method: Method) -> SearchConfig {
        let target = |name: &str| search::aim::Target::new(name, [0.8, 1.2], 1.0);
        let mut config = SearchConfig { method, ..SearchConfig::default() };
        config.aim.targets = ["a", "b", "c"].map(target).to_vec();
        config
    }

    fn execute(&self, theta: &DVector<f64>, seed: u64) -> (f64, bool, Vec<Option<f64>>) {
        let measure = |k: u64| {
            let along = direction(10, seed * 3 + k).dot(theta);
            let across = direction(10, seed * 3 + k + 1_000_000).dot(theta);
            along + 0.3 * (1.5 * across).sin()
        };
        let values = [0, 1, 2].map(measure);
        let off = values.iter().map(|v| (v - 1.0_f64).powi(2)).sum::<f64>();
        let success = values.iter().all(|v| (0.8..=1.2).contains(v));
        ((-off).exp() + f64::from(success), success, values.map(Some).to_vec())
    }
}

/// Two hills in a box of the plane, successes at their tops.
struct Plane;

impl Landscape for Plane {
    fn space(&self, _seed: u64) -> Space {
        let start = DVector::zeros(2);
        Space { bounds: Some(Bounds::around(&start, 1.0)), ..Space::white(start) }
    }

    fn config(&self, method: Method) -> SearchConfig {
        SearchConfig { method, ..SearchConfig::default() }
    }

    fn execute(&self, theta: &DVector<f64>, seed: u64) -> (f64, bool, Vec<Option<f64>>) {
        let top = direction(2, seed) * 0.7;
        let hill = |sign: f64| (-(theta - &top * sign).norm_squared() / 0.08).exp();
        let reward = hill(1.0) + hill(-1.0);
        (reward, reward > 0.95, Vec::new())
    }
}

/// Rollouts told and time until something was reached.
#[derive(Clone, Copy, Default)]
struct Reached {
    first: Option<(u64, f64)>,
    late: Option<(u64, f64)>,
}

fn run(landscape: &dyn Landscape, method: Method, arms: usize, jitter: f64, seed: u64) -> Reached {
    let config = landscape.config(method);
    let mut desk = AskTell::new(build(&config, seed, landscape.space(seed)));
    // Finishing time and rollout of each busy arm.
    let mut busy: Vec<(f64, u64, DVector<f64>)> = Vec::new();
    let (mut now, mut next, mut told) = (0.0, 1, 0);
    let (mut recent, mut reached) = (Vec::new(), Reached::default());
    while told < BUDGET && reached.late.is_none() {
        while busy.len() < arms {
            let lasts =
                (1.0 + jitter * standard_normal(&mut stream(seed, next + (1 << 40)))).max(0.2);
            busy.push((now + lasts, next, desk.ask(next).theta));
            next += 1;
        }
        busy.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
        now = busy[0].0;
        // Those that end at the same moment are told before anybody asks.
        let n = busy.iter().take_while(|(ends, ..)| *ends == now).count();
        for (_, rollout, theta) in busy.drain(..n) {
            let (reward, success, measured) = landscape.execute(&theta, seed);
            desk.tell(&Trial { rollout, theta, reward, success, measured }).unwrap();
            told += 1;
            recent.push(success);
            if success {
                reached.first.get_or_insert((told, now));
            }
            let newest = &recent[recent.len().saturating_sub(RECENT)..];
            if newest.iter().filter(|success| **success).count() >= ENOUGH {
                reached.late.get_or_insert((told, now));
            }
        }
    }
    reached
}

/// The median; what was never reached is above all that was.
fn median(values: impl Iterator<Item = Option<f64>>) -> f64 {
    let mut values: Vec<f64> = values.map(|value| value.unwrap_or(f64::INFINITY)).collect();
    values.sort_by(f64::total_cmp);
    0.5 * (values[(values.len() - 1) / 2] + values[values.len() / 2])
}

fn main() {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let numbers: Vec<u64> = arguments.iter().filter_map(|a| a.parse().ok()).collect();
    let (first, n) = (numbers.first().copied().unwrap_or(1), numbers.get(1).copied().unwrap_or(20));
    let words: BTreeSet<&str> =
        arguments.iter().map(String::as_str).filter(|a| a.parse::<u64>().is_err()).collect();
    let everywhere = [Method::Power, Method::Tempered, Method::Cem, Method::Pi2, Method::Rwr];
    let landscapes: [(&str, &dyn Landscape, Vec<Method>); 4] = [
        ("shaped", &Shaped, vec![Method::Power]),
        (
            "hill",
            &Hill,
            [everywhere.as_slice(), &[Method::Reinforce, Method::Enac, Method::Random]].concat(),
        ),
        ("windows", &Windows, vec![Method::Aim]),
        (
            "plane",
            &Plane,
            vec![Method::Regions, Method::Niching, Method::Algorithm1, Method::Tempered],
        ),
    ];
    println!(
        "| landscape | method | durations | arms | first: rollouts | time | late: rollouts | time |"
    );
    println!("|---|---|---|---|---|---|---|---|");
    for (name, landscape, methods) in landscapes {
        for method in methods {
            let label = format!("{method:?}").to_lowercase();
            let wanted = |word: &&str| *word == name || **word == *label;
            if !words.is_empty() && words.iter().filter(|w| wanted(w)).count() < words.len() {
                continue;
            }
            for (durations, jitter) in [("equal", 0.0), ("± 20 %", 0.2)] {
                for arms in ARMS {
                    let seeds = first..first + n;
                    let runs: Vec<Reached> =
                        seeds.map(|seed| run(landscape, method, arms, jitter, seed)).collect();
                    let of = |get: &dyn Fn(&Reached) -> Option<f64>| median(runs.iter().map(get));
                    println!(
                        "| {name} | {label} | {durations} | {arms} | {:.1} | {:.1} | {:.1} | {:.1} |",
                        of(&|r| r.first.map(|f| f.0 as f64)),
                        of(&|r| r.first.map(|f| f.1)),
                        of(&|r| r.late.map(|f| f.0 as f64)),
                        of(&|r| r.late.map(|f| f.1)),
                    );
                }
            }
        }
    }
}
