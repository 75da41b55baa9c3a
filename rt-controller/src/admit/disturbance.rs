//! The effect of a posture offset on a policy: a dry run on ideal arms, before a real one moves.

use physics::arm::{ArmModel, JointVector, kinematics};
use physics::ideal::IdealArm;
use physics::plant::Plant;
use physics::referee::Referee;
use shm_types::episode::TickRecord;
use thiserror::Error;

use crate::config::ControllerConfig;
use crate::fault::Fault;
use crate::hot::policy::Policy;
use crate::hot::posture::PostureMove;
use crate::hot::rollout::Phase;
use crate::hot::tick::Controller;

/// How far the tip may be off, m and rad, and how much faster a joint may turn, rad/s. A wrist that passes
/// close to its singularity spins, and then the least touch disturbs it. Below this speed none was disturbed, and
/// not far above it some were (docs/adr/0031-posture-moved-by-hand.md).
const TIP_OFF_MAX_M: f64 = 5e-3;
const TIP_OFF_MAX_RAD: f64 = 0.0175;
const SPIN_MAX: f64 = 6.0;
/// Steps in which the part of an offset is searched that would fit.
const PARTS: u32 = 20;

/// Why a policy and a posture do not agree.
#[derive(Debug, Error, PartialEq)]
#[error("dry run: {cause}; {}", advice(*.fits))]
pub struct Disturbed {
    pub cause: Disturbance,
    /// The largest part of the offset that would fit, 0 where none does.
    pub fits: f64,
}

/// What the dry run showed first.
#[derive(Debug, Error, PartialEq)]
pub enum Disturbance {
    #[error(
        "at t = {t_s:.2} s joint {joint} ({name}) would turn {speed:.1} rad/s faster, as a wrist does close to \
         its singularity, and at most {SPIN_MAX} is allowed"
    )]
    Spin { t_s: f64, joint: usize, name: String, speed: f64 },
    #[error(
        "at t = {t_s:.2} s the tip would be {mm:.1} mm and {degrees:.1} degrees off, and 5 mm and 1 degree are \
         allowed"
    )]
    TipOff { t_s: f64, mm: f64, degrees: f64 },
    #[error("{fault} at t = {t_s:.2} s")]
    Fault { fault: &'static str, t_s: f64 },
}

fn advice(fits: f64) -> String {
    if fits > 0.0 {
        return format!("{fits:.2} times this offset would fit");
    }
    "no part of this offset fits: serve another policy or keep the start posture".to_string()
}

/// Checks that `policy` hardly notices the posture: executes it on two ideal arms, one of them with its posture
/// moved from the beginning, and compares them tick by tick.
///
/// # Errors
/// [`Disturbed`] when the tip is more than 5 mm or 1° off, a joint turns more than 6 rad/s faster, or the tick
/// falls back to the hold.
pub fn check_under(
    policy: &Policy,
    to: &PostureMove,
    model: &ArmModel,
    q0: &JointVector,
    config: &ControllerConfig,
) -> Result<(), Disturbed> {
    let mut rehearsal = Rehearsal { policy, model, q0, config, undisturbed: Vec::new() };
    rehearsal.undisturbed = rehearsal.undisturbed();
    let Err(cause) = rehearsal.compare(to) else { return Ok(()) };
    Err(Disturbed { cause, fits: rehearsal.part_that_fits(to) })
}

/// A policy, and its behaviour without a posture offset.
struct Rehearsal<'a> {
    policy: &'a Policy,
    model: &'a ArmModel,
    q0: &'a JointVector,
    config: &'a ControllerConfig,
    /// q, rad, and q̇, rad/s, tick by tick.
    undisturbed: Vec<(JointVector, JointVector)>,
}

impl Rehearsal<'_> {
    /// Executes the policy; `see` ends it with an error.
    fn execute(
        &self,
        to: &PostureMove,
        mut see: impl FnMut(&TickRecord) -> Result<(), Disturbance>,
    ) -> Result<(), Disturbance> {
        // The object has neither weight nor height there.
        let mut arm = IdealArm::new(self.model, self.q0, self.config.period_s(), 0.0);
        let mut controller = Controller::new(self.model, self.q0, self.config, &Referee::Clock);
        let mut record = TickRecord::ZERO;
        controller.move_posture(to);
        controller.start(self.policy);
        while controller.phase() != Phase::Idle {
            let tau = controller.tick(&arm.measure(), &mut record);
            see(&record)?;
            arm.apply(&tau);
            arm.advance();
        }
        Ok(())
    }

    fn undisturbed(&self) -> Vec<(JointVector, JointVector)> {
        let mut ticks = Vec::new();
        // It sees no disturbance.
        let _ = self.execute(&PostureMove::NONE, |record| {
            ticks.push((record.q.into(), record.qd.into()));
            Ok(())
        });
        ticks
    }

    fn compare(&self, to: &PostureMove) -> Result<(), Disturbance> {
        let mut undisturbed = self.undisturbed.iter();
        self.execute(to, |record| match undisturbed.next() {
            Some((q, qd)) => self.compare_tick(q, qd, record),
            None => Ok(()),
        })
    }

    fn compare_tick(
        &self,
        q: &JointVector,
        qd: &JointVector,
        moved: &TickRecord,
    ) -> Result<(), Disturbance> {
        let t_s = moved.t_s;
        if moved.fault != Fault::None as u32 {
            return Err(Disturbance::Fault { fault: Fault::describe(moved.fault), t_s });
        }
        let faster = JointVector::from(moved.qd) - qd;
        let (i, speed) = (faster.icamax(), faster.amax());
        if speed > SPIN_MAX {
            let name = self.model.joint_names()[i].clone();
            return Err(Disturbance::Spin { t_s, joint: i + 1, name, speed });
        }
        let [a, b] = [q, &moved.q.into()].map(|q| kinematics::tip_pose(self.model, q));
        let off_m = (a.translation.vector - b.translation.vector).norm();
        let off_rad = a.rotation.angle_to(&b.rotation);
        if off_m > TIP_OFF_MAX_M || off_rad > TIP_OFF_MAX_RAD {
            let (mm, degrees) = (1e3 * off_m, off_rad.to_degrees());
            return Err(Disturbance::TipOff { t_s, mm, degrees });
        }
        Ok(())
    }

    /// The largest part of an offset that fits, in steps of 1/[`PARTS`]: halving finds it, because what fits
    /// does so with every smaller part, too. The other way along the self-motion disturbs as much.
    fn part_that_fits(&self, to: &PostureMove) -> f64 {
        let part = |n: u32| f64::from(n) / f64::from(PARTS);
        let (mut fits, mut too_much) = (0, PARTS);
        while too_much - fits > 1 {
            let middle = u32::midpoint(fits, too_much);
            let some = PostureMove { offset: to.offset * part(middle), ..*to };
            match self.compare(&some) {
                Ok(()) => fits = middle,
                Err(_) => too_much = middle,
            }
        }
        part(fits)
    }
}
