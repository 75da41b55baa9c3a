//! A number of components is taken, chosen, or refused with the place and what to do.

use super::*;
use crate::LearnerConfig;
use crate::encoding::fit;

/// Ways of 2 s with `corners` in z, between which they go straight.
fn zigzag(corners: usize) -> Demonstration {
    let row = |k: usize| {
        let u = (corners + 1) as f64 * k as f64 / 200.0;
        let height = if (u as usize).is_multiple_of(2) { u.fract() } else { 1.0 - u.fract() };
        format!("{:.2},{},0,{},0\n", 0.01 * k as f64, 0.5 + 0.1 * u, 0.5 + 0.2 * height)
    };
    let rows: String = (0..=200).map(row).collect();
    Demonstration::parse("zigzag.csv", &format!("t_s,x_m,y_m,z_m,pitch_rad\n{rows}")).unwrap()
}

fn config(kind: EncodingKind, n_components: impl Into<Components>) -> EncodingConfig {
    let config = LearnerConfig { n_components: n_components.into(), ..LearnerConfig::default() };
    let config = config.encoded(kind);
    assert_eq!(config.validate(), Ok(()));
    config.encoding()
}

#[test]
fn a_number_is_a_number_and_bic_is_a_word() {
    let config = |text: &str| serde_json::from_str::<LearnerConfig>(text);
    let parsed = config(r#"{"n_components": 5, "encoding": "gmr"}"#).unwrap();
    assert_eq!(parsed.n_components, Components::Number(5));
    let parsed = config(r#"{"n_components": "bic", "encoding": "gmr"}"#).unwrap();
    assert_eq!(
        (parsed.n_components, parsed.n_components.to_string()),
        (Components::BIC, "bic".into())
    );
    let text = serde_json::to_string(&parsed).unwrap();
    assert!(text.contains(r#""n_components":"bic""#), "{text}");
    let refused = config(r#"{"n_components": "aic"}"#).unwrap_err().to_string();
    assert!(refused.contains(r#"use a number of components, or "bic""#), "{refused}");
    // As it was written before there was a choice.
    let text = serde_json::to_string(&LearnerConfig::default()).unwrap();
    assert!(text.contains(r#""n_components":8,"#), "{text}");
}

/// More corners, more components: a straight part is one.
#[test]
fn the_criterion_takes_as_many_as_the_movement_has_parts() {
    for kind in [EncodingKind::Gmr, EncodingKind::Tsm] {
        let chosen = |corners: usize| {
            let shown = [zigzag(corners)];
            let n = number(&config(kind, Components::BIC), &shown).unwrap();
            let policy = fit(&config(kind, Components::BIC), &shown).unwrap();
            assert_eq!(policy.n_systems as usize, n, "{kind:?}");
            assert_eq!(policy, fit(&config(kind, n), &shown).unwrap(), "as if it had been given");
            n
        };
        let (few, many) = (chosen(1), chosen(5));
        assert!((2..=5).contains(&few) && (6..=16).contains(&many), "{kind:?}: {few} {many}");
    }
}

#[test]
fn more_components_than_points_are_refused() {
    let short = {
        let rows: String = (0..40).map(|k| format!("0.{k:02},0.{k:02},0,0.5,0\n")).collect();
        let text = format!("t_s,x_m,y_m,z_m,pitch_rad\n{rows}");
        Demonstration::parse("short.csv", &text).unwrap()
    };
    for kind in [EncodingKind::Gmr, EncodingKind::Tsm] {
        let refused = fit(&config(kind, 14), std::slice::from_ref(&short)).unwrap_err().to_string();
        for word in ["14 components", "short.csv has 40", "0.39 s at 0.01 s", "at most 13", "bic"] {
            assert!(refused.contains(word), "{kind:?}: no '{word}' in: {refused}");
        }
        let most = fit(&config(kind, 13), std::slice::from_ref(&short)).unwrap();
        assert_eq!(most.n_systems, 13);
        assert!(fit(&config(kind, Components::BIC), std::slice::from_ref(&short)).is_ok());
    }
}
