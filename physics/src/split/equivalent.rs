//! The free body that gives way to a push as an arm's tip does.

use nalgebra::{Matrix3, Rotation3, SMatrix, UnitQuaternion, Vector2, Vector3};

use super::MassFactor;
use crate::arm::{Jacobian, MAX_JOINTS};

/// Directions in which a tip gives way less than this, in 1/kg or 1/(kg·m²), are taken to give way
/// that much: a singular posture has a mass without end.
const LEAST_MOBILITY: f64 = 1e-4;

/// A rigid body with the mobility Λ⁻¹ = J·M⁻¹·Jᵀ of an arm's tip: wherever something presses on the
/// plane z = 0 of the tip's frame P along its normal, it moves and tilts as the arm does.
///
/// Λ⁻¹ has 21 numbers and a body ten. Along the normal and about both axes in the plane they agree
/// exactly, as does the spin about the normal; for pushes along the plane, as friction is, the mass is
/// that of the normal. What is done to the arm itself is exact: see [`super::Arm::finish`].
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct EquivalentBody {
    /// kg.
    pub mass: f64,
    /// Centre of mass in P, m; it lies in the plane.
    pub p_PBcm: Vector3<f64>,
    /// Principal moments of inertia about it, kg·m²; the third is about z.
    pub inertia: Vector3<f64>,
    /// The principal axes are those of P turned by this much about z, rad.
    pub angle: f64,
}

impl EquivalentBody {
    /// The equivalent body of an arm with the tip's rotation `R_WP`, its Jacobian and a mass matrix.
    ///
    /// With S = G·M⁻¹·Gᵀ, the rows of G being v_z, ω_x, ω_y and ω_z of the tip in P: the tilts' block
    /// S₁₁ is 1/I in its principal axes; a force along z gives the tilt b = S₀₁, which a centre of
    /// mass at c gives when S₁₁·(−c_y, c_x) = b; and 1/m is what is left of S₀₀.
    pub(super) fn of(R_WP: &UnitQuaternion<f64>, J: &Jacobian, M: &MassFactor) -> EquivalentBody {
        let R_PW: Matrix3<f64> = R_WP.to_rotation_matrix().into_inner().transpose();
        let mut G = SMatrix::<f64, 4, MAX_JOINTS>::zeros();
        G.fixed_rows_mut::<1>(0).copy_from(&(R_PW.row(2) * J.fixed_rows::<3>(0)));
        G.fixed_rows_mut::<3>(1).copy_from(&(R_PW * J.fixed_rows::<3>(3)));
        let S = G * M.solve(&G.transpose());

        let (mean, half) = ((S[(1, 1)] + S[(2, 2)]) / 2.0, (S[(1, 1)] - S[(2, 2)]) / 2.0);
        let radius = half.hypot(S[(1, 2)]);
        let angle = 0.5 * S[(1, 2)].atan2(half);
        let (sin, cos) = angle.sin_cos();
        let b = Vector2::new(S[(0, 1)], S[(0, 2)]);

        let mut left = S[(0, 0)];
        let mut lever = Vector2::zeros();
        let axes = [Vector2::new(cos, sin), Vector2::new(-sin, cos)];
        let tilts = [mean + radius, mean - radius];
        for (axis, tilt) in axes.iter().zip(tilts) {
            if tilt > LEAST_MOBILITY {
                let share = b.dot(axis);
                lever += axis * (share / tilt);
                left -= share * share / tilt;
            }
        }
        let inverse = |mobility: f64| 1.0 / mobility.max(LEAST_MOBILITY);
        EquivalentBody {
            mass: inverse(left),
            p_PBcm: Vector3::new(lever.y, -lever.x, 0.0),
            inertia: Vector3::new(inverse(tilts[0]), inverse(tilts[1]), inverse(S[(3, 3)])),
            angle,
        }
    }

    /// Inertia about the centre of mass in the axes of P, kg·m².
    pub fn inertia_P(&self) -> Matrix3<f64> {
        self.in_P(&self.inertia)
    }

    /// Its inverse, 1/(kg·m²).
    pub fn inverse_inertia_P(&self) -> Matrix3<f64> {
        self.in_P(&self.inertia.map(|inertia| 1.0 / inertia))
    }

    fn in_P(&self, principal: &Vector3<f64>) -> Matrix3<f64> {
        let R = Rotation3::from_axis_angle(&Vector3::z_axis(), self.angle).into_inner();
        R * Matrix3::from_diagonal(principal) * R.transpose()
    }
}
