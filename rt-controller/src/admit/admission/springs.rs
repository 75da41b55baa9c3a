//! What the springs of Eq. (5) must satisfy.

use nalgebra::DMatrix;
use shm_types::policy::PolicyMsg;

use super::{AdmissionError, DAMPER_MAX, Room, STIFFNESS_MAX, STIFFNESS_MIN};

pub(super) fn check(message: &PolicyMsg, room: &Room) -> Result<(), AdmissionError> {
    for (i, component) in message.components().iter().enumerate() {
        let d = message.task_dim as usize;
        let K = DMatrix::from_fn(d, d, |r, c| component.stiffness_at(r, c));
        for &eigenvalue in K.symmetric_eigenvalues().iter() {
            if !(STIFFNESS_MIN..=STIFFNESS_MAX).contains(&eigenvalue) {
                return Err(AdmissionError::Stiffness { component: i, eigenvalue });
            }
            let (ratio, damper) =
                (message.damping_ratio, 2.0 * message.damping_ratio * eigenvalue.sqrt());
            if damper > DAMPER_MAX {
                return Err(AdmissionError::Damper { component: i, ratio, damper });
            }
        }
        if let Some(distance) = room.excess(&component.attractor) {
            let ([x, y, z, ..], limit) = (component.attractor, room.limit);
            return Err(AdmissionError::Attractor { component: i, x, y, z, distance, limit });
        }
    }
    Ok(())
}
