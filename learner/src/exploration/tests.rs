//! The directions of the pancake's demonstration, and of skills that lack something.

use super::*;
use crate::LearnerConfig;
use crate::initial_policy::initial_policy;
use crate::parameters::ParameterMap;
use crate::problem::Problem;
use search::Space;

fn pancake() -> Demonstration {
    let path = concat!(env!("CARGO_MANIFEST_DIR"), "/../demos/pancake.csv");
    let text = std::fs::read_to_string(path).expect("the project's demonstration");
    Demonstration::parse("pancake.csv", &text).expect("it is valid")
}

fn config(task_dim: usize) -> LearnerConfig {
    LearnerConfig { task_dim, ..LearnerConfig::default() }
}

/// Two factors of stiffness for the whole movement.
fn uniform(task_dim: usize) -> LearnerConfig {
    with_stiffness(task_dim, StiffnessKind::Uniform)
}

fn with_stiffness(task_dim: usize, stiffness: StiffnessKind) -> LearnerConfig {
    let mut config = config(task_dim);
    config.exploration.stiffness = stiffness;
    config
}

fn space(config: &LearnerConfig, demonstration: &Demonstration) -> Space {
    Problem::new(config, std::slice::from_ref(demonstration))
        .expect("independent directions")
        .spaces
        .remove(0)
}

#[test]
fn what_is_not_learnt_or_not_there_gives_no_direction() {
    // Amplitude, offset, tempo and stiffness of the position; with pitch, three more.
    for (task_dim, directions) in [(3, 4), (4, 7), (6, 7)] {
        let space = space(&uniform(task_dim), &pancake());
        assert_eq!(space.exploration.ncols(), directions, "task_dim {task_dim}");
    }
    let mut level = pancake().poses().to_vec();
    level.iter_mut().for_each(|pose| pose[N_POSITIONS..].fill(0.0));
    let level = pancake().with_poses(level);
    assert_eq!(space(&uniform(4), &level).exploration.ncols(), 5, "no amplitude, no lag");

    let mut reach = pancake().poses().to_vec();
    let last = reach.len() as f64 - 1.0;
    reach.iter_mut().enumerate().for_each(|(k, pose)| pose[2] = 0.7 + 0.1 * k as f64 / last);
    let reach = pancake().with_poses(reach);
    let peak = Peak::of(&reach);
    assert_eq!(peak.reach_s, 0.0, "a movement that ends at its peak has nothing to move there");
}

#[test]
fn amounts_of_zero_leave_directions_out() {
    let mut config = uniform(4);
    config.exploration.tempo_s = 0.0;
    config.exploration.peak_offset_m = [0.05, 0.02, 0.0];
    config.exploration.rotation_log_stiffness = 0.0;
    assert_eq!(space(&config, &pancake()).exploration.ncols(), 6);
    config.exploration.kind = ExplorationKind::White;
    assert!(space(&config, &pancake()).is_white());
}

#[test]
fn each_direction_changes_what_it_says() {
    let (config, pancake) = (uniform(4), pancake());
    let columns = space(&config, &pancake).exploration;
    // Per component: x, y, z, pitch, then log K by rows of its lower triangle.
    let entry =
        |column: usize, component: usize, entry: usize| columns[(14 * component + entry, column)];
    let largest = |column: usize, entries: std::ops::Range<usize>| -> f64 {
        let all = (0..8).flat_map(|i| entries.clone().map(move |j| (i, j)));
        all.map(|(i, j)| entry(column, i, j).abs()).fold(0.0, f64::max)
    };
    // Higher, not turned; turned, not higher; forward at the peak only.
    assert!(largest(0, 2..3) > 1.0 && largest(0, 0..2).max(largest(0, 3..14)) < 1e-9);
    assert!(largest(1, 3..4) > 1.0 && largest(1, 0..3).max(largest(1, 4..14)) < 1e-9);
    assert!(largest(2, 0..1) > 1.0 && largest(2, 1..14) < 1e-9);
    assert!(entry(2, 0, 0).abs().max(entry(2, 7, 0).abs()) < 0.3 * largest(2, 0..1));
    // Sooner moves both, later the rotation only.
    assert!(largest(3, 2..3) > 1.0 && largest(3, 3..4) > 1.0);
    assert!(largest(4, 3..4) > 1.0 && largest(4, 0..3) < 1e-9);
    // 0.4 of log K in units of 0.3, on the diagonal.
    for (column, diagonal, other) in [(5, [4, 6, 9], 13), (6, [13; 3], 4)] {
        assert!(diagonal.iter().all(|&j| (entry(column, 3, j) - 0.4 / 0.3).abs() < 1e-9));
        assert!(entry(column, 3, other).abs() < 1e-9 && largest(column, 0..4) < 1e-9);
    }
}

#[test]
fn one_unit_along_a_direction_is_the_altered_demonstration() {
    let (config, pancake) = (config(4), pancake());
    let problem = Problem::new(&config, std::slice::from_ref(&pancake)).unwrap();
    let altered = alterations(&pancake, &config.exploration).swap_remove(0);
    let refitted = initial_policy(&altered, &config.initial_policy());
    let theta = &problem.spaces[0].theta_0 + problem.spaces[0].exploration.column(0);
    let initial = initial_policy(&pancake, &config.initial_policy());
    let map = ParameterMap::new(&initial, config.scales).unwrap();
    assert!((theta - map.encode(&refitted).unwrap()).amax() < 1e-12);
}

/// How many directions of stiffness there are, and that all but uniform ones open late.
#[test]
fn stiffness_has_the_directions_that_were_asked_for() {
    let kinematic = 5;
    for (kind, n) in [
        (StiffnessKind::Fixed, 0),
        (StiffnessKind::Uniform, 2),
        (StiffnessKind::Phases, 4),
        (StiffnessKind::Components, 16),
        // And z with pitch, the two that move, before and after the peak.
        (StiffnessKind::Full, 6),
    ] {
        let space = space(&with_stiffness(4, kind), &pancake());
        assert_eq!(space.exploration.ncols(), kinematic + n, "{kind:?}");
        for (i, direction) in space.directions.iter().enumerate() {
            assert_eq!(direction.grows, i == 0, "{kind:?}: only the position's amplitude");
            let is_late = i >= kinematic && kind != StiffnessKind::Uniform;
            assert_eq!(direction.late, is_late, "{kind:?}, direction {i}");
        }
    }
}

/// The phases of the pancake: components at 0, 0.2, 0.4 and 0.6 s come before the peak at 0.75 s.
#[test]
fn phases_change_the_stiffness_on_their_side_of_the_peak() {
    let space = space(&with_stiffness(4, StiffnessKind::Full), &pancake());
    let entry = |column: usize, component: usize, entry: usize| {
        space.exploration[(14 * component + entry, column)]
    };
    // Diagonal entries of log K: x, y, z at 4, 6 and 9, pitch at 13; z with pitch at 12.
    for (column, components, entries, amount) in [
        (5, 0..4, vec![4, 6, 9], 0.4),
        (6, 0..4, vec![13], 0.4),
        (7, 4..8, vec![4, 6, 9], 0.8),
        (8, 4..8, vec![13], 0.8),
        (9, 0..4, vec![12], 0.15),
        (10, 4..8, vec![12], 0.15),
    ] {
        for component in 0..8 {
            for j in 0..14 {
                let is_meant = components.contains(&component) && entries.contains(&j);
                let expected = if is_meant { amount / 0.3 } else { 0.0 };
                let found = entry(column, component, j);
                assert!((found - expected).abs() < 1e-9, "{column} {component} {j}: {found}");
            }
        }
    }
}

#[test]
fn movements_without_one_peak_have_no_phases() {
    let height = |z: &dyn Fn(f64) -> f64| {
        let mut poses = pancake().poses().to_vec();
        let last = poses.len() as f64 - 1.0;
        for (k, pose) in poses.iter_mut().enumerate() {
            *pose = pancake().poses()[0];
            pose[2] += z(k as f64 / last);
        }
        pancake().with_poses(poses)
    };
    let refusal = |demonstration: &Demonstration, components: usize| {
        let mut config = config(4);
        config.n_components = components.into();
        let problem = Problem::new(&config, std::slice::from_ref(demonstration));
        problem.err().map(|error| error.to_string())
    };
    let reach = height(&|s| 0.2 * s);
    let message = refusal(&reach, 8).unwrap();
    assert!(message.contains("does not go out and come back"), "{message}");
    assert!(message.contains("learner.exploration.stiffness"), "{message}");
    let swings = height(&|s| 0.2 * (4.0 * PI * s).sin());
    let message = refusal(&swings, 8).unwrap();
    assert!(message.contains("comes back twice, at 0."), "{message}");
    let wound_up = height(&|s| if s < 0.3 { -0.1 } else { 0.2 } * (PI * s).sin().abs());
    assert_eq!(refusal(&wound_up, 8), None, "winding up is no second peak");
    let early = height(&|s| 0.2 * (PI * s.powf(0.2)).sin());
    let message = refusal(&early, 2);
    assert_eq!(message, None);
    let message = refusal(&pancake(), 1).unwrap();
    assert!(message.contains("none of the 1 components lies after"), "{message}");
}

#[test]
fn attractors_stay_within_reach() {
    let mut config = config(4);
    config.exploration.attractor_reach_m = 0.1;
    let problem = Problem::new(&config, &[pancake()]).unwrap();
    let space = &problem.spaces[0];
    let far = &space.theta_0 + space.exploration.column(0) * 50.0;
    let policy = problem.decode(&space.inside(far), Default::default());
    let start = problem.decode(&space.theta_0, Default::default());
    let heights = |policy: &PolicyMsg| {
        let z = policy.components().iter().map(|component| component.attractor[2]);
        z.fold((f64::MAX, f64::MIN), |(low, high), z| (z.min(low), z.max(high)))
    };
    let ((low, high), (start_low, start_high)) = (heights(&policy), heights(&start));
    assert!((low - start_low + 0.1).abs() < 1e-9 && (high - start_high - 0.1).abs() < 1e-9);
}
