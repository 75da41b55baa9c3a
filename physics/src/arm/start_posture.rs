//! Postures to start from: the tip's z axis up, the joints away from their limits and the arm from
//! its singularities, the motors with torque to spare, the tip in front of the base and quick
//! enough to toss.
//!
//! A seeded search: postures from anywhere are levelled by damped least squares and judged; the best
//! of them are improved by small steps, levelled again. Same arm and seed, same postures.

use nalgebra::{Isometry3, Matrix3, SMatrix, Vector3};

use super::{ArmModel, JointVector, MAX_JOINTS, TipKinematics, dynamics};

const SEEDS: usize = 300;
const KEPT: usize = 40;
const IMPROVED: usize = 10;
const STEPS: usize = 120;
const ITERATIONS: usize = 60;
/// Rotation that may be left, rad.
const TILT: f64 = 1e-10;
/// Share of a joint's range at either end that the search keeps out of, and no more than this, rad.
const EDGE_SHARE: f64 = 0.05;
const EDGE_MAX: f64 = 0.2;
/// Distance from a limit, in rad or as a share of the range, that is as good as any larger one.
const ROOM: f64 = 0.6;
const ROOM_SHARE: f64 = 0.25;
/// Share of a torque limit that holding may take without a loss.
const EASY_TORQUE: f64 = 0.3;
/// Least singular value of the scaled Jacobian that counts half.
const HALF_DEXTERITY: f64 = 0.05;
/// Upward speed, m/s, and rate about the level axis across, rad/s, that a toss takes.
const TOSS_SPEED: f64 = 3.0;
const TOSS_RATE: f64 = 6.0;
/// The tip is to be this far from the base's vertical axis, m.
const CLEARANCE: f64 = 0.3;

/// A posture in which the tip is level, and what there is to know about it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct StartPosture {
    /// Joint positions, rad.
    pub q: JointVector,
    /// The tip there.
    pub X_WP: Isometry3<f64>,
    /// What holds the arm still, N·m.
    pub holding: JointVector,
    /// Least singular value of the Jacobian whose linear rows are divided by the reach.
    pub dexterity: f64,
    /// 0 to 1, the larger the better.
    pub score: f64,
}

/// Distance from the first joint to the tip along the links, m.
pub fn reach(model: &ArmModel) -> f64 {
    let between: f64 = model.bodies().iter().skip(1).map(|body| body.p_AB.norm()).sum();
    between + model.tip_offset().translation.vector.norm()
}

/// What the tip's frame is to be at the start.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Attitude {
    /// Its z axis up.
    Level,
    /// Along the world's axes.
    Aligned,
}

/// Postures found, the improved ones first, best first; none if none is within the limits.
pub fn find(model: &ArmModel, attitude: Attitude, seed: u64) -> Vec<StartPosture> {
    let mut noise = Noise(seed);
    let mut found: Vec<StartPosture> = Vec::new();
    for _ in 0..SEEDS {
        let mut q = JointVector::zeros();
        for i in 0..model.n_joints() {
            let (low, high) = inner_range(model, i);
            q[i] = low + (high - low) * noise.next();
        }
        found.extend(judged(model, q, attitude));
    }
    found.sort_by(|a, b| b.score.total_cmp(&a.score));
    found.truncate(KEPT);
    let mut improved: Vec<StartPosture> = found.iter().take(IMPROVED).copied().collect();
    for posture in &mut improved {
        for step in 0..STEPS {
            let width = 0.4 * 0.97_f64.powi(step as i32);
            let mut q = posture.q;
            for i in 0..model.n_joints() {
                q[i] += width * (2.0 * noise.next() - 1.0);
            }
            if let Some(better) = judged(model, q, attitude).filter(|p| p.score > posture.score) {
                *posture = better;
            }
        }
    }
    improved.sort_by(|a, b| b.score.total_cmp(&a.score));
    improved.extend(found);
    improved
}

/// The level posture near `q`, with its score.
fn judged(model: &ArmModel, q: JointVector, attitude: Attitude) -> Option<StartPosture> {
    let q = turn_to(model, q, attitude)?;
    let tip = TipKinematics::new(model, &q, &JointVector::zeros());
    let holding = dynamics::gravity_torque(model, &q);
    let dexterity = dexterity(model, &tip);
    let score = room(model, &q)
        * torque_to_spare(model, &holding)
        * (dexterity / (dexterity + HALF_DEXTERITY))
        * place(model, &tip.X_WP.translation.vector)
        * quickness(model, &tip);
    Some(StartPosture { q, X_WP: tip.X_WP, holding, dexterity, score })
}

/// Turns the tip to its attitude: Δq = Jᵀ(JJᵀ + λI)⁻¹ e, with e the rotation vector that is left and J
/// the angular rows. A level tip may turn about the vertical: its e has no z, its J no third row.
fn turn_to(model: &ArmModel, mut q: JointVector, attitude: Attitude) -> Option<JointVector> {
    clamp(model, &mut q);
    for _ in 0..ITERATIONS {
        let tip = TipKinematics::new(model, &q, &JointVector::zeros());
        let e = match attitude {
            Attitude::Level => upwards(&(tip.X_WP.rotation * Vector3::z())),
            Attitude::Aligned => -tip.X_WP.rotation.scaled_axis(),
        };
        if e.norm() < TILT {
            return Some(q);
        }
        let mut J: SMatrix<f64, 3, MAX_JOINTS> = tip.J.fixed_rows::<3>(3).into_owned();
        if attitude == Attitude::Level {
            J.row_mut(2).fill(0.0);
        }
        let lambda = 1e-9 + 1e-2 * e.norm_squared();
        let damped = J * J.transpose() + Matrix3::identity() * lambda;
        let mut dq = J.transpose() * damped.try_inverse()? * e;
        let longest = dq.amax();
        if longest > 0.5 {
            dq *= 0.5 / longest;
        }
        q += dq;
        clamp(model, &mut q);
    }
    None
}

/// The horizontal rotation vector that takes the direction `z` upwards.
fn upwards(z: &Vector3<f64>) -> Vector3<f64> {
    let axis = z.cross(&Vector3::z());
    let sine = axis.norm();
    let angle = sine.atan2(z.z);
    match sine > 1e-12 {
        true => axis * (angle / sine),
        // Straight down: about any axis.
        false => Vector3::x() * angle,
    }
}

/// 1 far from every limit, 0 at one.
fn room(model: &ArmModel, q: &JointVector) -> f64 {
    let limits = model.limits();
    let room = |i: usize| {
        let (low, high) = (limits.q_min[i], limits.q_max[i]);
        let enough = ROOM.min(ROOM_SHARE * (high - low));
        ((q[i] - low).min(high - q[i]) / enough).clamp(0.0, 1.0)
    };
    (0..model.n_joints()).map(room).fold(1.0, f64::min)
}

/// 1 while holding is easy, 0 where it takes a whole limit.
fn torque_to_spare(model: &ArmModel, holding: &JointVector) -> f64 {
    ((1.0 - largest_share(model, holding)) / (1.0 - EASY_TORQUE)).clamp(0.0, 1.0)
}

/// The largest share of a torque limit that `holding` takes.
pub fn largest_share(model: &ArmModel, holding: &JointVector) -> f64 {
    let share = |i: usize| holding[i].abs() / model.limits().tau_max[i];
    (0..model.n_joints()).map(share).fold(0.0, f64::max)
}

/// Least singular value that an arm of its number of joints can have above zero.
fn dexterity(model: &ArmModel, tip: &TipKinematics) -> f64 {
    let mut J = tip.J;
    let scale = 1.0 / reach(model).max(1e-3);
    for column in 0..MAX_JOINTS {
        for row in 0..3 {
            J[(row, column)] *= scale;
        }
    }
    let mut squares = (J * J.transpose()).symmetric_eigenvalues();
    squares.as_mut_slice().sort_by(|a, b| b.total_cmp(a));
    squares[model.n_joints().min(6) - 1].max(0.0).sqrt()
}

/// 1 in front of the base, along its x axis, above its foot and clear of it.
fn place(model: &ArmModel, p: &Vector3<f64>) -> f64 {
    let foot = model.bodies()[0].p_AB;
    let (x, y) = (p.x - foot.x, p.y - foot.y);
    let distance = x.hypot(y).max(1e-9);
    let ahead = ((x / distance + 0.2) / 1.2).clamp(0.05, 1.0).powi(2);
    let above = if p.z > foot.z.min(0.0) + 0.05 { 1.0 } else { 0.3 };
    ahead * above * (distance / CLEARANCE.min(0.5 * reach(model))).clamp(0.05, 1.0)
}

/// 1 where the joints' speeds are enough to throw up and to turn.
fn quickness(model: &ArmModel, tip: &TipKinematics) -> f64 {
    let speed_of = |row: usize| {
        let speed = |i: usize| tip.J[(row, i)].abs() * model.limits().qd_max[i];
        (0..model.n_joints()).map(speed).sum::<f64>()
    };
    let share = |speed: f64, enough: f64| (speed / enough).clamp(0.01, 1.0).sqrt();
    share(speed_of(2), TOSS_SPEED) * share(speed_of(4), TOSS_RATE)
}

fn inner_range(model: &ArmModel, i: usize) -> (f64, f64) {
    let (low, high) = (model.limits().q_min[i], model.limits().q_max[i]);
    let edge = EDGE_MAX.min(EDGE_SHARE * (high - low));
    // Nobody wants a start wound up.
    ((low + edge).max(-WOUND_UP).min(high - edge), (high - edge).min(WOUND_UP).max(low + edge))
}

/// Farthest a joint is turned from its zero where its range allows, rad.
const WOUND_UP: f64 = 0.9 * std::f64::consts::PI;

fn clamp(model: &ArmModel, q: &mut JointVector) {
    for i in 0..model.n_joints() {
        let (low, high) = inner_range(model, i);
        q[i] = q[i].clamp(low, high);
    }
}

/// SplitMix64 (Steele, Lea & Flood, 2014): enough for scattering.
struct Noise(u64);

impl Noise {
    /// Uniform in 0..1.
    fn next(&mut self) -> f64 {
        self.0 = self.0.wrapping_add(0x9E37_79B9_7F4A_7C15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
        ((z ^ (z >> 31)) >> 11) as f64 / (1_u64 << 53) as f64
    }
}
