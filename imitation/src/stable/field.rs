//! The field as a fit evaluates it, some million times, and its derivatives by everything it is made of.

/// f(x) = Σᵢ hᵢ(x) Aᵢx with hᵢ ∝ exp(cᵢ − ½(x−μᵢ)ᵀΛᵢ(x−μᵢ)), the target in the origin; or, entry by entry,
/// the derivatives of a number by these.
///
/// Matrices are lists of rows, component after component.
#[derive(Clone, Debug)]
pub(super) struct Field {
    /// d.
    pub d: usize,
    /// cᵢ: the logarithms of what the weights are at their centres (K).
    pub peaks: Vec<f64>,
    /// μᵢ (K·d).
    pub centers: Vec<f64>,
    /// Λᵢ = Σᵢ⁻¹ (K·d·d), symmetric.
    pub precisions: Vec<f64>,
    /// Aᵢ (K·d·d), 1/s.
    pub A: Vec<f64>,
}

/// What is found at a place x, and needed there again.
#[derive(Clone, Debug)]
pub(super) struct Evaluation {
    /// f(x) (d).
    pub f: Vec<f64>,
    /// hᵢ(x) (K).
    h: Vec<f64>,
    /// Aᵢx (K·d).
    velocities: Vec<f64>,
    /// Λᵢ(x−μᵢ) (K·d).
    pulls: Vec<f64>,
}

impl Field {
    /// All zeros: what derivatives are added to.
    pub fn zeros(d: usize, k: usize) -> Field {
        Field {
            d,
            peaks: vec![0.0; k],
            centers: vec![0.0; k * d],
            precisions: vec![0.0; k * d * d],
            A: vec![0.0; k * d * d],
        }
    }

    /// K.
    pub fn k(&self) -> usize {
        self.peaks.len()
    }

    /// Room for what is found at a place.
    pub fn evaluation(&self) -> Evaluation {
        let (k, d) = (self.k(), self.d);
        Evaluation {
            f: vec![0.0; d],
            h: vec![0.0; k],
            velocities: vec![0.0; k * d],
            pulls: vec![0.0; k * d],
        }
    }

    /// f(x), into `at`.
    pub fn evaluate(&self, x: &[f64], at: &mut Evaluation) {
        let d = self.d;
        let mut highest = f64::NEG_INFINITY;
        for i in 0..self.k() {
            let (matrix, vector) = (i * d * d, i * d);
            let mut squared = 0.0;
            for r in 0..d {
                let (mut pull, mut velocity) = (0.0, 0.0);
                for (c, x) in x.iter().enumerate() {
                    let entry = matrix + r * d + c;
                    pull += self.precisions[entry] * (x - self.centers[vector + c]);
                    velocity += self.A[entry] * x;
                }
                squared += pull * (x[r] - self.centers[vector + r]);
                at.pulls[vector + r] = pull;
                at.velocities[vector + r] = velocity;
            }
            at.h[i] = self.peaks[i] - 0.5 * squared;
            highest = highest.max(at.h[i]);
        }
        at.h.iter_mut().for_each(|h| *h = (*h - highest).exp());
        let sum: f64 = at.h.iter().sum();
        at.f.fill(0.0);
        for i in 0..self.k() {
            at.h[i] /= sum;
            for r in 0..d {
                at.f[r] += at.h[i] * at.velocities[i * d + r];
            }
        }
    }

    /// Chain rule: adds to `by_field` and `by_x` what a number changes by, if it changes by `by_f` (d) with
    /// f(x). `at` is what `evaluate` found at x.
    pub fn pull_back(
        &self,
        x: &[f64],
        at: &Evaluation,
        by_f: &[f64],
        by_field: &mut Field,
        by_x: &mut [f64],
    ) {
        let d = self.d;
        let dot = |a: &[f64]| a.iter().zip(by_f).map(|(a, b)| a * b).sum::<f64>();
        let mean = dot(&at.f);
        for i in 0..self.k() {
            let (matrix, vector) = (i * d * d, i * d);
            // ∂hₖ/∂(log hᵢ) = hₖ(δₖᵢ − hᵢ).
            let by_log = at.h[i] * (dot(&at.velocities[vector..vector + d]) - mean);
            by_field.peaks[i] += by_log;
            for r in 0..d {
                let pull = by_log * at.pulls[vector + r];
                by_field.centers[vector + r] += pull;
                by_x[r] -= pull;
                let by_velocity = at.h[i] * by_f[r];
                let half = -0.5 * by_log * (x[r] - self.centers[vector + r]);
                for c in 0..d {
                    let entry = matrix + r * d + c;
                    by_field.A[entry] += by_velocity * x[c];
                    by_x[c] += by_velocity * self.A[entry];
                    by_field.precisions[entry] += half * (x[c] - self.centers[vector + c]);
                }
            }
        }
    }
}
