//! Springs that were fitted on the sphere, followed by a body that does what they ask for.

use std::f64::consts::TAU;

use nalgebra::Vector3;

use super::*;
use crate::initial_policy::{InitialPolicyConfig, frame, initial_policy};
use crate::orientation::Orientation;

const STEP_S: f64 = 1e-3;

fn config() -> InitialPolicyConfig {
    InitialPolicyConfig {
        task_dim: 6,
        orientation: Orientation::Sphere,
        ..InitialPolicyConfig::default()
    }
}

/// `turn` of the progress of a movement of least jerk in `duration_s`, with quaternions, at 50 Hz.
fn turning(duration_s: f64, turn: impl Fn(f64) -> UnitQuaternion<f64>) -> Demonstration {
    let n = (duration_s / 0.02).round() as usize;
    let row = |k: usize| {
        let u = k as f64 / n as f64;
        let u = u * u * u * (10.0 - 15.0 * u + 6.0 * u * u);
        let q = turn(u);
        format!("{},{},0,0.7,{},{},{},{}\n", 0.02 * k as f64, 0.6 + 0.1 * u, q.w, q.i, q.j, q.k)
    };
    let rows: String = (0..=n).map(row).collect();
    Demonstration::parse("turn.csv", &format!("t_s,x_m,y_m,z_m,qw,qx,qy,qz\n{rows}")).unwrap()
}

fn about(axis: Vector3<f64>, angle: f64) -> UnitQuaternion<f64> {
    UnitQuaternion::from_scaled_axis(axis * angle)
}

/// What a body did that follows a policy on the sphere by Eq. (5).
struct Followed {
    /// The largest change of ω̇ in a tick, rad/s².
    jump: f64,
    /// ∫ω dt, rad.
    turned: Vector3<f64>,
    /// The largest angle to what was shown, and the last, rad.
    largest: f64,
    last: f64,
}

fn follow(policy: &PolicyMsg, shown: &Demonstration) -> Followed {
    let (K, rotations) = (stiffnesses(policy), shown.rotations());
    let attractors: Vec<_> = policy.components().iter().map(|one| exp(&one.attractor)).collect();
    let (mut R, mut omega, mut before) = (rotations[0], Vector3::zeros(), None::<Vector3<f64>>);
    let mut followed = Followed { jump: 0.0, turned: Vector3::zeros(), largest: 0.0, last: 0.0 };
    for k in 0..=(policy.duration_s / STEP_S) as usize {
        let t_s = k as f64 * STEP_S;
        let mut alpha = omega * -policy.damping;
        for ((h, attractor), K) in policy_activations(policy, t_s).iter().zip(&attractors).zip(&K) {
            let error =
                Vector6::from(with_rotation(&[0.0; 6], &(attractor * R.inverse()).scaled_axis()));
            let pull: Pose = (K * error * *h).into();
            alpha += rotation(&pull);
        }
        followed.jump = before.map_or(0.0, |before| followed.jump.max((alpha - before).amax()));
        before = Some(alpha);
        let at = ((t_s / shown.period_s()).round() as usize).min(rotations.len() - 1);
        followed.last = R.angle_to(&rotations[at]);
        followed.largest = followed.largest.max(followed.last);
        omega += alpha * STEP_S;
        followed.turned += omega * STEP_S;
        R = UnitQuaternion::from_scaled_axis(omega * STEP_S) * R;
    }
    followed
}

fn fitted(shown: &Demonstration, n_components: usize) -> PolicyMsg {
    let config = InitialPolicyConfig { n_components, ..config() };
    placed(&frame(&config, shown.duration_s()), std::slice::from_ref(shown))
}

/// About one axis and within half a turn the sphere is where it was before.
#[test]
fn the_pancake_is_fitted_as_with_rotation_vectors() {
    let text = include_str!("../../../../demos/pancake.csv");
    let pancake = Demonstration::parse("pancake.csv", text).unwrap();
    for task_dim in [3, 4, 6] {
        let config = InitialPolicyConfig { task_dim, ..config() };
        let vectors = InitialPolicyConfig { orientation: Orientation::Vector, ..config };
        let policy = placed(&frame(&config, pancake.duration_s()), std::slice::from_ref(&pancake));
        assert_eq!(policy.validate(), Ok(()));
        let expected = initial_policy(&pancake, &vectors);
        for (found, expected) in policy.components().iter().zip(expected.components()) {
            for c in 0..6 {
                let error = (found.attractor[c] - expected.attractor[c]).abs();
                assert!(error < 1e-5, "{task_dim}, {c}: {error}");
            }
        }
    }
}

#[test]
fn full_turns_are_followed_without_a_jump() {
    for (turns, n, duration_s) in [(1.0, 10, 4.0), (1.0, 12, 4.0), (-1.5, 16, 5.0)] {
        let shown = turning(duration_s, |u| about(Vector3::z(), 0.3 + TAU * turns * u));
        let policy = fitted(&shown, n);
        assert_eq!(policy.validate(), Ok(()));
        assert_eq!(too_far(&policy, std::slice::from_ref(&shown)), None);
        let followed = follow(&policy, &shown);
        assert!((followed.turned.z - TAU * turns).abs() < 0.05, "{turns}: {}", followed.turned);
        assert!(followed.largest < 0.15 && followed.last < 0.05, "{turns}: {}", followed.largest);
        // A smooth command; a jump to another side is hundreds.
        assert!(followed.jump < 5.0, "{turns}: {} rad/s² in a tick", followed.jump);
        // In the message it goes on beyond π.
        let last = policy.components()[n - 1].attractor[5];
        assert!((last - 0.3 - TAU * turns).abs() < 0.2, "{last}");
    }
}

/// A turn about an axis that turns itself has no rotation vector that is continuous.
#[test]
fn turns_about_several_axes_are_followed() {
    let shown = turning(4.0, |u| {
        about(Vector3::z(), TAU * u) * about(Vector3::x(), 1.5 * u) * about(Vector3::y(), 0.8 * u)
    });
    let followed = follow(&fitted(&shown, 12), &shown);
    assert!(
        followed.largest < 0.1 && followed.last < 0.05,
        "{} {}",
        followed.largest,
        followed.last
    );
    assert!(followed.jump < 5.0, "{}", followed.jump);
}

#[test]
fn too_few_components_for_a_turn_are_noticed() {
    let shown = turning(1.0, |u| about(Vector3::z(), TAU * u));
    let policy = fitted(&shown, 3);
    let far = too_far(&policy, std::slice::from_ref(&shown)).expect("half a turn apart");
    assert!(far.file == "turn.csv" && far.turn > MAX_TURN_RAD, "{far:?}");
}

/// Full matrices and dampers of their own: the springs that made a movement are found again.
#[test]
fn springs_of_any_stiffness_are_found_where_they_were() {
    let shown = turning(2.0, |u| about(Vector3::new(0.6, 0.0, 0.8), 1.5 * u));
    for damping_ratio in [0.0, 1.0] {
        let config = InitialPolicyConfig { damping_ratio, ..config() };
        let mut frame = frame(&config, shown.duration_s());
        for component in &mut frame.components[2..4] {
            component.stiffness[shm_types::policy::packed_index(1, 0)] = 80.0;
            component.stiffness[shm_types::policy::packed_index(5, 4)] = -120.0;
            component.stiffness[shm_types::policy::packed_index(5, 5)] = 300.0;
        }
        let policy = placed(&frame, std::slice::from_ref(&shown));
        let K = stiffnesses(&policy);
        let moments = moments(&policy, &[shown.on_sphere()]);
        let attractors: Vec<Attractor> = policy
            .components()
            .iter()
            .map(|one| Attractor { pose: one.attractor, R: exp(&one.attractor) })
            .collect();
        let rest = missing(&moments, &attractors, &K, true).norm();
        let none = starts(&policy, &shown);
        let before = missing(&moments, &none, &K, true).norm();
        assert!(rest < 0.1 * before, "{damping_ratio}: {rest} of {before}");
        // What is 20 mm or mrad away is worse.
        for c in 0..6 {
            for amount in [-0.02, 0.02] {
                let (mut step, mut moved) = (Vector6::zeros(), attractors.clone());
                step[c] = amount;
                moved[3] = attractors[3].moved(&step);
                assert!(missing(&moments, &moved, &K, true).norm() > rest, "{c}, {amount}");
            }
        }
    }
}
