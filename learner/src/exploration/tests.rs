//! The directions of the pancake's demonstration, and of skills that lack something.

use super::*;
use crate::LearnerConfig;
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
        let space = space(&config(task_dim), &pancake());
        assert_eq!(space.exploration.ncols(), directions, "task_dim {task_dim}");
    }
    let mut level = pancake().poses().to_vec();
    level.iter_mut().for_each(|pose| pose[N_POSITIONS..].fill(0.0));
    let level = pancake().with_poses(level);
    assert_eq!(space(&config(4), &level).exploration.ncols(), 5, "no amplitude, no lag");

    let mut reach = pancake().poses().to_vec();
    let last = reach.len() as f64 - 1.0;
    reach.iter_mut().enumerate().for_each(|(k, pose)| pose[2] = 0.7 + 0.1 * k as f64 / last);
    let reach = pancake().with_poses(reach);
    let peak = Peak::of(&reach);
    assert_eq!(peak.reach_s, 0.0, "a movement that ends at its peak has nothing to move there");
}

#[test]
fn amounts_of_zero_leave_directions_out() {
    let mut config = config(4);
    config.exploration.tempo_s = 0.0;
    config.exploration.peak_offset_m = [0.05, 0.02, 0.0];
    config.exploration.rotation_log_stiffness = 0.0;
    assert_eq!(space(&config, &pancake()).exploration.ncols(), 6);
    config.exploration.kind = ExplorationKind::White;
    assert!(space(&config, &pancake()).is_white());
}

#[test]
fn each_direction_changes_what_it_says() {
    let (config, pancake) = (config(4), pancake());
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
    let refitted = initial_policy(&pancake.with_poses(altered), &config.initial_policy());
    let theta = &problem.spaces[0].theta_0 + problem.spaces[0].exploration.column(0);
    let initial = initial_policy(&pancake, &config.initial_policy());
    let map = ParameterMap::new(&initial, config.scales).unwrap();
    assert!((theta - map.encode(&refitted).unwrap()).amax() < 1e-12);
}
