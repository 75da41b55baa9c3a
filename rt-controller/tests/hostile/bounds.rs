//! The bounds of a policy once more, as documented and not as implemented: definiteness by
//! elimination instead of eigenvalues, reach from the places of the joints.

use physics::arm::{ArmModel, JointVector, kinematics};
use shm_types::policy::{Component, PolicyMsg};
use shm_types::{MAX_COMPONENTS, SCHEMA, TASK_DIM};

use super::fields;

/// What the bounds depend on.
pub struct Arm {
    pub shoulder: [f64; 3],
    pub farthest_m: f64,
    pub longest_s: f64,
}

impl Arm {
    /// With settings of 1 kHz and `settle_s`.
    pub fn new(model: &ArmModel, settle_s: f64) -> Arm {
        let q = JointVector::zeros();
        let joints = &kinematics::body_poses(model, &q)[..model.n_joints()];
        let mut places: Vec<_> = joints.iter().map(|pose| pose.translation.vector).collect();
        places.push(kinematics::tip_pose(model, &q).translation.vector);
        let reach: f64 = places.windows(2).map(|pair| (pair[1] - pair[0]).norm()).sum();
        let shoulder = [places[0].x, places[0].y, places[0].z];
        // 4000 records of 1 ms, two of them for the ends.
        Arm { shoulder, farthest_m: 2.0 * reach, longest_s: 3.998 - settle_s }
    }

    /// Too far from the shoulder.
    pub fn is_beyond(&self, x: &[f64; TASK_DIM], slack: f64) -> bool {
        let away = |i: usize| x[i] - self.shoulder[i];
        let distance = (away(0).powi(2) + away(1).powi(2) + away(2).powi(2)).sqrt();
        distance > self.farthest_m * (1.0 + slack)
    }
}

/// The bound that `policy` violates, if any. Bounds that are computed are widened by the share
/// `slack`, or narrowed when it is negative.
pub fn violation(policy: &PolicyMsg, arm: &Arm, slack: f64) -> Option<String> {
    let mut broken = None;
    let mut must = |holds: bool, what: &str| {
        if !holds && broken.is_none() {
            broken = Some(what.to_string());
        }
    };
    must(policy.schema == SCHEMA, "schema");
    must(policy.digest == policy.compute_digest(), "digest");
    must([3, 4, 6].contains(&policy.task_dim), "task_dim");
    let counts = 1..=MAX_COMPONENTS as u32;
    let (springs, systems) = (policy.n_components, policy.n_systems);
    let is_one_kind =
        (counts.contains(&springs) && systems == 0) || (counts.contains(&systems) && springs == 0);
    must(is_one_kind, "n_components or n_systems");
    let most = u32::from(systems > 0);
    must(policy.activation <= 1 + most && policy.output <= most, "activation or output");
    must(policy.orientation <= 1, "orientation");
    must(policy.n_actions == 0, "n_actions");
    must(policy.duration_s >= 0.05, "shortest duration");
    must(policy.duration_s <= arm.longest_s + slack, "longest duration");
    must(policy.decay_rate >= if policy.activation == 1 { 1e-3 } else { 0.0 }, "slowest decay");
    must(policy.decay_rate <= 1e3, "fastest decay");
    must(policy.damping >= 0.0 && policy.damping <= 1e3, "damping");
    let ratio = policy.damping_ratio;
    must((0.0..=10.0).contains(&ratio), "damping ratio");
    let (k, d) = (policy.orientation_stiffness, policy.orientation_damping);
    must((0.0..=1e5).contains(&k) && (0.0..=1e3).contains(&d), "orientation gains");
    let slowest = f64::from(policy.output);
    must(policy.following >= slowest && policy.following <= 500.0, "following");
    must(policy.target.iter().all(|x| x.abs() <= 100.0), "target");
    must(policy.certificate.iter().all(|x| x.abs() <= 1e6), "certificate entry");
    if broken.is_some() {
        return broken;
    }
    if systems > 0 {
        return fields::violation(policy, arm, slack);
    }
    let used = &policy.components[..policy.n_components as usize];
    used.iter().find_map(|one| of_component(one, policy.task_dim as usize, ratio, arm, slack))
}

fn of_component(
    component: &Component,
    d: usize,
    ratio: f64,
    arm: &Arm,
    slack: f64,
) -> Option<String> {
    let within = |x: f64, min: f64, max: f64| x.is_finite() && x >= min && x <= max;
    let Component { center, width, attractor, stiffness } = component;
    if !within(*center, -30.0, 60.0) || !within(*width, 1e-4, 30.0) {
        return Some(format!("center {center}, width {width}"));
    }
    if let Some(x) = attractor.iter().find(|x| !within(**x, -100.0, 100.0)) {
        return Some(format!("attractor {x}"));
    }
    if let Some(x) = stiffness.iter().find(|x| !within(**x, -1e6, 1e6)) {
        return Some(format!("stiffness {x}"));
    }
    if arm.is_beyond(attractor, slack) {
        return Some(format!("attractor {attractor:?} too far from the shoulder"));
    }
    // λ within [1e-3, 5e4], and 2ζ√λ at most 1e3: both K − λ_min·1 and λ_max·1 − K are positive definite.
    let (min, max) = (1e-3 - slack, 5e4_f64.min((500.0 / ratio).powi(2)) * (1.0 + slack));
    let above = |r, c| component.stiffness_at(r, c) - if r == c { min } else { 0.0 };
    let below = |r, c| if r == c { max } else { 0.0 } - component.stiffness_at(r, c);
    match (is_positive(d, above), is_positive(d, below)) {
        (true, true) => None,
        _ => Some(format!("stiffness {stiffness:?}")),
    }
}

/// Gaussian elimination with pivots from the diagonal: all pivots of a positive definite matrix are
/// positive. `d` is at most 2·[`TASK_DIM`].
pub fn is_positive(d: usize, entry: impl Fn(usize, usize) -> f64) -> bool {
    const N: usize = 2 * TASK_DIM;
    let mut m: [[f64; N]; N] = std::array::from_fn(|r| {
        std::array::from_fn(|c| if r.max(c) < d { entry(r, c) } else { 0.0 })
    });
    let mut left: Vec<usize> = (0..d).collect();
    while let Some(at) =
        (0..left.len()).max_by(|&a, &b| m[left[a]][left[a]].total_cmp(&m[left[b]][left[b]]))
    {
        let p = left.swap_remove(at);
        let pivot = m[p][p];
        if pivot.is_nan() || pivot <= 0.0 {
            return false;
        }
        for &r in &left {
            let factor = m[r][p] / pivot;
            for &c in &left {
                m[r][c] -= factor * m[p][c];
            }
        }
    }
    true
}
