//! Numbers without constraints that stand for certified fields only.

use nalgebra::{DMatrix, DVector};

use super::field::Field;

/// No weight is narrower than this, in units of the recordings' size.
const NARROWEST: f64 = 0.06;

/// How a vector θ of any numbers is read as a field that ends in the origin. With P = LLᵀ,
///
/// Aᵢ = L⁻ᵀ Ãᵢ Lᵀ,  Ãᵢ = −sᵢ Bᵢ(I − Zᵢ)Bᵢᵀ − εI,  Σᵢ = GᵢGᵢᵀ + σ²I,
///
/// where L, Bᵢ and Gᵢ are lower triangular with positive diagonals and Zᵢ is skew. The symmetric part of Ãᵢ
/// is −(sᵢBᵢBᵢᵀ + εI) ≺ 0, so that every θ has a certificate. In the terms of `Certificate::damping`,
/// N = sBBᵀ + εI and W = sBZBᵀ, so that N + WᵀN⁻¹W ≼ sB(I + ZᵀZ)Bᵀ + εI; and with
///
/// sᵢ = 1/(1 + tᵢ/(λ−ε)),  tᵢ = tr Bᵢ(I + ZᵢᵀZᵢ)Bᵢᵀ,
///
/// that is ≺ λI: the motion driven with damping λ is certified too. λ = ∞ asks for nothing, s = 1.
#[derive(Clone, Copy, Debug)]
pub(super) struct Parameters {
    pub d: usize,
    pub k: usize,
    /// λ > ε.
    pub damping: f64,
    /// ε > 0.
    pub slowest: f64,
}

/// What θ stands for.
#[derive(Clone, Debug)]
pub(super) struct Model {
    /// L (d×d).
    pub L: DMatrix<f64>,
    pub components: Vec<Component>,
}

#[derive(Clone, Debug)]
pub(super) struct Component {
    /// log πᵢ, up to a constant that all share.
    pub log_prior: f64,
    /// μᵢ (d).
    pub center: DVector<f64>,
    /// Gᵢ (d×d).
    pub G: DMatrix<f64>,
    /// Bᵢ and Zᵢ (d×d).
    pub B: DMatrix<f64>,
    pub Z: DMatrix<f64>,
}

impl Parameters {
    /// Entries of a triangular and of a skew matrix.
    fn sizes(&self) -> (usize, usize) {
        (self.d * (self.d + 1) / 2, self.d * (self.d - 1) / 2)
    }

    /// Length of θ.
    pub fn len(&self) -> usize {
        let (triangle, skew) = self.sizes();
        triangle + self.k * (1 + self.d + 2 * triangle + skew)
    }

    /// θ of a model.
    pub fn pack(&self, model: &Model) -> DVector<f64> {
        let mut theta = Vec::with_capacity(self.len());
        push_triangle(&model.L, &mut theta);
        for component in &model.components {
            theta.push(component.log_prior);
            theta.extend(component.center.iter());
            push_triangle(&component.G, &mut theta);
            push_triangle(&component.B, &mut theta);
            push_skew(&component.Z, &mut theta);
        }
        DVector::from_vec(theta)
    }

    /// The model of θ.
    pub fn unpack(&self, theta: &DVector<f64>) -> Model {
        let mut entries = theta.iter().copied();
        let L = triangle(self.d, &mut entries);
        let component = |_| Component {
            log_prior: entries.next().unwrap_or_default(),
            center: DVector::from_fn(self.d, |_, _| entries.next().unwrap_or_default()),
            G: triangle(self.d, &mut entries),
            B: triangle(self.d, &mut entries),
            Z: skew(self.d, &mut entries),
        };
        Model { L, components: (0..self.k).map(component).collect() }
    }

    /// Ãᵢ: a system in coordinates in which V is the squared distance.
    pub fn in_metric(&self, component: &Component) -> DMatrix<f64> {
        let Component { B, Z, .. } = component;
        let I = DMatrix::<f64>::identity(self.d, self.d);
        -(B * (&I - Z) * B.transpose()) * self.shrink(component) - I * self.slowest
    }

    /// Bᵢ and Zᵢ for which Ãᵢ has the symmetric part −N and the skew part W, before it is shrunk.
    pub fn factors(
        &self,
        N: DMatrix<f64>,
        W: &DMatrix<f64>,
    ) -> Option<(DMatrix<f64>, DMatrix<f64>)> {
        let B = N.cholesky()?.unpack();
        let half = B.solve_lower_triangular(W)?;
        let Z = B.solve_lower_triangular(&half.transpose())?.transpose();
        Some((B, Z))
    }

    /// sᵢ.
    fn shrink(&self, component: &Component) -> f64 {
        let Component { B, Z, .. } = component;
        let turned = B * Z.transpose();
        1.0 / (1.0 + (B.norm_squared() + turned.norm_squared()) / (self.damping - self.slowest))
    }

    /// Σᵢ.
    pub fn covariance(&self, component: &Component) -> DMatrix<f64> {
        let G = &component.G;
        G * G.transpose() + DMatrix::from_diagonal_element(self.d, self.d, NARROWEST * NARROWEST)
    }

    /// The field of a model; `None` where numbers overflow.
    pub fn field(&self, model: &Model) -> Option<Field> {
        let (d, k) = (self.d, self.k);
        let mut field = Field::zeros(d, k);
        for (i, component) in model.components.iter().enumerate() {
            let covariance = self.covariance(component).cholesky()?;
            let log_determinant = 2.0 * covariance.l_dirty().diagonal().map(f64::ln).sum();
            field.peaks[i] = component.log_prior - 0.5 * log_determinant;
            field.centers[i * d..(i + 1) * d].copy_from_slice(component.center.as_slice());
            write(&covariance.inverse(), &mut field.precisions[i * d * d..]);
            let A = from_metric(&model.L, &self.in_metric(component))?;
            write(&A, &mut field.A[i * d * d..]);
        }
        Some(field)
    }

    /// Chain rule: the derivatives of a number by θ, from those by the field of `model`.
    pub fn pull_back(&self, model: &Model, field: &Field, by_field: &Field) -> DVector<f64> {
        let (d, k) = (self.d, self.k);
        let mut by_L = DMatrix::zeros(d, d);
        let mut by_theta = vec![0.0; self.sizes().0];
        for i in 0..k {
            let component = &model.components[i];
            let read =
                |rows: &[f64]| DMatrix::from_row_slice(d, d, &rows[i * d * d..(i + 1) * d * d]);
            by_theta.push(by_field.peaks[i]);
            by_theta.extend(&by_field.centers[i * d..(i + 1) * d]);

            // Λ = Σ⁻¹ and c = log π − ½ log|Σ|.
            let precision = read(&field.precisions);
            let by_covariance = -(&precision * read(&by_field.precisions) * &precision)
                - &precision * (0.5 * by_field.peaks[i]);
            let by_G = (&by_covariance + by_covariance.transpose()) * &component.G;
            push_triangle_slope(&component.G, &by_G, &mut by_theta);

            // M A = Ã M with M = Lᵀ.
            let by_A = read(&by_field.A);
            let A = read(&field.A);
            let Some(solved) = model.L.solve_lower_triangular(&by_A) else {
                return DVector::from_element(self.len(), f64::NAN);
            };
            let by_metric = &solved * &model.L;
            by_L += self.in_metric(component).tr_mul(&solved).transpose() - A * solved.transpose();
            self.pull_back_system(component, &by_metric, &mut by_theta);
        }
        let mut first = Vec::new();
        push_triangle_slope(&model.L, &by_L, &mut first);
        by_theta[..first.len()].copy_from_slice(&first);
        DVector::from_vec(by_theta)
    }

    /// The derivatives by Bᵢ and Zᵢ, from those by Ãᵢ.
    fn pull_back_system(&self, component: &Component, by: &DMatrix<f64>, by_theta: &mut Vec<f64>) {
        let Component { B, Z, .. } = component;
        let I = DMatrix::<f64>::identity(self.d, self.d);
        let (open, s) = (&I - Z, self.shrink(component));
        let mut by_B = -(by * B * open.transpose() + by.tr_mul(B) * &open) * s;
        let mut by_Z = B.tr_mul(by) * B * s;
        let by_s = -by.dot(&(B * &open * B.transpose()));
        let by_trace = -by_s * s * s / (self.damping - self.slowest);
        by_B += B * (I + Z.tr_mul(Z)) * (2.0 * by_trace);
        by_Z += Z * B.tr_mul(B) * (2.0 * by_trace);
        push_triangle_slope(B, &by_B, by_theta);
        push_skew(&(&by_Z - by_Z.transpose()), by_theta);
    }
}

/// L⁻ᵀ Ã Lᵀ.
pub(super) fn from_metric(L: &DMatrix<f64>, in_metric: &DMatrix<f64>) -> Option<DMatrix<f64>> {
    L.tr_solve_lower_triangular(&(in_metric * L.transpose()))
}

fn write(matrix: &DMatrix<f64>, rows: &mut [f64]) {
    rows.iter_mut().zip(matrix.transpose().iter()).for_each(|(to, from)| *to = *from);
}

/// A lower triangular matrix, row by row, with the logarithms of its diagonal.
fn triangle(d: usize, entries: &mut impl Iterator<Item = f64>) -> DMatrix<f64> {
    let mut matrix = DMatrix::zeros(d, d);
    for r in 0..d {
        for c in 0..=r {
            let entry = entries.next().unwrap_or_default();
            matrix[(r, c)] = if r == c { entry.exp() } else { entry };
        }
    }
    matrix
}

fn push_triangle(matrix: &DMatrix<f64>, entries: &mut Vec<f64>) {
    for r in 0..matrix.nrows() {
        entries.extend((0..=r).map(|c| if r == c { matrix[(r, c)].ln() } else { matrix[(r, c)] }));
    }
}

/// Derivatives by the entries of a triangle, from those `by` its matrix.
fn push_triangle_slope(matrix: &DMatrix<f64>, by: &DMatrix<f64>, entries: &mut Vec<f64>) {
    for r in 0..matrix.nrows() {
        let slope = |c| if r == c { by[(r, c)] * matrix[(r, c)] } else { by[(r, c)] };
        entries.extend((0..=r).map(slope));
    }
}

/// A skew matrix, from what is below its diagonal, row by row.
fn skew(d: usize, entries: &mut impl Iterator<Item = f64>) -> DMatrix<f64> {
    let mut matrix = DMatrix::zeros(d, d);
    for r in 0..d {
        for c in 0..r {
            let entry = entries.next().unwrap_or_default();
            matrix[(r, c)] = entry;
            matrix[(c, r)] = -entry;
        }
    }
    matrix
}

/// What is below the diagonal: of a skew matrix its entries; of by − byᵀ the derivatives by them.
fn push_skew(matrix: &DMatrix<f64>, entries: &mut Vec<f64>) {
    for r in 0..matrix.nrows() {
        entries.extend((0..r).map(|c| matrix[(r, c)]));
    }
}

#[cfg(test)]
mod tests;
