//! What happened to the pancake: every quantity of the paper's reward (Sec. 3.1), but no reward.
//!
//! ```
//! use nalgebra::{Isometry3, UnitQuaternion, Vector3};
//! use physics::pancake::outcome::{OutcomeConfig, OutcomeTracker};
//! use physics::plant::ObjectState;
//!
//! let mut tracker = OutcomeTracker::new(&OutcomeConfig::default());
//! let X_WP = Isometry3::identity();
//! // A pancake that stays in the pan.
//! let object = ObjectState {
//!     p_WO: Vector3::new(0.0, 0.0, 0.005),
//!     R_WO: UnitQuaternion::identity(),
//!     in_contact: true,
//! };
//! for tick in 0..1000 {
//!     tracker.observe(tick as f64 * 1e-3, &X_WP, &object);
//! }
//! assert!(!tracker.outcome().tossed);
//! ```

use std::f64::consts::TAU;

use nalgebra::{Isometry3, UnitQuaternion, Vector3};

use crate::plant::ObjectState;
use crate::referee::{State, Toss, TossConfig};

/// Thresholds of the tracker.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct OutcomeConfig {
    /// When the pancake comes back, and when it is lost.
    pub toss: TossConfig,
    /// A flight lasts longer than this, s: shorter losses of contact are flicker.
    pub min_flight_s: f64,
    /// Releases faster than this are exploits of the contact model, m/s.
    pub max_release_speed: f64,
    /// Releases spinning faster than this are exploits of the contact model, rad/s.
    pub max_release_spin: f64,
    /// Radius within which a caught pancake's centre lies, m.
    pub pan_radius: f64,
    /// Highest centre of a caught pancake over the pan's surface, along the pan's normal, m.
    pub max_rest_height_m: f64,
    /// Largest angle between pan and caught pancake, rad.
    pub max_rest_tilt_rad: f64,
    /// A caught pancake touched the pan within this time, s.
    pub recent_contact_s: f64,
}

impl Default for OutcomeConfig {
    fn default() -> Self {
        Self {
            toss: TossConfig::default(),
            min_flight_s: 0.1,
            max_release_speed: 6.0,
            max_release_spin: 40.0,
            pan_radius: 0.13,
            max_rest_height_m: 0.03,
            max_rest_tilt_rad: 30_f64.to_radians(),
            recent_contact_s: 0.05,
        }
    }
}

/// What one rollout did to the pancake. No reward: that is computed elsewhere, and can be again.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Outcome {
    /// The pancake flew above Δ_h and fell back to it.
    pub tossed: bool,
    /// There was a flight. Without one the release fields are zero.
    pub released: bool,
    /// Start of the longest flight, s.
    pub release_time_s: f64,
    /// Speed of the pancake's centre at release, m/s.
    pub release_speed: f64,
    /// Rate of turn at release, rad/s.
    pub release_spin: f64,
    /// Its part about the world's y axis, rad/s: positive turns the pancake's nose down.
    pub release_pitch_rate: f64,
    /// X₃ᵐᵃˣ: highest rise of the pancake above its start, m. Defined without a toss as well.
    pub apex_m: f64,
    /// When the pancake fell back to Δ_h, s. Zero unless tossed, as the next five.
    pub crossing_time_s: f64,
    /// arccos(V₀·V), the angle between the pancake's normals at the start and at the crossing, rad.
    pub flip_angle_rad: f64,
    /// ‖X − x‖, pancake centre to pan centre at the crossing, m; Δ_h at best.
    pub distance_m: f64,
    /// The part of that distance within the pan's plane, m.
    pub lateral_m: f64,
    /// How far the pancake's centre lies before the pan's along the world's x axis at the crossing, m.
    pub forward_m: f64,
    /// Turn about the world's y axis from the start to the crossing, not wrapped at π, minus the pan's
    /// pitch there, rad: positive is nose down, and a half flip backwards is −π.
    pub turn_rad: f64,
    /// Distance of the pancake's centre from the pan's axis at the end, m.
    pub final_lateral_m: f64,
    /// Angle between the normals of pancake and pan at the end, rad: π is upside down.
    pub final_tilt_rad: f64,
    /// Time without contact from the first touch after the crossing to the end, s: bouncing.
    pub bounce_s: f64,
    /// Success: at the end the pancake lies in the pan upside down.
    pub flipped_and_caught: bool,
    /// The release was faster than the task allows; never a success.
    pub exploit: bool,
    /// The pancake fell past the pan.
    pub dropped: bool,
}

/// A time without contact.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Flight {
    start_s: f64,
    last_s: f64,
    speed: f64,
    spin: f64,
    pitch_rate: f64,
}

impl Flight {
    fn duration(&self) -> f64 {
        self.last_s - self.start_s
    }
}

/// One observation.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Sample {
    t_s: f64,
    p_WO: Vector3<f64>,
    R_WO: UnitQuaternion<f64>,
    in_contact: bool,
}

/// Watches pan and pancake, tick by tick, without allocation.
///
/// Sec. 3.1: the reward is "computed at the moment when the pancake falls back down at a height
/// Δ_h above the frying pan". What the paper leaves open is decided so:
/// * height is the world's vertical difference of the two centres, sampled at the first tick at or
///   below Δ_h that follows a tick above it, both without contact;
/// * the start, for V₀ and X₃ᵐᵃˣ, is the first tick observed;
/// * release is the start of the longest time without contact, longer than 0.1 s, because the
///   pancake is nearly weightless while the pan dips and contact flickers;
/// * speeds are finite differences of poses, all that a tracking system gives;
/// * the catch is judged 0.5 s after the crossing, or the pancake is lost 0.2 m below the pan.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct OutcomeTracker {
    config: OutcomeConfig,
    first: Option<Sample>,
    last: Option<Sample>,
    /// The flight going on, and the longest one.
    flight: Option<Flight>,
    longest: Option<Flight>,
    last_contact_s: f64,
    /// Turn about the world's y axis since the start, rad.
    turn_rad: f64,
    /// The pancake has touched the pan again after the crossing.
    is_back: bool,
    toss: Toss,
    outcome: Outcome,
}

impl OutcomeTracker {
    /// A tracker for one rollout.
    pub fn new(config: &OutcomeConfig) -> OutcomeTracker {
        OutcomeTracker {
            config: *config,
            first: None,
            last: None,
            flight: None,
            longest: None,
            last_contact_s: f64::NEG_INFINITY,
            turn_rad: 0.0,
            is_back: false,
            toss: Toss::new(&config.toss),
            outcome: Outcome::default(),
        }
    }

    /// Takes one tick: time (s, increasing), pose of the pan, state of the pancake. Ticks after
    /// the end are ignored.
    pub fn observe(&mut self, t_s: f64, X_WP: &Isometry3<f64>, object: &ObjectState) {
        if self.is_finished() {
            return;
        }
        self.toss.observe(t_s, X_WP, object);
        let now =
            Sample { t_s, p_WO: object.p_WO, R_WO: object.R_WO, in_contact: object.in_contact };
        let first = *self.first.get_or_insert(now);
        let offset_P = X_WP.inverse_transform_point(&object.p_WO.into()).coords;
        let normal_P = X_WP.rotation.inverse() * normal(&now.R_WO);

        self.outcome.apex_m = self.outcome.apex_m.max(now.p_WO.z - first.p_WO.z);
        self.outcome.final_lateral_m = offset_P.xy().norm();
        self.outcome.final_tilt_rad = angle_between(&normal_P, &Vector3::z());
        self.turn_rad += self.last.map_or(0.0, |last| turn(&last.R_WO, &now.R_WO));
        self.track_flight(&now);
        self.track_crossing(&first, &now, X_WP, &offset_P);
        self.track_bounce(&now);

        self.outcome.dropped = self.toss.state() == State::Lost;
        if self.toss.state() == State::Settled {
            self.outcome.flipped_and_caught =
                self.is_caught(t_s, &offset_P) && !self.outcome.exploit;
        }
        self.last = Some(now);
    }

    /// Nothing more can change: the catch has been judged or the pancake is lost.
    pub fn is_finished(&self) -> bool {
        matches!(self.toss.state(), State::Settled | State::Lost)
    }

    /// What has happened so far; final once [`is_finished`](Self::is_finished).
    pub fn outcome(&self) -> Outcome {
        self.outcome
    }

    fn track_flight(&mut self, now: &Sample) {
        if now.in_contact {
            self.flight = None;
            self.last_contact_s = now.t_s;
            return;
        }
        let start =
            Flight { start_s: now.t_s, last_s: now.t_s, speed: 0.0, spin: 0.0, pitch_rate: 0.0 };
        let mut flight = self.flight.unwrap_or(start);
        flight.last_s = now.t_s;
        // The first difference that lies in the air as a whole is the release velocity.
        if let Some(last) = self.last.filter(|last| flight.start_s == last.t_s) {
            let dt = now.t_s - last.t_s;
            flight.speed = (now.p_WO - last.p_WO).norm() / dt;
            let turn = (now.R_WO * last.R_WO.inverse()).scaled_axis();
            flight.spin = last.R_WO.angle_to(&now.R_WO) / dt;
            flight.pitch_rate = turn.y / dt;
        }
        self.flight = Some(flight);

        let is_longest = self.longest.is_none_or(|longest| flight.duration() > longest.duration());
        if flight.duration() > self.config.min_flight_s && is_longest {
            self.longest = Some(flight);
            self.outcome.released = true;
            self.outcome.release_time_s = flight.start_s;
            self.outcome.release_speed = flight.speed;
            self.outcome.release_spin = flight.spin;
            self.outcome.release_pitch_rate = flight.pitch_rate;
            self.outcome.exploit = flight.speed > self.config.max_release_speed
                || flight.spin > self.config.max_release_spin;
        }
    }

    fn track_crossing(
        &mut self,
        first: &Sample,
        now: &Sample,
        X_WP: &Isometry3<f64>,
        offset_P: &Vector3<f64>,
    ) {
        let Some(crossing_s) = self.toss.crossing_s().filter(|_| !self.outcome.tossed) else {
            return;
        };
        self.outcome.tossed = true;
        self.outcome.crossing_time_s = crossing_s;
        self.outcome.flip_angle_rad = angle_between(&normal(&first.R_WO), &normal(&now.R_WO));
        self.outcome.distance_m = (now.p_WO - X_WP.translation.vector).norm();
        self.outcome.lateral_m = offset_P.xy().norm();
        self.outcome.forward_m = now.p_WO.x - X_WP.translation.vector.x;
        self.outcome.turn_rad = self.turn_rad - pitch(&X_WP.rotation);
    }

    fn track_bounce(&mut self, now: &Sample) {
        self.is_back |= self.outcome.tossed && now.in_contact;
        if let Some(last) = self.last.filter(|_| self.is_back && !now.in_contact) {
            self.outcome.bounce_s += now.t_s - last.t_s;
        }
    }

    /// Does the pancake lie in the pan upside down? At the start its normal is the pan's.
    fn is_caught(&self, t_s: f64, offset_P: &Vector3<f64>) -> bool {
        let config = &self.config;
        t_s - self.last_contact_s <= config.recent_contact_s
            && offset_P.xy().norm() < config.pan_radius
            && (0.0..config.max_rest_height_m).contains(&offset_P.z)
            && std::f64::consts::PI - self.outcome.final_tilt_rad < config.max_rest_tilt_rad
    }
}

/// The pancake's normal in the world: its z axis.
fn normal(R_WO: &UnitQuaternion<f64>) -> Vector3<f64> {
    R_WO * Vector3::z()
}

/// Direction of the normal in the world's x-z plane, rad: positive is nose down.
fn pitch(R_W: &UnitQuaternion<f64>) -> f64 {
    let n = normal(R_W);
    n.x.atan2(n.z)
}

/// From one tick to the next, the shorter way round, rad.
fn turn(from: &UnitQuaternion<f64>, to: &UnitQuaternion<f64>) -> f64 {
    let turn = pitch(to) - pitch(from);
    turn - TAU * (turn / TAU).round()
}

/// Angle between unit vectors in [0, π], accurate at both ends.
fn angle_between(a: &Vector3<f64>, b: &Vector3<f64>) -> f64 {
    a.cross(b).norm().atan2(a.dot(b))
}
