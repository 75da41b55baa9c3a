//! The judge: from a finished rollout to what was measured of it, whether it succeeded, and its reward.
//!
//! It sits in the learner alone: the loop only knows when a rollout is over, and the controller hears
//! of a success with the acknowledgement. What a rollout is measured by is the task's; a program of the
//! user's may measure more, as an [`Assessor`]. What it is worth is a [`Verdict`] over all these measures,
//! and can be asked again at any time.

use std::path::PathBuf;

use shm_types::episode::{EpisodeHeader, TickRecord};
use shm_types::measures::{Measure, Measures, MeasuresError};
use shm_types::policy::PolicyMsg;
use thiserror::Error;

use crate::compliance::{self, ComplianceConfig};
use crate::prediction::Predictor;

/// Names and units of the measures of a session, in order.
pub type Declared = Vec<(String, String)>;

/// What a task measures of a rollout.
pub trait Measurer: Send {
    /// The same names in every rollout.
    fn declared(&self) -> Declared;

    /// From a checked episode; `header.measures` are those of the plant.
    fn measure(
        &self,
        header: &EpisodeHeader,
        records: &[TickRecord],
    ) -> Result<Measures, MeasuresError>;
}

/// What measures a rollout beyond its task, in its own time: a program.
pub trait Assessor: Send {
    /// The same names in every rollout.
    fn declared(&self) -> Declared;

    /// Which one it is, in words; another one has other words. `None` where there is nothing to write down.
    fn identity(&self) -> Option<String>;

    /// Its measures, in the order of [`Assessor::declared`], of a checked episode of which `measures` are known.
    /// It never takes longer than a moment: after [`AssessError::NotYet`] it is asked again, with the same
    /// episode.
    fn assess(
        &self,
        header: &EpisodeHeader,
        records: &[TickRecord],
        measures: &Measures,
    ) -> Result<Vec<f64>, AssessError>;
}

/// Why an assessor has no measures of a rollout.
#[derive(Clone, Debug, Error, PartialEq)]
pub enum AssessError {
    /// It is still at work.
    #[error("the judge is still running")]
    NotYet,
    /// It cannot judge this rollout, and says why. The next one it may.
    #[error("{0}")]
    Declined(String),
    /// The disk refuses what it is to read.
    #[error("{path}: {detail}")]
    NotWritten { path: PathBuf, detail: String },
    /// It is broken: no other rollout would fare better.
    #[error("{0}")]
    Broken(String),
}

/// What measures are worth.
pub trait Verdict: Send {
    /// Success, and a reward that is finite.
    fn judge(&self, measures: &Measures) -> Result<(bool, f64), VerdictError>;

    /// What the reward is the sum of, by name; nothing where it is no sum, or there is no verdict.
    fn terms(&self, _: &Measures) -> Vec<(String, f64)> {
        Vec::new()
    }
}

/// Why there is no verdict.
#[derive(Clone, Debug, Error, PartialEq)]
#[error("{0}")]
pub struct VerdictError(pub String);

/// Measures by the task and by a program, where there is one, then judges.
pub struct Judge {
    measurer: Box<dyn Measurer>,
    compliance: Option<ComplianceConfig>,
    assessor: Option<Box<dyn Assessor>>,
    verdict: Box<dyn Verdict>,
    predictor: Option<Predictor>,
    /// Those of the measures that count, where not all do.
    kept: Option<Declared>,
}

/// A verdict, and pay for compliance where it is success.
pub struct Paid<V> {
    pub verdict: V,
    /// [`ComplianceConfig::weight`]; the measure is [`compliance::MEASURE`].
    pub weight: f64,
}

impl<V: Verdict> Verdict for Paid<V> {
    fn judge(&self, measures: &Measures) -> Result<(bool, f64), VerdictError> {
        let (success, reward) = self.verdict.judge(measures)?;
        let compliance = measures.get(compliance::MEASURE).filter(|_| success).unwrap_or(0.0);
        Ok((success, reward + self.weight * compliance))
    }

    fn terms(&self, measures: &Measures) -> Vec<(String, f64)> {
        let mut terms = self.verdict.terms(measures);
        let compliance = measures.get(compliance::MEASURE);
        let is_success = self.verdict.judge(measures).is_ok_and(|(success, _)| success);
        if let Some(compliance) = compliance.filter(|_| is_success && self.weight > 0.0) {
            terms.push((compliance::MEASURE.into(), self.weight * compliance));
        }
        terms
    }
}

/// Why a rollout was not judged.
#[derive(Clone, Debug, Error, PartialEq)]
pub enum JudgeError {
    #[error(
        "this session expects {}, but its plant and task give {}: resume it with its original \
         plant and task",
        list(expected),
        list(found)
    )]
    OtherMeasures { found: Declared, expected: Declared },
    #[error(transparent)]
    Measures(#[from] MeasuresError),
    #[error(transparent)]
    Assess(#[from] AssessError),
    #[error("no verdict: {error}")]
    Verdict { error: VerdictError, measures: Box<Measures> },
}

impl Judge {
    pub fn new(measurer: Box<dyn Measurer>, verdict: Box<dyn Verdict>) -> Judge {
        let (compliance, assessor, predictor, kept) = (None, None, None, None);
        Judge { measurer, compliance, assessor, verdict, predictor, kept }
    }

    /// Knows what the task can compute of its measures before a rollout.
    pub fn with_prediction(self, predictor: Option<Predictor>) -> Judge {
        Judge { predictor, ..self }
    }

    pub fn predictor(&self) -> Option<Predictor> {
        self.predictor.clone()
    }

    /// Goes on with the measures of a session, whose task measured less when it was started.
    pub fn keeping(self, measures: &Declared) -> Judge {
        let all = self.declared();
        let are_known = measures.iter().all(|measure| all.contains(measure));
        Judge { kept: are_known.then(|| measures.clone()), ..self }
    }

    /// Measures the policy's compliance too, after the task's measures, unless it pays nothing.
    pub fn with_compliance(self, config: &ComplianceConfig) -> Judge {
        Judge { compliance: Some(*config).filter(ComplianceConfig::pays), ..self }
    }

    /// Measures by a program too, after everything else.
    pub fn with_assessor(self, assessor: Option<Box<dyn Assessor>>) -> Judge {
        Judge { assessor, ..self }
    }

    /// Which program judges; see [`Assessor::identity`].
    pub fn identity(&self) -> Option<String> {
        self.assessor.as_ref().and_then(|assessor| assessor.identity())
    }

    /// The judge of a world that takes all measures itself.
    pub fn of_plant(measures: &[(&str, &str)], verdict: impl Verdict + 'static) -> Judge {
        let declared = measures.iter().map(|(name, unit)| (name.to_string(), unit.to_string()));
        Judge::new(Box::new(PlantMeasures(declared.collect())), Box::new(verdict))
    }

    pub fn declared(&self) -> Declared {
        let mut declared = self.measurer.declared();
        declared.extend(self.compliance.and_then(|config| config.declared()));
        declared.extend(self.assessed());
        self.kept.clone().unwrap_or(declared)
    }

    /// What the assessor measures.
    fn assessed(&self) -> Declared {
        self.assessor.as_ref().map_or(Vec::new(), |assessor| assessor.declared())
    }

    /// Measures, success and reward of a checked episode of `policy`. After [`AssessError::NotYet`] the same
    /// episode is to be judged again.
    pub fn judge(
        &self,
        policy: &PolicyMsg,
        header: &EpisodeHeader,
        records: &[TickRecord],
    ) -> Result<(Measures, bool, f64), JudgeError> {
        let mut measures = self.measured(policy, header, records)?;
        if let Some(assessor) = &self.assessor {
            let values = assessor.assess(header, records, &measures)?;
            for ((name, unit), value) in self.assessed().iter().zip(values) {
                measures.push(Measure { name, unit, value })?;
            }
        }
        self.decide(measures)
    }

    /// The same of a trial that is executed again: what its assessor said is taken from what was `stored`.
    pub fn judge_again(
        &self,
        policy: &PolicyMsg,
        header: &EpisodeHeader,
        records: &[TickRecord],
        stored: &Measures,
    ) -> Result<(Measures, bool, f64), JudgeError> {
        let mut measures = self.measured(policy, header, records)?;
        for (name, unit) in &self.assessed() {
            if let Some(value) = stored.get(name) {
                measures.push(Measure { name, unit, value })?;
            }
        }
        self.decide(measures)
    }

    /// What the reward of a trial with these measures is the sum of, by name; nothing where it is no sum.
    pub fn terms(&self, measures: &Measures) -> Vec<(String, f64)> {
        self.verdict.terms(measures)
    }

    /// What is measured here.
    fn measured(
        &self,
        policy: &PolicyMsg,
        header: &EpisodeHeader,
        records: &[TickRecord],
    ) -> Result<Measures, MeasuresError> {
        let mut measures = self.measurer.measure(header, records)?;
        if let Some(config) = &self.compliance {
            let value = config.measure(policy);
            measures.push(Measure { name: compliance::MEASURE, unit: "1", value })?;
        }
        Ok(measures)
    }

    /// What all of the measures are worth.
    fn decide(&self, mut measures: Measures) -> Result<(Measures, bool, f64), JudgeError> {
        if let Some(kept) = &self.kept {
            let is_kept = |m: &Measure| kept.iter().any(|(name, _)| name == m.name);
            measures = Measures::of(measures.iter().filter(is_kept))?;
        }
        let (found, expected) = (measures.declared(), self.declared());
        if found != expected {
            return Err(JudgeError::OtherMeasures { found, expected });
        }
        match self.verdict.judge(&measures) {
            // As in the measures: zero has one sign.
            Ok((success, reward)) => Ok((measures, success, reward + 0.0)),
            Err(error) => Err(JudgeError::Verdict { error, measures: Box::new(measures) }),
        }
    }
}

/// The plant's own measures and nothing else: worlds without an arm.
pub struct PlantMeasures(pub Declared);

impl Measurer for PlantMeasures {
    fn declared(&self) -> Declared {
        self.0.clone()
    }

    fn measure(&self, header: &EpisodeHeader, _: &[TickRecord]) -> Result<Measures, MeasuresError> {
        Ok(header.measures)
    }
}

/// As people read it.
pub fn list(declared: &Declared) -> String {
    if declared.is_empty() {
        return "no measures".into();
    }
    let names: Vec<String> =
        declared.iter().map(|(name, unit)| format!("{name} ({unit})")).collect();
    names.join(", ")
}

#[cfg(test)]
mod tests {
    use super::*;
    use shm_types::measures::TRUTH;

    /// Says of a rollout what the measure `caught` says.
    struct Caught;

    impl Verdict for Caught {
        fn judge(&self, measures: &Measures) -> Result<(bool, f64), VerdictError> {
            Ok((measures.has("caught"), 2.0))
        }
    }

    /// A task that measures more than it did leaves the sessions of before as they are.
    #[test]
    fn a_session_keeps_the_measures_it_was_started_with() {
        let number = |name| Measure { name, unit: "m", value: 0.5 };
        let caught = Measure { name: "caught", unit: TRUTH, value: 1.0 };
        let all = Measures::of([number("new_m"), caught, number("apex_m")]).unwrap();
        let before = Measures::of([caught, number("apex_m")]).unwrap();
        let judge = || Judge::new(Box::new(PlantMeasures(all.declared())), Box::new(Caught));
        let judged = |judge: Judge| {
            let header = EpisodeHeader { measures: all, ..EpisodeHeader::default() };
            judge.judge(&PolicyMsg::EMPTY, &header, &[]).unwrap().0
        };
        assert_eq!(judged(judge()), all);
        let kept = judge().keeping(&before.declared());
        assert_eq!(kept.declared(), before.declared());
        assert_eq!(judged(kept), before);
        // One that the task does not have is no session of it.
        let other = Measures::of([caught, number("miss_m")]).unwrap();
        assert_eq!(judge().keeping(&other.declared()).declared(), all.declared());
    }

    /// Measures a gap of the rollout's number in cm, when it is asked for the second time.
    struct Slow(std::cell::Cell<bool>);

    impl Assessor for Slow {
        fn declared(&self) -> Declared {
            vec![("gap_m".into(), "m".into())]
        }

        fn identity(&self) -> Option<String> {
            None
        }

        fn assess(
            &self,
            header: &EpisodeHeader,
            _: &[TickRecord],
            measures: &Measures,
        ) -> Result<Vec<f64>, AssessError> {
            assert!(measures.has("caught"), "it is told what was measured before");
            match self.0.replace(true) {
                true => Ok(vec![0.01 * header.rollout as f64]),
                false => Err(AssessError::NotYet),
            }
        }
    }

    #[test]
    fn what_a_program_measures_comes_last_and_is_not_measured_again() {
        let caught = Measures::of([Measure { name: "caught", unit: TRUTH, value: 1.0 }]).unwrap();
        let judge = Judge::new(Box::new(PlantMeasures(caught.declared())), Box::new(Caught))
            .with_assessor(Some(Box::new(Slow(false.into()))));
        let header = EpisodeHeader { rollout: 3, measures: caught, ..EpisodeHeader::default() };
        let policy = PolicyMsg::EMPTY;
        let early = judge.judge(&policy, &header, &[]);
        assert_eq!(early, Err(JudgeError::Assess(AssessError::NotYet)));
        let (measures, success, reward) = judge.judge(&policy, &header, &[]).unwrap();
        assert_eq!((measures.declared(), success, reward), (judge.declared(), true, 2.0));
        assert_eq!(measures.iter().last().map(|gap| gap.value), Some(0.03));

        // Executed again, it is the stored value that counts, and without one it is no trial of this session.
        let header = EpisodeHeader { rollout: 4, ..header };
        let again = judge.judge_again(&policy, &header, &[], &measures).unwrap();
        assert_eq!(again, (measures, true, 2.0));
        let nothing = judge.judge_again(&policy, &header, &[], &Measures::NONE);
        assert!(matches!(nothing, Err(JudgeError::OtherMeasures { .. })), "{nothing:?}");
    }

    #[test]
    fn only_a_success_is_paid() {
        let paid = Paid { verdict: Caught, weight: 0.5 };
        let reward = |caught: bool| {
            let measures = [
                Measure { name: "caught", unit: TRUTH, value: f64::from(u8::from(caught)) },
                Measure { name: compliance::MEASURE, unit: "1", value: 1.5 },
            ];
            paid.judge(&Measures::of(measures).unwrap()).unwrap().1
        };
        assert_eq!((reward(true), reward(false)), (2.75, 2.0));
        let unmeasured =
            Measures::of([Measure { name: "caught", unit: TRUTH, value: 1.0 }]).unwrap();
        assert_eq!(paid.judge(&unmeasured).unwrap(), (true, 2.0));
    }
}
