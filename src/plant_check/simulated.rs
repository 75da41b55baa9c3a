//! A plant in lockstep, step by step.

use std::time::Duration;

use anyhow::Result;
use physics::arm::{JointVector, dynamics};
use shm_types::plant::{PLANT_DETERMINISTIC, PlantHello, PlantState};

use super::Bench;
use super::line::{Line, q, qd};

/// How far the arm may be from its start posture after a reset, rad, and from where it is softly held.
const SAME_POSTURE: f64 = 0.01;
const SAG: f64 = 0.05;
/// A push of this share of the torque limit for some samples; what the model makes of it and what the plant
/// does agree within this share.
const PUSH: f64 = 0.05;
const PUSH_SAMPLES: usize = 10;
const AGREEMENT: f64 = 0.2;
/// How long the plant is left without an answer.
const PAUSE: Duration = Duration::from_millis(1200);

/// A check that ends early, with its reason, has failed.
type Outcome = Result<(bool, String)>;
type Check = fn(&Bench, &mut Line) -> Outcome;

pub fn check(bench: &mut Bench, mut line: Line, hello: &PlantHello) -> Result<()> {
    let all: [(&'static str, Check); 8] = [
        ("reset", resets),
        ("numbers and time", counts),
        ("a sign of life", ignores_signs_of_life),
        ("a foreign answer", ignores_foreign_answers),
        ("holding", is_held),
        ("torque", moves_as_the_model),
        ("torque limits", survives_its_limits),
        ("a late answer", waits),
    ];
    for (name, check) in all {
        match check(bench, &mut line) {
            Ok((passed, detail)) => bench.note(name, passed, detail),
            Err(error) => {
                bench.note(name, false, format!("{error:#}"));
                return Ok(());
            }
        }
    }
    match (hello.flags & PLANT_DETERMINISTIC != 0, repeats(bench, &mut line)) {
        (_, Err(error)) => bench.note("determinism", false, format!("{error:#}")),
        (_, Ok(true)) => {
            bench.note("determinism", true, "equal torques, equal samples, bit for bit")
        }
        (true, Ok(false)) => {
            bench.note("determinism", false, "declared deterministic, but samples differ")
        }
        (false, Ok(false)) => {
            bench.skip("determinism", "not declared deterministic, and samples differ")
        }
    }
    rates(bench, &mut line.round_trips);
    Ok(())
}

fn gravity(bench: &Bench, state: &PlantState) -> JointVector {
    dynamics::gravity_torque(bench.model, &q(state))
}

fn resets(bench: &Bench, line: &mut Line) -> Outcome {
    let state = line.reset()?;
    let n = bench.model.n_joints();
    let off = (0..n).map(|i| (state.q[i] - bench.q0[i]).abs()).fold(0.0, f64::max);
    let fastest = qd(&state).amax();
    let detail = format!("{off:.4} rad from the start posture, at {fastest:.4} rad/s");
    Ok((off < SAME_POSTURE && fastest < SAME_POSTURE, detail))
}

fn counts(bench: &Bench, line: &mut Line) -> Outcome {
    for _ in 0..bench.samples {
        let before = line.state;
        let now = line.step(&gravity(bench, &before))?;
        if now.seq != before.seq + 1 {
            return Ok((false, format!("after sample {} came {}", before.seq, now.seq)));
        }
        let passed = now.t_ns.wrapping_sub(before.t_ns);
        if passed != bench.period_ns {
            let detail = format!("{passed} ns passed in a step, the period is {}", bench.period_ns);
            return Ok((false, detail));
        }
        if !q(&now).iter().chain(qd(&now).iter()).all(|x| x.is_finite()) {
            return Ok((false, format!("sample {} is not a number", now.seq)));
        }
    }
    Ok((true, format!("{} samples, one period apart", bench.samples)))
}

fn ignores_signs_of_life(bench: &Bench, line: &mut Line) -> Outcome {
    for _ in 0..3 {
        line.sign_of_life()?;
    }
    if line.within(Duration::from_millis(100))?.is_some() {
        return Ok((false, "it stepped without a torque".into()));
    }
    line.step(&gravity(bench, &line.state))?;
    Ok((true, "time stands still".into()))
}

fn ignores_foreign_answers(bench: &Bench, line: &mut Line) -> Outcome {
    let limits = bench.model.limits().tau_max;
    line.answer_to(line.state.seq.wrapping_sub(1), &limits)?;
    if line.within(Duration::from_millis(100))?.is_some() {
        return Ok((false, "it accepted a reply to the previous sample".into()));
    }
    line.step(&gravity(bench, &line.state))?;
    Ok((true, "a reply to another sample is dropped".into()))
}

fn is_held(bench: &Bench, line: &mut Line) -> Outcome {
    let start = q(&line.reset()?);
    let half_a_second = 500_000_000 / bench.period_ns;
    for _ in 0..half_a_second {
        line.step(&bench.hold(&start, &line.state))?;
    }
    let sag = (q(&line.state) - start).amax();
    Ok((sag < SAG, format!("it sinks by {sag:.4} rad in 0.5 s, held softly by the model")))
}

/// Pushes one joint after the other: sign, unit and order of the torques, and the masses.
fn moves_as_the_model(bench: &Bench, line: &mut Line) -> Outcome {
    let (model, n) = (bench.model, bench.model.n_joints());
    let mut worst = (0.0_f64, 0);
    for joint in 0..n {
        let start = line.reset()?;
        let mut push = JointVector::zeros();
        push[joint] = PUSH * model.limits().tau_max[joint];
        let mass = dynamics::mass_matrix(model, &q(&start)).cholesky();
        let Some(expected) = mass.map(|mass| mass.solve(&push)[joint]) else { continue };
        for _ in 0..PUSH_SAMPLES {
            let tau = gravity(bench, &line.state) + push;
            line.step(&tau)?;
        }
        let time = PUSH_SAMPLES as f64 * bench.period_ns as f64 / 1e9;
        let found = (line.state.qd[joint] - start.qd[joint]) / time;
        let off = (found / expected - 1.0).abs();
        if off > AGREEMENT {
            let name = &model.joint_names()[joint];
            let detail = format!(
                "{name} gains {found:.2} rad/s² under {:.2} N·m, the model {expected:.2}",
                push[joint]
            );
            return Ok((false, detail));
        }
        if off > worst.0 {
            worst = (off, joint);
        }
    }
    let name = &model.joint_names()[worst.1];
    Ok((true, format!("matches the model within {:.1} % (worst: {name})", worst.0 * 100.0)))
}

fn survives_its_limits(bench: &Bench, line: &mut Line) -> Outcome {
    line.reset()?;
    let limits = bench.model.limits().tau_max;
    for tick in 0..100 {
        let sign = if (tick / 10) % 2 == 0 { 1.0 } else { -1.0 };
        let state = line.step(&(limits * sign))?;
        if !state.q.iter().chain(&state.qd).all(|x| x.is_finite()) {
            return Ok((false, format!("sample {} is not a number", state.seq)));
        }
    }
    line.reset()?;
    Ok((true, "0.1 s at full torque, to and fro".into()))
}

fn waits(bench: &Bench, line: &mut Line) -> Outcome {
    let before = line.state;
    if let Some(state) = line.within(PAUSE)? {
        return Ok((false, format!("it went on to sample {} without a reply", state.seq)));
    }
    let now = line.step(&gravity(bench, &before))?;
    let passed = now.t_ns - before.t_ns;
    Ok((passed == bench.period_ns, format!("its time stood still for {} s", PAUSE.as_secs_f64())))
}

/// The same torques in two episodes.
fn repeats(bench: &Bench, line: &mut Line) -> Result<bool> {
    let mut episode = || -> Result<Vec<PlantState>> {
        let start = line.reset()?;
        let hold = gravity(bench, &start);
        let limits = bench.model.limits().tau_max;
        let tau = |i: u32| hold + limits * (0.1 * (f64::from(i) * 0.05).sin());
        let steps = (0..300).map(|i| line.step(&tau(i)));
        std::iter::once(Ok(start)).chain(steps).collect()
    };
    let (first, second) = (episode()?, episode()?);
    let bits = |state: &PlantState| {
        let numbers = state.q.iter().chain(&state.qd).chain(&state.object_position);
        numbers.map(|x| x.to_bits()).collect::<Vec<_>>()
    };
    Ok(first.iter().map(bits).eq(second.iter().map(bits)))
}

fn rates(bench: &mut Bench, round_trips: &mut [Duration]) {
    round_trips.sort_unstable();
    let at = |share: f64| {
        round_trips[((round_trips.len() - 1) as f64 * share) as usize].as_secs_f64() * 1e6
    };
    let rate = round_trips.len() as f64 / round_trips.iter().sum::<Duration>().as_secs_f64();
    let detail = format!(
        "{:.0} steps per second; a step takes {:.0} µs (p50), {:.0} µs (p99)",
        rate,
        at(0.5),
        at(0.99)
    );
    bench.note("speed", true, detail);
}
