//! Table skittles, Sec. 4.2's second experiment: a ball on a string swings around a post.
//!
//! The paper leaves the horizon open; here a flight lasts one revolution, or until the ball meets
//! the post.

use std::f64::consts::{PI, TAU};

use nalgebra::Vector2;
use thiserror::Error;

/// m, kg.
const MASS: f64 = 0.1;
/// k, N/m: the string is a massless spring to the post.
const STIFFNESS: f64 = 1.0;
/// τ, s.
const DECAY_TIME: f64 = 20.0;
/// x_p, m: the axis of the lever arm.
const PIVOT: Vector2<f64> = Vector2::new(0.0, -1.5);
/// r_p, m.
const LEVER: f64 = 0.4;
/// r_c + r_b, m: the centres of post and ball are this far apart when they touch.
pub const CONTACT_DISTANCE: f64 = 0.25 + 0.05;
/// A skittle stands within this distance of the post, m. The paper gives no edge.
pub const TABLE_RADIUS: f64 = 2.0;
/// Skittles with one, two and two regions of rewards of at least 0.9, m; the first is the paper's.
pub const TARGETS: [[f64; 2]; 3] = [[0.3, 1.4], [1.2, 0.0], [0.8, 0.8]];
/// The box of throws (α, α̇) that is searched.
pub const BOX: ([f64; 2], [f64; 2]) = ([-PI, 0.0], [PI, 15.0]);

/// Steps per flight between which a minimum is bracketed: 2.8° of a revolution, against extrema
/// of the distance that are some tens of degrees apart.
const STEPS: u32 = 128;

/// ω = √(k/m − 1/τ²), rad/s.
pub fn angular_frequency() -> f64 {
    (STIFFNESS / MASS - DECAY_TIME.powi(-2)).sqrt()
}

/// Longest flight, s: one revolution, 2π/ω.
pub fn horizon() -> f64 {
    TAU / angular_frequency()
}

/// The policy parameters Θ: angle (rad) and angular velocity (rad/s) of the lever at the release.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Throw {
    pub alpha: f64,
    pub alpha_dot: f64,
}

/// How amplitude and phase follow from the release.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum SwingModel {
    /// The paper's: from the energy, which ignores the damping (rewards differ by 0.004 on average).
    #[default]
    Energy,
    /// The solution of the damped oscillator with these initial conditions.
    Exact,
}

/// A task: where the skittle stands.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SkittlesConfig {
    /// x_t, m from the post.
    pub target: [f64; 2],
    pub model: SwingModel,
}

/// Why no skittle can stand there.
#[derive(Debug, Error, PartialEq)]
pub enum SkittlesError {
    #[error(
        "target is [{x}, {y}] m: a skittle stands on the table, at most {TABLE_RADIUS} m from the \
         post at [0, 0], and clear of the post, more than {CONTACT_DISTANCE} m from it; use for \
         example [0.3, 1.4]"
    )]
    OffTable { x: f64, y: f64 },
}

/// What a throw came to.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Flight {
    /// d = ‖x_e − x_t‖: smallest distance to the skittle, m.
    pub distance_m: f64,
    /// When the ball is at x_e, the closest point, s after the release.
    pub closest_time_s: f64,
    /// When the ball meets the post, which ends the flight, s after the release.
    pub collision_time_s: Option<f64>,
}

impl Default for SkittlesConfig {
    fn default() -> Self {
        SkittlesConfig { target: TARGETS[0], model: SwingModel::default() }
    }
}

impl SkittlesConfig {
    /// The skittle stands on the table and beside the post.
    pub fn validate(&self) -> Result<(), SkittlesError> {
        let [x, y] = self.target;
        let radius = x.hypot(y);
        // Also false for NaN.
        if radius > CONTACT_DISTANCE && radius <= TABLE_RADIUS {
            Ok(())
        } else {
            Err(SkittlesError::OffTable { x, y })
        }
    }

    /// The flight of `throw` against this skittle.
    pub fn fly(&self, throw: &Throw) -> Flight {
        let swing = Swing::new(throw, self.model);
        let collision_time_s = swing.collision();
        let target = Vector2::from(self.target);
        let end = collision_time_s.unwrap_or_else(horizon);
        let candidates = swing.closest_approaches(&target, end).into_iter().chain([0.0, end]);
        let (closest_time_s, distance_m) = candidates
            .map(|t| (t, (swing.position(t) - target).norm()))
            .min_by(|a, b| a.1.total_cmp(&b.1))
            .expect("both ends of the flight are candidates");
        Flight { distance_m, closest_time_s, collision_time_s }
    }
}

/// The motion after a release, per axis: x(t) = A sin(ωt + φ) exp(−t/τ).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Swing {
    /// x_r, m.
    pub release_position: Vector2<f64>,
    /// ẋ_r, m/s. Opposite in sign to the derivative of x_r by time, as printed.
    pub release_velocity: Vector2<f64>,
    /// A, m.
    pub amplitude: Vector2<f64>,
    /// φ, rad.
    pub phase: Vector2<f64>,
}

impl Swing {
    /// Departures: E = ½(mẋ² + kx²), whose squares are missing in print; φ = atan2(x, ẋ√(m/k)), as
    /// arcsin(x/A) loses the sign of the velocity.
    pub fn new(throw: &Throw, model: SwingModel) -> Swing {
        let (sin, cos) = throw.alpha.sin_cos();
        let release_position = PIVOT + LEVER * Vector2::new(cos, -sin);
        let release_velocity = throw.alpha_dot * LEVER * Vector2::new(sin, cos);
        // A cos φ, next to A sin φ = x.
        let quadrature = match model {
            SwingModel::Energy => release_velocity * (MASS / STIFFNESS).sqrt(),
            SwingModel::Exact => {
                (release_velocity + release_position / DECAY_TIME) / angular_frequency()
            }
        };
        Swing {
            release_position,
            release_velocity,
            amplitude: release_position.zip_map(&quadrature, f64::hypot),
            phase: release_position.zip_map(&quadrature, f64::atan2),
        }
    }

    /// x(t), m, `t` s after the release.
    pub fn position(&self, t: f64) -> Vector2<f64> {
        let angle = self.phase.add_scalar(angular_frequency() * t);
        self.amplitude.component_mul(&angle.map(f64::sin)) * (-t / DECAY_TIME).exp()
    }

    /// ẋ(t), m/s.
    pub fn velocity(&self, t: f64) -> Vector2<f64> {
        let omega = angular_frequency();
        let angle = self.phase.add_scalar(omega * t);
        let slope = angle.map(|a| omega * a.cos() - a.sin() / DECAY_TIME);
        self.amplitude.component_mul(&slope) * (-t / DECAY_TIME).exp()
    }

    /// When the ball first touches the post within the horizon.
    fn collision(&self) -> Option<f64> {
        let gap = |t: f64| self.position(t).norm() - CONTACT_DISTANCE;
        let nearest = self
            .closest_approaches(&Vector2::zeros(), horizon())
            .into_iter()
            .chain([horizon()])
            .find(|&t| gap(t) <= 0.0)?;
        Some(bisect(|t| -gap(t), 0.0, nearest))
    }

    /// Times within (0, `end`) at which the distance to `point` has a minimum, in order.
    fn closest_approaches(&self, point: &Vector2<f64>, end: f64) -> Vec<f64> {
        // Half the derivative of the squared distance.
        let slope = |t: f64| (self.position(t) - point).dot(&self.velocity(t));
        let time = |step: u32| end * f64::from(step) / f64::from(STEPS);
        (0..STEPS)
            .map(|step| (time(step), time(step + 1)))
            .filter(|&(from, to)| slope(from) < 0.0 && slope(to) >= 0.0)
            .map(|(from, to)| bisect(slope, from, to))
            .collect()
    }
}

/// Where `f` rises through zero between `low` (negative) and `high`, to the last bit.
fn bisect(f: impl Fn(f64) -> f64, mut low: f64, mut high: f64) -> f64 {
    loop {
        let middle = 0.5 * (low + high);
        if middle <= low || middle >= high {
            return high;
        }
        if f(middle) < 0.0 {
            low = middle;
        } else {
            high = middle;
        }
    }
}
