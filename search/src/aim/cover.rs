//! Covering the windows: which part of them is aimed at next.
//!
//! The parts are those of all targets together: three parts of a height and two of a distance are six. The
//! next one is the part with the fewest aims and successes so far, so that one that nothing reaches costs at
//! most twice what the others do.

use super::config::Target;

/// Aims and successes of every part.
#[derive(Clone, Debug)]
pub struct Cover {
    counts: Vec<u64>,
}

impl Cover {
    pub fn new(targets: &[Target]) -> Cover {
        Cover { counts: vec![0; targets.iter().map(|target| target.parts).product()] }
    }

    pub fn n_parts(&self) -> usize {
        self.counts.len()
    }

    /// The part that is aimed at next; the first of equals.
    pub fn next(&self) -> usize {
        let order = |i: &usize| (self.counts[*i], *i);
        (0..self.counts.len()).min_by_key(order).unwrap_or(0)
    }

    /// Counts an aim at the part, or a success in it.
    pub fn count(&mut self, part: usize) {
        self.counts[part] += 1;
    }
}

/// The part in which `values` lie, one each target.
pub fn part_of(targets: &[Target], values: impl IntoIterator<Item = f64>) -> usize {
    let parts = targets.iter().zip(values).map(|(target, value)| (target, target.part_of(value)));
    parts.fold(0, |part, (target, i)| part * target.parts + i)
}

/// The windows of a part, one each target; `None` where a target has one part only.
pub fn windows(targets: &[Target], mut part: usize) -> Vec<Option<[f64; 2]>> {
    let mut windows = vec![None; targets.len()];
    for (j, target) in targets.iter().enumerate().rev().filter(|(_, target)| target.parts > 1) {
        windows[j] = Some(target.part(part % target.parts));
        part /= target.parts;
    }
    windows
}

#[cfg(test)]
mod tests {
    use super::*;

    fn targets() -> [Target; 3] {
        let target = |parts| Target { parts, ..Target::new("a", [1.0, 4.0], 1.0) };
        [target(3), target(1), target(2)]
    }

    #[test]
    fn every_part_has_windows_that_hold_what_lies_in_it() {
        let targets = targets();
        assert_eq!(Cover::new(&targets).n_parts(), 6);
        assert_eq!(windows(&targets, 0), [Some([1.0, 2.0]), None, Some([1.0, 2.5])]);
        assert_eq!(windows(&targets, 5), [Some([3.0, 4.0]), None, Some([2.5, 4.0])]);
        for part in 0..6 {
            let middle = |window: Option<[f64; 2]>| window.map_or(2.5, |[a, b]| 0.5 * (a + b));
            assert_eq!(part_of(&targets, windows(&targets, part).into_iter().map(middle)), part);
        }
        assert_eq!(part_of(&targets, [9.0, 0.0, 9.0]), 5, "the nearest one");
        assert_eq!(part_of(&targets, [-9.0, 0.0, f64::NEG_INFINITY]), 0);
    }

    #[test]
    fn the_part_with_the_fewest_aims_and_successes_is_next() {
        let mut cover = Cover::new(&targets());
        let reachable = [true, true, false, true, true, true];
        let mut aims = [0; 6];
        for _ in 0..70 {
            let part = cover.next();
            aims[part] += 1;
            cover.count(part);
            if reachable[part] {
                cover.count(part);
            }
        }
        assert_eq!(aims, [10, 10, 20, 10, 10, 10]);
    }
}
