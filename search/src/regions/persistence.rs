//! Counts peaks by persistence: how far one must descend to reach a higher one.

use nalgebra::{DMatrix, DVector};

/// Trial → the trial that is the peak of its region; `points` in fractions of the box.
///
/// 0-dimensional persistence of the superlevel sets (as in Chazal et al., "Persistence-based
/// clustering in Riemannian manifolds", J. ACM 2013): trials appear in the order of their rewards;
/// each joins the highest region it touches, or is a peak when it touches none; regions that meet
/// there dissolve into the highest one if the meeting point has `ratio` of their peak.
pub fn peaks(points: &[DVector<f64>], rewards: &[f64], ratio: f64) -> Vec<usize> {
    let neighbours = gabriel_graph(points);
    let mut order: Vec<usize> = (0..rewards.len()).collect();
    order.sort_by(|&a, &b| rewards[b].total_cmp(&rewards[a]).then(a.cmp(&b)));
    let mut rank = vec![0; rewards.len()];
    order.iter().enumerate().for_each(|(place, &trial)| rank[trial] = place);

    let mut parent: Vec<usize> = (0..rewards.len()).collect();
    for &saddle in &order {
        let earlier = neighbours[saddle].iter().filter(|&&other| rank[other] < rank[saddle]);
        let met: Vec<usize> = earlier.map(|&other| root(&parent, other)).collect();
        let Some(&highest) = met.iter().min_by_key(|&&peak| rank[peak]) else { continue };
        parent[saddle] = highest;
        for peak in met.into_iter().filter(|&peak| rewards[saddle] >= ratio * rewards[peak]) {
            parent[peak] = highest;
        }
    }
    (0..rewards.len()).map(|trial| root(&parent, trial)).collect()
}

fn root(parent: &[usize], mut trial: usize) -> usize {
    while parent[trial] != trial {
        trial = parent[trial];
    }
    trial
}

/// Joins points when the ball that has their distance as its diameter holds no other: nothing was
/// tried between them. It has no parameter and is connected. O(n³).
fn gabriel_graph(points: &[DVector<f64>]) -> Vec<Vec<usize>> {
    let n = points.len();
    let squared = DMatrix::from_fn(n, n, |a, b| points[a].metric_distance(&points[b]).powi(2));
    let mut neighbours = vec![Vec::new(); n];
    for a in 0..n {
        for b in 0..a {
            if (0..n).all(|c| squared[(a, c)] + squared[(b, c)] >= squared[(a, b)]) {
                neighbours[a].push(b);
                neighbours[b].push(a);
            }
        }
    }
    neighbours
}

#[cfg(test)]
mod tests {
    use super::*;

    fn line(places: &[f64]) -> Vec<DVector<f64>> {
        places.iter().map(|x| DVector::from_vec(vec![*x, 0.1 * x])).collect()
    }

    #[test]
    fn a_point_between_two_takes_their_edge() {
        assert_eq!(gabriel_graph(&line(&[0.0, 1.0])), [[1], [0]]);
        assert_eq!(gabriel_graph(&line(&[0.0, 1.0, 0.4])), [vec![2], vec![2], vec![0, 1]]);
    }

    #[test]
    fn a_peak_counts_when_the_saddle_is_low_enough() {
        let points = line(&[0.0, 1.0, 2.0, 3.0, 4.0]);
        let rewards = [0.2, 1.0, 0.5, 0.8, 0.1];
        assert_eq!(peaks(&points, &rewards, 0.7), [1, 1, 1, 3, 3]);
        assert_eq!(peaks(&points, &rewards, 0.6), [1; 5]);
    }

    #[test]
    fn without_rewards_there_is_one_peak_and_equal_points_are_one_place() {
        assert_eq!(peaks(&line(&[0.0, 1.0, 2.0]), &[0.0; 3], 0.9), [0; 3]);
        assert_eq!(peaks(&line(&[1.0, 1.0, 1.0]), &[0.2, 0.5, 0.3], 0.9), [1; 3]);
    }
}
