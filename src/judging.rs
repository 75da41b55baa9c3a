//! The judge of a configuration: what its task measures, and what that is worth.

use anyhow::{Context, Result, bail};
use learner::LearnerConfig;
use learner::expression::{Expression, Kind};
use learner::judge::{Declared, Judge, Measurer, Paid, Verdict, VerdictError, list};
use learner::targets;
use learner::wish::{Wish, kinds};
use shm_types::episode::{EpisodeHeader, TickRecord};
use shm_types::measures::{Measure, Measures, MeasuresError};

use crate::config::{Config, JudgeConfig};

pub fn judge(config: &Config) -> Result<Judge> {
    let task = config.task()?;
    let (measurer, compliance) = (measurer(config)?, &config.learner.compliance);
    let mut declared = measurer.declared();
    declared.extend(compliance.declared());
    targets::check(config.learner.search.targets(), &declared)?;
    Wish::parse_any(&config.learner.wish, &declared).context("learner.where")?;
    let judge = Judge::new(measurer, verdict(config, &declared)?).with_compliance(compliance);
    Ok(judge.with_prediction(task.predictor(config)?))
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
    // Names and units, as they will come.
    let zero = both.declared();
    let zero = zero.iter().map(|(name, unit)| Measure { name, unit, value: 0.0 });
    Measures::of(zero).context("plant.measures")?;
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
}

impl Written {
    fn parse(written: &JudgeConfig, declared: &Declared) -> Result<Written> {
        let names = kinds(declared);
        let success = written
            .success
            .as_ref()
            .map(|text| Expression::parse(text, &names, Kind::Truth).context("task.judge.success"));
        Ok(Written {
            reward: Expression::parse(&written.reward, &names, Kind::Number)
                .context("task.judge.reward")?,
            success: success.transpose()?,
        })
    }
}

impl Verdict for Written {
    fn judge(&self, measures: &Measures) -> Result<(bool, f64), VerdictError> {
        let values: Vec<f64> = measures.iter().map(|measure| measure.value).collect();
        let named = |name: &str, error: &dyn std::fmt::Display| {
            VerdictError(format!("task.judge.{name}: {error}"))
        };
        let success = self.success.as_ref().map(|success| success.truth(&values)).transpose();
        Ok((
            success.map_err(|error| named("success", &error))?.unwrap_or(false),
            self.reward.number(&values).map_err(|error| named("reward", &error))?,
        ))
    }
}
