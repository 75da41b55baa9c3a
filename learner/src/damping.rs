//! What damps the springs of a policy.

use nalgebra::{DMatrix, SymmetricEigen};
use shm_types::policy::{Component, PolicyMsg};

use crate::parameters::spectral;

/// Dampers of the learnt coordinates of a validated policy, one a spring (d×d, s⁻¹): 2ζ Kᵢ^½ with the
/// symmetric root, or κᵛ I where the policy has no damping ratio. None of a policy without springs.
pub fn dampers(policy: &PolicyMsg) -> Vec<DMatrix<f64>> {
    let d = policy.task_dim as usize;
    let damper = |component: &Component| match policy.damping_ratio {
        0.0 => DMatrix::from_diagonal_element(d, d, policy.damping),
        ratio => {
            let k = DMatrix::from_fn(d, d, |row, col| component.stiffness_at(row, col));
            spectral(&SymmetricEigen::new(k), |value| value.max(0.0).sqrt()) * (2.0 * ratio)
        }
    };
    policy.components().iter().map(damper).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use shm_types::policy::packed_index;

    #[test]
    fn a_damper_is_the_root_of_its_spring_or_the_same_for_all() {
        let mut policy = PolicyMsg { task_dim: 3, n_components: 1, ..PolicyMsg::EMPTY };
        policy.damping = 28.0;
        for (row, col, k) in [(0, 0, 300.0), (1, 1, 200.0), (2, 2, 60.0), (1, 0, 80.0)] {
            policy.components[0].stiffness[packed_index(row, col)] = k;
        }
        assert_eq!(dampers(&policy), [DMatrix::from_diagonal_element(3, 3, 28.0)]);
        policy.damping_ratio = 0.5;
        let damper = dampers(&policy).remove(0);
        let squared = &damper * &damper;
        for (row, col) in [(0, 0), (1, 1), (2, 2), (1, 0), (0, 2)] {
            let k = policy.components[0].stiffness_at(row, col);
            assert!((squared[(row, col)] - k).abs() < 1e-9, "2 · ½ · K^½, squared, is K");
        }
    }
}
