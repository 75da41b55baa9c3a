//! Modes found by a search: each with its best reward, its tolerance to errors (Sec. 4) and whether
//! it may be used.

use nalgebra::{DMatrix, DVector, SymmetricEigen};
use serde::{Deserialize, Serialize};

use search::Mode;
use search::trial::Trial;

/// Which mode is exported and activated.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(rename_all = "lowercase")]
pub enum Prefer {
    /// The one with the best trial.
    #[default]
    Best,
    /// The one that loses least when executed with errors.
    Tolerant,
}

/// A mode as it is reported.
#[derive(Clone, Debug, PartialEq)]
pub struct ModeReport {
    /// From 1, by falling prior.
    pub number: usize,
    pub mode: Mode,
    /// Trials that belong to it, by responsibility.
    pub n_trials: usize,
    /// The best of them: rollout and reward.
    pub best: Option<(u64, f64)>,
    /// Expected reward when the mode's policy is executed with noise, the same noise for every
    /// mode: the covariance within the modes, averaged by prior. `None` where no trial is near.
    pub tolerance: Option<f64>,
    pub forbidden: bool,
}

/// The policy of rollout n has the id n; that of mode k after n trials this + 100 n + k.
pub const MODE_POLICY_ID: u64 = 1_000_000;

/// Id of the policy of mode `number`, from 1, as found after `trials`.
pub fn mode_policy_id(trials: u64, number: u64) -> u64 {
    MODE_POLICY_ID + 100 * trials + number
}

/// Trials the tolerance is estimated from, the newest.
const MAX_TRIALS: usize = 1000;
/// Bandwidth of the density of the trials, in units of the noise.
const BANDWIDTH: f64 = 0.5;
/// Sum of kernel values below which no trial counts as near.
const NEAR: f64 = 1e-2;
/// A forbidden place forbids every mode within this many standard deviations of the noise.
const FORBIDDEN_WITHIN: f64 = 1.0;

/// Judges `modes` by the `trials` the search was told; `forbidden` are means of forbidden modes.
pub fn assess(modes: &[Mode], trials: &[Trial], forbidden: &[DVector<f64>]) -> Vec<ModeReport> {
    let whitening = Whitening::of(modes);
    let centres: Vec<DVector<f64>> = modes.iter().map(|mode| whitening.apply(&mode.mean)).collect();
    let trials = &trials[trials.len().saturating_sub(MAX_TRIALS)..];
    let points: Vec<DVector<f64>> = trials.iter().map(|t| whitening.apply(&t.theta)).collect();
    let owners = owners(modes, &whitening, &centres, &points);
    let density = density(&points);

    let mut reports = Vec::new();
    for (index, (mode, centre)) in modes.iter().zip(&centres).enumerate() {
        let own: Vec<&Trial> =
            trials.iter().zip(&owners).filter(|(_, o)| **o == index).map(|(t, _)| t).collect();
        let best = own.iter().copied().reduce(|a, b| if b.reward > a.reward { b } else { a });
        reports.push(ModeReport {
            number: index + 1,
            mode: mode.clone(),
            n_trials: own.len(),
            best: best.map(|trial| (trial.rollout, trial.reward)),
            tolerance: expected_reward(centre, trials, &points, &density),
            forbidden: forbidden.iter().any(|place| whitening.covers(place, centre)),
        });
    }
    reports
}

/// Indices of those among `modes` that a forbidden `place` forbids.
pub fn forbidden_by(place: &DVector<f64>, modes: &[Mode]) -> Vec<usize> {
    let whitening = Whitening::of(modes);
    let is_covered = |i: &usize| whitening.covers(place, &whitening.apply(&modes[*i].mean));
    (0..modes.len()).filter(is_covered).collect()
}

/// The mode to use: the preferred one of those that are allowed; `None` when none is.
pub fn choose<'a>(
    reports: impl IntoIterator<Item = &'a ModeReport>,
    prefer: Prefer,
) -> Option<&'a ModeReport> {
    let merit = |report: &ModeReport| match prefer {
        Prefer::Best => report.best.map(|(_, reward)| reward),
        Prefer::Tolerant => report.tolerance,
    };
    let allowed = reports.into_iter().filter(|report| !report.forbidden);
    // The first of equals: the one with the highest prior.
    allowed.reduce(|a, b| if merit(b) > merit(a) { b } else { a })
}

/// y = W θ, in which the noise common to the modes is white. W = Λ^{-1/2} Vᵀ of
/// Σ_c = Σᵢ πᵢ Σᵢ = V Λ Vᵀ, without the directions in which there is no noise.
struct Whitening(DMatrix<f64>);

impl Whitening {
    fn of(modes: &[Mode]) -> Whitening {
        let dim = modes[0].mean.len();
        let mut common = DMatrix::zeros(dim, dim);
        for mode in modes {
            common += &mode.covariance * mode.prior;
        }
        let eigen = SymmetricEigen::new(common);
        let smallest = 1e-9 * eigen.eigenvalues.max().max(f64::MIN_POSITIVE);
        let kept = (0..dim).filter(|k| eigen.eigenvalues[*k] > smallest);
        let rows: Vec<_> = kept
            .map(|k| eigen.eigenvectors.column(k).transpose() / eigen.eigenvalues[k].sqrt())
            .collect();
        Whitening(if rows.is_empty() { DMatrix::zeros(1, dim) } else { DMatrix::from_rows(&rows) })
    }

    fn apply(&self, theta: &DVector<f64>) -> DVector<f64> {
        &self.0 * theta
    }

    /// A forbidden `place` forbids a mode with this `centre`.
    fn covers(&self, place: &DVector<f64>, centre: &DVector<f64>) -> bool {
        (self.apply(place) - centre).norm() < FORBIDDEN_WITHIN
    }
}

/// For each point the mode with the highest responsibility πᵢ 𝒩(y | cᵢ, W Σᵢ Wᵀ).
fn owners(
    modes: &[Mode],
    whitening: &Whitening,
    centres: &[DVector<f64>],
    points: &[DVector<f64>],
) -> Vec<usize> {
    let factors: Vec<_> = modes
        .iter()
        .map(|mode| {
            let mut covariance = &whitening.0 * &mode.covariance * whitening.0.transpose();
            // A mode may be flat where others are not.
            (0..covariance.nrows()).for_each(|i| covariance[(i, i)] += 1e-6);
            covariance.cholesky()
        })
        .collect();
    let log_joint = |i: usize, point: &DVector<f64>| match &factors[i] {
        Some(factor) => {
            let distance = factor.solve(&(point - &centres[i])).dot(&(point - &centres[i]));
            modes[i].prior.ln() - 0.5 * (distance + factor.ln_determinant())
        }
        None => f64::NEG_INFINITY,
    };
    let owner = |point: &DVector<f64>| {
        (0..modes.len())
            .reduce(|a, b| if log_joint(b, point) > log_joint(a, point) { b } else { a })
            .unwrap_or(0)
    };
    points.iter().map(owner).collect()
}

/// Kernel density of the points at each of them, up to a factor. Of all that a trial costs this grows
/// fastest: every pair is looked at once, without memory of its own.
fn density(points: &[DVector<f64>]) -> Vec<f64> {
    let mut density = vec![0.0; points.len()];
    let mut difference = DVector::zeros(points.first().map_or(0, DVector::len));
    for (i, a) in points.iter().enumerate() {
        for (j, b) in points[..i].iter().enumerate() {
            difference.copy_from(a);
            difference -= b;
            let kernel = (-0.5 * difference.norm_squared() / (BANDWIDTH * BANDWIDTH)).exp();
            density[i] += kernel;
            density[j] += kernel;
        }
        density[i] += 1.0;
    }
    density
}

/// E r(y), y ~ 𝒩(c, I), by self-normalised importance sampling over the trials.
fn expected_reward(
    centre: &DVector<f64>,
    trials: &[Trial],
    points: &[DVector<f64>],
    density: &[f64],
) -> Option<f64> {
    let (mut near, mut weights, mut sum) = (0.0, 0.0, 0.0);
    for ((trial, point), density) in trials.iter().zip(points).zip(density) {
        let kernel = (-0.5 * (point - centre).norm_squared()).exp();
        near += kernel;
        weights += kernel / density;
        sum += kernel / density * trial.reward;
    }
    (near > NEAR).then(|| sum / weights)
}

#[cfg(test)]
mod tests {
    use super::*;
    use search::normals::{standard_normal, stream};

    /// A narrow high hill at 0 and a wide lower one at 10.
    fn reward(theta: &DVector<f64>) -> f64 {
        let hill = |centre: f64, width: f64| {
            let d2 = (theta[0] - centre).powi(2) + theta[1].powi(2);
            (-0.5 * d2 / (width * width)).exp()
        };
        hill(0.0, 0.3) + 0.8 * hill(10.0, 2.0)
    }

    fn setting() -> (Vec<Mode>, Vec<Trial>) {
        let mode = |x: f64, prior: f64, variance: f64| Mode {
            prior,
            mean: DVector::from_vec(vec![x, 0.0]),
            covariance: DMatrix::from_diagonal_element(2, 2, variance),
        };
        let modes = vec![mode(10.0, 0.6, 2.0), mode(0.0, 0.4, 0.05)];
        let mut rng = stream(1, 1);
        let trials = (1..=400).map(|rollout| {
            let x = if rollout % 2 == 0 { 0.0 } else { 10.0 };
            let noise = DVector::from_fn(2, |_, _| 1.5 * standard_normal(&mut rng));
            let theta = DVector::from_vec(vec![x, 0.0]) + noise;
            Trial { rollout, reward: reward(&theta), theta, success: false, measured: Vec::new() }
        });
        (modes, trials.collect())
    }

    #[test]
    fn the_wide_hill_is_tolerant_and_the_narrow_one_is_best() {
        let (modes, trials) = setting();
        let reports = assess(&modes, &trials, &[]);
        assert_eq!(reports.iter().map(|r| r.n_trials).sum::<usize>(), 400);
        assert_eq!(choose(&reports, Prefer::Tolerant).unwrap().number, 1);
        assert_eq!(choose(&reports, Prefer::Best).unwrap().number, 2);
        // The exact expectation at the wide hill: 0.8·4/(4 + s²), s² = 0.6·2 + 0.4·0.05.
        let expected = 0.8 * 4.0 / (4.0 + 1.22);
        let found = reports[0].tolerance.unwrap();
        assert!((found - expected).abs() < 0.06, "{found} instead of {expected}");
        assert!(reports[1].tolerance.unwrap() < 0.35);
    }

    #[test]
    fn the_density_is_the_sum_of_all_kernels_to_the_last_bit() {
        let points: Vec<_> = setting().1.into_iter().map(|trial| trial.theta).collect();
        let kernel = |a: &DVector<f64>, b: &DVector<f64>| {
            (-0.5 * (a - b).norm_squared() / (BANDWIDTH * BANDWIDTH)).exp()
        };
        let sum = |a| points.iter().map(|b| kernel(a, b)).sum();
        assert_eq!(density(&points), points.iter().map(sum).collect::<Vec<f64>>());
    }

    #[test]
    fn a_forbidden_mode_gives_way_to_the_next_best() {
        let (modes, trials) = setting();
        let place = DVector::from_vec(vec![0.2, -0.1]);
        let reports = assess(&modes, &trials, &[place]);
        assert_eq!(reports.iter().map(|r| r.forbidden).collect::<Vec<_>>(), [false, true]);
        assert_eq!(choose(&reports, Prefer::Best).unwrap().number, 1);
        let near = DVector::from_vec(vec![10.1, 0.0]);
        assert_eq!(forbidden_by(&near, &modes), [0], "what `assess` says, for one place");
        let all = [DVector::from_vec(vec![0.0, 0.0]), DVector::from_vec(vec![10.0, 0.0])];
        assert_eq!(choose(&assess(&modes, &trials, &all), Prefer::Best), None);
    }

    #[test]
    fn flat_modes_and_no_trials_are_no_problem() {
        let flat = Mode {
            prior: 1.0,
            mean: DVector::zeros(3),
            covariance: DMatrix::from_diagonal(&DVector::from_vec(vec![1.0, 0.0, 0.0])),
        };
        let reports = assess(&[flat], &[], &[]);
        assert_eq!((reports[0].best, reports[0].tolerance), (None, None));
        assert_eq!(choose(&reports, Prefer::Tolerant).unwrap().number, 1);
    }
}
