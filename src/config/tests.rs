//! What a configuration file may contain, and which errors name the field.

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

fn of_text(text: &str) -> Result<Config> {
    let folder = tempfile::TempDir::new().unwrap();
    let path = folder.path().join("my.toml");
    std::fs::write(&path, text).unwrap();
    let defaults: Defaults = |name, _| {
        let mut config = Config::default();
        config.task.name = name.into();
        config.task.judge = Some(JudgeConfig::written("exp(-miss_m)", "miss_m < 0.05"));
        config
    };
    let config = Config::read(&path, defaults)?;
    config.validate_settings()?;
    Ok(config)
}

/// What a task writes itself is kept beside expressions, and gives way to a program.
#[test]
fn a_program_takes_the_place_of_what_its_task_writes() {
    let written = of_text("[task.judge]\nsuccess = \"miss_m < 0.1\"\n").unwrap();
    assert_eq!(written.task.judge.unwrap().reward(), "exp(-miss_m)");
    let text = "[task.judge]\nprogram = [\"python3\", \"a.py\"]\nmeasures = { gap_m = \"m\" }\n";
    let mut judge = of_text(text).unwrap().task.judge.unwrap();
    assert_eq!((judge.reward(), judge.success()), ("reward", Some("success")));
    let names: Vec<String> = judge.declared().into_iter().map(|(name, _)| name).collect();
    assert_eq!(names, ["reward", "success", "gap_m"]);
    assert!(judge.directory.as_ref().unwrap().is_absolute());
    let before = judge.clone();
    judge.run(vec!["./b".into()], "/elsewhere".into());
    assert_eq!(judge.measures, before.measures);
    assert_eq!(judge.without_place(), before.without_place());
    // Words of before are another judge than any program.
    let mut written = JudgeConfig::written("1", "true");
    written.run(vec!["./b".into()], "/elsewhere".into());
    assert_eq!(written.reward(), "reward");
}

#[test]
fn a_judge_that_cannot_be_names_its_field() {
    for (text, word) in [
        ("timeout_s = 0.0\nprogram = [\"a\"]", "task.judge.timeout_s is 0"),
        ("timeout_s = nan\nprogram = [\"a\"]", "task.judge.timeout_s is NaN"),
        ("timeout_s = inf\nprogram = [\"a\"]", "task.judge.timeout_s is inf"),
        ("program = [\"\"]", "an empty word"),
        ("reward = \"1\"\nmeasures = { a = \"m\" }", "task.judge.program"),
        ("reword = \"1\"", "reword"),
    ] {
        let message = format!("{:#}", of_text(&format!("[task.judge]\n{text}\n")).unwrap_err());
        assert!(message.contains(word), "{text}: {message}");
    }
    let mut config = Config::default();
    config.task.judge = Some(JudgeConfig { reward: None, ..JudgeConfig::written("1", "true") });
    let message = format!("{:#}", config.validate_settings().unwrap_err());
    assert!(message.contains("task.judge.reward is missing"), "{message}");
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
