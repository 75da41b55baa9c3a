//! What the exchange needs to know of its controller.

use std::path::Path;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;

use physics::arm::JointVector;
use shm_types::equipment::Equipment;
use shm_types::policy::PolicyMsg;

use crate::admit::admission::AdmissionError;
use crate::admit::disturbance::Disturbed;
use crate::admit::posture::PostureError;
use crate::config::Pace;
use crate::executor::latch::Latch;
use crate::hot::posture::PostureMove;
use crate::remote::PlantName;

/// Checks a message; the policy to execute and the records it can fill.
type Admit<'a, P> = &'a dyn Fn(&PolicyMsg) -> Result<(P, usize), AdmissionError>;

/// Checks an offset of the posture, rad, reached within some time, s, from the offset of before, rad.
type AdmitPosture<'a> =
    &'a dyn Fn(&JointVector, f64, &JointVector) -> Result<PostureMove, PostureError>;

/// Checks that a policy hardly notices a posture.
type CheckPosture<'a, P> = &'a dyn Fn(&P, &PostureMove) -> Result<(), Disturbed>;

pub(crate) struct Setup<'a, P> {
    /// Identifies this start of the controller.
    pub boot_id: u64,
    /// Admission of a proposal, which is executed once.
    pub admit: Admit<'a, P>,
    /// Admission of a policy to be served, with the dry run.
    pub admit_to_serve: Admit<'a, P>,
    pub admit_posture: AdmitPosture<'a>,
    pub check_posture: CheckPosture<'a, P>,
    pub period_ns: u64,
    /// Time between two records.
    pub record_ns: u64,
    pub pace: Pace,
    /// What is driven; of a plant in another process, its name is to be added.
    pub equipment: Equipment,
    pub plant_apart: Option<PlantName>,
    pub privileged: &'a AtomicBool,
    pub latch: &'a Latch,
    pub n_joints: usize,
    /// A policy can be exchanged within a rollout, and takes over within so many ticks.
    pub can_swap: bool,
    pub blend_ticks: u64,
    /// Serve without a learner that was not heard for so long; never when absent.
    pub alone_after: Option<Duration>,
    /// Where the catalogue lives; in memory when absent.
    pub state: Option<&'a Path>,
}

impl<P> Setup<'_, P> {
    pub fn is_realtime(&self) -> bool {
        self.pace != Pace::Max
    }

    /// What is driven now.
    pub fn equipment(&self) -> Equipment {
        match &self.plant_apart {
            Some(name) => Equipment { plant: name.get(), ..self.equipment },
            None => self.equipment,
        }
    }

    pub fn is_privileged(&self) -> bool {
        self.privileged.load(Ordering::Relaxed)
    }
}
