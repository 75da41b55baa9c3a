//! One virtual spring of Eq. (5).

#[cfg(feature = "transport")]
use iceoryx2::prelude::ZeroCopySend;

use super::{PolicyMsgError, packed_index};
use crate::{PACKED, TASK_DIM};

message! {
    /// One virtual spring of Eq. (5).
    pub struct Component as "skillet/Component/1" {
        /// Centre of the activation: seconds, or s ∈ (0, 1] when driven by decay.
        pub center: f64,
        /// Standard deviation of the activation, in the unit of `center`.
        pub width: f64,
        /// μᵢ: x, y, z, pitch, roll, yaw in m and rad, world frame. Coordinates from `task_dim` on
        /// are not learnt; they are the reference of the orientation controller.
        pub attractor: [f64; TASK_DIM],
        /// Kᵢ: packed lower triangle by rows of the leading `task_dim`×`task_dim` block, s⁻².
        pub stiffness: [f64; PACKED],
    }
}

impl Component {
    pub const ZERO: Component =
        Component { center: 0.0, width: 1.0, attractor: [0.0; TASK_DIM], stiffness: [0.0; PACKED] };

    /// Entry (row, column) of the symmetric Kᵢ.
    pub fn stiffness_at(&self, row: usize, column: usize) -> f64 {
        self.stiffness[packed_index(row, column)]
    }

    /// Ranges of all entries; `component` is its place in the policy.
    pub(super) fn validate(&self, component: usize) -> Result<(), PolicyMsgError> {
        let check = |field, value: f64, min: f64, max: f64| {
            if (min..=max).contains(&value) {
                Ok(())
            } else {
                Err(PolicyMsgError::ComponentRange { component, field, value, min, max })
            }
        };
        check("center", self.center, -30.0, 60.0)?;
        check("width", self.width, 1e-4, 30.0)?;
        for value in self.attractor {
            check("attractor", value, -100.0, 100.0)?;
        }
        for value in self.stiffness {
            check("stiffness", value, -1e6, 1e6)?;
        }
        Ok(())
    }
}
