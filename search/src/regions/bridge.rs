//! Whether two regions are one: looks for a high way between them.

use super::map::Map;
use super::{Regions, Step};

/// Between regions whose best way seems lower than this nothing is tried.
const HOPELESS_SHARE: f64 = 0.1;

/// Two regions and the places of the map nearest to their best trials.
struct Pair {
    regions: [usize; 2],
    ends: [usize; 2],
}

impl Regions {
    /// Merges the regions that a high way connects. Returns the point that tells most on a way that may
    /// be high, where one is worth a trial now.
    pub(super) fn bridge(&mut self) -> Option<Step> {
        if self.config.n_bridges == 0 || self.high_regions().len() < 2 {
            return None;
        }
        let beliefs = self.map.as_mut()?.beliefs();
        let scores = |deviations: f64| -> Vec<f64> {
            beliefs.iter().map(|belief| belief.mean + deviations * belief.std).collect()
        };
        let safe = scores(-self.config.caution);
        while let Some([a, b]) = self.connected(&safe) {
            self.merge(a, b);
        }
        if self.n_bridges >= self.config.n_bridges {
            return None;
        }
        self.doubtful(&scores(self.config.optimism), &safe)
    }

    /// The regions whose best trial is high enough to be connected.
    fn high_regions(&self) -> Vec<usize> {
        let is_high = |r: &usize| self.reaches(&self.regions[*r], self.config.connected);
        (0..self.regions.len()).filter(is_high).collect()
    }

    fn high_pairs(&self, map: &Map) -> Vec<Pair> {
        let end = |r: usize| map.nearest(&self.points[self.regions[r].best]);
        let high: Vec<(usize, usize)> =
            self.high_regions().into_iter().map(|r| (r, end(r))).collect();
        let mut pairs = Vec::new();
        for (i, &(a, from)) in high.iter().enumerate() {
            let others = high[i + 1..].iter();
            pairs.extend(others.map(|&(b, to)| Pair { regions: [a, b], ends: [from, to] }));
        }
        pairs
    }

    /// The first two regions that are connected for all that is safe to say.
    fn connected(&self, safe: &[f64]) -> Option<[usize; 2]> {
        let map = self.map.as_ref()?;
        let least = self.config.connected.ln();
        let is_connected = |pair: &Pair| map.highest_way(safe, least, pair.ends).is_some();
        self.high_pairs(map).into_iter().find(is_connected).map(|pair| pair.regions)
    }

    /// The least safe place on the highest of the ways hoped for, if that is high enough to be tried.
    fn doubtful(&self, hoped: &[f64], safe: &[f64]) -> Option<Step> {
        let map = self.map.as_ref()?;
        // Ways that would have to be better than hoped are tried by turns with climbs.
        let connected = self.config.connected.ln();
        let is_their_turn = self.rewards.len().is_multiple_of(2);
        let mut least = if is_their_turn { connected.min(HOPELESS_SHARE.ln()) } else { connected };
        let mut highest = None;
        for Pair { regions, ends } in self.high_pairs(map) {
            if let Some(way) = map.highest_way(hoped, least, ends) {
                // Another way must be higher.
                least = way.height.next_up();
                highest = Some((way, regions));
            }
        }
        let (way, regions) = highest?;
        let inner = way.places[1..way.places.len() - 1].iter().copied();
        let place = inner.min_by(|&p, &q| safe[p].total_cmp(&safe[q]))?;
        Some(Step::Bridge { regions, point: map.place(place).clone() })
    }
}
