//! The judge of a configuration: what its task, its plant and its program measure, and what that is worth.

mod answer;
pub mod command;
mod last_words;
mod npy;
mod process;
mod program;

use anyhow::{Context, Result, bail};
use learner::LearnerConfig;
use learner::expression::{Expression, Kind};
use learner::judge::{
    AssessError, Assessor, Declared, Judge, Measurer, Paid, Verdict, VerdictError, list,
};
use learner::targets;
use learner::wish::{Wish, kinds};
use shm_types::episode::{EpisodeHeader, TickRecord};
use shm_types::measures::{Measure, Measures, MeasuresError};

use crate::config::{Config, JudgeConfig};
use crate::session_folder::SessionFolder;
use program::Program;

/// A judge that starts no program: for checks, studies and trials whose measures are stored.
pub fn judge(config: &Config) -> Result<Judge> {
    with_assessor(config, |judge| Ok(Box::new(NotHere(judge.declared()))))
}

/// The judge of a session at work. Its program, where it has one, starts with the first rollout to be judged.
pub fn of_session(config: &Config, folder: &SessionFolder) -> Result<Judge> {
    with_assessor(config, |judge| Ok(Box::new(Program::new(judge, folder)?)))
}

fn with_assessor(
    config: &Config,
    assessor: impl FnOnce(&JudgeConfig) -> Result<Box<dyn Assessor>>,
) -> Result<Judge> {
    let task = config.task()?;
    let (measurer, compliance) = (measurer(config)?, &config.learner.compliance);
    let mut declared = measurer.declared();
    declared.extend(compliance.declared());
    let program = config.task.judge.as_ref().filter(|judge| judge.has_program());
    if let Some(program) = program {
        declared.extend(program.declared());
        check(&declared).context("task.judge.measures")?;
    }
    targets::check(config.learner.search.targets(), &declared)?;
    Wish::parse_any(&config.learner.wish, &declared).context("learner.where")?;
    let judge = Judge::new(measurer, verdict(config, &declared)?).with_compliance(compliance);
    let judge = judge.with_assessor(program.map(assessor).transpose()?);
    Ok(judge.with_prediction(task.predictor(config)?))
}

/// Names and units, as they will come.
fn check(declared: &Declared) -> Result<(), MeasuresError> {
    let zero = declared.iter().map(|(name, unit)| Measure { name, unit, value: 0.0 });
    Measures::of(zero).map(|_| ())
}

/// Stands for a program where no rollout is to be judged.
struct NotHere(Declared);

impl Assessor for NotHere {
    fn declared(&self) -> Declared {
        self.0.clone()
    }

    fn identity(&self) -> Option<String> {
        None
    }

    fn assess(
        &self,
        _: &EpisodeHeader,
        _: &[TickRecord],
        _: &Measures,
    ) -> Result<Vec<f64>, AssessError> {
        Err(AssessError::Broken("the program of task.judge runs only in a session".into()))
    }
}

/// What the task measures, and what only the plant can.
fn measurer(config: &Config) -> Result<Box<dyn Measurer>> {
    let measurer = config.task()?.measurer(config)?;
    if config.plant.measures.is_empty() {
        return Ok(measurer);
    }
    let of_plant =
        config.plant.measures.iter().map(|(n, unit)| (n.clone(), unit.clone())).collect();
    let both = WithPlant { measurer, of_plant };
    check(&both.declared()).context("plant.measures")?;
    Ok(Box::new(both))
}

struct WithPlant {
    measurer: Box<dyn Measurer>,
    of_plant: Declared,
}

impl Measurer for WithPlant {
    fn declared(&self) -> Declared {
        let of_task = self.measurer.declared();
        of_task.into_iter().chain(self.of_plant.iter().cloned()).collect()
    }

    fn measure(
        &self,
        header: &EpisodeHeader,
        records: &[TickRecord],
    ) -> Result<Measures, MeasuresError> {
        let mut all = self.measurer.measure(header, records)?;
        for (name, unit) in &self.of_plant {
            let value = header.measures.get(name);
            let value = value.ok_or_else(|| MeasuresError::Missing(name.clone()))?;
            all.push(Measure { name, unit, value })?;
        }
        Ok(all)
    }
}

/// What `config` makes of the measures `declared`.
pub fn verdict(config: &Config, declared: &Declared) -> Result<Box<dyn Verdict>> {
    match &config.task.judge {
        Some(written) => Ok(Box::new(Written::parse(written, declared)?)),
        None => built_in(&config.learner, &config.task.name, declared),
    }
}

fn built_in(learner: &LearnerConfig, task: &str, declared: &Declared) -> Result<Box<dyn Verdict>> {
    let reward = &learner.reward;
    let missing = reward.missing(declared);
    if !missing.is_empty() {
        bail!(
            "learner.reward.kind is {}, which needs {}; the task {task} has {}: use another kind, or \
             write a reward as task.judge.reward",
            reward.kind.name(),
            missing.join(", "),
            list(declared)
        );
    }
    // A reward of one's own names the measure where it wants it.
    Ok(Box::new(Paid { verdict: *reward, weight: learner.compliance.weight }))
}

/// Reward and success as the configuration writes them.
struct Written {
    reward: Expression,
    /// Without one, only the reward tells good from bad.
    success: Option<Expression>,
    /// Names of all measures, in the order of the expressions' values.
    names: Vec<String>,
}

impl Written {
    fn parse(written: &JudgeConfig, declared: &Declared) -> Result<Written> {
        let names = kinds(declared);
        let parse = |text: &str, kind| Expression::parse(text, &names, kind);
        let success = written.success().map(|text| parse(text, Kind::Truth));
        Ok(Written {
            success: success.transpose().context("task.judge.success")?,
            reward: parse(written.reward(), Kind::Number).context("task.judge.reward")?,
            names: declared.iter().map(|(name, _)| name.clone()).collect(),
        })
    }

    /// Values by name: a session of before may lack some of the measures.
    fn values(&self, measures: &Measures) -> Result<Vec<f64>, VerdictError> {
        let expressions = self.success.iter().chain([&self.reward]);
        let mut occurring = expressions.flat_map(Expression::occurring);
        if let Some(missing) = occurring.find(|name| measures.get(name).is_none()) {
            return Err(VerdictError(format!(
                "task.judge names {missing}, which this session does not measure"
            )));
        }
        Ok(self.names.iter().map(|name| measures.get(name).unwrap_or(0.0)).collect())
    }
}

impl Verdict for Written {
    fn judge(&self, measures: &Measures) -> Result<(bool, f64), VerdictError> {
        let values = self.values(measures)?;
        let named = |name: &str, error: &dyn std::fmt::Display| {
            VerdictError(format!("task.judge.{name}: {error}"))
        };
        let success = self.success.as_ref().map(|success| success.truth(&values)).transpose();
        Ok((
            success.map_err(|error| named("success", &error))?.unwrap_or(false),
            self.reward.number(&values).map_err(|error| named("reward", &error))?,
        ))
    }

    fn terms(&self, measures: &Measures) -> Vec<(String, f64)> {
        self.values(measures).map_or(Vec::new(), |values| self.reward.summands(&values))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use shm_types::measures::TRUTH;

    /// A newer task may measure something between what the session knows.
    #[test]
    fn expressions_take_their_measures_by_name() {
        let number = |name, value| Measure { name, unit: "m", value };
        let caught = Measure { name: "caught", unit: TRUTH, value: 1.0 };
        let all = Measures::of([number("new_m", 9.0), caught, number("apex_m", 0.5)]).unwrap();
        let known = Measures::of([caught, number("apex_m", 0.5)]).unwrap();
        let judge = |reward: &str, measures: &Measures| {
            let judge = JudgeConfig::written(reward, "caught");
            Written::parse(&judge, &all.declared()).unwrap().judge(measures)
        };
        assert_eq!(judge("2*apex_m", &all), Ok((true, 1.0)));
        assert_eq!(judge("2*apex_m", &known), Ok((true, 1.0)));
        assert!(judge("new_m", &known).unwrap_err().0.contains("names new_m"));
    }
}
