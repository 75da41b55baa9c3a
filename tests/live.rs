//! Live policies on a real controller process: every way in, every refusal, every way back.

mod util;

use std::time::Duration;

use serde_json::Value;
use shm_types::cell::Cell;
use shm_types::command::{
    AT_NOW, COMMAND_ACTIVATE, COMMAND_IMPORT, COMMAND_STATUS, Command, Reply, Status,
};
use shm_types::policy::{PolicyMsg, packed_index};
use shm_types::policy_json;
use shm_types::ports::ToolPorts;
use util::{Bench, Running, bits, eventually, kill, rocking};

const REALTIME: [&str; 5] = ["controller", "--cell", "c1", "--pace", "realtime"];
const MAX: [&str; 5] = ["controller", "--cell", "c1", "--pace", "max"];

/// A bench with a cell whose commands need no process each.
struct Live {
    bench: Bench,
    next_id: std::cell::Cell<u64>,
}

impl Live {
    fn new() -> Live {
        Live { bench: Bench::new(), next_id: 1.into() }
    }

    /// Starts a controller and waits until it answers.
    fn controller(&self, arguments: &[&str]) -> Running {
        let controller = self.bench.start(arguments);
        eventually("a controller", || self.tool().status(Duration::from_secs(5)));
        controller
    }

    fn tool(&self) -> ToolPorts {
        let cell = Cell::in_dir(&self.bench.path("run"), "c1").unwrap();
        ToolPorts::open(&cell, util::WATCHDOG).unwrap()
    }

    fn command(&self, kind: u64) -> Command {
        self.next_id.set(self.next_id.get() + 1);
        Command::new(kind, self.next_id.get())
    }

    fn status(&self) -> Status {
        self.tool().status(util::WATCHDOG).unwrap()
    }

    /// `skillet policy <arguments> --cell c1`, with exit code 0.
    fn policy(&self, arguments: &[&str]) -> String {
        self.bench.ok(&[&["policy"], arguments, &["--cell", "c1"]].concat())
    }

    /// Activates policy 1, as soon as the swap before it has faded in.
    fn activate(&self, at: &str) {
        let arguments = ["policy", "activate", "1", "--at", at, "--cell", "c1"];
        eventually("its turn", || self.bench.run(&arguments).status.success().then_some(()));
    }

    fn refused(&self, arguments: &[&str], words: &[&str]) {
        self.bench.refused(&[&["policy"], arguments, &["--cell", "c1"]].concat(), words);
    }

    fn import(&self, policy: &PolicyMsg) {
        let text = policy_json::to_json(policy).unwrap();
        let path = self.bench.write("policy.json", &text);
        self.policy(&["import", path.to_str().unwrap()]);
    }
}

#[test]
fn a_swap_is_acknowledged_with_its_tick_and_leads_both_ways() {
    let live = Live::new();
    let _controller = live.controller(&REALTIME);
    live.import(&rocking(0.02));
    live.import(&rocking(0.04));

    let first: Value = serde_json::from_str(&live.policy(&["activate", "1", "--json"])).unwrap();
    assert_eq!(first["policy"]["policy_id"], 1);
    assert_eq!(live.status().applied_tick, first["applied_tick"].as_u64().unwrap());
    let pinned: Value = serde_json::from_str(&live.policy(&["pin", "--json"])).unwrap();
    assert_eq!(
        (&pinned["active_policy"]["policy_id"], &pinned["pinned"]),
        (&1.into(), &true.into())
    );
    let second: Value =
        serde_json::from_str(&live.policy(&["activate", "2", "--at", "now", "--json"])).unwrap();
    assert_eq!(second["policy"]["policy_id"], 2);
    assert!(second["applied_tick"].as_u64() > first["applied_tick"].as_u64());
    assert!(second["latency_ms"].as_f64().is_some_and(|ms| ms > 0.0));

    eventually("the blend to end", || {
        live.bench.run(&["policy", "rollback", "--cell", "c1"]).status.success().then_some(())
    });
    let status = live.status();
    assert_eq!((status.active.policy_id, status.pinned, status.swaps_torn), (1, 1, 0));
    assert_eq!(status.swaps_applied, 3);
    eventually("a rollout of it", || (live.status().last_good.policy_id == 1).then_some(()));
    live.refused(&["rollback"], &["no earlier policy"]);
    let exported = live.policy(&["export", "2"]);
    assert_eq!(policy_json::from_json(&exported).unwrap().digest, rocking(0.04).digest);
    let list: Value = serde_json::from_str(&live.policy(&["list", "--json"])).unwrap();
    assert_eq!((&list["active_policy"]["policy_id"], &list["pinned"]), (&1.into(), &true.into()));

    live.policy(&["forbid", "2"]);
    live.refused(&["activate", "2"], &["policy 2 is forbidden", "allow 2"]);
    live.policy(&["allow", "2"]);
    live.policy(&["activate", "2"]);
}

#[test]
fn what_must_not_come_in_is_refused_counted_and_changes_nothing() {
    let live = Live::new();
    let _controller = live.controller(&MAX);
    live.import(&rocking(0.02));
    live.policy(&["activate", "1"]);
    let tool = live.tool();
    let ask = |command: Command| -> Reply { tool.request(&command, util::WATCHDOG).unwrap() };
    let mut refusals = 0;
    let mut refused = |reply: Reply, words: &[&str]| {
        let reason = reply.reason_text();
        assert_eq!(reply.accepted, 0, "{words:?} was accepted");
        assert!(words.iter().all(|word| reason.contains(word)), "{words:?}: {reason}");
        refusals += 1;
        assert_eq!(reply.status.commands_refused, refusals, "{reason}");
        assert_eq!(reply.status.active.policy_id, 1, "{reason}");
    };
    let import = |change: &dyn Fn(&mut PolicyMsg)| {
        let mut policy = rocking(0.03);
        change(&mut policy);
        ask(Command { policy: policy.sealed(), ..live.command(COMMAND_IMPORT) })
    };
    refused(import(&|p| p.components[1].attractor[0] = f64::NAN), &["component 1", "attractor"]);
    refused(import(&|p| p.components[2].stiffness[0] = -4.0), &["component 2", "eigenvalue"]);
    refused(import(&|p| p.components[0].stiffness[1] = 900.0), &["eigenvalue"]);
    refused(
        import(&|p| p.components[3].attractor[2] = 7.0),
        &["component 3", "m from the shoulder"],
    );
    refused(import(&|p| p.components[3].width = 0.0), &["component 3", "width"]);
    refused(import(&|p| p.n_components = 99), &["n_components is 99"]);
    refused(import(&|p| p.duration_s = 25.0), &["duration_s"]);
    let violent = |p: &mut PolicyMsg| {
        (0..3).for_each(|row| p.components[1].stiffness[packed_index(row, row)] = 4e4);
        p.components[1].attractor[2] = -0.2;
    };
    refused(import(&violent), &["dry run"]);
    refused(import(&|p| *p = PolicyMsg::of_action(&[1.0])), &["n_actions is 1"]);
    let torn = PolicyMsg { digest: 7, ..rocking(0.03) };
    refused(ask(Command { policy: torn, ..live.command(COMMAND_IMPORT) }), &["digest"]);
    let other_build = PolicyMsg { schema: 7, ..rocking(0.03) };
    refused(ask(Command { policy: other_build, ..live.command(COMMAND_IMPORT) }), &["schema 0x7"]);
    refused(ask(Command { schema: 7, ..live.command(COMMAND_STATUS) }), &["different builds"]);
    refused(ask(live.command(77)), &["kind 77"]);
    refused(ask(Command { at: 5, ..live.command(COMMAND_ACTIVATE) }), &["at is 5"]);
    refused(ask(Command { policy_id: 9, ..live.command(COMMAND_ACTIVATE) }), &["policy 9"]);

    // A command that is repeated, after a lost answer, is the same command.
    let again = Command { policy_id: 9, ..live.command(COMMAND_ACTIVATE) };
    refused(ask(again), &["policy 9"]);
    assert_eq!(ask(again).status.commands_refused, refusals);

    let text = policy_json::to_json(&rocking(0.03)).unwrap();
    let cut = live.bench.write("cut.json", &text[..text.len() / 2]);
    live.refused(&["import", cut.to_str().unwrap()], &["cut.json", "not a whole, valid policy"]);
    let nan = live.bench.write("nan.json", &text.replace("0.75", "NaN"));
    live.refused(&["import", nan.to_str().unwrap()], &["nan.json"]);
    live.refused(&["import", "absent.json"], &["absent.json", "check the path"]);
    live.refused(&["activate", "nine"], &["'nine'", "last-good"]);
    assert_eq!(live.status().imported, 1);
}

#[test]
fn a_swap_while_one_is_under_way_is_refused() {
    let live = Live::new();
    let config = live.bench.write("slow.toml", "[controller]\nblend_s = 1.0\n");
    let config = ["--config", config.to_str().unwrap()];
    let _controller = live.controller(&[&REALTIME[..], &config].concat());
    live.import(&rocking(0.02));
    live.import(&rocking(0.04));
    live.policy(&["activate", "1"]);
    live.policy(&["pin"]);
    live.policy(&["activate", "2", "--at", "now"]);
    let tool = live.tool();
    let back = Command { policy_id: 1, at: AT_NOW, ..live.command(COMMAND_ACTIVATE) };
    let reply = tool.request(&back, util::WATCHDOG).unwrap();
    assert_eq!(reply.accepted, 0);
    assert!(reply.reason_text().contains("policy 2 is under way"), "{}", reply.reason_text());
    eventually("the blend to end", || {
        // Field by field: a struct update in a closure trips the compiler over the array in it.
        let mut back = back;
        back.id = live.command(0).id;
        (tool.request(&back, util::WATCHDOG).unwrap().accepted == 1).then_some(())
    });
}

#[test]
fn swaps_and_pins_between_change_no_bit_of_a_session() {
    let live = Live::new();
    let _controller = live.controller(&MAX);
    live.import(&rocking(0.02));
    let config = live.bench.write("c.toml", "[learner]\nrollouts = 25\nseed = 3\n");
    let learner = ["learner", "--cell", "c1", "--session", "s", "--config"];
    let learner = live.bench.start(&[&learner[..], &[config.to_str().unwrap()]].concat());
    live.bench.wait_for_trials("s", 5);
    for at in ["now", "next-rollout", "now"] {
        live.activate(at);
    }
    live.policy(&["pin"]);
    let held = live.bench.trials("s").len();
    let served = live.status().rollouts_served;
    eventually("service", || (live.status().rollouts_served > served + 3).then_some(()));
    assert!(live.bench.trials("s").len() <= held + 1, "the learner waits");
    live.policy(&["unpin"]);
    let output = learner.wait();
    assert!(output.status.success(), "{}", util::stderr(&output));
    let log = util::stderr(&output);
    assert!(log.contains("serves a pinned policy"), "{log}");

    let undisturbed =
        ["learn", "pancake", "--seed", "3", "--rollouts", "25", "--out", "undisturbed"];
    live.bench.ok(&undisturbed);
    assert_eq!(bits(&live.bench.trials("s")), bits(&live.bench.trials("undisturbed")));
}

#[test]
fn the_last_good_policy_serves_after_a_kill_without_any_learner() {
    let live = Live::new();
    let first = live.controller(&MAX);
    live.import(&rocking(0.02));
    live.policy(&["activate", "1"]);
    eventually("proof", || (live.status().last_good.policy_id == 1).then_some(()));
    live.policy(&["pin"]);
    kill(first.pid(), "KILL");
    first.wait();
    let second = live.controller(&MAX);
    eventually("service, pinned", || (live.status().rollouts_served > 1).then_some(()));
    let status = live.status();
    assert_eq!((status.active.digest, status.pinned), (rocking(0.02).digest, 1));

    // Not pinned, it serves when no learner was heard for a while.
    live.policy(&["unpin"]);
    kill(second.pid(), "KILL");
    second.wait();
    let third = live.controller(&MAX);
    assert_eq!(live.status().pinned, 0);
    eventually("service, alone", || (live.status().rollouts_served > 1).then_some(()));

    // And it holds where it is told to.
    third.signal("TERM");
    assert!(third.wait().status.success());
    let config =
        live.bench.write("hold.toml", "[controller]\nalone = \"hold\"\nalone_after_s = 0.5\n");
    let _fourth = live.controller(&[&MAX[..], &["--config", config.to_str().unwrap()]].concat());
    std::thread::sleep(Duration::from_secs(1));
    assert_eq!(live.status().rollouts_served, 0);
}

#[test]
fn a_broken_state_folder_is_named_and_left_as_it_is() {
    let bench = Bench::new();
    std::fs::create_dir_all(bench.path("state/c1")).unwrap();
    bench.write("state/c1/state.json", "{\"format\": 1, \"nex");
    bench.refused(&MAX, &["state.json", "move it away"]);
    assert_eq!(util::text(&bench.path("state/c1/state.json")), "{\"format\": 1, \"nex");
}

#[test]
fn a_period_that_the_host_cannot_hold_is_refused() {
    let bench = Bench::new();
    // So many solver iterations take longer than a quarter of a millisecond on any host.
    let text = "[plant]\nsolver_iterations = 64\n[controller]\nperiod_us = 250\n";
    let config = bench.write("fast.toml", text);
    let arguments = [&REALTIME[..], &["--config", config.to_str().unwrap()]].concat();
    bench.refused(&arguments, &["period_us is 250", "use at least"]);
}
