//! Pushes away from a motion, and how it goes on.

use imitation::align::{resampled_by_length, warp};
use nalgebra::{DMatrix, DVector};
use serde::Serialize;

use super::{N_WARPED, PERIOD_S, arrival};

/// Pushes a shape, and how far, m.
pub const N_PUSHES: usize = 10;
const PUSH: f64 = 0.2;
/// How long a hand that pushes may hold on, as a share of the movement.
const HELD: f64 = 0.3;

/// What became of the pushed motions of a shape, all from rest where they were pushed to.
#[derive(Serialize)]
pub struct Pushed {
    /// Share that arrive, and how far from the end they are when time is up, mm: a mean.
    pushed_arrived: f64,
    pushed_rest_mm: f64,
    /// Mean distance, by warping, from the rest of the way without a push, mm: of a motion that is let go at
    /// once, and of one that is held there for 30 % of the movement, while time goes on.
    pushed_mm: f64,
    held_mm: f64,
}

/// One push: where to, and what was left of the motion.
pub struct Push {
    /// Where it leads (d), m.
    pub to: DVector<f64>,
    /// The motion that is pushed, and its point at that time.
    motion: usize,
    place: usize,
}

/// Pushes from places along the motions, in directions that go round.
pub fn pushes(motions: &[DMatrix<f64>]) -> Vec<Push> {
    let push = |k: usize| {
        let motion = k % motions.len();
        let place = place(&motions[motion], share(k));
        let angle = 2.4 * k as f64;
        let off = DVector::from_vec(vec![PUSH * angle.cos(), PUSH * angle.sin()]);
        Push { to: motions[motion].column(place) + off, motion, place }
    };
    (0..N_PUSHES).map(push).collect()
}

/// Where push `k` comes, as a share of the way.
fn share(k: usize) -> f64 {
    k as f64 / N_PUSHES as f64
}

impl Push {
    /// The same push of other `motions` from the same starts: to the same place, where they have gone the same
    /// share of their way.
    pub fn of(&self, k: usize, motions: &[DMatrix<f64>]) -> Push {
        let place = place(&motions[self.motion], share(k));
        Push { to: self.to.clone(), motion: self.motion, place }
    }
}

/// The first point with that share of the length of a path (d×T) behind it.
fn place(path: &DMatrix<f64>, share: f64) -> usize {
    let steps = (1..path.ncols()).map(|k| path.column(k).metric_distance(&path.column(k - 1)));
    let lengths: Vec<f64> = std::iter::once(0.0)
        .chain(steps.scan(0.0, |sum, step| {
            *sum += step;
            Some(*sum)
        }))
        .collect();
    let gone = share * lengths[lengths.len() - 1];
    lengths.iter().position(|length| *length >= gone).unwrap_or(0)
}

/// `go_on` makes the motion from rest at a place (m) and at a time of the movement (s); `motions` are those without
/// a push, `end` where they should arrive, and `duration_s` what time knows the movement to take.
pub fn pushed(
    pushes: &[Push],
    motions: &[DMatrix<f64>],
    end: &DVector<f64>,
    duration_s: f64,
    go_on: impl Fn(&DVector<f64>, f64) -> DMatrix<f64>,
) -> Pushed {
    let n = pushes.len() as f64;
    let mut found =
        Pushed { pushed_arrived: 0.0, pushed_rest_mm: 0.0, pushed_mm: 0.0, held_mm: 0.0 };
    for push in pushes {
        let motion = &motions[push.motion];
        let rest = arriving(&motion.columns_range(push.place..).clone_owned(), end);
        let at_s = push.place as f64 * PERIOD_S;
        let off_mm = |path: &DMatrix<f64>| {
            let by_length = |path: &DMatrix<f64>| resampled_by_length(path, N_WARPED);
            let warp = warp(&by_length(&rest), &by_length(&arriving(path, end)));
            1e3 * warp.distance / warp.pairs.len() as f64
        };
        let path = go_on(&push.to, at_s);
        found.pushed_arrived += f64::from(arrival(&path, end).is_some()) / n;
        found.pushed_rest_mm += 1e3 * (path.column(path.ncols() - 1) - end).norm() / n;
        found.pushed_mm += off_mm(&path) / n;
        found.held_mm += off_mm(&go_on(&push.to, at_s + HELD * duration_s)) / n;
    }
    found
}

/// The path until it arrives; all of it if it does not.
fn arriving(path: &DMatrix<f64>, end: &DVector<f64>) -> DMatrix<f64> {
    let n = arrival(path, end).map_or(path.ncols(), |k| (k + 1).max(2).min(path.ncols()));
    path.columns(0, n).clone_owned()
}
