//! A policy message is refused for each of its fields that is wrong.

use super::*;

fn valid() -> PolicyMsg {
    let mut policy = PolicyMsg { task_dim: 4, n_components: 8, ..PolicyMsg::EMPTY };
    policy.damping = 28.0;
    policy.sealed()
}

#[test]
fn accepts_a_sealed_policy_and_refuses_each_broken_field() {
    assert_eq!(valid().validate(), Ok(()));
    type Break = fn(&mut PolicyMsg);
    let breaks: [(&str, Break); 11] = [
        ("task_dim", |p| p.task_dim = 5),
        ("n_components", |p| p.n_components = 17),
        ("n_components", |p| p.n_components = 0),
        ("activation", |p| p.activation = ACTIVATION_STATE),
        ("output", |p| p.output = OUTPUT_VELOCITY),
        ("orientation", |p| p.orientation = 2),
        ("target", |p| p.target[0] = f64::NAN),
        ("duration_s", |p| p.duration_s = f64::NAN),
        ("damping", |p| p.damping = -1.0),
        ("attractor", |p| p.components[7].attractor[5] = f64::INFINITY),
        ("width", |p| p.components[0].width = 0.0),
    ];
    for (field, break_it) in breaks {
        let mut policy = valid();
        break_it(&mut policy);
        let error = policy.sealed().validate().expect_err(field).to_string();
        assert!(error.contains(field), "{field}: {error}");
    }
}

#[test]
fn a_policy_is_springs_or_an_action() {
    let action = PolicyMsg::of_action(&[8.0, 2.0]).sealed();
    assert_eq!((action.validate(), action.actions()), (Ok(()), &[8.0, 2.0][..]));
    let both = PolicyMsg { n_actions: 1, ..valid() }.sealed().validate();
    assert_eq!(both, Err(PolicyMsgError::Actions { actions: 1, components: 8 }));
    let many = PolicyMsg { n_actions: 17, ..PolicyMsg::EMPTY }.sealed();
    assert!(many.validate().unwrap_err().to_string().contains("n_actions is 17"));
    let nan = PolicyMsg::of_action(&[f64::NAN]).sealed();
    assert!(nan.validate().unwrap_err().to_string().contains("action is NaN"));
    let torn = PolicyMsg { action: [8.1; MAX_ACTIONS], ..action };
    assert_eq!(torn.validate(), Err(PolicyMsgError::Digest));
}

/// A field of the state in three coordinates.
fn field() -> PolicyMsg {
    let mut policy = PolicyMsg { task_dim: 3, n_systems: 2, ..PolicyMsg::EMPTY };
    (policy.activation, policy.output, policy.following) =
        (ACTIVATION_STATE, OUTPUT_VELOCITY, 50.0);
    for system in &mut policy.systems[..2] {
        for i in 0..3 {
            system.covariance[packed_index(i, i)] = 0.01;
            system.of_position[TASK_DIM * i + i] = -2.0;
        }
    }
    policy.sealed()
}

#[test]
fn refuses_each_broken_field_of_systems() {
    assert_eq!(field().validate(), Ok(()));
    assert_eq!((field().systems().len(), field().drive_dim()), (2, 3));
    type Break = fn(&mut PolicyMsg);
    let breaks: [(&str, Break); 15] = [
        ("n_systems is 17", |p| p.n_systems = 17),
        ("nothing beside them", |p| p.n_components = 1),
        ("nothing beside them", |p| p.n_actions = 1),
        ("task_dim", |p| p.task_dim = 7),
        ("activation", |p| p.activation = 3),
        ("output", |p| p.output = 2),
        ("orientation", |p| p.orientation = 2),
        ("following is 0", |p| p.following = 0.0),
        ("following is 501", |p| p.following = 501.0),
        ("certificate", |p| p.certificate[20] = f64::INFINITY),
        ("system 1: log_prior", |p| p.systems[1].log_prior = f64::NEG_INFINITY),
        ("system 0: covariance", |p| p.systems[0].covariance[3] = f64::NAN),
        ("system 1: of_position", |p| p.systems[1].of_position[35] = 1e7),
        ("system 1: of_velocity", |p| p.systems[1].of_velocity[0] = -1e7),
        ("system 0: offset", |p| p.systems[0].offset[0] = f64::MAX),
    ];
    for (words, break_it) in breaks {
        let mut policy = field();
        break_it(&mut policy);
        let error = policy.sealed().validate().expect_err(words).to_string();
        assert!(error.contains(words), "{words}: {error}");
    }
}

#[test]
fn what_acts_is_digested_and_what_is_not_in_use_is_not() {
    type Change = fn(&mut PolicyMsg);
    let acts: [Change; 8] = [
        |p| p.target[5] = 0.1,
        |p| p.certificate[5] = 2.0,
        |p| p.following = 51.0,
        |p| p.orientation = ORIENTATION_SPHERE,
        |p| p.systems[1].log_prior = -1.0,
        |p| p.systems[1].of_velocity[14] = 0.5,
        |p| p.systems[0].of_drive[2] = 0.5,
        |p| p.systems[0].center[2] = 0.5,
    ];
    for (i, change) in acts.iter().enumerate() {
        let mut policy = field();
        change(&mut policy);
        assert_eq!(policy.validate(), Err(PolicyMsgError::Digest), "change {i}");
    }
    let idle: [Change; 4] = [
        |p| p.certificate[6] = 2.0,
        |p| p.systems[0].of_position[3] = 0.5,
        |p| p.systems[0].offset[3] = 0.5,
        |p| p.systems[2].offset[0] = 0.5,
    ];
    for (i, change) in idle.iter().enumerate() {
        let mut policy = field();
        change(&mut policy);
        assert_eq!(policy.compute_digest(), field().digest, "change {i}");
    }
}

/// They name policies in sessions and catalogues on disk: as they were before there were systems.
#[test]
fn digests_of_springs_and_actions_stay_what_they_were() {
    let mut springs = PolicyMsg { task_dim: 4, n_components: 8, ..PolicyMsg::EMPTY };
    (springs.duration_s, springs.damping) = (1.4, 28.0);
    (springs.orientation_stiffness, springs.orientation_damping) = (400.0, 40.0);
    for (i, component) in springs.components[..8].iter_mut().enumerate() {
        (component.center, component.width) = (0.2 * i as f64, 0.1);
        component.attractor = [0.78, 0.0, 0.72, 0.1, 0.0, 0.5 * i as f64];
        for row in 0..4 {
            component.stiffness[packed_index(row, row)] = 200.0 + row as f64;
        }
    }
    let damped = PolicyMsg { damping_ratio: 0.7, ..springs };
    let decaying = PolicyMsg { activation: ACTIVATION_DECAY, decay_rate: 2.5, ..springs };
    let action = PolicyMsg::of_action(&[8.0, 2.0]);
    let digests = [springs, damped, decaying, action].map(|policy| policy.compute_digest());
    let before = [
        0xa977_e6b2_f6f7_e1c0,
        0x4920_b0ef_9ec5_82cb,
        0x4d55_ef6a_4d74_b159,
        0xa06b_9631_dbc8_4095,
    ];
    assert_eq!(digests, before, "{digests:#x?}");

    let sphere = PolicyMsg { orientation: ORIENTATION_SPHERE, ..springs };
    assert_ne!(sphere.compute_digest(), springs.compute_digest());
    // 1 as a float's bits is no ratio that could be taken for the orientation's code.
    let tiny = PolicyMsg { damping_ratio: f64::from_bits(1), ..springs };
    assert_ne!(sphere.compute_digest(), tiny.compute_digest());
}

#[test]
fn refuses_another_schema_and_a_change_after_sealing() {
    let other = PolicyMsg { schema: 1, ..valid() };
    assert_eq!(other.validate(), Err(PolicyMsgError::Schema { found: 1 }));
    let mut torn = valid();
    torn.components[3].attractor[0] = 0.1;
    assert_eq!(torn.validate(), Err(PolicyMsgError::Digest));
}

#[test]
fn packed_index_is_symmetric_and_dense() {
    let mut seen = [0; PACKED];
    for row in 0..TASK_DIM {
        for column in 0..=row {
            assert_eq!(packed_index(row, column), packed_index(column, row));
            seen[packed_index(row, column)] += 1;
        }
    }
    assert_eq!(seen, [1; PACKED]);
}
