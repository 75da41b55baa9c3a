//! The skittles as a landscape over throws: rewards, and the true regions of solutions.

use std::collections::BTreeSet;
use std::sync::OnceLock;

use nalgebra::DVector;
use physics::skittles::{BOX, SkittlesConfig, TARGETS, Throw};
use search::{Bounds, Mode};

/// λ of the reward exp(−λ d), 1/m.
const LAMBDA: f64 = 3.0;
/// A region is connected by rewards of at least this …
const GOOD: f64 = 0.7;
/// … and has one of at least this.
const SOLVED: f64 = 0.9;
/// Cells of the grid on which regions are connected.
const CELLS: [usize; 2] = [240, 120];

pub fn reward(target: [f64; 2], theta: &DVector<f64>) -> f64 {
    let world = SkittlesConfig { target, ..SkittlesConfig::default() };
    let throw = Throw { alpha: theta[0], alpha_dot: theta[1] };
    (-LAMBDA * world.fly(&throw).distance_m).exp()
}

/// The box of throws.
pub fn bounds() -> Bounds {
    Bounds::new(2, &BOX.0, &BOX.1).expect("the box is not empty")
}

/// The solutions for a skittle: connected cells; α wraps around.
pub struct Regions {
    target: [f64; 2],
    /// Number of the region of each cell, row by row of α; from 1, 0 for none.
    cells: Vec<usize>,
    pub n: usize,
}

impl Regions {
    /// The regions of [`TARGETS`]`[index]`, computed once.
    pub fn of(index: usize) -> &'static Regions {
        static REGIONS: [OnceLock<Regions>; 3] = [const { OnceLock::new() }; 3];
        REGIONS[index].get_or_init(|| Regions::new(TARGETS[index]))
    }

    fn new(target: [f64; 2]) -> Regions {
        let bounds = bounds();
        let centre = |cell: usize| {
            let [i, j] = [cell / CELLS[1], cell % CELLS[1]];
            bounds.at(&[(i as f64 + 0.5) / CELLS[0] as f64, (j as f64 + 0.5) / CELLS[1] as f64])
        };
        let rewards: Vec<f64> =
            (0..CELLS[0] * CELLS[1]).map(|cell| reward(target, &centre(cell))).collect();
        let mut regions = Regions { target, cells: vec![0; rewards.len()], n: 0 };
        let mut seen = vec![false; rewards.len()];
        for seed in 0..rewards.len() {
            let mut region = vec![seed];
            let mut next = 0;
            while next < region.len() {
                let cell = region[next];
                if seen[cell] || rewards[cell] < GOOD {
                    region.swap_remove(next);
                    continue;
                }
                seen[cell] = true;
                region.extend(neighbours(cell));
                next += 1;
            }
            if region.iter().any(|cell| rewards[*cell] >= SOLVED) {
                regions.n += 1;
                region.into_iter().for_each(|cell| regions.cells[cell] = regions.n);
            }
        }
        regions
    }

    /// How many of the regions hold a mode's policy.
    pub fn answered<'a>(&self, modes: impl IntoIterator<Item = &'a Mode>) -> usize {
        modes.into_iter().filter_map(|mode| self.at(&mode.mean)).collect::<BTreeSet<_>>().len()
    }

    /// The region a throw belongs to.
    pub fn at(&self, theta: &DVector<f64>) -> Option<usize> {
        let fractions = bounds().fractions(theta);
        let index = |d: usize| {
            let cell = (fractions[d] * CELLS[d] as f64).floor();
            cell.clamp(0.0, CELLS[d] as f64 - 1.0) as usize
        };
        let region = self.cells[index(0) * CELLS[1] + index(1)];
        (region > 0 && reward(self.target, theta) >= GOOD).then_some(region)
    }
}

/// The up to eight cells around one.
fn neighbours(cell: usize) -> impl Iterator<Item = usize> {
    let [i, j] = [cell / CELLS[1], cell % CELLS[1]];
    let columns = j.saturating_sub(1)..=(j + 1).min(CELLS[1] - 1);
    let rows = [i + CELLS[0] - 1, i, i + 1].map(|i| i % CELLS[0]);
    rows.into_iter().flat_map(move |i| columns.clone().map(move |j| i * CELLS[1] + j))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// One solution for the paper's skittle, two for each of the others.
    #[test]
    fn skittles_have_one_two_and_two_regions() {
        assert_eq!([0, 1, 2].map(|index| Regions::of(index).n), [1, 2, 2]);
    }

    #[test]
    fn only_good_throws_belong_to_a_region() {
        let regions = Regions::of(1);
        let grid =
            (0..2500).map(|i| bounds().at(&[(i / 50) as f64 / 50.0, (i % 50) as f64 / 50.0]));
        let mut found = vec![0; regions.n + 1];
        for theta in grid {
            let region = regions.at(&theta);
            assert!(region.is_none() || reward(TARGETS[1], &theta) >= GOOD);
            found[region.unwrap_or(0)] += 1;
        }
        assert!(found.iter().all(|n| *n > 10), "{found:?}");
    }
}
