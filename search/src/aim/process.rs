//! Gaussian processes that grow by one measured value at a time.
//!
//! With K + σ²I = L Lᵀ and z = L⁻¹y, at a place e: v = L⁻¹k(e), mean vᵀz, variance k(e, e) − vᵀv (Rasmussen
//! and Williams 2006, Alg. 2.1). A further value adds one row to L, one entry to z and one to every v that
//! is kept, so a step costs n operations a place instead of n².

use nalgebra::DVector;

/// Values beyond this are not taken any more: what a process knows by then, it knows.
const MAX_VALUES: usize = 400;

/// k(e, e') = c² + l² e·e' + r² exp(−‖e − e'‖²/2ℓ²): standard deviations of what is the same everywhere, of
/// a slope, and of what is local.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Kernel {
    pub constant: f64,
    pub linear: f64,
    pub local: f64,
    /// ℓ
    pub length: f64,
}

impl Kernel {
    pub fn of(&self, a: &DVector<f64>, b: &DVector<f64>) -> f64 {
        let squared = (0..a.len()).map(|i| (a[i] - b[i]).powi(2)).sum::<f64>();
        let local = (-0.5 * squared / self.length.powi(2)).exp();
        self.constant.powi(2) + self.linear.powi(2) * a.dot(b) + self.local.powi(2) * local
    }
}

/// A process of mean 0 with what was observed of it.
#[derive(Clone, Debug)]
pub struct Process {
    kernel: Kernel,
    /// σ, of what does not repeat.
    noise: f64,
    places: Vec<DVector<f64>>,
    /// L, without its diagonal and with it.
    rows: Vec<Vec<f64>>,
    diagonal: Vec<f64>,
    z: Vec<f64>,
}

/// v of one place, as long as it was needed so far.
pub type Projection = Vec<f64>;

impl Process {
    pub fn new(kernel: Kernel, noise: f64) -> Process {
        let (places, rows, diagonal, z) = (Vec::new(), Vec::new(), Vec::new(), Vec::new());
        Process { kernel, noise, places, rows, diagonal, z }
    }

    /// Takes the value `y` at `e`. Returns its log density, given those before.
    pub fn observe(&mut self, e: &DVector<f64>, y: f64) -> f64 {
        let mut row = Projection::new();
        let (mean, variance) = self.at(e, &mut row);
        let deviation = (variance + self.noise.powi(2)).sqrt();
        let z = (y - mean) / deviation;
        if self.z.len() < MAX_VALUES {
            self.places.push(e.clone());
            self.rows.push(row);
            self.diagonal.push(deviation);
            self.z.push(z);
        }
        -0.5 * z * z - deviation.ln() - 0.5 * std::f64::consts::TAU.ln()
    }

    /// Mean and variance at `e`, without the noise. `projection` is that of `e`, empty at first.
    pub fn at(&self, e: &DVector<f64>, projection: &mut Projection) -> (f64, f64) {
        for i in projection.len()..self.z.len() {
            let known: f64 = self.rows[i].iter().zip(&*projection).map(|(l, v)| l * v).sum();
            projection.push((self.kernel.of(e, &self.places[i]) - known) / self.diagonal[i]);
        }
        let mean = projection.iter().zip(&self.z).map(|(v, z)| v * z).sum();
        let explained: f64 = projection.iter().map(|v| v * v).sum();
        (mean, (self.kernel.of(e, e) - explained).max(0.0))
    }
}

#[cfg(test)]
mod tests {
    use nalgebra::DMatrix;

    use super::*;

    const KERNEL: Kernel = Kernel { constant: 0.3, linear: 0.7, local: 0.5, length: 1.2 };

    fn place(i: usize) -> DVector<f64> {
        DVector::from_fn(3, |j, _| ((i * 7 + j * 5) % 11) as f64 / 5.0 - 1.0)
    }

    /// The textbook's formulas, with dense matrices: k(e)ᵀ(K + σ²I)⁻¹y and k(e, e) − k(e)ᵀ(K + σ²I)⁻¹k(e).
    #[test]
    fn grows_to_what_the_dense_formulas_give() {
        let (n, noise) = (9, 0.1);
        let value = |i: usize| (i as f64).sin();
        let mut process = Process::new(KERNEL, noise);
        let (e, mut projection) = (DVector::from_vec(vec![0.2, -0.4, 0.1]), Projection::new());
        let mut evidence = 0.0;
        for i in 0..n {
            evidence += process.observe(&place(i), value(i));
            process.at(&e, &mut projection);
        }
        let (mean, variance) = process.at(&e, &mut projection);

        let mut k = DMatrix::from_fn(n, n, |i, j| KERNEL.of(&place(i), &place(j)));
        (0..n).for_each(|i| k[(i, i)] += noise * noise);
        let (y, k_e) = (
            DVector::from_fn(n, |i, _| value(i)),
            DVector::from_fn(n, |i, _| KERNEL.of(&place(i), &e)),
        );
        let inverse = k.clone().try_inverse().unwrap();
        assert!((mean - k_e.dot(&(&inverse * &y))).abs() < 1e-10);
        assert!((variance - KERNEL.of(&e, &e) + k_e.dot(&(&inverse * &k_e))).abs() < 1e-10);
        let log = -0.5 * y.dot(&(&inverse * &y))
            - 0.5 * k.determinant().ln()
            - 0.5 * n as f64 * std::f64::consts::TAU.ln();
        assert!((evidence - log).abs() < 1e-9, "{evidence} {log}");
    }

    #[test]
    fn a_value_is_known_where_it_was_observed_and_forgotten_far_away() {
        let local = Kernel { constant: 0.0, linear: 0.0, local: 2.0, length: 1.0 };
        let mut process = Process::new(local, 1e-3);
        let (here, far) = (DVector::zeros(2), DVector::repeat(2, 9.0));
        process.observe(&here, 5.0);
        let (mean, variance) = process.at(&here, &mut Projection::new());
        assert!((mean - 5.0).abs() < 1e-5 && variance < 1e-5);
        let (mean, variance) = process.at(&far, &mut Projection::new());
        assert!(mean.abs() < 1e-9 && (variance - 4.0).abs() < 1e-9);
    }
}
