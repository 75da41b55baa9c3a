//! The fitted policy reproduces the demonstration, as far as the arm follows Eq. (5) exactly.

use super::*;
use crate::activation::policy_activations;
use crate::trajectory::Pose;

fn pancake() -> Demonstration {
    let path = concat!(env!("CARGO_MANIFEST_DIR"), "/../demos/pancake.csv");
    let text = std::fs::read_to_string(path).expect("the project's demonstration");
    Demonstration::parse(path, &text).expect("the demonstration is valid")
}

/// Eq. (5): ẍ = Σᵢ hᵢ[Kᵢ(μᵢ − x) − κᵛẋ], integrated from rest at 1 kHz (semi-implicit Euler);
/// coordinates from `task_dim` on with the orientation gains. One state per ms.
fn integrate(policy: &PolicyMsg, start: Pose) -> Vec<(Pose, Pose)> {
    const STEP_S: f64 = 1e-3;
    let d = policy.task_dim as usize;
    let (mut x, mut xd) = (start, [0.0; TASK_DIM]);
    let mut states = vec![(x, xd)];
    for k in 0..(policy.duration_s / STEP_S).round() as usize {
        let h = policy_activations(policy, k as f64 * STEP_S);
        let mut xdd = [0.0; TASK_DIM];
        for (weight, component) in h.iter().zip(policy.components()) {
            let error: Pose = std::array::from_fn(|c| component.attractor[c] - x[c]);
            for row in 0..TASK_DIM {
                let pull = if row < d {
                    (0..d).map(|col| component.stiffness_at(row, col) * error[col]).sum::<f64>()
                        - policy.damping * xd[row]
                } else {
                    policy.orientation_stiffness * error[row] - policy.orientation_damping * xd[row]
                };
                xdd[row] += weight * pull;
            }
        }
        for c in 0..TASK_DIM {
            xd[c] += STEP_S * xdd[c];
            x[c] += STEP_S * xd[c];
        }
        states.push((x, xd));
    }
    states
}

struct Reproduction {
    rms: Pose,
    z_stroke_m: f64,
    demonstrated_stroke_m: f64,
    top_speed_m_s: f64,
}

fn reproduce(config: &InitialPolicyConfig) -> Reproduction {
    let demonstration = pancake();
    let policy = initial_policy(&demonstration, config);
    assert_eq!(policy.validate(), Ok(()));
    let states = integrate(&policy, demonstration.poses()[0]);
    let poses = demonstration.poses();
    let rms = std::array::from_fn(|c| {
        let squares =
            poses.iter().enumerate().map(|(k, pose)| (states[10 * k].0[c] - pose[c]).powi(2));
        (squares.sum::<f64>() / poses.len() as f64).sqrt()
    });
    let stroke = |values: &mut dyn Iterator<Item = f64>| {
        let (low, high) = values.fold((f64::MAX, f64::MIN), |(l, h), z| (l.min(z), h.max(z)));
        high - low
    };
    Reproduction {
        rms,
        z_stroke_m: stroke(&mut states.iter().map(|(x, _)| x[2])),
        demonstrated_stroke_m: stroke(&mut poses.iter().map(|pose| pose[2])),
        top_speed_m_s: states.iter().map(|(_, xd)| xd[2]).fold(0.0, f64::max),
    }
}

#[test]
fn lays_out_eight_components_a_fifth_of_a_second_apart() {
    let policy = initial_policy(&pancake(), &InitialPolicyConfig::default());
    for (i, component) in policy.components().iter().enumerate() {
        assert!((component.center - 0.2 * i as f64).abs() < 1e-12);
        assert!((component.width - 0.1).abs() < 1e-12);
        assert_eq!(component.stiffness_at(2, 2), 200.0);
        assert_eq!(component.stiffness_at(2, 1), 0.0);
    }
    assert!((policy.damping - 28.284).abs() < 1e-3);
}

/// Measured: RMS 4.3 mm in z and 0.021 rad in pitch (0.015 rad with the orientation gains); stroke
/// 0.230 of 0.220 m; 0.935 m/s upwards, against 0.94 m/s of an independent reproduction.
#[test]
fn reproduces_the_demonstration() {
    for task_dim in [3, 4, 6] {
        let result = reproduce(&InitialPolicyConfig { task_dim, ..Default::default() });
        assert!((result.z_stroke_m - result.demonstrated_stroke_m).abs() < 0.015);
        assert!((result.top_speed_m_s - 0.94).abs() < 0.02, "{}", result.top_speed_m_s);
        assert!(result.rms[2] < 0.01 && result.rms[3] < 0.05);
    }
}

#[test]
fn decay_reproduces_the_demonstration_too() {
    let config = InitialPolicyConfig { activation: Activation::Decay, ..Default::default() };
    let result = reproduce(&config);
    assert!((result.z_stroke_m - result.demonstrated_stroke_m).abs() < 0.03);
    let policy = initial_policy(&pancake(), &config);
    assert_eq!(policy.components[0].center, 1.0);
    assert!((policy.components[7].center - (-2.8_f64).exp()).abs() < 1e-12);
}

#[test]
fn any_number_of_components_gives_an_admissible_policy() {
    for n_components in 1..=MAX_COMPONENTS {
        for activation in [Activation::Time, Activation::Decay] {
            let config = InitialPolicyConfig { n_components, activation, ..Default::default() };
            assert_eq!(initial_policy(&pancake(), &config).validate(), Ok(()));
        }
    }
}
