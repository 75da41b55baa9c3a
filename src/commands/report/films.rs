//! Rollouts as they moved: postures of the arm from the joints of a rollout executed again, where the simulation
//! is in this process and comes to the same; from the path of the tip otherwise.

#![allow(non_snake_case)] // monogram notation: X_WP

use anyhow::Result;
use learner::path::{DECIMATION, PathRow, unwrapped};
use learner::store::{Store, TrialRecord};
use nalgebra::{Isometry3, Translation3, UnitQuaternion, Vector3};
use physics::arm::urdf::LoadedArm;
use physics::arm::{JointVector, inverse_kinematics};
use shm_types::episode::TickRecord;

use crate::commands::replay::{Again, Replayed};
use crate::config::Config;
use crate::report::{Film, Links, Look, followed};
use crate::setup;

/// Shows rollouts of a session.
pub struct Projector<'a> {
    store: &'a Store,
    trials: &'a [TrialRecord],
    again: Option<Again<'a>>,
    arm: Option<(LoadedArm, JointVector)>,
}

impl<'a> Projector<'a> {
    /// What cannot be loaded any more is not drawn: a report of what was learnt must not fail on it.
    pub fn new(store: &'a Store, config: &Config, trials: &'a [TrialRecord]) -> Projector<'a> {
        let is_here = config.has_arm() && !config.plant.is_external();
        let again = is_here.then(|| Again::of(store, config).ok()).flatten();
        let arm = config.has_arm().then(|| setup::load_arm(config).ok()).flatten();
        let arm = arm.map(|arm| (arm, config.plant.start_posture()));
        Projector { store, trials, again, arm }
    }

    /// The path of a rollout; that of the tip in place of an object where none is tracked.
    pub fn path(&self, rollout: u64) -> Result<Vec<PathRow>> {
        let rows = self.store.path(rollout)?.unwrap_or_default();
        let is_vector = self.store.meta().learner.orientation.is_vector();
        Ok(followed(if is_vector { rows } else { unwrapped(rows) }))
    }

    /// A rollout, whether its postures are those of its joints, and what it was executed again as.
    pub fn film(&mut self, rollout: u64) -> Result<(Film, Option<Replayed>)> {
        let path = self.path(rollout)?;
        let Some((arm, q0)) = &self.arm else {
            return Ok((Film { rollout, path, arm: Vec::new() }, None));
        };
        let trial = self.trials.iter().find(|trial| trial.rollout == rollout);
        let replayed = trial.zip(self.again.as_mut()).and_then(|(trial, again)| {
            again.replay(trial).ok().filter(|replayed| replayed.is_same(trial))
        });
        let place = |q: &JointVector| arm.appearance.placed(&arm.model, q);
        let links: Vec<Links> = match &replayed {
            Some(replayed) => postures(&replayed.records).map(|q| place(&q)).collect(),
            None => solved(arm, q0, &path).iter().map(place).collect(),
        };
        Ok((Film { rollout, path, arm: links }, replayed))
    }

    /// What the arm and what it handles look like.
    pub fn look(&self, config: &Config, is_measured: bool) -> Option<Look> {
        let (arm, _) = self.arm.as_ref()?;
        let solids = (config.task().ok()?.arm().ok()?.solids)(config);
        let radii = arm.appearance.capsules.iter().map(|capsule| capsule.radius).collect();
        Some(Look { radii, has_shapes: arm.appearance.has_shapes, is_measured, solids })
    }
}

/// The postures of the rows of a path, rad.
fn postures(records: &[TickRecord]) -> impl Iterator<Item = JointVector> {
    records.iter().step_by(DECIMATION).map(|record| JointVector::from(record.q))
}

/// Postures in which the tip is where the path says, each next to the one before.
fn solved(arm: &LoadedArm, q0: &JointVector, path: &[PathRow]) -> Vec<JointVector> {
    let mut q = *q0;
    let posture = |row: &PathRow| {
        let [pitch, roll, yaw] = row.pan_rotation.map(f64::from);
        let turn = UnitQuaternion::from_scaled_axis(Vector3::new(roll, pitch, yaw));
        let at = Translation3::from(row.pan_position.map(f64::from));
        // Where it is not within reach, the arm is drawn as it was.
        q = inverse_kinematics::solve(&arm.model, &Isometry3::from_parts(at, turn), &q)
            .unwrap_or(q);
        q
    };
    path.iter().map(posture).collect()
}
