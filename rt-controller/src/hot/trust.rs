//! Which joints are believed after positions and speeds have contradicted each other.
//!
//! A sensor that is dead contradicts nothing while its joint rests. So a joint is believed again
//! only once its position has followed its speed over some way, or a person has re-armed.

use nalgebra::ArrayStorage;
use physics::arm::JointVector;

/// The way that proves a joint, rad, and the share of it by which position and speed may differ.
const PROOF: f64 = 0.02;
const DIFFERENCE: f64 = 0.25;

const NONE: JointVector = JointVector::from_array_storage(ArrayStorage([[0.0; N]]));
/// Places of a joint vector.
const N: usize = 7;

/// Sums since a joint was last doubted: ∫ q̇ dt by its speed, and by how much its position lags.
#[derive(Clone, Copy)]
pub(crate) struct Trust {
    way: JointVector,
    lag: JointVector,
    doubted: [bool; N],
}

impl Trust {
    pub const FULL: Trust = Trust { way: NONE, lag: NONE, doubted: [false; N] };

    /// Every joint must prove itself anew.
    pub fn doubt(&mut self) {
        *self = Trust { doubted: [true; N], ..Trust::FULL };
    }

    /// Takes in one sample: the joints' `way` by their speeds, and what their positions lag, rad.
    pub fn follow(&mut self, way: &JointVector, lag: &JointVector) {
        (self.way, self.lag) = (self.way + way, self.lag + lag);
        for i in 0..self.doubted.len() {
            let is_proof = self.way[i].abs() >= PROOF || self.lag[i].abs() >= PROOF;
            if self.doubted[i] && is_proof {
                self.doubted[i] = self.lag[i].abs() > DIFFERENCE * self.way[i].abs();
                (self.way[i], self.lag[i]) = (0.0, 0.0);
            }
        }
    }

    pub fn is_full(&self) -> bool {
        !self.doubted.contains(&true)
    }

    pub fn believes(&self, joint: usize) -> bool {
        !self.doubted[joint]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_joint_is_believed_when_its_position_has_followed_its_speed() {
        let mut trust = Trust::FULL;
        assert!(trust.is_full());
        trust.doubt();
        // Joint 0 moves as it says, joint 1 is frozen at a live speed, joint 2 creeps a little off,
        // joint 3 jumps without a speed, joint 4 rests.
        let way = JointVector::from_column_slice(&[1e-3, 1e-3, 1e-3, 0.0, 0.0, 0.0, 0.0]);
        let lag = JointVector::from_column_slice(&[0.0, -1e-3, 2e-4, 5e-3, 0.0, 0.0, 0.0]);
        for _ in 0..15 {
            trust.follow(&way, &lag);
        }
        assert!(!trust.believes(0), "too early");
        for _ in 0..100 {
            trust.follow(&way, &lag);
        }
        let believed = [0, 1, 2, 3, 4].map(|i| trust.believes(i));
        assert_eq!(believed, [true, false, true, false, false]);
    }
}
