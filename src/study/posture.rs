//! The posture moved while a learnt flip goes on: what pan and pancake see of it.
//!
//! Each policy is executed twice in every world, with the posture at its start and with the posture on its way
//! elsewhere, and the two are compared tick by tick. The posture is moved both ways along the self-motion, and by one
//! joint alone. Rows called admitted hold what the controller would have let pass: `skillet posture` refuses what would
//! disturb a policy.

use anyhow::Result;
use nalgebra::Isometry3;
use physics::arm::{ArmModel, JointVector, MAX_JOINTS, TipKinematics, kinematics};
use physics::pancake::PancakeConfig;
use rt_controller::admit::admission::admit;
use rt_controller::admit::disturbance::check_under;
use rt_controller::hot::posture::PostureMove;
use rt_controller::hot::rollout::Phase;
use shm_types::episode::{EpisodeHeader, FLAG_TORQUE_CLIPPED, TickRecord};

use super::Sample;
use super::pancake::{Answer, Bench, JUDGING, N_PERTURBED, learn};
use crate::config::Config;

/// How far the posture is moved, rad at the joint that goes farthest, and within how long, s.
const OFFSET_RAD: f64 = 0.5;
const MOVE_S: f64 = 1.0;
/// What may be seen of it, mm and degrees.
const PAN_MM: f64 = 5.0;
const PAN_DEG: f64 = 1.0;
/// The joint that is moved alone, from 0: near the base, where an offset takes the arm along.
const ALONE: usize = 0;

pub fn run_seed(seed: u64) -> Result<Vec<Sample>> {
    let mut config = Config::default();
    config.learner.seed = seed;
    let bench = Bench::new(config, false)?;
    let (_, answer) = learn(&bench, |_| bench.world)?;
    let aside = self_motion(&bench.arm, &bench.config.plant.start_posture()) * OFFSET_RAD;
    let mut alone = JointVector::zeros();
    alone[ALONE] = OFFSET_RAD;
    let cases =
        [("self-motion", aside), ("self-motion, other way", -aside), ("joint 1 alone", alone)];
    let mut samples = Vec::new();
    for (name, offset) in cases {
        let posture = PostureMove { offset, duration_s: MOVE_S };
        let judged = judge(name, &bench, &answer, &posture, seed)?;
        let is_admitted = is_admitted(&bench, &answer, &posture)?;
        samples.push(Sample::rate(name, "admitted", is_admitted));
        samples.extend(judged.iter().cloned());
        if is_admitted {
            let admitted = format!("{name}, admitted");
            samples
                .extend(judged.into_iter().map(|one| Sample { method: admitted.clone(), ..one }));
        }
    }
    Ok(samples)
}

/// The controller's verdict on a posture while it serves the selected policy.
fn is_admitted(bench: &Bench, (problem, theta): &Answer, to: &PostureMove) -> Result<bool> {
    let (q0, config) = (bench.config.plant.start_posture(), &bench.config.controller);
    let policy = admit(&bench.policy(problem, theta), &bench.arm, config)?;
    Ok(check_under(&policy, to, &bench.arm, &q0, config).is_ok())
}

/// The direction in which the arm can move while its tip stands still: J n = 0, its largest entry 1.
///
/// What the projection I − Jᵀ (J Jᵀ)⁻¹ J leaves of the joint that it leaves most of.
fn self_motion(arm: &ArmModel, q: &JointVector) -> JointVector {
    let jacobian = TipKinematics::new(arm, q, &JointVector::zeros()).J;
    let inverse =
        (jacobian * jacobian.transpose()).try_inverse().expect("the start posture is not singular");
    let left = |i: usize| {
        let e = JointVector::ith(i, 1.0);
        e - jacobian.transpose() * (inverse * (jacobian * e))
    };
    let n = (0..MAX_JOINTS).map(left).max_by(|a, b| a.norm().total_cmp(&b.norm())).expect("joints");
    n / n[n.icamax()]
}

/// What two executions of a policy in one world have apart, from the beginning of Execute to its end.
#[derive(Default)]
struct Apart {
    pan_mm: f64,
    pan_deg: f64,
    /// Distance in joint space, rad, and of the joint that went farthest.
    posture_rad: f64,
    joint_rad: f64,
    success: [bool; 2],
    /// Share of the ticks in which a torque was clipped.
    clipped: [f64; 2],
}

impl Apart {
    fn is_within_bounds(&self) -> bool {
        self.pan_mm <= PAN_MM && self.pan_deg <= PAN_DEG
    }

    /// The worse of both.
    fn or_worse(self, other: &Apart) -> Apart {
        Apart {
            pan_mm: self.pan_mm.max(other.pan_mm),
            pan_deg: self.pan_deg.max(other.pan_deg),
            ..self
        }
    }
}

fn judge(
    name: &str,
    bench: &Bench,
    answer: &Answer,
    posture: &PostureMove,
    seed: u64,
) -> Result<Vec<Sample>> {
    let nominal = apart(bench, answer, posture, &bench.world)?;
    let (mut successes, mut changed, mut worst) = ([0.0; 2], 0.0, Apart::default());
    for draw in 0..N_PERTURBED {
        let world = bench.perturbed(seed, JUDGING + draw);
        let here = apart(bench, answer, posture, &world)?;
        for (sum, success) in successes.iter_mut().zip(here.success) {
            *sum += f64::from(u8::from(success)) / N_PERTURBED as f64;
        }
        changed += f64::from(u8::from(here.success[0] != here.success[1]));
        worst = worst.or_worse(&here);
    }
    Ok(vec![
        Sample::median(name, "posture moved, rad", nominal.posture_rad),
        Sample::median(name, "joint moved farthest, rad", nominal.joint_rad),
        Sample::median(name, "pan off, mm", nominal.pan_mm),
        Sample::median(name, "pan off, deg", nominal.pan_deg),
        Sample::rate(name, "pan within 5 mm and 1 deg", nominal.is_within_bounds()),
        Sample::median(name, "pan off, worst of 20 worlds, mm", worst.pan_mm),
        Sample::median(name, "pan off, worst of 20 worlds, deg", worst.pan_deg),
        Sample::rate(name, "pan within 5 mm and 1 deg in 20 worlds", worst.is_within_bounds()),
        Sample::mean(name, "ticks clipped at the start posture", nominal.clipped[0]),
        Sample::mean(name, "ticks clipped, moved", nominal.clipped[1]),
        Sample::rate(name, "success at the start posture", nominal.success[0]),
        Sample::rate(name, "success, moved", nominal.success[1]),
        Sample::mean(name, "robustness at the start posture", successes[0]),
        Sample::mean(name, "robustness, moved", successes[1]),
        Sample::mean(name, "worlds of 20 with another outcome", changed),
    ])
}

fn apart(
    bench: &Bench,
    (problem, theta): &Answer,
    posture: &PostureMove,
    world: &PancakeConfig,
) -> Result<Apart> {
    let policy = bench.policy(problem, theta);
    let execute = |posture: &PostureMove| -> Result<(Vec<TickRecord>, bool)> {
        let records = bench.records_moved(problem, theta, &mut bench.plant(world), posture)?;
        let (_, success, _) = bench.judge.judge(&policy, &EpisodeHeader::default(), &records)?;
        Ok((records, success))
    };
    let (start, moved) = (execute(&PostureMove::NONE)?, execute(posture)?);
    let mut apart = Apart { success: [start.1, moved.1], ..Apart::default() };
    apart.clipped = [clipped(&start.0), clipped(&moved.0)];
    for (a, b) in executed(&start.0).zip(executed(&moved.0)) {
        let (q_a, q_b) = (JointVector::from(a.q), JointVector::from(b.q));
        let (pan_mm, pan_deg) = between(&bench.arm, &q_a, &q_b);
        apart.pan_mm = apart.pan_mm.max(pan_mm);
        apart.pan_deg = apart.pan_deg.max(pan_deg);
        apart.posture_rad = apart.posture_rad.max((q_a - q_b).norm());
        apart.joint_rad = apart.joint_rad.max((q_a - q_b).amax());
    }
    Ok(apart)
}

fn executed(records: &[TickRecord]) -> impl Iterator<Item = &TickRecord> {
    records.iter().filter(|record| record.phase == Phase::Execute as u32)
}

fn clipped(records: &[TickRecord]) -> f64 {
    let n = executed(records).filter(|record| record.flags & FLAG_TORQUE_CLIPPED != 0).count();
    n as f64 / executed(records).count().max(1) as f64
}

/// How far the tips of two postures are from each other, mm and degrees.
fn between(arm: &ArmModel, q_a: &JointVector, q_b: &JointVector) -> (f64, f64) {
    let [a, b]: [Isometry3<f64>; 2] = [q_a, q_b].map(|q| kinematics::tip_pose(arm, q));
    let distance = (a.translation.vector - b.translation.vector).norm();
    (1e3 * distance, a.rotation.angle_to(&b.rotation).to_degrees())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::setup;

    #[test]
    fn the_tip_stands_still_in_the_self_motion() {
        let arm = setup::arm(&Config::default()).unwrap();
        let q = Config::default().plant.start_posture();
        let n = self_motion(&arm, &q);
        assert!((n.amax() - 1.0).abs() < 1e-12);
        let jacobian = TipKinematics::new(&arm, &q, &JointVector::zeros()).J;
        assert!((jacobian * n).amax() < 1e-9);
        let (mm, deg) = between(&arm, &q, &(q + n * 1e-3));
        assert!(mm < 1e-2 && deg < 1e-3, "{mm} mm, {deg} deg");
        assert!(between(&arm, &q, &(q + JointVector::ith(0, 1e-3))).0 > 0.5);
    }
}
