//! What a configuration of the learner may say, and what a session that resumes may change of it.

use search::Method;

use super::*;

#[test]
fn defaults_are_valid_and_survive_a_round_trip() {
    let config = LearnerConfig::default();
    assert_eq!(config.validate(), Ok(()));
    let text = serde_json::to_string(&config).unwrap();
    assert_eq!(serde_json::from_str::<LearnerConfig>(&text).unwrap(), config);
    // What a session that was stored before there was a choice does not say is off.
    let old = LearnerConfig { compliance: ComplianceConfig::off(), ..config };
    assert_eq!(serde_json::from_str::<LearnerConfig>("{}").unwrap(), old);
}

#[test]
fn refuses_each_bad_value_and_names_it() {
    type Break = fn(&mut LearnerConfig);
    let breaks: [(&str, Break); 23] = [
        ("learner.task_dim is 5: use 3", |c| c.task_dim = 5),
        ("learner.rollouts is 0: use 1 to 100000", |c| c.rollouts = 0),
        ("learner.n_components is 17: use 1 to 16", |c| c.n_components = 17.into()),
        ("learner.kappa_p is NaN", |c| c.kappa_p = f64::NAN),
        ("learner.damping_ratio is -1: use 0 to 10", |c| c.damping_ratio = -1.0),
        ("learner.decay_rate is 0", |c| c.decay_rate = 0.0),
        ("learner.width_ratio is -1", |c| c.width_ratio = -1.0),
        ("learner.orientation_stiffness", |c| c.orientation_stiffness = -1.0),
        ("learner.orientation_damping", |c| c.orientation_damping = f64::INFINITY),
        ("learner.scales.position_m is 0", |c| c.scales.position_m = 0.0),
        ("learner.search.power.n_elites is 0", |c| c.search.power.n_elites = 0),
        ("learner.search.power.n_initial", |c| c.search.power.n_initial = 20_000),
        ("learner.search.power.initial_std", |c| c.search.power.initial_std = -0.5),
        ("learner.search.regions.connected is 0: use 0.05 to 1", |c| {
            c.search.regions.connected = 0.0
        }),
        ("learner.search.power.floor_decay is 1.1", |c| c.search.power.floor_decay = 1.1),
        ("learner.search.power.floor_min is 0.6: use 0 to 0.5", |c| c.search.power.floor_min = 0.6),
        ("learner.search.random.std", |c| c.search.random.std = f64::NAN),
        ("learner.reward.w2 is -1", |c| c.reward.w2 = -1.0),
        ("learner.reward.catch.lateral_m is 0", |c| c.reward.catch.lateral_m = 0.0),
        ("learner.exploration.tempo_s is -0.1", |c| c.exploration.tempo_s = -0.1),
        ("learner.people.weight is NaN: use 0 to 1", |c| c.people.weight = f64::NAN),
        ("learner.people.success_from is 11: use 0 to 10", |c| c.people.success_from = 11.0),
        ("learner.people.weight is 0.5: use 0, because this search", |c| {
            (c.people.weight, c.search.method) = (0.5, Method::Cem);
        }),
    ];
    for (expected, break_it) in breaks {
        let mut config = LearnerConfig::default();
        break_it(&mut config);
        let message = config.validate().expect_err(expected).to_string();
        assert!(message.contains(expected), "{message:?} lacks {expected:?}");
    }
}

/// Sessions that were stored before resume, and those that were stored since keep their choice.
#[test]
fn choices_of_orientation_stiffness_and_components_leave_no_trace_until_they_are_made() {
    let config = LearnerConfig::default();
    let text = serde_json::to_string(&config).unwrap();
    for field in ["orientation\":", "initial_stiffness", "stiffness_range"] {
        assert!(!text.contains(field), "{field}: {text}");
    }
    type Change = fn(&mut LearnerConfig);
    let changes: [(&str, Change); 4] = [
        ("learner.orientation is \"sphere\", but the session was started with its default", |c| {
            c.orientation = Orientation::Sphere;
        }),
        ("learner.initial_stiffness is \"variability\"", |c| {
            c.initial_stiffness = InitialStiffness::Variability;
        }),
        ("learner.stiffness_range is 2", |c| c.stiffness_range = 2.0),
        ("learner.n_components is \"bic\", but the session was started with 8", |c| {
            c.n_components = Components::BIC;
        }),
    ];
    for (expected, change) in changes {
        let mut changed = config.clone();
        change(&mut changed);
        let message = changed.check_resumes(&config).unwrap_err().to_string();
        assert!(message.contains(expected), "{message:?} lacks {expected:?}");
        assert_eq!(changed.check_resumes(&changed.clone()), Ok(()));
        let text = serde_json::to_string(&changed).unwrap();
        let back: LearnerConfig = serde_json::from_str(&text).unwrap();
        assert_eq!(back.check_resumes(&changed), Ok(()));
    }
}

#[test]
fn what_goes_with_some_encodings_alone_is_refused_with_others() {
    type Change = fn(&mut LearnerConfig);
    let variability: Change = |c| {
        c.initial_stiffness = InitialStiffness::Variability;
        c.demonstrations_are = DemonstrationsAre::Repetitions;
    };
    let refused = |encoding: EncodingKind, change: Change| {
        let mut config = LearnerConfig::default().encoded(encoding);
        change(&mut config);
        config.validate().map_err(|error| error.to_string()).unwrap_err()
    };
    let sphere: Change = |c| c.orientation = Orientation::Sphere;
    let bic: Change = |c| c.n_components = Components::BIC;
    for (message, words) in [
        (refused(EncodingKind::Gmr, sphere), ["learner.orientation is sphere", "rotation_vector"]),
        (refused(EncodingKind::Springs, bic), ["learner.n_components is bic", "a number"]),
        (refused(EncodingKind::Dmp, bic), ["learner.n_components is bic", "\"dmp\""]),
        (refused(EncodingKind::Dmp, variability), ["learner.initial_stiffness", "kappa_p"]),
        (
            refused(EncodingKind::Springs, |c| {
                c.initial_stiffness = InitialStiffness::Variability;
            }),
            ["learner.initial_stiffness is variability", "\"repetitions\" of one movement"],
        ),
        (
            refused(EncodingKind::Springs, |c| {
                c.demonstrations_are = DemonstrationsAre::Repetitions;
            }),
            ["learner.demonstrations_are", "initial_stiffness = \"variability\""],
        ),
    ] {
        assert!(words.iter().all(|word| message.contains(word)), "{words:?}: {message}");
    }
    let mut config = LearnerConfig { kappa_p: 10_000.0, ..LearnerConfig::default() };
    variability(&mut config);
    let message = config.validate().unwrap_err().to_string();
    assert!(message.contains("learner.stiffness_range is 4: use 1 to 2.0"), "{message}");
    config.stiffness_range = 1.5;
    assert_eq!(config.validate(), Ok(()));
    config.stiffness_range = 0.5;
    let message = config.validate().unwrap_err().to_string();
    assert!(message.contains("learner.stiffness_range is 0.5: use 1 to 100"), "{message}");
}

#[test]
fn refuses_unknown_fields_and_choices() {
    for text in [
        r#"{"rollout": 3}"#,
        r#"{"search": {"power": {"elites": 3}}}"#,
        r#"{"reward": {"w4": 1}}"#,
        r#"{"scales": {"position": 1}}"#,
        r#"{"search": {"method": "magic"}}"#,
    ] {
        assert!(serde_json::from_str::<LearnerConfig>(text).is_err(), "{text}");
    }
}

#[test]
fn when_people_are_asked_may_change_and_what_they_count_for_may_not() {
    let stored = LearnerConfig::default();
    let with = |people| LearnerConfig { people, ..stored.clone() };
    let people = PeopleConfig { wait: false, ask_after: 9, ..stored.people };
    assert_eq!(with(people).check_resumes(&stored), Ok(()));
    let error = with(PeopleConfig { weight: 0.5, ..people }).check_resumes(&stored);
    assert!(error.unwrap_err().to_string().contains("learner.people.weight is 0.5"));
}

#[test]
fn a_session_may_grow_but_not_change() {
    let stored = LearnerConfig::default();
    let longer = LearnerConfig { rollouts: 200, ..stored.clone() };
    assert_eq!(longer.check_resumes(&stored), Ok(()));
    let mut changed = stored.clone();
    changed.search.power.floor_std = 0.3;
    let message = changed.check_resumes(&stored).unwrap_err().to_string();
    assert!(
        message.contains(
            "learner.search.power.floor_std is 0.3, but the session was started with 0.5"
        )
    );
}
