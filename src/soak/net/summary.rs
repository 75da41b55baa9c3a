//! What a soak across machines found.

use std::time::Duration;

use serde_json::{Map, Value, json};

use super::super::summary::{times, times_json};
use super::NetPlan;
use super::tally::NetTally;

pub struct NetSummary {
    pub wall: Duration,
    pub plan: NetPlan,
    pub tally: NetTally,
    /// Processes that did not come back, or did not end cleanly.
    pub failures: Vec<String>,
    /// Shared memory and locks that should be gone.
    pub left_over: Vec<String>,
}

impl NetSummary {
    pub fn is_good(&self) -> bool {
        self.reasons().is_empty()
    }

    /// Everything that makes it a failure, in words.
    fn reasons(&self) -> Vec<String> {
        let NetTally { books, alone, in_spools, .. } = &self.tally;
        let mut reasons = self.failures.clone();
        reasons.extend(self.left_over.iter().map(|path| format!("left over: {path}")));
        let faults = [
            (books.lost, "episodes or rollouts were lost"),
            (books.doubled, "episodes were executed twice in one cell"),
            (books.again_for_nothing, "rollouts were executed in a second cell for no reason"),
            (books.foreign, "episodes were learnt from another execution than the durable one"),
            (books.produced.abs_diff(books.learnt), "more rollouts on one side than on the other"),
            (books.different, "trials differ when they are executed again"),
            (books.not_reproduced, "sessions do not propose the same again"),
            (*in_spools, "episodes stayed in a spool"),
            (alone.stood_still, "cells stood still behind a cut though they had a good policy"),
        ];
        let faults = faults.into_iter().filter(|(n, _)| *n > 0);
        reasons.extend(faults.map(|(n, what)| format!("{n} {what}")));
        reasons
    }

    pub fn json(&self) -> Value {
        let NetTally { books, alone, packets, .. } = &self.tally;
        let NetPlan { hosts, cells, weather, seed, .. } = &self.plan;
        let parts = self.tally.parts().map(|(name, part)| {
            let of = json!({
                "kills": part.kills,
                "kills_at_start": part.at_start,
                "starts": part.restarts.len(),
                "start_ms": times_json(&part.restarts),
            });
            (name.to_string(), of)
        });
        json!({
            "passed": self.is_good(),
            "minutes": self.wall.as_secs_f64() / 60.0,
            "hosts": hosts,
            "cells": cells,
            "seed": seed,
            "network": {
                "delay_ms": 1e3 * weather.delay.as_secs_f64(),
                "packets": packets.sent,
                "lost": packets.lost,
                "duplicated": packets.doubled,
                "reordered": packets.overtaken,
                "cut": packets.cut,
            },
            "processes": parts.collect::<Map<_, _>>(),
            "kills": self.tally.kills,
            "cuts": {
                "short": self.tally.short_cuts,
                "beyond_a_lease": self.tally.long_cuts,
                "one_way": self.tally.one_way,
                "seconds": self.tally.cut_for.as_secs_f64(),
            },
            "alone": {
                "went_on": alone.went_on,
                "rollouts": alone.rollouts,
                "stood_still": alone.stood_still,
                "without_policy": alone.without_policy,
                "not_told": alone.not_told,
            },
            "sessions": books.sessions,
            "learner_restarts": books.restarts,
            "leases_over": books.leases,
            "episodes": {
                "produced": books.produced,
                "learnt": books.learnt,
                "again_after_lease": books.again_after_lease,
                "again_after_restart": books.again_after_restart,
                "again_for_nothing": books.again_for_nothing,
                "doubled": books.doubled,
                "lost": books.lost,
                "foreign": books.foreign,
                "in_spools": self.tally.in_spools,
            },
            "sessions_resumed_for_spools": self.tally.resumed,
            "replayed": books.replayed,
            "different": books.different,
            "not_reproduced": books.not_reproduced,
            "failures": self.reasons(),
            "left_over": self.left_over,
        })
    }

    pub fn text(&self) -> String {
        let NetTally { books, alone, packets, .. } = &self.tally;
        let NetPlan { hosts, cells, weather, .. } = &self.plan;
        let mut text = format!(
            "soaked for {:.1} min: {cells} cells on {hosts} hosts\n\n\
             \x20 network     {:.0} ms one way; {} packets, {} lost, {} duplicated, {} reordered, {} cut off\n\
             \x20 cuts        {} shorter and {} longer than a lease, {} in one direction only; {:.0} s in all\n",
            self.wall.as_secs_f64() / 60.0,
            1e3 * weather.delay.as_secs_f64(),
            packets.sent,
            packets.lost,
            packets.doubled,
            packets.overtaken,
            packets.cut,
            self.tally.short_cuts,
            self.tally.long_cuts,
            self.tally.one_way,
            self.tally.cut_for.as_secs_f64(),
        );
        for (name, part) in self.tally.parts() {
            text += &format!(
                "  {name:<11} {} kills, {} of them at its start; up after {}\n",
                part.kills,
                part.at_start,
                times(&part.restarts)
            );
        }
        let kills: Vec<String> =
            self.tally.kills.iter().map(|(name, n)| format!("{n} {name}")).collect();
        text += &format!(
            "  kills       {}\n\
             \x20 alone       {} cells behind a cut served {} rollouts, {} stood still, {} had no policy yet, {} not told\n\
             \x20 sessions    {}, {} not reproduced; {} restarts of their learners, {} leases over\n\
             \x20 episodes    {} produced, {} learnt; {} executed again after a lease, {} after a restart, {} for \
             nothing; {} duplicated, {} lost, {} foreign, {} left in spools\n\
             \x20 replay      {} trials, {} different\n\n",
            if kills.is_empty() { "none".into() } else { kills.join(", ") },
            alone.went_on,
            alone.rollouts,
            alone.stood_still,
            alone.without_policy,
            alone.not_told,
            books.sessions,
            books.not_reproduced,
            books.restarts,
            books.leases,
            books.produced,
            books.learnt,
            books.again_after_lease,
            books.again_after_restart,
            books.again_for_nothing,
            books.doubled,
            books.lost,
            books.foreign,
            self.tally.in_spools,
            books.replayed,
            books.different,
        );
        for reason in self.reasons() {
            text += &format!("FAILED: {reason}\n");
        }
        if self.is_good() {
            text += "passed: nothing lost or learnt twice, every session reproduced bit for bit\n";
        }
        text
    }
}
