//! A movement recorded elsewhere, moved to where the arm starts.
#![allow(non_snake_case)] // monogram notation: X_WP, R

use nalgebra::Isometry3;

/// Moves `path` so that it begins at `X_WS`. Displacements and turns since the first pose stay what they
/// are in the world's axes: up stays up, whatever frame the recorded tip had,
///
/// p ← p_S + (p − p₀),  R ← (R R₀⁻¹) R_S.
pub fn begin_at(path: &mut [Isometry3<f64>], X_WS: &Isometry3<f64>) {
    let Some(first) = path.first().copied() else { return };
    for pose in path {
        pose.translation.vector += X_WS.translation.vector - first.translation.vector;
        pose.rotation = pose.rotation * first.rotation.inverse() * X_WS.rotation;
    }
}

#[cfg(test)]
mod tests {
    use nalgebra::{UnitQuaternion, Vector3};

    use super::*;

    #[test]
    fn begins_there_and_keeps_steps_and_turns() {
        let pose = |p: [f64; 3], r: [f64; 3]| {
            let rotation = UnitQuaternion::from_scaled_axis(Vector3::from(r));
            Isometry3::from_parts(Vector3::from(p).into(), rotation)
        };
        // A tool that points down, and tosses up while it turns about y.
        let down = UnitQuaternion::from_axis_angle(&Vector3::x_axis(), 3.1);
        let mut path =
            vec![pose([5.0, 1.0, 2.0], [0.0; 3]), pose([5.1, 1.0, 2.3], [0.0, 0.4, 0.0])];
        path.iter_mut().for_each(|X| X.rotation *= down);
        let start = pose([0.7, 0.0, 0.6], [0.0, 0.0, 0.5]);
        begin_at(&mut path, &start);
        assert!((path[0].to_homogeneous() - start.to_homogeneous()).abs().max() < 1e-12);
        let step = path[1].translation.vector - path[0].translation.vector;
        assert!((step - Vector3::new(0.1, 0.0, 0.3)).norm() < 1e-12);
        let turn = path[1].rotation * path[0].rotation.inverse();
        assert!((turn.scaled_axis() - Vector3::new(0.0, 0.4, 0.0)).norm() < 1e-12);
    }
}
