//! A map of the box: what is believed of places everywhere, and how high ways between them lead.

use std::cell::OnceCell;
use std::cmp::Ordering;
use std::collections::BinaryHeap;

use nalgebra::DVector;

use super::lanes::{LANES, Lanes};
use super::surrogate::{Belief, Conditioned, Surrogate};
use crate::filling::Filling;

/// Places of the map; in two dimensions they are 0.02 widths of the box apart.
const N_PLACES: u64 = 3000;
/// A way leads from a place to one of so many nearest ones.
const N_NEIGHBOURS: usize = 8;

/// Places that fill the box evenly, joined to their neighbours, under a [`Surrogate`] of the trials.
pub struct Map {
    surrogate: Surrogate,
    conditioned: Conditioned,
    places: Vec<DVector<f64>>,
    /// Found when a way first leads to the place; many places are never reached.
    neighbours: Vec<OnceCell<Vec<usize>>>,
    /// The same places; [`Map::beliefs`] whitens them.
    lanes: Vec<Lanes>,
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
        let surrogate = Surrogate::fit(points, values);
        Map {
            conditioned: surrogate.condition(values),
            surrogate,
            neighbours: vec![OnceCell::new(); places.len()],
            lanes: places.chunks(LANES).map(Lanes::new).collect(),
            places,
        }
    }

    /// Adds a trial; `values` are those of all trials.
    pub fn push(&mut self, point: DVector<f64>, values: &[f64]) {
        self.surrogate.push(&[point]);
        self.conditioned = self.surrogate.condition(values);
    }

    /// What is believed of any points.
    pub fn beliefs_at(&self, points: &[DVector<f64>]) -> Vec<Belief> {
        beliefs(&self.surrogate, &self.conditioned, points)
    }

    /// The same if each of the `pending` points had the value that is expected there; `values` are those of all
    /// trials.
    pub fn beliefs_beside(
        &self,
        pending: &[DVector<f64>],
        values: &[f64],
        points: &[DVector<f64>],
    ) -> Vec<Belief> {
        if pending.is_empty() {
            return self.beliefs_at(points);
        }
        let expected = self.beliefs_at(pending).into_iter().map(|belief| belief.mean);
        let values: Vec<f64> = values.iter().copied().chain(expected).collect();
        let mut surrogate = self.surrogate.clone();
        pending.chunks(LANES).for_each(|points| surrogate.push(points));
        beliefs(&surrogate, &surrogate.condition(&values), points)
    }

    /// What is believed of each place.
    pub fn beliefs(&mut self) -> Vec<Belief> {
        let believed = self.lanes.iter_mut().flat_map(|lanes| {
            self.surrogate.whiten(lanes);
            self.conditioned.at(lanes)
        });
        believed.take(self.places.len()).collect()
    }

    pub fn place(&self, place: usize) -> &DVector<f64> {
        &self.places[place]
    }

    fn distances(&self, point: &DVector<f64>) -> impl Iterator<Item = (f64, usize)> {
        let distances = self.lanes.iter().flat_map(|lanes| lanes.distances(point));
        distances.take(self.places.len()).zip(0..)
    }

    /// The place nearest to `point`; the first of equals.
    pub fn nearest(&self, point: &DVector<f64>) -> usize {
        self.distances(point).min_by(|a, b| a.0.total_cmp(&b.0)).expect("a map has places").1
    }

    /// The nearest places, `place` itself aside.
    fn neighbours(&self, place: usize) -> &[usize] {
        self.neighbours[place].get_or_init(|| {
            let mut others: Vec<(f64, usize)> = self.distances(&self.places[place]).collect();
            others.select_nth_unstable_by(N_NEIGHBOURS, |a, b| a.0.total_cmp(&b.0));
            others.truncate(N_NEIGHBOURS + 1);
            others.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
            others.into_iter().skip(1).map(|(_, i)| i).collect()
        })
    }

    /// The way between two places whose lowest score is highest; `None` if there is none of at least
    /// the height `least`.
    pub fn highest_way(&self, scores: &[f64], least: f64, [from, to]: [usize; 2]) -> Option<Way> {
        let mut height = vec![f64::NEG_INFINITY; scores.len()];
        let mut before = vec![None; scores.len()];
        height[from] = f64::INFINITY;
        let mut reached = BinaryHeap::from([Reached { height: f64::INFINITY, place: from }]);
        while let Some(Reached { height: so_far, place }) = reached.pop() {
            if place == to {
                break;
            }
            for &next in self.neighbours(place) {
                let score = if next == to { f64::INFINITY } else { scores[next] };
                if so_far.min(score) > height[next] && so_far.min(score) >= least {
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

fn beliefs(
    surrogate: &Surrogate,
    conditioned: &Conditioned,
    points: &[DVector<f64>],
) -> Vec<Belief> {
    let believed = points.chunks(LANES).flat_map(|points| {
        let mut lanes = Lanes::new(points);
        surrogate.whiten(&mut lanes);
        conditioned.at(&lanes).into_iter().take(points.len())
    });
    believed.collect()
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
        let way = map.highest_way(&scores, f64::NEG_INFINITY, [from, to]).unwrap();
        assert_eq!((way.places.first(), way.places.last()), (Some(&from), Some(&to)));
        assert!(way.height > 0.4, "{}", way.height);
        let crossing = way.places.iter().find(|&&p| (map.place(p)[0] - 0.5).abs() < 0.05).unwrap();
        assert!((map.place(*crossing)[1] - 0.9).abs() < 0.05);
        for pair in way.places.windows(2) {
            assert!((map.place(pair[0]) - map.place(pair[1])).norm() < 0.06);
        }
        // A bound leaves out what is lower and changes nothing else.
        assert_eq!(map.highest_way(&scores, way.height, [from, to]), Some(way.clone()));
        assert_eq!(map.highest_way(&scores, way.height + 1e-9, [from, to]), None);
    }
}
