//! Whether two regions are one: looks for a high way between them.

use super::map::Way;
use super::{Regions, Step};

/// Between regions whose best way seems lower than this nothing is tried.
const HOPELESS_SHARE: f64 = 0.1;

/// What is between the regions.
pub(super) enum Look {
    /// A way that stays high.
    Connected([usize; 2]),
    /// A way that may stay high, and what to try.
    Doubtful(Step),
    /// Nothing that is worth a trial now.
    Apart,
}

impl Regions {
    /// Two of the `high` regions that are connected, or else the point between two of them that
    /// tells most.
    pub(super) fn look_between(&self, high: &[usize]) -> Look {
        let Some(map) = self.map.as_ref().filter(|_| high.len() > 1 && self.config.n_bridges > 0)
        else {
            return Look::Apart;
        };
        let beliefs = map.beliefs(&map.condition(&self.values()));
        let score = |deviations: f64| -> Vec<f64> {
            beliefs.iter().map(|belief| belief.mean + deviations * belief.std).collect()
        };
        let (hoped, safe) = (score(self.config.optimism), score(-self.config.caution));
        let connected = self.config.connected.ln();
        let mut best: Option<(f64, [usize; 2], usize)> = None;
        for (i, &a) in high.iter().enumerate() {
            for &b in &high[i + 1..] {
                let [from, to] = [a, b].map(|r| map.nearest(&self.points[self.regions[r].best]));
                let is_safe = |way: &Way| way.height >= connected;
                if map.highest_way(&safe, from, to).as_ref().is_some_and(is_safe) {
                    return Look::Connected([a, b]);
                }
                let Some(way) = map.highest_way(&hoped, from, to) else { continue };
                let inner = way.places[1..way.places.len() - 1].iter().copied();
                let doubtful = inner.min_by(|&p, &q| safe[p].total_cmp(&safe[q]));
                if let Some(place) = doubtful.filter(|_| best.is_none_or(|b| way.height > b.0)) {
                    best = Some((way.height, [a, b], place));
                }
            }
        }
        // Ways that would have to be better than hoped are tried by turns with climbs.
        let is_due = |height: f64| {
            height >= connected
                || height >= HOPELESS_SHARE.ln() && self.rewards.len().is_multiple_of(2)
        };
        match best.filter(|b| self.n_bridges < self.config.n_bridges && is_due(b.0)) {
            Some((_, regions, place)) => {
                Look::Doubtful(Step::Bridge { regions, point: map.place(place).clone() })
            }
            None => Look::Apart,
        }
    }
}
