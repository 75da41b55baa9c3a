//! The distributions proposals are drawn from, and the density of all of them together.

use std::sync::Arc;

use nalgebra::{DMatrix, DVector};
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, StandardUniform};

use super::super::gaussian::{log_add, log_sum_exp};
use super::super::mixture::Mixture;
use super::super::normals::standard_normal;

/// Samplers kept: beyond them each two neighbours in time become the later one.
const MAX_SAMPLERS: usize = 32;

/// A mixture of whose draws a share is wide: 𝒩(μᵢ, factor²·Σᵢ) instead of 𝒩(μᵢ, Σᵢ).
pub struct Sampler {
    mixture: Mixture,
    wide_share: f64,
    wide_factor: f64,
}

impl Sampler {
    /// `wide_volume` is by how much wide draws enlarge the volume of Σᵢ's ellipsoid, so that they
    /// reach as far in many dimensions as is useful there.
    pub fn new(mixture: Mixture, wide_share: f64, wide_volume: f64) -> Sampler {
        let dim = mixture.components[0].gaussian.dim() as f64;
        Sampler { mixture, wide_share, wide_factor: wide_volume.powf(1.0 / dim) }
    }

    pub fn draw(&self, rng: &mut ChaCha8Rng) -> DVector<f64> {
        let wide: f64 = StandardUniform.sample(rng);
        let component = StandardUniform.sample(rng);
        let scale = if wide < self.wide_share { self.wide_factor } else { 1.0 };
        let dim = self.mixture.components[0].gaussian.dim();
        let z = DVector::from_fn(dim, |_, _| scale * standard_normal(rng));
        self.mixture.draw(component, &z).1
    }

    /// log q(θ) of every column of `thetas` (D×n).
    pub fn log_densities(&self, thetas: &DMatrix<f64>) -> Vec<f64> {
        let narrow = (1.0 - self.wide_share).ln();
        let wide = self.wide_share.ln() - thetas.nrows() as f64 * self.wide_factor.ln();
        let shrink = self.wide_factor.powi(-2);
        // A row of 2K terms for each θ.
        let width = 2 * self.mixture.components.len();
        let mut terms = vec![0.0; width * thetas.ncols()];
        for (i, component) in self.mixture.components.iter().enumerate() {
            let constant = component.prior.ln() + component.gaussian.log_normaliser();
            let distances = component.gaussian.squared_distances(thetas);
            for (row, d2) in terms.chunks_exact_mut(width).zip(distances) {
                row[2 * i] = constant + narrow - 0.5 * d2;
                row[2 * i + 1] = constant + wide - 0.5 * shrink * d2;
            }
        }
        terms.chunks_exact(width).map(log_sum_exp).collect()
    }
}

/// All samplers so far, each with the log of the number of its draws.
#[derive(Default)]
pub struct Past {
    samplers: Vec<(Arc<Sampler>, f64)>,
}

impl Past {
    /// One more draw, from `sampler`; the earlier ones count `log_decay` less.
    pub fn push(&mut self, sampler: Arc<Sampler>, log_decay: f64) {
        self.samplers.iter_mut().for_each(|(_, log_count)| *log_count += log_decay);
        if self.samplers.len() == MAX_SAMPLERS {
            let join =
                |two: &[(Arc<Sampler>, f64)]| (two[1].0.clone(), log_add(two[0].1, two[1].1));
            self.samplers = self.samplers.chunks_exact(2).map(join).collect();
        }
        self.samplers.push((sampler, 0.0));
    }

    /// log Σ q(θ) over the draws.
    pub fn log_density(&self, theta: &DVector<f64>) -> f64 {
        let theta = DMatrix::from_columns(std::slice::from_ref(theta));
        let term = |(sampler, log_count): &(Arc<Sampler>, f64)| {
            log_count + sampler.log_densities(&theta)[0]
        };
        log_sum_exp(&self.samplers.iter().map(term).collect::<Vec<_>>())
    }
}
