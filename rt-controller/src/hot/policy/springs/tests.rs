//! Eq. (5), entry by entry.

use super::*;
use shm_types::policy::packed_index;

fn two_springs() -> PolicyMsg {
    let mut message = PolicyMsg { task_dim: 3, n_components: 2, ..PolicyMsg::EMPTY };
    message.damping = 10.0;
    message.orientation_stiffness = 400.0;
    message.orientation_damping = 40.0;
    for (i, component) in message.components.iter_mut().take(2).enumerate() {
        component.center = i as f64;
        component.width = 0.1;
        for row in 0..3 {
            component.stiffness[packed_index(row, row)] = 200.0;
        }
    }
    message.components[1].stiffness[packed_index(1, 0)] = 50.0;
    message.components[1].attractor = [1.0, 0.0, 0.0, 0.5, 0.0, 0.0];
    message.sealed()
}

#[test]
fn activations_sum_to_one_and_never_underflow() {
    let springs = Springs::new(&two_springs());
    for t in [-1e3, 0.0, 0.5, 1.0, 1e3] {
        let sum: f64 = springs.activations(t).iter().sum();
        assert!((sum - 1.0).abs() < 1e-15, "t = {t}: {sum}");
    }
    assert_eq!(springs.activations(1e3)[1], 1.0);
}

#[test]
fn full_stiffness_couples_coordinates_and_orientation_keeps_its_own_gains() {
    let springs = Springs::new(&two_springs());
    let task = TaskState::at(Vector6::zeros(), Vector6::repeat(1.0));
    let command = springs.command(1.0, &task);
    // hᵢ of the far spring is exp(−50): below the tolerance.
    let expected = [200.0 - 10.0, 50.0 - 10.0, -10.0, 400.0 * 0.5 - 40.0, -40.0, -40.0];
    for (found, expected) in command.xdd.iter().zip(expected) {
        assert!((found - expected).abs() < 1e-9, "{found} instead of {expected}");
    }
}

#[test]
fn a_spring_with_a_damper_of_its_own_is_critical_along_every_axis() {
    let mut message = two_springs();
    message.damping_ratio = 1.0;
    let springs = Springs::new(&message.sealed());
    let damper = springs.springs[1].damper.fixed_view::<3, 3>(0, 0) * 0.5;
    let stiffness = springs.springs[1].stiffness.fixed_view::<3, 3>(0, 0).clone_owned();
    assert!((damper * damper - stiffness).amax() < 1e-10, "half of it squared is K");

    let task = TaskState::at(Vector6::zeros(), Vector6::z());
    let command = springs.command(1.0, &task);
    // z is coupled with nothing: 2√200, where κᵛ is 10; what is not learnt keeps its own.
    assert!((command.xdd[2] + 2.0 * 200_f64.sqrt()).abs() < 1e-9, "{}", command.xdd[2]);
    let turning = TaskState::at(Vector6::zeros(), Vector6::ith(4, 1.0));
    assert!((springs.command(1.0, &turning).xdd[4] + 40.0).abs() < 1e-9);
}

#[test]
fn decay_runs_through_the_same_springs() {
    let mut message = two_springs();
    message.activation = ACTIVATION_DECAY;
    message.decay_rate = 2.0;
    message.components[0].center = 1.0;
    message.components[1].center = (-2.0f64).exp();
    let springs = Springs::new(&message);
    assert!(springs.activations(0.0)[0] > 0.999);
    assert!(springs.activations(1.0)[1] > 0.999);
}

/// Eq. (5) in the order in which it has always been added up: rollouts that are stored come out the same.
#[test]
fn springs_keep_their_bits() {
    let mut message = PolicyMsg { task_dim: 4, n_components: 5, ..PolicyMsg::EMPTY };
    message.damping = 28.3;
    (message.orientation_stiffness, message.orientation_damping) = (400.0, 40.0);
    for (i, component) in message.components[..5].iter_mut().enumerate() {
        (component.center, component.width) = (0.25 * i as f64, 0.11 + 0.01 * i as f64);
        component.attractor = std::array::from_fn(|k| 0.1 * k as f64 - 0.07 * i as f64);
        component.stiffness = std::array::from_fn(|k| 3.7 * k as f64 - 2.0 * i as f64);
        (0..6).for_each(|k| component.stiffness[packed_index(k, k)] += 210.0);
    }
    let springs = Springs::new(&message.sealed());
    let damping = Vector6::new(28.3, 28.3, 28.3, 28.3, 40.0, 40.0);
    for tick in 0..200 {
        let t = 0.006 * f64::from(tick);
        let x = Vector6::from_fn(|k, _| 0.013 * f64::from(tick) - 0.2 * k as f64);
        let task = TaskState::at(x, x * 0.3);
        let logs: [f64; 5] = std::array::from_fn(|i| {
            let component = &message.components[i];
            let z = (t - component.center) / component.width;
            -0.5 * z * z - component.width.ln()
        });
        let largest = logs.into_iter().fold(f64::NEG_INFINITY, f64::max);
        let weights = logs.map(|log| (log - largest).exp());
        let sum = weights.iter().fold(0.0, |sum, weight| sum + weight);
        let mut xdd = -damping.component_mul(&task.xd);
        for (weight, spring) in weights.iter().zip(&springs.springs) {
            xdd += spring.stiffness * (spring.attractor - task.x) * (weight / sum);
        }
        assert_eq!(springs.command(t, &task).xdd, xdd, "at {t} s");
    }
}

#[test]
fn on_the_sphere_an_error_is_the_shortest_rotation() {
    let mut message = two_springs();
    message.orientation = ORIENTATION_SPHERE;
    message.components[1].attractor = [1.0, 0.0, 0.0, 0.0, 0.0, 3.0];
    let springs = Springs::new(&message.sealed());
    // Half a turn about yaw lies between 3 and −3 rad: 2π − 6 apart.
    let task = TaskState::at(Vector6::ith(5, -3.0), Vector6::zeros());
    let xdd = springs.command(1.0, &task).xdd;
    assert!((xdd[5] + 400.0 * (std::f64::consts::TAU - 6.0)).abs() < 1e-9, "{xdd}");
    assert!((xdd[0] - 200.0).abs() < 1e-9, "positions are as ever");
    let near = TaskState::at(Vector6::ith(5, 2.9), Vector6::zeros());
    assert!((springs.command(1.0, &near).xdd[5] - 40.0).abs() < 1e-9);
}
