//! Limits between the commanded and the applied torque: pure functions, one per limit.

use physics::arm::{JointLimits, JointVector};

/// Pushes a joint back that is closer than `margin` rad to its limit: a spring that reaches the
/// joint's whole torque limit at the limit itself, where of a command that drives the joint
/// outwards nothing is left. In between it keeps the share that the spring does not have,
///
/// τ = min(τ_c, (1 − s) τ_max) − s τ_max,  s = (q − q_max + margin) / margin,
///
/// at the upper limit, so that the push wins from the middle of the margin on, however large τ_c is.
/// Returns the torque and whether it acted.
pub fn push_from_joint_limits(
    limits: &JointLimits,
    q: &JointVector,
    tau: &JointVector,
    margin: f64,
) -> (JointVector, bool) {
    let mut acted = false;
    let torque = JointVector::from_fn(|i, _| {
        let tau_max = limits.tau_max[i];
        let below = (limits.q_min[i] + margin - q[i]).max(0.0);
        let above = (q[i] - limits.q_max[i] + margin).max(0.0);
        // A joint that the arm does not have has no torque and no room.
        if tau_max == 0.0 || (below == 0.0 && above == 0.0) {
            return tau[i];
        }
        acted = true;
        let left = |push: f64| tau_max * (1.0 - push / margin).max(0.0);
        // Not by `min` and `max`: they would make a number of a torque that is none.
        let kept = match tau[i] {
            tau if above > 0.0 && tau > left(above) => left(above),
            tau if below > 0.0 && tau < -left(below) => -left(below),
            tau => tau,
        };
        kept + tau_max * (below - above) / margin
    });
    (torque, acted)
}

/// Fades the torque that would speed a joint up: full below `taper`·q̇_max, none at q̇_max and
/// beyond. Torques that brake pass. Returns the torque and whether it acted.
pub fn taper_speed(
    limits: &JointLimits,
    qd: &JointVector,
    tau: &JointVector,
    taper: f64,
) -> (JointVector, bool) {
    let mut acted = false;
    let tapered = JointVector::from_fn(|i, _| {
        let speed = qd[i].abs() / limits.qd_max[i].max(f64::MIN_POSITIVE);
        if speed <= taper || tau[i] * qd[i] <= 0.0 {
            return tau[i];
        }
        acted = true;
        tau[i] * ((1.0 - speed) / (1.0 - taper)).clamp(0.0, 1.0)
    });
    (tapered, acted)
}

/// Clamps to ±τ_max. Returns the torque and whether it acted.
pub fn clamp_torque(limits: &JointLimits, tau: &JointVector) -> (JointVector, bool) {
    let clamped = JointVector::from_fn(|i, _| tau[i].clamp(-limits.tau_max[i], limits.tau_max[i]));
    (clamped, clamped != *tau)
}

/// Limits the change since the last tick to `max_step` of the torque limit. Between two torques
/// within the limits, so is the result. Returns the torque and whether it acted.
pub fn limit_torque_rate(
    limits: &JointLimits,
    last: &JointVector,
    tau: &JointVector,
    max_step: f64,
) -> (JointVector, bool) {
    let limited = JointVector::from_fn(|i, _| {
        let step = max_step * limits.tau_max[i];
        last[i] + (tau[i] - last[i]).clamp(-step, step)
    });
    (limited, limited != *tau)
}

/// True when every entry is a number.
pub fn is_finite(v: &JointVector) -> bool {
    v.iter().all(|x| x.is_finite())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn limits() -> JointLimits {
        JointLimits {
            q_min: JointVector::repeat(-1.0),
            q_max: JointVector::repeat(2.0),
            qd_max: JointVector::repeat(4.0),
            tau_max: JointVector::repeat(10.0),
        }
    }

    #[test]
    fn joint_limit_pushes_inwards_with_full_torque_at_the_limit() {
        let mut q = JointVector::zeros();
        let still = JointVector::zeros();
        assert_eq!(push_from_joint_limits(&limits(), &q, &still, 0.1), (still, false));
        (q[0], q[1], q[2]) = (-1.0, 2.0, 1.95);
        let (tau, acted) = push_from_joint_limits(&limits(), &q, &still, 0.1);
        assert!(acted);
        assert!((tau[0] - 10.0).abs() < 1e-12);
        assert!((tau[1] + 10.0).abs() < 1e-12);
        assert!((tau[2] + 5.0).abs() < 1e-9);
    }

    #[test]
    fn the_push_wins_against_any_command_from_the_middle_of_the_margin_on() {
        let commands = [1.0, 9.9, 1e3, 1e9, f64::MAX];
        for (command, beyond) in commands.iter().flat_map(|c| [(c, 0.0), (c, 0.1), (c, 5.0)]) {
            for (q, outwards) in [(2.0 + beyond, 1.0), (-1.0 - beyond, -1.0)] {
                let (tau, _) = push_from_joint_limits(
                    &limits(),
                    &JointVector::repeat(q),
                    &JointVector::repeat(outwards * command),
                    0.1,
                );
                let (tau, _) = clamp_torque(&limits(), &tau);
                assert!((tau[0] + outwards * 10.0).abs() < 1e-9, "{command} at {q}: {}", tau[0]);
            }
            let (q, tau) = (JointVector::repeat(1.96), JointVector::repeat(*command));
            assert!(push_from_joint_limits(&limits(), &q, &tau, 0.1).0[0] < 0.0, "{command}");
        }
        let (q, none) = (JointVector::repeat(2.0), JointVector::repeat(f64::NAN));
        assert!(push_from_joint_limits(&limits(), &q, &none, 0.1).0[0].is_nan(), "not hidden");
        // Inwards a command loses nothing, and clear of the margin none does.
        let (q, tau) = (JointVector::repeat(2.0), JointVector::repeat(-3.0));
        assert_eq!(push_from_joint_limits(&limits(), &q, &tau, 0.1).0[0], -13.0);
        let q = JointVector::repeat(1.8);
        assert_eq!(push_from_joint_limits(&limits(), &q, &(tau * 1e9), 0.1).0, tau * 1e9);
    }

    #[test]
    fn speed_taper_never_weakens_a_brake() {
        let qd = JointVector::from_column_slice(&[3.8, -3.8, 3.0, 5.0, 5.0, 0.0, 0.0]);
        let tau = JointVector::from_column_slice(&[8.0, 8.0, 8.0, 8.0, -8.0, 8.0, 0.0]);
        let (tapered, acted) = taper_speed(&limits(), &qd, &tau, 0.9);
        let expected = JointVector::from_column_slice(&[4.0, 8.0, 8.0, 0.0, -8.0, 8.0, 0.0]);
        assert!(acted);
        assert!((tapered - expected).abs().max() < 1e-9, "{tapered}");
    }

    #[test]
    fn clamp_and_rate_stay_within_their_bounds() {
        let tau = JointVector::repeat(1e9);
        let (clamped, acted) = clamp_torque(&limits(), &tau);
        assert_eq!((clamped, acted), (JointVector::repeat(10.0), true));
        let (limited, acted) = limit_torque_rate(&limits(), &JointVector::zeros(), &clamped, 0.2);
        assert_eq!((limited, acted), (JointVector::repeat(2.0), true));
        assert_eq!(limit_torque_rate(&limits(), &limited, &limited, 0.2), (limited, false));
    }

    #[test]
    fn finite_check_catches_what_comparisons_let_pass() {
        let mut tau = JointVector::zeros();
        tau[6] = f64::NAN;
        assert!(!is_finite(&tau));
        assert!(clamp_torque(&limits(), &tau).0[6].is_nan(), "a clamp is no finite check");
    }
}
