//! Velocities a field is to have: along the recordings, and around them.

use nalgebra::{DMatrix, DVector};
use search::normals::{standard_normal, stream};

/// Stream of the seed that places around the recordings are drawn from.
const STREAM: u64 = (1 << 32) + 1;
/// Distances of the places drawn around each sample, in units of the recordings' size, and their weights
/// relative to each other.
const AROUND: [(f64, f64); 3] = [(0.15, 1.0), (0.5, 0.1), (1.5, 0.1)];
/// Beside a recording the motion turns back to it by this much of a direction per distance …
const RETURN: f64 = 5.0;
/// … and less within this distance of the target, about which all recordings lie in one direction.
const NEAR_TARGET: f64 = 0.24;
/// Beside a slow part of a recording the motion need not be slower than this, in units of the recordings'
/// speed, at this distance from it.
const RETURN_SPEED: f64 = 0.3;
const RETURN_DISTANCE: f64 = 0.08;
/// About the target, at this distance and for every so many samples of the recordings, the motion leads
/// straight to it, at this rate in units of the recordings' speed by their size.
const ARRIVAL: f64 = 0.1;
const ARRIVALS: usize = 5;
const ARRIVAL_RATE: f64 = 2.0;

/// Places and the velocities there, in units of the recordings' size and speed, with weights that sum to one.
#[derive(Clone, Debug)]
pub(super) struct Samples {
    /// d×N.
    pub places: DMatrix<f64>,
    /// d×N.
    pub velocities: DMatrix<f64>,
    pub weights: Vec<f64>,
}

impl Samples {
    /// Those along the recordings (d×N each), and at two places around each of them: there the motion goes
    /// as at the nearest sample, and towards it. Without these, a field learns nothing of what it does a
    /// little beside its recordings. They weigh `weight` beside the recordings.
    pub fn around(
        places: &DMatrix<f64>,
        velocities: &DMatrix<f64>,
        weight: f64,
        seed: u64,
    ) -> Samples {
        let (d, n) = places.shape();
        let mut rng = stream(seed, STREAM);
        let n_arrivals = n / ARRIVALS;
        let total = n * (1 + AROUND.len()) + n_arrivals;
        let mut all = Samples {
            places: places.clone().resize_horizontally(total, 0.0),
            velocities: velocities.clone().resize_horizontally(total, 0.0),
            weights: vec![1.0; n],
        };
        // As far on average in any number of coordinates.
        let coordinate = (2.0 / d as f64).sqrt();
        for (ring, (distance, share)) in AROUND.into_iter().enumerate() {
            let distance = distance * coordinate;
            for k in 0..n {
                let mut place = places.column(k).clone_owned();
                place.iter_mut().for_each(|x| *x += distance * standard_normal(&mut rng));
                let nearest = nearest(places, &place);
                let off = &place - places.column(nearest);
                let speed = velocities.column(nearest).norm();
                let near_target = (place.norm() / NEAR_TARGET).min(1.0);
                let mut direction = velocities.column(nearest) / speed.max(1e-3);
                direction -= &off * (RETURN * near_target);
                direction /= direction.norm().max(1.0);
                let returning = RETURN_SPEED * (off.norm() / RETURN_DISTANCE).min(1.0);
                let column = n * (1 + ring) + k;
                all.velocities.set_column(column, &(direction * speed.max(returning)));
                all.places.set_column(column, &place);
                all.weights.push(weight * share);
            }
        }
        for column in total - n_arrivals..total {
            let place =
                DVector::from_fn(d, |_, _| ARRIVAL * coordinate * standard_normal(&mut rng));
            all.velocities.set_column(column, &(&place * -ARRIVAL_RATE));
            all.places.set_column(column, &place);
            all.weights.push(weight);
        }
        let sum: f64 = all.weights.iter().sum();
        all.weights.iter_mut().for_each(|weight| *weight /= sum);
        all
    }
}

fn nearest(places: &DMatrix<f64>, to: &DVector<f64>) -> usize {
    let distance = |k: usize| (places.column(k) - to).norm_squared();
    (1..places.ncols()).fold(0, |best, k| if distance(k) < distance(best) { k } else { best })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn beside_a_line_the_motion_leads_along_and_towards_it() {
        let line = DMatrix::from_fn(2, 50, |c, k| if c == 0 { 2.0 - k as f64 / 25.0 } else { 0.0 });
        let along = DMatrix::from_fn(2, 50, |c, _| if c == 0 { -1.0 } else { 0.0 });
        let samples = Samples::around(&line, &along, 1.0, 4);
        assert_eq!(samples.places.ncols(), 50 + 150 + 10);
        assert!((samples.weights.iter().sum::<f64>() - 1.0).abs() < 1e-12);
        for k in 50..200 {
            let (place, velocity) = (samples.places.column(k), samples.velocities.column(k));
            assert!(place[1] * velocity[1] <= 0.0, "{place} {velocity}");
            assert!(velocity.norm() <= 1.0 + 1e-12);
        }
        assert_eq!(samples.places, Samples::around(&line, &along, 1.0, 4).places);
    }
}
