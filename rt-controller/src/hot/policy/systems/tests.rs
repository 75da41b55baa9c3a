//! Eq. (2) against the formulas written once more, and what the damped law promises.

use super::super::springs::Springs;
use super::*;
use nalgebra::{Matrix3, Vector3};
use shm_types::TASK_DIM;
use shm_types::policy::{ACTIVATION_TIME, packed_index};

const FOLLOWING: f64 = 40.0;

/// Three springs with full matrices and dampers alike, and what is not learnt.
fn springs(task_dim: u32) -> PolicyMsg {
    let mut message = PolicyMsg { task_dim, n_components: 3, ..PolicyMsg::EMPTY };
    message.damping = 25.0;
    (message.orientation_stiffness, message.orientation_damping) = (400.0, 40.0);
    for (i, component) in message.components[..3].iter_mut().enumerate() {
        (component.center, component.width) = (0.3 * i as f64, 0.1 + 0.05 * i as f64);
        component.attractor = [0.7, 0.1 * i as f64, 0.5, 0.2, -0.1, 0.3];
        for row in 0..task_dim as usize {
            component.stiffness[packed_index(row, row)] = 200.0 + 50.0 * row as f64;
            component.stiffness[packed_index(row, 0)] += 20.0 * i as f64;
        }
    }
    message.sealed()
}

/// Aᵢ = (−Kᵢ, −κᵛ), bᵢ = Kᵢ μᵢ: Eq. (5) as a case of Eq. (2).
fn as_systems(message: &PolicyMsg) -> PolicyMsg {
    let d = message.task_dim as usize;
    let n_systems = message.n_components;
    let mut systems = PolicyMsg { n_components: 0, n_systems, ..*message };
    systems.target = message.components[0].attractor;
    for (system, component) in systems.systems.iter_mut().zip(message.components()) {
        (system.center[0], system.covariance[0]) = (component.center, component.width.powi(2));
        for row in 0..d {
            system.of_velocity[TASK_DIM * row + row] = -message.damping;
            for column in 0..d {
                let k = component.stiffness_at(row, column);
                system.of_position[TASK_DIM * row + column] = -k;
                system.offset[row] += k * component.attractor[column];
            }
        }
    }
    systems.sealed()
}

#[test]
fn springs_are_a_case_of_systems() {
    for task_dim in [3, 4, 6] {
        let message = springs(task_dim);
        let (springs, systems) = (Springs::new(&message), Systems::new(&as_systems(&message)));
        let task = TaskState::at(
            Vector6::new(0.6, 0.2, 0.4, 0.1, -0.2, 0.3),
            Vector6::new(0.1, -0.3, 0.2, 0.4, 0.5, -0.6),
        );
        for t_s in [-0.2, 0.0, 0.14, 0.45, 1.0] {
            let (a, b) = (springs.command(t_s, &task), systems.command(t_s, &task));
            assert!((a.xdd - b.xdd).amax() < 1e-10, "{task_dim} at {t_s}: {} {}", a.xdd, b.xdd);
            let (h, k) = (springs.activations(t_s), systems.activations(t_s, &task));
            assert!(h.iter().zip(k).all(|(h, k)| (h - k).abs() < 1e-14), "{h:?} {k:?}");
        }
        let attractor = systems.command(0.1, &task).attractor;
        assert_eq!(attractor[0], task.x[0], "an acceleration is drawn nowhere");
        let unlearnt = if task_dim == 6 { task.x[5] } else { message.components[0].attractor[5] };
        assert_eq!(attractor[5], unlearnt);
    }
}

/// ẋ = Σ hᵢ(t) [aᵢ t + bᵢ], as GMR in time yields it.
fn regression() -> PolicyMsg {
    let mut message = PolicyMsg { task_dim: 3, n_systems: 2, ..PolicyMsg::EMPTY };
    (message.activation, message.output) = (ACTIVATION_TIME, OUTPUT_VELOCITY);
    (message.following, message.duration_s) = (FOLLOWING, 1.0);
    (message.orientation_stiffness, message.orientation_damping) = (400.0, 40.0);
    for (i, system) in message.systems[..2].iter_mut().enumerate() {
        system.log_prior = [0.3_f64, 0.7][i].ln();
        (system.center[0], system.covariance[0]) = ([0.3, 0.6][i], [0.02, 0.05][i]);
        system.of_drive[..3].copy_from_slice(&[[0.5, -1.0, 0.0], [-0.2, 0.4, 0.3]][i]);
        system.offset[..3].copy_from_slice(&[[0.1, 0.2, -0.1], [0.0, -0.3, 0.2]][i]);
    }
    message.sealed()
}

#[test]
fn regression_in_time_is_exact_and_ends_with_the_movement() {
    let systems = Systems::new(&regression());
    let task = TaskState::at(Vector6::repeat(0.1), Vector6::new(0.3, 0.1, -0.2, 0.0, 0.0, 0.5));
    for t in [0.0, 0.2, 0.45, 0.9, 1.0] {
        let density = |prior: f64, mean: f64, variance: f64| {
            prior * (-0.5 * (t - mean) * (t - mean) / variance).exp() / variance.sqrt()
        };
        let (a, b) = (density(0.3, 0.3, 0.02), density(0.7, 0.6, 0.05));
        let first = Vector3::new(0.5, -1.0, 0.0) * t + Vector3::new(0.1, 0.2, -0.1);
        let second = Vector3::new(-0.2, 0.4, 0.3) * t + Vector3::new(0.0, -0.3, 0.2);
        let f = (first * a + second * b) / (a + b);
        let command = systems.command(t, &task);
        for i in 0..3 {
            let expected = FOLLOWING * (f[i] - task.xd[i]);
            assert!((command.xdd[i] - expected).abs() < 1e-12, "{i} at {t}");
            assert!((command.attractor[i] - task.x[i] - f[i] / FOLLOWING).abs() < 1e-15);
        }
        assert!((command.xdd[5] - (400.0 * -0.1 - 40.0 * 0.5)).abs() < 1e-12, "held, not learnt");
    }
    let after = systems.command(1.1, &task);
    assert_eq!(after.xdd[0], -FOLLOWING * task.xd[0], "it comes to rest");
    assert_eq!(after.attractor[0], task.x[0]);
}

/// A field of the state in three coordinates around its target, with full matrices.
fn field() -> PolicyMsg {
    let mut message = PolicyMsg { task_dim: 3, n_systems: 2, ..PolicyMsg::EMPTY };
    (message.activation, message.output) = (ACTIVATION_STATE, OUTPUT_VELOCITY);
    (message.following, message.target) = (FOLLOWING, [0.5, 0.1, 0.8, 0.0, 0.0, 0.0]);
    let target = Vector3::new(0.5, 0.1, 0.8);
    for (i, system) in message.systems[..2].iter_mut().enumerate() {
        system.log_prior = -0.4 * i as f64;
        let A = matrix(i);
        let b = -A * target;
        for row in 0..3 {
            system.center[row] = [[0.3, 0.0, 0.7], [0.5, 0.1, 0.8]][i][row];
            system.offset[row] = b[row];
            for column in 0..3 {
                system.covariance[packed_index(row, column)] = covariance(i)[(row, column)];
                system.of_position[TASK_DIM * row + column] = A[(row, column)];
            }
        }
    }
    message.sealed()
}

fn matrix(i: usize) -> Matrix3<f64> {
    match i {
        0 => Matrix3::new(-3.0, 1.0, 0.0, -1.0, -2.0, 0.5, 0.0, -0.5, -4.0),
        _ => Matrix3::new(-2.0, 0.0, 1.0, 0.0, -2.0, 0.0, -1.0, 0.0, -2.0),
    }
}

fn covariance(i: usize) -> Matrix3<f64> {
    match i {
        0 => Matrix3::new(0.02, 0.01, 0.0, 0.01, 0.03, 0.002, 0.0, 0.002, 0.01),
        _ => Matrix3::new(0.01, 0.0, -0.004, 0.0, 0.05, 0.0, -0.004, 0.0, 0.02),
    }
}

fn place(x: f64, y: f64, z: f64) -> Vector6<f64> {
    Vector6::new(x, y, z, 0.1, 0.2, 0.3)
}

#[test]
fn the_state_drives_activations_by_whole_gaussians() {
    let message = field();
    let systems = Systems::new(&message);
    for x in [place(0.3, 0.05, 0.75), place(0.6, -0.2, 0.9), place(0.5, 0.1, 0.8)] {
        let at = Vector3::new(x[0], x[1], x[2]);
        let density = |i: usize| {
            let e = at - Vector3::from_column_slice(&message.systems[i].center[..3]);
            let sigma = covariance(i);
            let quadratic = (e.transpose() * sigma.try_inverse().unwrap() * e)[0];
            (-0.4 * i as f64 - 0.5 * quadratic).exp() / sigma.determinant().sqrt()
        };
        let (a, b) = (density(0), density(1));
        let h = systems.activations(7.0, &TaskState::at(x, Vector6::zeros()));
        assert!((h[0] - a / (a + b)).abs() < 1e-12 && (h[0] + h[1] - 1.0).abs() < 1e-15);

        let e = at - Vector3::new(0.5, 0.1, 0.8);
        let f = (matrix(0) * a + matrix(1) * b) / (a + b) * e;
        let command = systems.command(7.0, &TaskState::at(x, Vector6::repeat(0.2)));
        for i in 0..3 {
            assert!((command.xdd[i] - FOLLOWING * (f[i] - 0.2)).abs() < 1e-10, "{i} at {x}");
        }
    }
    let far = TaskState::at(place(1e6, -1e6, 1e6), Vector6::zeros());
    assert!((systems.activations(0.0, &far).iter().sum::<f64>() - 1.0).abs() < 1e-15);
    assert!(systems.command(0.0, &far).xdd.iter().all(|x| x.is_finite()));
}

#[test]
fn a_covariance_that_is_none_is_no_panic() {
    let mut message = field();
    message.systems[0].covariance[0] = -1.0;
    let systems = Systems::new(&message.sealed());
    let h = systems.activations(0.0, &TaskState::at(place(0.3, 0.0, 0.7), Vector6::zeros()));
    assert!(h.iter().all(|h| h.is_finite()));
}

/// Pseudo-random numbers in −1..1.
fn noise(k: usize) -> f64 {
    (k as f64 * 12.9898).sin() * 43758.5453 % 1.0
}

#[test]
fn the_damped_law_injects_a_quarter_of_what_the_field_asks_at_most() {
    let systems = Systems::new(&field());
    let mut closest: f64 = 0.0;
    for k in 0..2000 {
        let x = place(0.5 + 0.4 * noise(k), 0.4 * noise(k + 1), 0.8 + 0.4 * noise(k + 2));
        let at_rest = systems.command(0.0, &TaskState::at(x, Vector6::zeros())).xdd;
        let f = Vector3::new(at_rest[0], at_rest[1], at_rest[2]) / FOLLOWING;
        let bound = FOLLOWING * f.norm_squared() / 4.0;
        // Half of f is where most is injected.
        let v = f * 0.5 + Vector3::new(noise(k + 3), noise(k + 4), noise(k + 5)) * 0.1;
        let xd = Vector6::new(v.x, v.y, v.z, 0.0, 0.0, 0.0);
        let xdd = systems.command(0.0, &TaskState::at(x, xd)).xdd;
        let power = xd.fixed_rows::<3>(0).dot(&xdd.fixed_rows::<3>(0));
        assert!(power <= bound * (1.0 + 1e-9), "{power} of {bound} W/kg");
        closest = closest.max(power / bound);
    }
    assert!(closest > 0.9, "the bound is reached nearly: {closest}");
}

/// f = −∇V with V = ½ (x − x*)ᵀ G (x − x*).
#[test]
fn the_damped_law_is_passive_on_a_gradient() {
    let mut message = field();
    message.n_systems = 1;
    let G = Matrix3::new(3.0, 1.0, 0.0, 1.0, 2.0, -0.5, 0.0, -0.5, 4.0);
    let target = Vector3::new(0.5, 0.1, 0.8);
    let b = G * target;
    for row in 0..3 {
        message.systems[0].offset[row] = b[row];
        for column in 0..3 {
            message.systems[0].of_position[TASK_DIM * row + column] = -G[(row, column)];
        }
    }
    let systems = Systems::new(&message.sealed());
    let storage = |x: &Vector3<f64>, v: &Vector3<f64>| {
        let e = x - target;
        0.5 * v.norm_squared() + 0.5 * FOLLOWING * (e.transpose() * G * e)[0]
    };
    const DT: f64 = 1e-5;
    let (mut x, mut v, mut fed) = (Vector3::new(0.3, 0.0, 0.9), Vector3::zeros(), 0.0);
    let start = storage(&x, &v);
    for k in 0..100_000 {
        // Pushes of 20 ms in any direction.
        let push = Vector3::from_fn(|i, _| 20.0 * noise(3 * (k / 2000) + i));
        let task = TaskState::at(place(x.x, x.y, x.z), Vector6::new(v.x, v.y, v.z, 0.0, 0.0, 0.0));
        let xdd = systems.command(0.0, &task).xdd;
        let a = Vector3::new(xdd[0], xdd[1], xdd[2]) + push;
        let before = v;
        v += a * DT;
        let middle = (before + v) * 0.5;
        x += middle * DT;
        fed += middle.dot(&push) * DT;
        assert!(storage(&x, &v) <= start + fed + 1e-3, "energy from nowhere after {k} steps");
    }
    assert!(fed > 0.1, "the pushes did work: {fed} J/kg");
}

#[test]
fn on_the_sphere_a_field_leads_to_its_target_the_shortest_way() {
    let mut message = PolicyMsg { task_dim: 6, n_systems: 1, ..PolicyMsg::EMPTY };
    (message.activation, message.output) = (ACTIVATION_STATE, OUTPUT_VELOCITY);
    (message.following, message.target) = (FOLLOWING, [0.0, 0.0, 0.0, 0.0, 0.0, 3.0]);
    for i in 0..6 {
        message.systems[0].covariance[packed_index(i, i)] = 1.0;
        message.systems[0].of_position[TASK_DIM * i + i] = -2.0;
    }
    message.orientation = ORIENTATION_SPHERE;
    // A yaw of −3 rad is 2π − 6 beyond one of 3 rad.
    let beyond = std::f64::consts::TAU - 6.0;
    let task = TaskState::at(Vector6::new(0.0, 0.0, 0.0, 0.0, 0.0, -3.0), Vector6::zeros());
    let xdd = Systems::new(&message.sealed()).command(0.0, &task).xdd;
    assert!((xdd[5] + 2.0 * FOLLOWING * beyond).abs() < 1e-9, "{xdd}");
    assert!(xdd.rows(0, 5).amax() < 1e-9);
    message.orientation = 0;
    let difference = Systems::new(&message.sealed()).command(0.0, &task).xdd;
    assert!((difference[5] - 2.0 * FOLLOWING * 3.0).abs() < 1e-9, "about zero, not the target");
}
