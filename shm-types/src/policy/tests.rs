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
    let breaks: [(&str, Break); 8] = [
        ("task_dim", |p| p.task_dim = 5),
        ("n_components", |p| p.n_components = 17),
        ("n_components", |p| p.n_components = 0),
        ("activation", |p| p.activation = 2),
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
