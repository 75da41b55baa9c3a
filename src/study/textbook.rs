//! What a textbook says of a pancake on an arm that is held: rebound, sliding, lying still.

use anyhow::Result;
use nalgebra::{UnitQuaternion, Vector3};
use physics::arm::{ArmModel, JointVector, dynamics, inverse_kinematics, kinematics};
use physics::pancake::{PancakeConfig, PancakePlant};
use physics::plant::Plant;

/// Heights of the drops, m, so many, so far apart that blows fall anywhere in a step; and what is long
/// enough for one, s.
const FALL_M: f64 = 0.1;
const N_DROPS: u32 = 10;
const APART_M: f64 = 0.3e-3;
const DROP_S: f64 = 0.4;
/// Slope on which the pancake slides, rad, and times at which its place is noted, s.
const SLOPE: f64 = 25.0 * std::f64::consts::PI / 180.0;
const SLIDING_S: [f64; 3] = [0.15, 0.3, 0.45];
/// Gains of the arm, 1/s² and 1/s: as people hold arms, and so stiff that the pan's slope stays.
const SOFT: [f64; 2] = [400.0, 40.0];
const STIFF: [f64; 2] = [1e4, 200.0];
/// A pan whose rim is out of reach, m.
const WIDE_M: f64 = 1.0;

/// What came of it.
pub struct Textbook {
    /// Speed after a drop over the speed before it, in the mean of the drops.
    pub rebound: f64,
    /// Acceleration down the slope over Coulomb's g(sin β − μ cos β), less one.
    pub slide: f64,
    /// How far it wanders in the pan within a second, m.
    pub drift_m: f64,
}

/// An arm that computed torques hold at its start posture.
struct Held<'a> {
    model: &'a ArmModel,
    q0: JointVector,
    plant: PancakePlant,
    period_s: f64,
    gains: [f64; 2],
}

pub fn textbook(model: &ArmModel, q0: &JointVector, world: &PancakeConfig) -> Result<Textbook> {
    Ok(Textbook {
        rebound: rebound(model, q0, world),
        slide: slide(model, q0, world)?,
        drift_m: drift(model, q0, world),
    })
}

fn rebound(model: &ArmModel, q0: &JointVector, world: &PancakeConfig) -> f64 {
    let drop = |n: u32| {
        let world = PancakeConfig { start_gap: FALL_M + APART_M * f64::from(n), ..*world };
        let places = Held::new(model, q0, world, SOFT).places(DROP_S);
        let speeds: Vec<f64> = places.windows(2).map(|p| p[1].z - p[0].z).collect();
        let impact = speeds.iter().copied().fold(f64::INFINITY, f64::min);
        speeds.iter().copied().fold(f64::NEG_INFINITY, f64::max) / -impact
    };
    (0..N_DROPS).map(drop).sum::<f64>() / f64::from(N_DROPS)
}

fn slide(model: &ArmModel, q0: &JointVector, world: &PancakeConfig) -> Result<f64> {
    let mut tip = kinematics::tip_pose(model, q0);
    tip.rotation *= UnitQuaternion::from_axis_angle(&Vector3::y_axis(), SLOPE);
    let q0 = inverse_kinematics::solve(model, &tip, q0)?;
    let world = PancakeConfig { pan_radius: WIDE_M, ..*world };
    let places = Held::new(model, &q0, world, STIFF).places(SLIDING_S[2]);
    let [a, b, c] = SLIDING_S.map(|t_s| places[(t_s / world.period_s).round() as usize - 1].x);
    // Three points of a parabola.
    let measured = (c - 2.0 * b + a) / (SLIDING_S[1] - SLIDING_S[0]).powi(2);
    let expected = -model.gravity().z * (SLOPE.sin() - world.friction * SLOPE.cos());
    Ok(measured / expected - 1.0)
}

fn drift(model: &ArmModel, q0: &JointVector, world: &PancakeConfig) -> f64 {
    let places = Held::new(model, q0, *world, SOFT).places(2.0);
    let settled = places[places.len() / 2];
    (places[places.len() - 1] - settled).norm()
}

impl Held<'_> {
    fn new<'a>(
        model: &'a ArmModel,
        q0: &JointVector,
        world: PancakeConfig,
        gains: [f64; 2],
    ) -> Held<'a> {
        let plant = PancakePlant::new(model, q0, &world);
        Held { model, q0: *q0, plant, period_s: world.period_s, gains }
    }

    /// Centres of the pancake in the pan after each period of `duration_s`, m.
    fn places(&mut self, duration_s: f64) -> Vec<Vector3<f64>> {
        (0..(duration_s / self.period_s).round() as usize).map(|_| self.place()).collect()
    }

    fn place(&mut self) -> Vector3<f64> {
        let state = self.plant.measure();
        let qdd = (self.q0 - state.q) * self.gains[0] - state.qd * self.gains[1];
        self.plant.apply(&dynamics::rnea(self.model, &state.q, &state.qd, &qdd));
        self.plant.advance();
        let state = self.plant.measure();
        let tip = kinematics::tip_pose(self.model, &state.q);
        tip.inverse_transform_point(&state.object.p_WO.into()).coords
    }
}
