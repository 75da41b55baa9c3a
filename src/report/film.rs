//! A rollout as it moved: what the arm carried, the object, and the arm itself.

use learner::path::PathRow;
use nalgebra::{Vector3, convert};

use crate::record::solids::Solids;

/// Both ends of every capsule of the arm in the world, m.
pub type Links = Vec<[Vector3<f64>; 2]>;

/// What was seen of a rollout, 100 times a second from the start of Execute.
#[derive(Clone, Debug, Default)]
pub struct Film {
    pub rollout: u64,
    pub path: Vec<PathRow>,
    /// One a row of the path, or none where no arm is to be drawn.
    pub arm: Vec<Links>,
}

/// What the arm and what it handles look like.
#[derive(Clone, Debug, PartialEq)]
pub struct Look {
    /// Radius of each of the arm's capsules, m.
    pub radii: Vec<f64>,
    /// They are shapes of the URDF.
    pub has_shapes: bool,
    /// The postures are those of the joints; otherwise they follow from the path of the tip.
    pub is_measured: bool,
    pub solids: Solids,
}

impl Film {
    /// The rows that hold numbers only.
    pub fn finite(&self) -> Film {
        let is_finite = |row: &PathRow| row.columns().iter().all(|value| value.is_finite());
        let kept: Vec<usize> = (0..self.path.len()).filter(|i| is_finite(&self.path[*i])).collect();
        let arm = match self.arm.len() == self.path.len() {
            true => kept.iter().map(|i| self.arm[*i].clone()).collect(),
            false => Vec::new(),
        };
        Film { rollout: self.rollout, path: kept.iter().map(|i| self.path[*i]).collect(), arm }
    }

    /// Every `stride`th row, by rising times, with the last one.
    pub fn thinned(&self, stride: usize) -> Film {
        let mut film = Film { rollout: self.rollout, ..Film::default() };
        for (k, row) in self.path.iter().enumerate() {
            let is_later = film.path.last().is_none_or(|last| row.t_s > last.t_s);
            if is_later && (k % stride == 0 || k + 1 == self.path.len()) {
                film.path.push(*row);
                film.arm.extend(self.arm.get(k).cloned());
            }
        }
        film
    }

    /// The arm in a row; nothing without one.
    pub fn links(&self, row: usize) -> &[[Vector3<f64>; 2]] {
        self.arm.get(row).map_or(&[], Vec::as_slice)
    }
}

/// The plant tracks no object: it reports the world's frame in every row.
fn tracks_nothing(path: &[PathRow]) -> bool {
    path.iter().all(|row| row.object_position == [0.0; 3])
}

/// The path, with the tip in place of an object where none is tracked.
pub fn followed(mut path: Vec<PathRow>) -> Vec<PathRow> {
    if tracks_nothing(&path) {
        path.iter_mut().for_each(|row| row.object_position = row.pan_position);
    }
    path
}

/// Does the path follow the tip, as no object is tracked?
pub fn follows_tip(path: &[PathRow]) -> bool {
    !path.is_empty() && path.iter().all(|row| row.object_position == row.pan_position)
}

/// Where a row has the tip, m.
pub fn tip(row: &PathRow) -> Vector3<f64> {
    convert(Vector3::from(row.pan_position))
}

/// Where a row has the object, m.
pub fn object(row: &PathRow) -> Vector3<f64> {
    convert(Vector3::from(row.object_position))
}
