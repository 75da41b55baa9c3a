//! Directions of stiffness: which springs become stiffer or softer together, and which couple.
//!
//! In 100 rollouts a profile emerges where it has few numbers: one a phase, before the demonstration's
//! peak, where a movement needs force, and after it, where it may give way.

use std::ops::Range;

use nalgebra::DVector;
use shm_types::policy::{PolicyMsg, packed_index};
use thiserror::Error;

use super::{Column, ExplorationConfig, ExplorationError, NO_CHANGE, Peak, StiffnessKind};
use crate::activation::Activation;
use crate::demonstration::Demonstration;
use crate::parameters::{N_POSITIONS, ParameterMap};
use search::Direction;

/// Two peaks are two where the movement between them comes back below this part of the excursion, and the
/// lower one has this part of it: winding up for a throw is none.
const DIP: f64 = 0.5;
const SECOND: f64 = 0.8;

/// Why a movement has no two phases.
#[derive(Clone, Copy, Debug, Error, PartialEq)]
pub enum PhaseError {
    #[error(
        "the demonstration is farthest from its start at {t_s:.2} s of {duration_s:.2} s: it does not go \
         out and come back, so nothing is before and after its peak; set learner.exploration.stiffness \
         to components or uniform"
    )]
    NoPeak { t_s: f64, duration_s: f64 },
    #[error(
        "the demonstration goes out and comes back twice, at {first_s:.2} s and {second_s:.2} s, so it \
         has no one peak with a before and an after; set learner.exploration.stiffness to components or \
         uniform"
    )]
    SeveralPeaks { first_s: f64, second_s: f64 },
    #[error(
        "none of the {n} components lies {side} the peak of the demonstration, at {t_s:.2} s: raise \
         learner.n_components, or set learner.exploration.stiffness to components or uniform"
    )]
    NoComponent { n: usize, side: &'static str, t_s: f64 },
}

/// The directions that `config.stiffness` names.
pub(super) fn columns(
    initial: &PolicyMsg,
    map: &ParameterMap,
    config: &ExplorationConfig,
    demonstration: &Demonstration,
) -> Result<Vec<Column>, ExplorationError> {
    let all = 0..initial.n_components as usize;
    let [position, rotation] = [0..N_POSITIONS, N_POSITIONS..initial.task_dim as usize];
    let late = |late| Direction { grows: false, late };
    let scaled = |of: &Range<usize>, coordinates: &Range<usize>, amount: f64| {
        let change =
            map.encode(&stiffened(initial, of, coordinates, amount))? - map.encode(initial)?;
        Ok::<_, ExplorationError>(change)
    };
    let mut columns = Vec::new();
    let amounts = [config.position_log_stiffness, config.rotation_log_stiffness];
    match config.stiffness {
        StiffnessKind::Fixed => {}
        StiffnessKind::Uniform => {
            for (coordinates, amount) in [&position, &rotation].into_iter().zip(amounts) {
                columns.push((scaled(&all, coordinates, amount)?, late(false)));
            }
        }
        StiffnessKind::Components => {
            for component in all {
                for (coordinates, amount) in [&position, &rotation].into_iter().zip(amounts) {
                    let one = component..component + 1;
                    columns.push((scaled(&one, coordinates, amount)?, late(true)));
                }
            }
        }
        StiffnessKind::Phases | StiffnessKind::Full => {
            let phases = phases(initial, demonstration)?;
            let amounts = [config.before_log_stiffness, config.after_log_stiffness];
            for (phase, amount) in phases.iter().zip(amounts) {
                for coordinates in [&position, &rotation] {
                    columns.push((scaled(phase, coordinates, amount)?, late(true)));
                }
            }
            if config.stiffness == StiffnessKind::Full {
                for phase in &phases {
                    for change in couplings(initial, map, phase, config.coupling_log_stiffness) {
                        columns.push((change, late(true)));
                    }
                }
            }
        }
    }
    Ok(columns)
}

/// `policy` with exp(`amount`) times the stiffness of `coordinates` in `components`, Kᵢ → D Kᵢ D.
fn stiffened(
    policy: &PolicyMsg,
    components: &Range<usize>,
    coordinates: &Range<usize>,
    amount: f64,
) -> PolicyMsg {
    let mut stiffened = *policy;
    let factor = |c: usize| if coordinates.contains(&c) { (0.5 * amount).exp() } else { 1.0 };
    for component in &mut stiffened.components[components.clone()] {
        for row in 0..policy.task_dim as usize {
            for col in 0..=row {
                component.stiffness[packed_index(row, col)] *= factor(row) * factor(col);
            }
        }
    }
    stiffened.sealed()
}

/// Changes of one off-diagonal entry of log K in `components` each, of two coordinates that both move.
fn couplings(
    initial: &PolicyMsg,
    map: &ParameterMap,
    components: &Range<usize>,
    amount: f64,
) -> Vec<DVector<f64>> {
    let moves = |c: usize| {
        let of = |i: usize| initial.components[i].attractor[c];
        let (low, high) = (0..initial.n_components as usize)
            .fold((f64::MAX, f64::MIN), |(low, high), i| (of(i).min(low), of(i).max(high)));
        high - low > NO_CHANGE
    };
    let d = initial.task_dim as usize;
    let pairs = (0..d).flat_map(|row| (0..row).map(move |col| (row, col)));
    pairs
        .filter(|(row, col)| moves(*row) && moves(*col))
        .map(|(row, col)| map.log_stiffness_change(components, row, col, amount))
        .collect()
}

/// The components whose centre comes before the peak of the demonstration, and the others.
fn phases(
    initial: &PolicyMsg,
    demonstration: &Demonstration,
) -> Result<[Range<usize>; 2], PhaseError> {
    let peak = peak(demonstration)?;
    let n = initial.n_components as usize;
    let is_decay = initial.activation == Activation::Decay.code();
    let activation = if is_decay { Activation::Decay } else { Activation::Time };
    let at_peak = activation.drive(peak, initial.decay_rate);
    let is_before = |center: f64| if is_decay { center > at_peak } else { center < at_peak };
    let n_before = initial.components().iter().filter(|c| is_before(c.center)).count();
    for (side, there) in [("before", n_before), ("after", n - n_before)] {
        if there == 0 {
            return Err(PhaseError::NoComponent { n, side, t_s: peak });
        }
    }
    Ok([0..n_before, n_before..n])
}

/// When the demonstration is at its one peak, s.
fn peak(demonstration: &Demonstration) -> Result<f64, PhaseError> {
    let Peak { t_s, reach_s } = Peak::of(demonstration);
    let duration_s = demonstration.duration_s();
    if reach_s == 0.0 {
        return Err(PhaseError::NoPeak { t_s, duration_s });
    }
    let excursion: Vec<f64> = Peak::excursion(demonstration).iter().map(|d| d.sqrt()).collect();
    let at = (t_s / demonstration.period_s()).round() as usize;
    // From the peak to both sides: once it has come back, it must not go out again.
    for side in [excursion[at..].to_vec(), excursion[..=at].iter().rev().copied().collect()] {
        let mut is_back = false;
        for (step, now) in side.iter().enumerate() {
            is_back |= *now < DIP * side[0];
            if is_back && *now > SECOND * side[0] {
                let there = step as f64 * demonstration.period_s();
                let is_later = side.len() == excursion.len() - at;
                let other = if is_later { t_s + there } else { t_s - there };
                let (first_s, second_s) = (t_s.min(other), t_s.max(other));
                return Err(PhaseError::SeveralPeaks { first_s, second_s });
            }
        }
    }
    Ok(t_s)
}
