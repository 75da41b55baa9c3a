//! `skillet bench tick`: what the hot path costs, whole and in parts.

use std::hint::black_box;
use std::time::{Duration, Instant};

use anyhow::Result;
use physics::arm::{ArmModel, BodyFrames, TipKinematics, dynamics};
use physics::plant::Plant;
use rt_controller::hot::policy::Policy;
use rt_controller::hot::wrench::{ArmState, TaskInertia};

use super::arm::{Arm, Loop, State};
use super::{Bench, Case, Plan, Row, interleave};

pub const BENCH: Bench = Bench {
    name: "tick",
    title: "What a tick costs",
    about: "Parts of a tick are too short to be timed individually: each value is the mean of 100 \
            calls over different random states of the arm (one seed), so the tails are those of \
            batches. Whole ticks are timed individually, during rollouts in the pancake world in \
            which the policy drives the arm. Springs are those of Eq. (5); systems are the \
            complete Eq. (2), each with a full Gaussian and a full matrix. The timer is what a \
            pair of clock readings adds to each timing. The costs of the arm's parts depend on \
            its joints only, not on the policy.",
    seconds: 30.0,
    run,
};

const COMPONENTS: [usize; 5] = [1, 2, 4, 8, 16];
const DIMS: [usize; 3] = [3, 4, 6];
/// Eq. (2) whole, beside the springs of Eq. (5).
const FIELD: &str = "8 systems driven by the state, 6 dims";
const FIELD_DIMS: usize = 6;
/// Few enough to stay in a cache, as the loop's own state does.
const N_STATES: usize = 400;
const CALLS: usize = 100;

fn run(plan: &Plan) -> Result<Vec<Row>> {
    let arm = Arm::new()?;
    let states = arm.states(N_STATES);
    let mut cases = vec![timer()];
    for dims in DIMS {
        for components in COMPONENTS {
            let policy = arm.policy(components, dims)?;
            cases.push(command(&states, policy, dims, &policy_size(components, dims)));
        }
    }
    cases.push(command(&states, arm.field()?, FIELD_DIMS, FIELD));
    cases.extend(arm_parts(&arm.model, &states));
    for dims in DIMS {
        for components in COMPONENTS {
            let policy = arm.policy(components, dims)?;
            cases.push(whole_tick(&arm, policy, dims, &policy_size(components, dims)));
        }
    }
    cases.push(whole_tick(&arm, arm.field()?, FIELD_DIMS, FIELD));
    interleave(plan, cases)
}

fn policy_size(components: usize, dims: usize) -> String {
    let s = if components == 1 { "" } else { "s" };
    format!("{components} component{s}, {dims} dims")
}

fn timer<'a>() -> Case<'a> {
    let measure = |slice: Duration, row: &mut Row| {
        let begin = Instant::now();
        loop {
            let start = Instant::now();
            row.add_time(start.elapsed());
            if begin.elapsed() >= slice {
                return Ok(());
            }
        }
    };
    let row = Row::time("Timer", "timer", "two clock readings");
    Case { row, measure: Box::new(measure) }
}

/// A case that calls `f` on every state in turn and times batches of calls.
fn batches<'a, T>(row: Row, states: &'a [State], f: impl Fn(&State) -> T + 'a) -> Case<'a> {
    let mut next = 0;
    let mut batch = move || {
        let start = Instant::now();
        for state in &states[next..next + CALLS] {
            black_box(f(black_box(state)));
        }
        next = (next + CALLS) % N_STATES;
        start.elapsed()
    };
    let measure = move |slice: Duration, row: &mut Row| {
        // What the case before left in the caches is not this one's.
        batch();
        let start = Instant::now();
        loop {
            row.add_time(batch());
            if start.elapsed() >= slice {
                return Ok(());
            }
        }
    };
    Case { row, measure: Box::new(measure) }
}

fn command<'a>(states: &'a [State], policy: Policy, dims: usize, size: &str) -> Case<'a> {
    let group = format!("Policy command, {dims} dims");
    let row = Row::batch(&group, "policy command", size, CALLS);
    batches(row, states, move |state| policy.command(state.t_s, &state.task))
}

fn arm_parts<'a>(model: &'a ArmModel, states: &'a [State]) -> Vec<Case<'a>> {
    let joints = format!("{} joints", model.n_joints());
    let row = |name: &str| Row::batch("Parts of the arm", name, &joints, CALLS);
    vec![
        batches(row("kinematics with Jdot*qd"), states, |state| {
            TipKinematics::new(model, &state.q, &state.qd)
        }),
        batches(row("mass matrix"), states, |state| dynamics::mass_matrix(model, &state.q)),
        batches(row("bias (Newton-Euler)"), states, |state| {
            dynamics::bias(model, &state.q, &state.qd)
        }),
        // As the loop calls them: where the bodies are is worked out once for all three.
        batches(row("frames of the bodies"), states, |state| BodyFrames::new(model, &state.q)),
        batches(row("all three, shared frames"), states, |state| {
            ArmState::new(model, &state.q, &state.qd)
        }),
        batches(row("gravity torque"), states, |state| dynamics::gravity_torque(model, &state.q)),
        batches(row("operational-space torque"), states, |state| {
            TaskInertia::new(&state.arm)
                .map(|inertia| inertia.torque(&state.arm, &state.xdd, &state.qdd))
        }),
    ]
}

fn whole_tick<'a>(arm: &'a Arm, policy: Policy, dims: usize, size: &str) -> Case<'a> {
    let mut running = Loop::new(arm, policy, &arm.world());
    let measure = move |slice: Duration, row: &mut Row| {
        let begin = Instant::now();
        let before = row.n();
        while row.n() == before || begin.elapsed() < slice {
            running.begin_if_idle();
            let measured = running.plant.measure();
            let counts = running.is_executing();
            let start = Instant::now();
            let tau = running.controller.tick(&measured, &mut running.record);
            let time = start.elapsed();
            if counts {
                row.add_time(time);
            }
            running.plant.apply(&tau);
            running.plant.advance();
        }
        Ok(())
    };
    let group = format!("Whole tick, {dims} dims");
    let row = Row::time(&group, "whole tick", size);
    Case { row, measure: Box::new(measure) }
}
