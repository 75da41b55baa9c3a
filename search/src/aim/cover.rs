//! Covering the windows: which part of them is aimed at next.
//!
//! The parts are those of all targets together: three parts of a height and two of a distance are six. The
//! next one is the part with the fewest trials so far; those that lie in it count twice, those that were aimed at
//! it and missed once. One in which trials lie and none succeeded is given up: whatever succeeds, it does not do
//! so there, or is not wished to any more.

use super::config::Target;

/// Failures without a success after which a part is given up.
const GIVE_UP: u64 = 2;

/// What became of the trials of every part.
#[derive(Clone, Debug)]
pub struct Cover {
    parts: Vec<Part>,
}

#[derive(Clone, Copy, Debug, Default)]
struct Part {
    /// Trials that were aimed at it, or came to lie in it.
    tried: u64,
    /// Trials in the part that succeeded, with all measures in their windows.
    succeeded: u64,
    failed: u64,
}

impl Part {
    fn is_given_up(self) -> bool {
        self.succeeded == 0 && self.failed >= GIVE_UP
    }
}

impl Cover {
    pub fn new(targets: &[Target]) -> Cover {
        let n = targets.iter().map(|target| target.parts).product();
        Cover { parts: vec![Part::default(); n] }
    }

    pub fn n_parts(&self) -> usize {
        self.parts.len()
    }

    /// The part that is aimed at next, with one more trial for each of the `pending` aims; the first of equals.
    pub fn next(&self, pending: &[usize]) -> usize {
        let order = |i: &usize| {
            let part = self.parts[*i];
            let n_pending = pending.iter().filter(|aimed| *aimed == i).count() as u64;
            (part.is_given_up(), part.tried + part.succeeded + part.failed + n_pending, *i)
        };
        (0..self.parts.len()).min_by_key(order).unwrap_or(0)
    }

    /// Counts a trial that was aimed at a part, if it was, and lies in one, if it does.
    pub fn tell(&mut self, aimed: Option<usize>, lies: Option<usize>, success: bool) {
        if let Some(part) = aimed.filter(|aimed| Some(*aimed) != lies) {
            self.parts[part].tried += 1;
        }
        if let Some(part) = lies {
            self.parts[part].tried += 1;
            self.parts[part].succeeded += u64::from(success);
            self.parts[part].failed += u64::from(!success);
        }
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
    fn the_part_with_the_fewest_trials_is_next_and_one_that_never_succeeds_is_given_up() {
        let mut cover = Cover::new(&targets());
        let mut aims = [0; 6];
        for _ in 0..55 {
            let part = cover.next(&[]);
            aims[part] += 1;
            // What is aimed at part 2 lies beside it; part 4 holds no success.
            let lies = if part == 2 { 3 } else { part };
            cover.tell(Some(part), Some(lies), part != 4);
        }
        assert_eq!(aims[4], GIVE_UP);
        assert!(aims[2] > aims[0] && aims[0] >= 8 && aims[5] >= 8, "{aims:?}");
        cover.tell(None, Some(4), true);
        assert_eq!(cover.next(&[]), 4, "a success by chance opens it again");
    }
}
