//! A made-up session for the tests: the demonstration's policy, one that throws harder, a pancake
//! that flies like a stone and turns as it should.

use std::f64::consts::PI;

use learner::activation::policy_activations;
use learner::demonstration::Demonstration;
use learner::initial_policy::{InitialPolicyConfig, initial_policy};
use learner::path::PathRow;
use nalgebra::{DMatrix, DVector, SMatrix, SVector, UnitQuaternion, Vector3};
use rt_controller::Pace;
use rt_controller::disk::timing_file::LoopTiming;
use search::Mode;
use shm_types::measures::{Measure, Measures, TRUTH};
use shm_types::policy::{PolicyMsg, packed_index};

use super::{
    Attempt, Circumstance, FLIP, Film, LinkTo, Links, Look, ModeRow, Origin, Pictures, ReportData,
    Robustness, Term, TrialRow,
};
use crate::provenance::Run;
use crate::record::solids::Solids;

/// Parameters of a made-up policy.
const DIM: usize = 6;
const GRAVITY: f64 = 9.81;
const RELEASE_S: f64 = 0.56;
const SPEED: f64 = 3.1;
const DROP_HEIGHT: f64 = 0.1;

/// A session of `n` rollouts that gets better.
pub fn session(n: u64) -> ReportData {
    let demonstration =
        Demonstration::parse("pancake.csv", include_str!("../../demos/pancake.csv"))
            .expect("the demonstration of the repository is valid");
    let initial = initial_policy(&demonstration, &InitialPolicyConfig::default());
    let learnt = learnt(initial);
    let (path, crossing_s) = flip(&learnt);
    let film =
        Film { rollout: n.saturating_sub(3).max(1), arm: path.iter().map(arm).collect(), path };
    let learnt_measures = measures(&[
        ("caught", 1.0),
        ("release_time_s", RELEASE_S),
        ("release_speed_m_s", SPEED),
        ("release_spin_rad_s", 5.1),
        ("apex_m", SPEED * SPEED / (2.0 * GRAVITY) + 0.03),
        ("crossing_time_s", crossing_s),
        ("flip_angle_rad", 3.02),
        ("distance_m", 0.106),
        ("lateral_m", 0.034),
        ("final_lateral_m", 0.028),
        ("bounce_s", 0.012),
        ("clipped_share", 0.03),
    ]);
    ReportData {
        task: "pancake".into(),
        session: "2026-01-31-1412-seed7".into(),
        seed: 7,
        config_toml: "[task]\nname = \"pancake\"\n\n[learner]\nkappa_p = 200.0\n".into(),
        trials: (1..=n).map(trial).collect(),
        initial,
        learnt,
        learnt_rollout: n.saturating_sub(3).max(1),
        initial_path: flip(&initial).0.into_iter().map(keep_pancake_in_pan).collect(),
        modes: modes(&film),
        film,
        look: Some(Look {
            radii: vec![0.07, 0.05],
            has_shapes: false,
            is_measured: true,
            solids: Solids { tip: ("pan", vec![]), object: ("pancake", vec![]), has_string: false },
        }),
        demonstrations: vec![demonstration],
        terms: terms(n),
        robustness: Ok(robustness()),
        origin: Origin { runs: Ok(vec![Run::here(0)]) },
        files: vec![LinkTo::new("all trials, CSV", "trials.csv")],
        learnt_measures,
        notes: vec![("rollouts per second".into(), "4.2".into())],
        timing: Ok(vec![LoopTiming {
            pace: Pace::Realtime,
            ticks: 1900,
            missed_deadlines: 1,
            wakeup: vec![(51_000, 1500), (61_000, 399), (1_200_000, 1)],
            tick: vec![(1700, 1000), (2100, 900)],
        }]),
        pictures: Pictures::Toss,
        tip: "pan",
        object: "pancake",
        success: Some(FLIP),
    }
}

/// A base and a link that ends at the pan.
fn arm(row: &PathRow) -> Links {
    let pan = Vector3::from(row.pan_position.map(f64::from));
    let shoulder = Vector3::new(0.0, 0.0, 0.35);
    vec![[Vector3::zeros(), shoulder], [shoulder, pan - Vector3::x() * 0.3]]
}

fn terms(n: u64) -> Vec<Term> {
    let term = |name: &str, k| Term {
        name: name.into(),
        values: (0..n).map(|rollout| 0.5 + 0.4 * noise(7 * rollout + k)).collect(),
    };
    vec![term("height", 1), term("flip angle", 2), term("aim", 3), term("catch", 4)]
}

fn robustness() -> Robustness {
    let attempt = |value, reward| Attempt { value, success: reward > 0.5, reward };
    let attempts = |values: [f64; 4]| values.into_iter().zip([0.2, 1.0, 1.0, 0.9]);
    let circumstance = |name, unit, values| Circumstance {
        name,
        unit,
        attempts: attempts(values).map(|(value, reward)| attempt(value, reward)).collect(),
    };
    Robustness {
        policy: "the policy of rollout 4".into(),
        as_learnt: attempt(0.0, 1.2),
        circumstances: vec![
            circumstance("forward", "cm", [-2.0, -1.0, 1.0, 2.0]),
            circumstance("mass", "×", [0.5, 0.75, 1.5, 2.0]),
        ],
    }
}

/// Two of them, the first the answer.
fn modes(film: &Film) -> Vec<ModeRow> {
    let row = |number: usize, prior, best| ModeRow {
        mode: Mode {
            prior,
            mean: DVector::from_fn(DIM, |i, _| 0.4 * noise((i + number) as u64)),
            covariance: DMatrix::from_diagonal_element(DIM, DIM, 0.02),
        },
        number,
        policy_id: 1_000_000 + number as u64,
        film: Some(film.clone()),
        n_trials: 12,
        best: Some((9, best)),
        tolerance: Some(0.8),
        is_answer: number == 1,
        forbidden: false,
    };
    vec![row(1, 0.7, 1.2), row(2, 0.3, 0.9)]
}

/// A number in −1..1 that looks random.
fn noise(seed: u64) -> f64 {
    let mixed = (seed + 1).wrapping_mul(0x9E37_79B9_7F4A_7C15);
    let mixed = (mixed ^ (mixed >> 29)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
    (mixed >> 11) as f64 / (1_u64 << 52) as f64 - 1.0
}

fn trial(rollout: u64) -> TrialRow {
    let skill = 1.0 - (-(rollout as f64) / 30.0).exp();
    let shaken = |k: u64, size: f64| size * noise(17 * rollout + k);
    let apex_m = (0.15 + 0.45 * skill + shaken(1, 0.12)).max(0.0);
    let crossed = apex_m > 0.2;
    let flip_angle_rad = (0.4 + 2.7 * skill + shaken(2, 0.9)).clamp(0.0, PI);
    let lateral_m = (0.2 - 0.17 * skill + shaken(3, 0.1)).abs();
    let success = crossed && flip_angle_rad > 2.55 && lateral_m < 0.085;
    let distance_m = lateral_m.hypot(DROP_HEIGHT);
    let mut measured = vec![("caught", f64::from(u8::from(success))), ("apex_m", apex_m)];
    if crossed {
        measured.extend([
            ("release_time_s", 0.55),
            ("release_speed_m_s", (2.0 * GRAVITY * apex_m).sqrt()),
            ("release_spin_rad_s", 2.0 + 3.0 * skill),
            ("crossing_time_s", 1.2),
            ("flip_angle_rad", flip_angle_rad),
            ("distance_m", distance_m),
            ("lateral_m", lateral_m),
        ]);
    }
    let reward = if crossed {
        0.5 * flip_angle_rad / PI + 0.5 * (-distance_m).exp() + 0.5 * apex_m
    } else {
        0.5 * apex_m
    };
    let theta = DVector::from_fn(DIM, |i, _| skill * noise(100 * rollout + i as u64));
    let (measures, fault) = (measures(&measured), u64::from(rollout % 41 == 40));
    TrialRow { rollout, theta, reward, success, is_mean: false, measures, fault }
}

/// The measures of a pancake: those given, 0 the others.
pub fn measures(given: &[(&str, f64)]) -> Measures {
    const ALL: [(&str, &str); 12] = [
        ("caught", TRUTH),
        ("release_time_s", "s"),
        ("release_speed_m_s", "m/s"),
        ("release_spin_rad_s", "rad/s"),
        ("apex_m", "m"),
        ("crossing_time_s", "s"),
        ("flip_angle_rad", "rad"),
        ("distance_m", "m"),
        ("lateral_m", "m"),
        ("final_lateral_m", "m"),
        ("bounce_s", "s"),
        ("clipped_share", "1"),
    ];
    let value =
        |name: &str| given.iter().find(|(given, _)| *given == name).map_or(0.0, |(_, x)| *x);
    let all = ALL.map(|(name, unit)| Measure { name, unit, value: value(name) });
    Measures::of(all).expect("they fit")
}

/// Stiff for the throw, compliant for the catch.
fn learnt(mut policy: PolicyMsg) -> PolicyMsg {
    const STIFFNESS: [f64; 8] = [210.0, 300.0, 520.0, 610.0, 260.0, 90.0, 70.0, 110.0];
    for (i, k_zz) in STIFFNESS.into_iter().enumerate() {
        let component = &mut policy.components[i];
        for c in 0..4 {
            let size = if c < 3 { 0.022 } else { 0.1 };
            component.attractor[c] += size * noise((10 * i + c) as u64);
            let k = if c == 2 { k_zz } else { 200.0 + 60.0 * noise((90 * i + c) as u64) };
            component.stiffness[packed_index(c, c)] = k;
        }
        component.stiffness[packed_index(2, 0)] = 60.0 * noise(300 + i as u64);
    }
    policy.components[3].attractor[2] += 0.09;
    policy.sealed()
}

/// Eq. (5), integrated, with a pancake thrown at [`RELEASE_S`]; and when it falls back.
fn flip(policy: &PolicyMsg) -> (Vec<PathRow>, f64) {
    const DT: f64 = 1e-3;
    type Task = SVector<f64, 4>;
    let start = Task::new(0.78, 0.0, 0.72, 0.0);
    let (mut x, mut xd) = (start, Task::zeros());
    let mut thrown_from: Option<Vector3<f64>> = None;
    let (mut rows, mut crossing_s) = (Vec::new(), 0.0);
    let on_pan = |x: &Task, sign: f64| {
        let tilt = UnitQuaternion::from_scaled_axis(Vector3::y() * x[3]);
        (Vector3::new(x[0], x[1], x[2]) + tilt * Vector3::z() * 0.005 * sign, tilt)
    };
    for tick in 0..1900 {
        let t_s = f64::from(tick) * DT;
        let h = policy_activations(policy, t_s);
        let (mut force, mut attractor) = (Task::zeros(), [0.0_f32; 6]);
        for (h, component) in h.iter().zip(policy.components()) {
            let mu = Task::from_column_slice(&component.attractor[..4]);
            let k = SMatrix::<f64, 4, 4>::from_fn(|r, c| component.stiffness_at(r, c));
            force += *h * k * (mu - x);
            (0..6).for_each(|c| attractor[c] += (h * component.attractor[c]) as f32);
        }
        xd += DT * (force - policy.damping * xd);
        x += DT * xd;

        let (mut position, mut turn) = on_pan(&x, 1.0);
        if t_s >= RELEASE_S {
            let from = *thrown_from.get_or_insert(position);
            let flight_s = t_s - RELEASE_S;
            let flown = Vector3::new(
                0.03 * flight_s,
                0.0,
                SPEED * flight_s - 0.5 * GRAVITY * flight_s * flight_s,
            );
            let caught = on_pan(&x, 1.0);
            if (from + flown).z > caught.0.z || flight_s < 0.2 {
                position = from + flown;
                turn = UnitQuaternion::from_scaled_axis(
                    Vector3::y() * (-0.35 - 4.6 * flight_s) + Vector3::x() * 0.12 * flight_s,
                );
                if crossing_s == 0.0 && flight_s > 0.2 && position.z - x[2] < DROP_HEIGHT {
                    crossing_s = t_s;
                }
            } else {
                position = caught.0 + Vector3::x() * 0.028;
                turn = caught.1 * UnitQuaternion::from_scaled_axis(Vector3::y() * PI);
            }
        }
        if tick % 10 == 0 {
            let turn = turn.quaternion();
            rows.push(PathRow {
                t_s: t_s as f32,
                pan_position: [x[0] as f32, x[1] as f32, x[2] as f32],
                pan_rotation: [x[3] as f32, 0.0, 0.0],
                object_position: [position.x as f32, position.y as f32, position.z as f32],
                object_quaternion: [turn.w as f32, turn.i as f32, turn.j as f32, turn.k as f32],
                attractor,
            });
        }
    }
    (rows, crossing_s)
}

/// The initial policy does not throw.
fn keep_pancake_in_pan(row: PathRow) -> PathRow {
    let half = 0.5 * row.pan_rotation[0];
    PathRow {
        object_position: row.pan_position,
        object_quaternion: [half.cos(), 0.0, half.sin(), 0.0],
        ..row
    }
}
