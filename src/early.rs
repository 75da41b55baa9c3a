//! Rollouts that ended early, by reason, to explain a session that learns nothing.

use std::collections::BTreeMap;

use learner::summary::ends_early;
use rt_controller::fault::Fault;

/// How many rollouts ended early for which reason.
pub type EndedEarly = BTreeMap<String, u64>;

/// The reasons in words, from counts by the code of the fault.
pub fn by_reason(by_code: &BTreeMap<u64, u64>) -> EndedEarly {
    let mut reasons = EndedEarly::new();
    for (code, count) in by_code {
        *reasons.entry(reason(*code)).or_default() += count;
    }
    reasons
}

/// Counts one more, if `fault` ends a rollout early.
pub fn add(reasons: &mut EndedEarly, fault: u64) {
    if ends_early(fault) {
        *reasons.entry(reason(fault)).or_default() += 1;
    }
}

/// "12 ended early: 10 the pan left the workspace, 2 …"; nothing if none did.
pub fn sentence(reasons: &EndedEarly) -> Option<String> {
    let total: u64 = reasons.values().sum();
    let mut counts: Vec<(&String, &u64)> = reasons.iter().collect();
    counts.sort_by_key(|(_, count)| std::cmp::Reverse(**count));
    let parts: Vec<String> = match counts[..] {
        [] => return None,
        [(reason, _)] => vec![reason.clone()],
        _ => counts.iter().map(|(reason, count)| format!("{count} {reason}")).collect(),
    };
    Some(format!("{total} ended early: {}", parts.join(", ")))
}

fn reason(code: u64) -> String {
    Fault::describe(u32::try_from(code).unwrap_or(u32::MAX)).to_string()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn reasons_are_counted_in_words_most_frequent_first() {
        assert_eq!(sentence(&EndedEarly::new()), None);
        let mut reasons = by_reason(&BTreeMap::from([(2, 1), (13, 2)]));
        [0, 8, 13].iter().for_each(|fault| add(&mut reasons, *fault));
        let text = sentence(&reasons).unwrap();
        assert_eq!(
            text,
            "4 ended early: 3 the pan left the workspace, 1 a joint is far beyond its position limit"
        );
    }
}
