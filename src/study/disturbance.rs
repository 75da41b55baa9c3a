//! What acts on the tip besides the controller's torques: a person who pushes, a table in the way.

use nalgebra::{Vector3, Vector6};
use physics::arm::{ArmModel, JointVector, TipKinematics};
use physics::plant::{Measurement, Plant};

/// How long a push lasts, s.
pub const PUSH_S: f64 = 0.2;
/// The pancake has left when it has not touched the pan for so long, s: at the throw contact flickers.
const FLIGHT_S: f64 = 0.05;

/// What a disturbance sees of a tick.
pub struct Seen {
    /// From the world's beginning.
    pub tick: usize,
    pub tip: TipKinematics,
    /// The object touches the tip.
    pub in_contact: bool,
}

pub trait Disturbance {
    /// On the tip's origin in this tick, N in world axes.
    fn force(&mut self, now: &Seen) -> Vector3<f64>;

    /// Another rollout begins.
    fn forget(&mut self);
}

/// A plant with a disturbance in it.
pub struct Disturbed<'a, P, D> {
    plant: P,
    arm: &'a ArmModel,
    tick: usize,
    pub by: D,
}

impl<'a, P: Plant, D: Disturbance> Disturbed<'a, P, D> {
    pub fn new(plant: P, arm: &'a ArmModel, by: D) -> Disturbed<'a, P, D> {
        Disturbed { plant, arm, tick: 0, by }
    }
}

impl<P: Plant, D: Disturbance + Send> Plant for Disturbed<'_, P, D> {
    fn is_simulated(&self) -> bool {
        self.plant.is_simulated()
    }

    fn begin_reset(&mut self) {
        self.plant.begin_reset();
        self.tick = 0;
        self.by.forget();
    }

    fn is_ready(&self) -> bool {
        self.plant.is_ready()
    }

    fn measure(&self) -> Measurement {
        self.plant.measure()
    }

    fn apply(&mut self, tau: &JointVector) {
        let Measurement { q, qd, object, .. } = self.plant.measure();
        let tip = TipKinematics::new(self.arm, &q, &qd);
        let now = Seen { tick: self.tick, tip, in_contact: object.in_contact };
        let f = self.by.force(&now);
        let wrench = Vector6::new(f.x, f.y, f.z, 0.0, 0.0, 0.0);
        self.plant.apply(&(tau + now.tip.J.tr_mul(&wrench)));
    }

    fn advance(&mut self) {
        self.plant.advance();
        self.tick += 1;
    }
}

/// When a push begins.
#[derive(Clone, Copy)]
pub enum Begins {
    Never,
    /// With this tick of the world.
    At(usize),
    /// So long after the pancake has left the pan, s.
    Thrown(f64),
}

/// A person's push.
pub struct Push {
    /// N, in world axes.
    force: Vector3<f64>,
    begins: Begins,
    period_s: f64,
    /// Ticks since the pancake has last touched the pan.
    in_the_air: usize,
    /// The tick with which it begins, once that is known.
    first: Option<usize>,
    /// Height of the tip in each tick, m.
    pub heights: Vec<f64>,
}

impl Push {
    pub fn new(force: Vector3<f64>, begins: Begins, period_s: f64) -> Push {
        let (in_the_air, heights) = (0, Vec::new());
        let mut push = Push { force, begins, period_s, in_the_air, first: None, heights };
        push.forget();
        push
    }

    fn ticks_of(&self, time_s: f64) -> usize {
        (time_s / self.period_s).round() as usize
    }
}

impl Disturbance for Push {
    fn force(&mut self, now: &Seen) -> Vector3<f64> {
        self.heights.push(now.tip.X_WP.translation.z);
        self.in_the_air = if now.in_contact { 0 } else { self.in_the_air + 1 };
        let has_left = self.in_the_air >= self.ticks_of(FLIGHT_S);
        if let (Begins::Thrown(after_s), None, true) = (self.begins, self.first, has_left) {
            self.first = Some(now.tick + self.ticks_of(after_s));
        }
        let lasts = self.ticks_of(PUSH_S);
        let is_now = |first: usize| (first..first + lasts).contains(&now.tick);
        if self.first.is_some_and(is_now) { self.force } else { Vector3::zeros() }
    }

    fn forget(&mut self) {
        (self.in_the_air, self.heights) = (0, Vec::new());
        self.first = match self.begins {
            Begins::At(tick) => Some(tick),
            Begins::Never | Begins::Thrown(_) => None,
        };
    }
}

/// A table whose edge lies across the tip's way: a corner that gives way a little and rubs.
pub struct Table {
    /// Where the tip's origin would touch: it may be above `height_m` or nearer than `edge_x_m`, m.
    pub height_m: f64,
    pub edge_x_m: f64,
    /// The largest force it has seen, N.
    pub peak_n: f64,
}

/// Wood and what stands on it: N/m, N·s/m, and Coulomb's coefficient.
const TABLE_STIFFNESS: f64 = 2e4;
const TABLE_DAMPING: f64 = 50.0;
const TABLE_FRICTION: f64 = 0.3;

impl Table {
    pub fn new(height_m: f64, edge_x_m: f64) -> Table {
        Table { height_m, edge_x_m, peak_n: 0.0 }
    }
}

impl Disturbance for Table {
    fn force(&mut self, now: &Seen) -> Vector3<f64> {
        let p = now.tip.X_WP.translation.vector;
        let v = now.tip.v.fixed_rows::<3>(0).into_owned();
        let (below, beyond) = (self.height_m - p.z, p.x - self.edge_x_m);
        // The nearer face of the corner pushes back.
        let (depth, normal) =
            if below < beyond { (below, Vector3::z()) } else { (beyond, -Vector3::x()) };
        if depth <= 0.0 {
            return Vector3::zeros();
        }
        let approach = -v.dot(&normal);
        let push = (TABLE_STIFFNESS * depth + TABLE_DAMPING * approach).max(0.0);
        let sliding = v + normal * approach;
        // Coulomb, smoothed where it hardly slides.
        let rub = sliding.cap_magnitude(0.01) * (TABLE_FRICTION * push / 0.01);
        let force = normal * push - rub;
        self.peak_n = self.peak_n.max(force.norm());
        force
    }

    fn forget(&mut self) {
        self.peak_n = 0.0;
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::config::Config;
    use crate::setup;

    fn seen(tick: usize, in_contact: bool) -> Seen {
        let arm = setup::arm(&Config::default()).unwrap();
        let q = Config::default().plant.start_posture();
        let tip = TipKinematics::new(&arm, &q, &JointVector::zeros());
        Seen { tick, tip, in_contact }
    }

    #[test]
    fn a_push_waits_for_the_throw_and_ends() {
        let mut push = Push::new(Vector3::z() * -2.0, Begins::Thrown(0.1), 1e-3);
        let pushed: Vec<usize> = (0..1000)
            .filter(|tick| push.force(&seen(*tick, *tick < 300 || *tick == 310)).z < 0.0)
            .collect();
        // A flicker at 310; 50 ticks after it it has left, 100 later comes the push.
        assert_eq!((pushed[0], pushed.len()), (310 + 50 + 100, 200));
        push.forget();
        assert!(push.force(&seen(500, true)).z == 0.0, "the next rollout is another");
    }

    #[test]
    fn a_table_pushes_out_of_itself_by_the_nearer_face() {
        let mut now = seen(0, false);
        let p = now.tip.X_WP.translation.vector;
        let mut deep = Table::new(p.z + 0.01, p.x - 0.1);
        assert!((deep.force(&now) - Vector3::z() * 200.0).norm() < 1e-9);
        assert!((Table::new(p.z + 0.1, p.x - 0.01).force(&now).x + 200.0).abs() < 1e-9);
        assert_eq!(Table::new(p.z - 0.01, p.x - 0.1).force(&now), Vector3::zeros());
        assert_eq!(Table::new(p.z + 0.01, p.x + 0.1).force(&now), Vector3::zeros());
        // It slides on: friction against it, and nothing that pulls it in.
        now.tip.v = Vector6::new(1.0, 0.0, 5.0, 0.0, 0.0, 0.0);
        let force = Table::new(p.z + 0.01, p.x - 0.1).force(&now);
        assert_eq!(force, Vector3::zeros(), "it leaves faster than the wood follows");
        now.tip.v.z = 0.0;
        let force = deep.force(&now);
        assert!((force.x + 0.3 * force.z).abs() < 1e-9 && force.z > 0.0);
        assert!(deep.peak_n > 200.0);
    }
}
