//! Every kind of policy comes back from its text bit for bit; damaged text is refused by name.

use super::*;
use crate::TASK_DIM;
use crate::policy::{OUTPUT_VELOCITY, packed_index};

#[test]
fn an_action_survives_a_round_trip_and_is_checked() {
    let policy = PolicyMsg::of_action(&[8.0, 0.1 + 0.2]).sealed();
    assert_eq!(from_json(&to_json(&policy).unwrap()).unwrap(), policy);
    let error = |text: &str| from_json(text).unwrap_err().to_string();
    let many = serde_json::json!({ "action": vec![1.0; 17] }).to_string();
    assert!(error(&many).contains("17 actions"));
    assert!(error(r#"{"action": [1], "damping": 2}"#).contains("damping"));
    assert!(error(r#"{"action": []}"#).contains("n_components"));
}

fn policy() -> PolicyMsg {
    let mut policy = PolicyMsg { task_dim: 4, n_components: 2, ..PolicyMsg::EMPTY };
    policy.damping = 2.0 * 200_f64.sqrt();
    for (i, component) in policy.components[..2].iter_mut().enumerate() {
        component.center = 0.1 + 0.2 * i as f64;
        component.attractor = [0.78, -0.0, 1.0 / 3.0, 0.1, 5e-324, 1e-17];
        (0..10).for_each(|k| component.stiffness[k] = (k as f64 + 0.1).sqrt() * 37.0);
    }
    policy.sealed()
}

#[test]
fn survives_a_round_trip_bit_for_bit() {
    let follows = PolicyMsg { damping_ratio: 0.7, ..policy() }.sealed();
    assert_ne!(follows.digest, policy().digest);
    for policy in [policy(), follows] {
        let back = from_json(&to_json(&policy).unwrap()).unwrap();
        assert_eq!(back, policy);
        assert_eq!(back.digest, policy.digest);
    }
    assert!(
        !to_json(&policy()).unwrap().contains("damping_ratio"),
        "as it was before there was one"
    );
}

#[test]
fn refuses_damaged_text() {
    let text = to_json(&policy()).unwrap();
    let error = |text: &str| from_json(text).expect_err("must be refused").to_string();
    assert!(error("{}").contains("task_dim"));
    assert!(error(&text.replace("\"task_dim\": 4", "\"task_dim\": 3")).contains("3 rows of 3"));
    assert!(error(&text.replace("\"task_dim\"", "\"dim\"")).contains("dim"));
    assert!(error(&text.replace("\"width\": 1.0", "\"width\": 0.0")).contains("width"));
    let mut value: serde_json::Value = serde_json::from_str(&text).unwrap();
    value["components"][1]["stiffness"][0][1] = 0.5.into();
    assert!(error(&value.to_string()).contains("component 1: stiffness must be symmetric"));
}

#[test]
fn springs_on_the_sphere_say_so_and_others_do_not() {
    let sphere = PolicyMsg { orientation: ORIENTATION_SPHERE, ..policy() }.sealed();
    let text = to_json(&sphere).unwrap();
    assert!(text.contains(r#""orientation": "sphere""#), "{text}");
    assert_eq!(from_json(&text).unwrap(), sphere);
    assert!(!to_json(&policy()).unwrap().contains("\"orientation\""));
    let unknown = text.replace("sphere", "cube");
    assert!(from_json(&unknown).unwrap_err().to_string().contains("cube"));
}

/// A number for every entry in use, some of them hard to write.
fn systems(activation: u32, output: u32) -> PolicyMsg {
    let mut policy =
        PolicyMsg { task_dim: 4, n_systems: 3, activation, output, ..PolicyMsg::EMPTY };
    (policy.decay_rate, policy.following) = (0.1 + 0.2, 60.0);
    policy.target = [0.7, -0.0, 1.0 / 3.0, 5e-324, 0.1, -1e-17];
    (0..10).for_each(|k| policy.certificate[k] = (k as f64 + 0.1).sqrt());
    let drive_dim = policy.drive_dim();
    for (i, system) in policy.systems[..3].iter_mut().enumerate() {
        let number = |k: usize| (k as f64 + 1.1 + i as f64).ln() - 0.7;
        system.log_prior = -(1.0 / (i as f64 + 3.0));
        (0..drive_dim).for_each(|k| system.center[k] = number(k));
        (0..drive_dim * (drive_dim + 1) / 2).for_each(|k| system.covariance[k] = number(3 * k));
        for row in 0..4 {
            for column in 0..4 {
                system.of_position[TASK_DIM * row + column] = number(7 * row + column);
                system.of_velocity[TASK_DIM * row + column] = -number(row + 9 * column);
            }
            (system.of_drive[row], system.offset[row]) = (number(row), -number(row));
        }
    }
    policy.systems[1].of_velocity = [0.0; 36];
    policy.systems[2].offset[..4].fill(-0.0);
    policy.sealed()
}

#[test]
fn systems_come_back_bit_for_bit_whatever_drives_them() {
    let bits = |policy: &PolicyMsg| zerocopy::IntoBytes::as_bytes(policy).to_vec();
    for activation in [ACTIVATION_TIME, ACTIVATION_DECAY, ACTIVATION_STATE] {
        for (output, orientation) in [(0, ORIENTATION_SPHERE), (OUTPUT_VELOCITY, 0)] {
            let policy = PolicyMsg { orientation, ..systems(activation, output) }.sealed();
            let text = to_json(&policy).unwrap();
            let back = from_json(&text).unwrap();
            assert!(bits(&back) == bits(&policy), "{text}");
        }
    }
}

#[test]
fn what_a_policy_of_systems_has_none_of_is_left_out() {
    let text = r#"{
        "task_dim": 3, "activation": "time", "output": "velocity", "following": 50, "duration_s": 1,
        "orientation_stiffness": 400, "orientation_damping": 40, "target": [0, 0, 0, 0, 0, 0],
        "systems": [{ "log_prior": 0, "center": [0.5], "covariance": [[0.01]], "of_drive": [1, 2, 3] }]
    }"#;
    let policy = from_json(text).unwrap();
    assert_eq!(policy.systems()[0].of_drive[..3], [1.0, 2.0, 3.0]);
    let written = to_json(&policy).unwrap();
    for field in ["certificate", "decay_rate", "of_position", "offset", "\"orientation\""] {
        assert!(!written.contains(field), "{field}: {written}");
    }
    assert_eq!(from_json(&written).unwrap(), policy);
}

#[test]
fn damaged_text_of_systems_is_refused_with_the_place() {
    let value: serde_json::Value =
        serde_json::from_str(&to_json(&systems(ACTIVATION_STATE, OUTPUT_VELOCITY)).unwrap())
            .unwrap();
    type Break = fn(&mut serde_json::Value);
    let breaks: [(&str, Break); 10] = [
        ("policy has 0 systems", |v| v["systems"] = serde_json::json!([])),
        ("system 1: center must be 4 numbers", |v| {
            v["systems"][1]["center"] = [0.5].as_slice().into()
        }),
        ("system 0: covariance must be symmetric", |v| {
            v["systems"][0]["covariance"][0][1] = 9.0.into();
        }),
        ("system 2: of_position must be 4 rows of 4", |v| {
            v["systems"][2]["of_position"][1] = serde_json::json!([1.0]);
        }),
        ("system 2: of_drive must be 4 numbers", |v| {
            v["systems"][2]["of_drive"] = serde_json::json!([1.0]);
        }),
        ("certificate must be symmetric", |v| v["certificate"][3][0] = 9.0.into()),
        ("following", |v| v["following"] = 0.0.into()),
        ("output", |v| v["output"] = "force".into()),
        ("components", |v| v["components"] = serde_json::json!([])),
        ("system 0: log_prior", |v| v["systems"][0]["log_prior"] = 1e4.into()),
    ];
    for (words, break_it) in breaks {
        let mut value = value.clone();
        break_it(&mut value);
        let error = from_json(&value.to_string()).expect_err(words).to_string();
        let is_told = error.contains(words) || (words == "output" && error.contains("force"));
        assert!(is_told, "{words}: {error}");
    }
    let many = serde_json::json!({ "systems": vec![value["systems"][0].clone(); 17] });
    let mut value = value.clone();
    value["systems"] = many["systems"].clone();
    assert!(from_json(&value.to_string()).unwrap_err().to_string().contains("17 systems"));
}
