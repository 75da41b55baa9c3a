//! A map of the box: what is believed of places everywhere, and how high ways between them lead.

use std::cmp::Ordering;
use std::collections::BinaryHeap;

use nalgebra::DVector;

use super::surrogate::{Belief, Conditioned, Surrogate};
use crate::filling::Filling;

/// Places of the map; in two dimensions they are 0.02 widths of the box apart.
const N_PLACES: u64 = 3000;
/// A way leads from a place to one of so many nearest ones.
const N_NEIGHBOURS: usize = 8;

/// Places that fill the box evenly, joined to their neighbours, under a [`Surrogate`] of the trials.
pub struct Map {
    surrogate: Surrogate,
    places: Vec<DVector<f64>>,
    neighbours: Vec<Vec<usize>>,
    /// Whitened kernel of each place.
    whitened: Vec<Vec<f64>>,
}

/// A way between two places, ends included.
#[derive(Clone, Debug, PartialEq)]
pub struct Way {
    /// The lowest score on it, its ends aside.
    pub height: f64,
    pub places: Vec<usize>,
}

impl Map {
    /// `points` in fractions of the box, `values` one each.
    pub fn new(points: &[DVector<f64>], values: &[f64]) -> Map {
        let filling = Filling::new(points[0].len(), 0);
        let places: Vec<DVector<f64>> = (0..N_PLACES).map(|i| filling.place(i)).collect();
        let neighbours = places.iter().map(|place| nearest(&places, place)).collect();
        let mut map = Map {
            surrogate: Surrogate::fit(points, values),
            whitened: vec![Vec::new(); places.len()],
            places,
            neighbours,
        };
        map.whiten();
        map
    }

    /// Adds a trial.
    pub fn push(&mut self, point: DVector<f64>) {
        self.surrogate.push(point);
        self.whiten();
    }

    fn whiten(&mut self) {
        for (place, v) in self.places.iter().zip(&mut self.whitened) {
            self.surrogate.whiten(place, v);
        }
    }

    pub fn condition(&self, values: &[f64]) -> Conditioned {
        self.surrogate.condition(values)
    }

    /// What is believed of any point.
    pub fn belief(&self, conditioned: &Conditioned, point: &DVector<f64>) -> Belief {
        let mut v = Vec::new();
        self.surrogate.whiten(point, &mut v);
        conditioned.at(&v)
    }

    /// What is believed of each place.
    pub fn beliefs(&self, conditioned: &Conditioned) -> Vec<Belief> {
        self.whitened.iter().map(|v| conditioned.at(v)).collect()
    }

    pub fn place(&self, place: usize) -> &DVector<f64> {
        &self.places[place]
    }

    /// The place nearest to `point`.
    pub fn nearest(&self, point: &DVector<f64>) -> usize {
        let distance = |place: &usize| self.places[*place].metric_distance(point);
        (0..self.places.len())
            .min_by(|a, b| distance(a).total_cmp(&distance(b)))
            .expect("a map has places")
    }

    /// The way between two places whose lowest score is highest; `None` if none leads there.
    pub fn highest_way(&self, scores: &[f64], from: usize, to: usize) -> Option<Way> {
        let mut height = vec![f64::NEG_INFINITY; scores.len()];
        let mut before = vec![None; scores.len()];
        height[from] = f64::INFINITY;
        let mut reached = BinaryHeap::from([Reached { height: f64::INFINITY, place: from }]);
        while let Some(Reached { height: so_far, place }) = reached.pop() {
            if place == to {
                break;
            }
            for &next in &self.neighbours[place] {
                let score = if next == to { f64::INFINITY } else { scores[next] };
                if so_far.min(score) > height[next] {
                    height[next] = so_far.min(score);
                    before[next] = Some(place);
                    reached.push(Reached { height: height[next], place: next });
                }
            }
        }
        let mut places: Vec<usize> =
            std::iter::successors(Some(to), |&place| before[place]).collect();
        places.reverse();
        (places[0] == from).then(|| Way { height: height[to], places })
    }
}

/// Indices of the nearest places, `place` itself aside.
fn nearest(places: &[DVector<f64>], place: &DVector<f64>) -> Vec<usize> {
    let distance = |other: &DVector<f64>| other.metric_distance(place);
    let mut others: Vec<(f64, usize)> =
        places.iter().enumerate().map(|(i, other)| (distance(other), i)).collect();
    others.select_nth_unstable_by(N_NEIGHBOURS, |a, b| a.0.total_cmp(&b.0));
    others.truncate(N_NEIGHBOURS + 1);
    others.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
    others.into_iter().skip(1).map(|(_, i)| i).collect()
}

/// A place on the frontier; the highest comes first.
struct Reached {
    height: f64,
    place: usize,
}

impl Ord for Reached {
    fn cmp(&self, other: &Self) -> Ordering {
        self.height.total_cmp(&other.height).then(other.place.cmp(&self.place))
    }
}

impl PartialOrd for Reached {
    fn partial_cmp(&self, other: &Self) -> Option<Ordering> {
        Some(self.cmp(other))
    }
}

impl PartialEq for Reached {
    fn eq(&self, other: &Self) -> bool {
        self.cmp(other) == Ordering::Equal
    }
}

impl Eq for Reached {}

#[cfg(test)]
mod tests {
    use super::*;

    /// A wall at x = 0.5 with a gap near y = 0.9: the way between its sides leads through the gap.
    #[test]
    fn the_highest_way_leads_around_a_wall() {
        let corner = DVector::from_vec(vec![0.0, 0.0]);
        let map = Map::new(&[corner], &[0.0]);
        let score = |place: usize| {
            let place = map.place(place);
            let wall = (place[0] - 0.5).abs() < 0.05 && (place[1] - 0.9).abs() > 0.05;
            if wall { -1.0 } else { place[1] }
        };
        let scores: Vec<f64> = (0..N_PLACES as usize).map(score).collect();
        let [from, to] = [0.2, 0.8].map(|x| map.nearest(&DVector::from_vec(vec![x, 0.5])));
        let way = map.highest_way(&scores, from, to).unwrap();
        assert_eq!((way.places.first(), way.places.last()), (Some(&from), Some(&to)));
        assert!(way.height > 0.4, "{}", way.height);
        let crossing = way.places.iter().find(|&&p| (map.place(p)[0] - 0.5).abs() < 0.05).unwrap();
        assert!((map.place(*crossing)[1] - 0.9).abs() < 0.05);
        for pair in way.places.windows(2) {
            assert!((map.place(pair[0]) - map.place(pair[1])).norm() < 0.06);
        }
    }
}
