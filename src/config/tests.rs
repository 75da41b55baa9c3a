//! What a configuration file may say, and what is refused by name.

use super::*;

#[test]
fn what_is_written_reads_back() {
    let config = Config::default();
    assert_eq!(toml::from_str::<Config>(&config.to_toml().unwrap()).unwrap(), config);
    config.validate_settings().unwrap();
}

#[test]
fn misspelt_keys_are_refused_by_name_and_line() {
    let error = toml::from_str::<Config>("[learner]\nseed = 1\nrolouts = 5\n").unwrap_err();
    let message = error.to_string();
    assert!(message.contains("line 3") && message.contains("rolouts"), "{message}");
    assert!(message.contains("`rollouts`"), "the message lists what is known: {message}");
}

#[test]
fn what_a_file_does_not_say_are_the_defaults_it_is_given() {
    let defaults: Defaults = |name, options| {
        let mut config = Config::default();
        (config.task.name, config.task.options) = (name.into(), options);
        config.learner.rollouts = 7;
        config
    };
    let config = parse("[task]\nname = \"tennis\"\n[learner]\nseed = 9\n", defaults).unwrap();
    assert_eq!((config.learner.rollouts, config.learner.seed), (7, 9));
    assert_eq!(config.task.name, "tennis", "whether there is such a task is not known here");
}

#[test]
fn ranges_name_the_field() {
    let mut config = Config::default();
    config.plant.friction = -0.1;
    let message = format!("{:#}", config.validate_settings().unwrap_err());
    assert!(message.contains("plant.friction is -0.1"), "{message}");
}

#[test]
fn nothing_but_loopback_is_listened_on() {
    for good in ["127.0.0.1:9464", "[::1]:0"] {
        MetricsConfig::check(good.parse().unwrap()).unwrap();
    }
    for bad in ["0.0.0.0:9464", "192.168.1.5:80", "[::]:9464"] {
        let message = MetricsConfig::check(bad.parse().unwrap()).unwrap_err().to_string();
        assert!(message.contains(bad) && message.contains("127.0.0.1"), "{message}");
    }
}
