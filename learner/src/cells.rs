//! Cells whose rollouts differ from those of the others: another pan, a worn arm. They are named, so that
//! they are not mistaken for chance.
//!
//! While a search learns, rewards rise: a trial is compared only with those of other cells that were told just before
//! and after it. If the cells are alike, a trial has as many better neighbours as worse ones, whatever the
//! rewards are distributed like.

use std::collections::BTreeSet;

use crate::store::TrialRecord;

/// Neighbours on either side, in the order in which trials were told.
const NEIGHBOURS: usize = 8;
/// Trials of a cell below which nothing is said of it.
const MIN_TRIALS: usize = 12;
/// Standard deviations beyond which a cell is said to differ. It is looked at after every trial, so this is far out.
const DEVIATIONS: f64 = 4.5;

/// A cell that differs.
#[derive(Clone, Debug, PartialEq)]
pub struct Odd {
    pub cell: String,
    pub trials: usize,
    /// Share of comparisons with trials of other cells in which its own had the lower reward; ties count half.
    pub worse: f64,
}

/// The cells that differ from the others, of trials in the order in which they were told: the one that differs most
/// first, then those that differ from the rest.
pub fn odd_ones(trials: &[TrialRecord]) -> Vec<Odd> {
    let mut left: Vec<&TrialRecord> =
        trials.iter().filter(|trial| trial.was_executed() && !trial.unrated).collect();
    let mut odd = Vec::new();
    loop {
        let cells: BTreeSet<&str> = left.iter().map(|trial| trial.cell.as_str()).collect();
        let all = cells.into_iter().filter_map(|cell| compared(cell, &left));
        let most = all.max_by(|a, b| a.deviation.total_cmp(&b.deviation));
        let Some(most) = most.filter(|most| most.deviation > DEVIATIONS) else { return odd };
        left.retain(|trial| trial.cell != most.odd.cell);
        odd.push(most.odd);
    }
}

/// A cell beside the others.
struct Compared {
    odd: Odd,
    /// In standard deviations of the sum below.
    deviation: f64,
}

/// Σ sᵢ over the trials of a cell, sᵢ = mean of sign(rᵢ − rⱼ) over its m neighbours j of other cells. If all are alike
/// its mean is 0, and its variance Σ (n + m + 1)/(3m) with n own trials among these neighbours, as of Mann and
/// Whitney's U, 2U/m − n; with ties it is less.
fn compared(cell: &str, trials: &[&TrialRecord]) -> Option<Compared> {
    let (mut sum, mut variance, mut count) = (0.0, 0.0, 0_u32);
    for (i, trial) in trials.iter().enumerate().filter(|(_, trial)| trial.cell == cell) {
        let others = |(_, trial): &(usize, &&TrialRecord)| trial.cell != cell;
        let before = trials.iter().enumerate().take(i).rev().filter(others).take(NEIGHBOURS);
        let after = trials.iter().enumerate().skip(i + 1).filter(others).take(NEIGHBOURS);
        let near: Vec<(usize, f64)> =
            before.chain(after).map(|(j, other)| (j, sign(trial.reward - other.reward))).collect();
        let first = near.iter().map(|(j, _)| *j).min().unwrap_or(i).min(i);
        let last = near.iter().map(|(j, _)| *j).max().unwrap_or(i).max(i);
        if near.is_empty() {
            continue;
        }
        let (m, span) = (near.len() as f64, (last - first + 1) as f64);
        sum += near.iter().map(|(_, sign)| sign).sum::<f64>() / m;
        // Own trials and those of others fill the span.
        variance += (span + 1.0) / (3.0 * m);
        count += 1;
    }
    let worse = 0.5 * (1.0 - sum / f64::from(count));
    let odd = Odd { cell: cell.into(), trials: count as usize, worse };
    let deviation = sum.abs() / f64::sqrt(variance);
    (odd.trials >= MIN_TRIALS).then_some(Compared { odd, deviation })
}

fn sign(difference: f64) -> f64 {
    if difference == 0.0 { 0.0 } else { difference.signum() }
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::DVector;
    use rand::{RngExt, SeedableRng};
    use rand_chacha::ChaCha12Rng;
    use search::trial::Trial;
    use shm_types::measures::Measures;

    /// A search that gets better, in `n_cells` of which the first one earns `less`.
    fn session(n_cells: u64, n_trials: u64, less: f64, seed: u64) -> Vec<TrialRecord> {
        let mut random = ChaCha12Rng::seed_from_u64(seed);
        let trial = |rollout: u64| {
            let cell = random.random_range(0..n_cells);
            let reward = 5.0 * rollout as f64 / n_trials as f64 + random.random::<f64>()
                - if cell == 0 { less } else { 0.0 };
            let theta = DVector::zeros(1);
            let trial = Trial { rollout, theta, reward, success: false, measured: Vec::new() };
            TrialRecord { cell: cell.to_string(), ..TrialRecord::of(trial, Measures::NONE) }
        };
        (1..=n_trials).map(trial).collect()
    }

    #[test]
    fn alike_cells_are_not_told_apart_however_often_one_looks() {
        for seed in 0..40 {
            let trials = session(4, 200, 0.0, seed);
            for n in 1..=trials.len() {
                assert_eq!(odd_ones(&trials[..n]), [], "seed {seed}, {n} trials");
            }
        }
    }

    #[test]
    fn a_cell_that_earns_less_is_named_and_no_other() {
        for seed in 0..20 {
            let odd = odd_ones(&session(4, 200, 0.5, seed));
            assert_eq!(odd.len(), 1, "seed {seed}: {odd:?}");
            assert!(odd[0].cell == "0" && odd[0].worse > 0.7, "seed {seed}: {odd:?}");
        }
        let better = odd_ones(&session(2, 200, -0.5, 1));
        assert!(better.iter().any(|odd| odd.cell == "0" && odd.worse < 0.3), "{better:?}");
    }

    #[test]
    fn one_cell_is_like_no_other() {
        assert_eq!(odd_ones(&session(1, 50, 1.0, 1)), []);
    }
}
