//! One execution of a policy: Idle → Approach → Execute → Settle → Idle.

use nalgebra::Isometry3;
use physics::arm::JointVector;
use physics::plant::Measurement;
use physics::referee::{Referee, State};
use shm_types::episode::FLAG_BLENDING;
use shm_types::policy::PolicyMsg;

use crate::config::ControllerConfig;
use crate::hot::blend::Blend;
use crate::hot::policy::{Command, Policy};
use crate::hot::posture::{Offset, PostureMove, PosturePath};
use crate::hot::task_space::TaskState;

/// After the policy's duration an object that rests on the tip gets this long to leave it.
const NO_TOSS_S: f64 = 0.1;
/// Speed of the Approach, rad/s, how close it must come, rad, and how slow the arm must be then,
/// rad/s: under an object that the model does not know the wrist sags at up to 0.1.
const APPROACH_SPEED: f64 = 0.5;
const APPROACH_TOLERANCE: f64 = 0.02;
const APPROACH_REST: f64 = 0.15;
const APPROACH_TIMEOUT_S: f64 = 20.0;
/// A load that the model does not know keeps the arm from its start posture: after the shortest Approach the
/// reference moves against what is missing, at this rate, s⁻¹, and by so much at most, rad.
const TRIM_RATE: f64 = 2.0;
const TRIM_MAX: f64 = 0.2;
/// The most that the clock moves between two samples, s: a movement does not go on in a gap that the
/// monitor calls one, and a leap of the plant's clock is no lunge of the arm.
const MAX_STEP_S: f64 = 0.01;

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u32)]
pub enum Phase {
    /// Holds the posture; no policy.
    Idle = 0,
    /// Moves to the start posture and holds it for `approach_s`.
    Approach = 1,
    /// Runs the policy for its duration.
    Execute = 2,
    /// Lets the last attractor hold until the outcome is known.
    Settle = 3,
}

/// The phase machine. Its time is the plant's: the stamps of the samples say what has passed. It is kept
/// in periods, so that a plant whose samples are exactly one apart counts whole numbers.
#[derive(Clone, Copy)]
pub struct Rollout {
    phase: Phase,
    /// Time since the phase began, periods; in Execute and Settle the clock of the policy, which a swap
    /// to one of another duration moves.
    elapsed: f64,
    /// Time since Execute began, periods.
    executed: f64,
    /// The phase's first sample is still to come: its time is 0.
    is_new: bool,
    /// Time stamp of the last sample, ns.
    stamp: Option<u64>,
    period_s: f64,
    period_ns: u64,
    /// Shortest Approach, periods.
    approach: f64,
    settle_s: f64,
    q0: JointVector,
    /// Where the arm was at the first good sample of this Idle or Approach: what Idle holds and the
    /// Approach leaves from. No posture is assumed before the arm has shown one.
    q_start: Option<JointVector>,
    /// Added to the start posture as the Approach's reference, rad.
    trim: JointVector,
    /// Added to it while a policy acts: a rollout begins where it began.
    posture: PosturePath,
    /// The arm rests at the start posture.
    arrived: bool,
    timed_out: bool,
    policy: Policy,
    /// The policy before a swap, while it fades out.
    blend: Option<Blend>,
    blend_ticks: u32,
    /// As it is before a rollout, and in this one.
    new_referee: Referee,
    referee: Referee,
}

impl Rollout {
    pub fn new(q0: &JointVector, config: &ControllerConfig, referee: &Referee) -> Rollout {
        Rollout {
            phase: Phase::Idle,
            elapsed: 0.0,
            executed: 0.0,
            is_new: true,
            stamp: None,
            period_s: config.period_s(),
            period_ns: config.period_ns(),
            approach: (config.approach_s / config.period_s()).ceil(),
            settle_s: config.settle_s,
            q0: *q0,
            q_start: None,
            trim: JointVector::zeros(),
            posture: PosturePath::NONE,
            arrived: false,
            timed_out: false,
            policy: Policy::new(&PolicyMsg::EMPTY),
            blend: None,
            blend_ticks: config.blend_ticks(),
            new_referee: *referee,
            referee: *referee,
        }
    }

    /// Begins the Approach from where the arm is.
    pub fn start(&mut self, policy: &Policy) {
        self.policy = *policy;
        self.blend = None;
        self.timed_out = false;
        self.referee = self.new_referee;
        self.enter(Phase::Approach);
    }

    pub fn phase(&self) -> Phase {
        self.phase
    }

    pub fn policy(&self) -> &Policy {
        &self.policy
    }

    /// What a record says of this tick.
    pub fn flags(&self) -> u32 {
        if self.blend.is_some() { FLAG_BLENDING } else { 0 }
    }

    /// Exchanges the policy from the next command on. In Execute and Settle it goes on at the same
    /// phase, t/duration, and the old policy fades out; before, nothing of the old one is left.
    pub fn swap(&mut self, policy: &Policy) {
        let old = self.policy;
        self.policy = *policy;
        if !matches!(self.phase, Phase::Execute | Phase::Settle) {
            return;
        }
        let t_old = self.t_s();
        let t_new = if t_old <= old.duration_s {
            t_old / old.duration_s * policy.duration_s
        } else {
            policy.duration_s + (t_old - old.duration_s)
        };
        self.elapsed = (t_new / self.period_s).round();
        self.blend =
            (self.blend_ticks > 0).then(|| Blend::new(&old, t_old, self.t_s(), self.blend_ticks));
    }

    /// Moves the posture of Execute and Settle: in this rollout from where it is, in those to come from the
    /// start posture.
    pub fn move_posture(&mut self, to: &PostureMove) {
        self.posture.go(to, self.executed * self.period_s);
    }

    /// What is to be added to the start posture in this tick of Execute or Settle.
    pub fn posture_offset(&self) -> Option<Offset> {
        self.posture.at(self.executed * self.period_s)
    }

    /// What the policy, or the mixture of two, asks for in this tick of Execute or Settle.
    pub fn command(&self, task: &TaskState) -> Command {
        let command = self.policy.command(self.t_s(), task);
        match &self.blend {
            Some(blend) => blend.mix(command, self.t_s(), task),
            None => command,
        }
    }

    pub fn q0(&self) -> &JointVector {
        &self.q0
    }

    /// The Approach took too long.
    pub fn timed_out(&self) -> bool {
        self.timed_out
    }

    /// Time since the start of Execute, s; 0 before.
    pub fn t_s(&self) -> f64 {
        match self.phase {
            Phase::Idle | Phase::Approach => 0.0,
            Phase::Execute | Phase::Settle => self.elapsed * self.period_s,
        }
    }

    /// Where the arm, now at `q`, should be in Idle and Approach: where the phase found it, or on a
    /// straight line in joint space from there to the start posture, at `APPROACH_SPEED` for the
    /// joint that has farthest to go.
    pub fn posture_reference(&mut self, q: &JointVector) -> JointVector {
        let q_start = *self.q_start.get_or_insert(*q);
        if self.phase == Phase::Idle {
            return q_start;
        }
        let way = self.q0 - q_start;
        let duration = way.abs().max() / APPROACH_SPEED;
        let t = self.elapsed * self.period_s;
        if t < duration {
            return q_start + way * (t / duration);
        }
        if self.elapsed > self.approach {
            let trim = self.trim + (self.q0 - q) * (TRIM_RATE * self.period_s);
            self.trim = trim.map(|trim| trim.clamp(-TRIM_MAX, TRIM_MAX));
        }
        self.q0 + self.trim
    }

    /// Takes in what the world looks like in this tick.
    pub fn observe(&mut self, X_WP: &Isometry3<f64>, measured: &Measurement) {
        if matches!(self.phase, Phase::Execute | Phase::Settle) {
            let t_s = self.executed * self.period_s;
            self.referee.observe(t_s, X_WP, measured);
        }
    }

    /// Takes in where the arm is and how fast it moves; the Approach ends by it.
    pub fn locate(&mut self, q: &JointVector, qd: &JointVector) {
        self.arrived =
            (q - self.q0).abs().max() < APPROACH_TOLERANCE && qd.abs().max() < APPROACH_REST;
    }

    /// From now on Idle holds the arm where it is.
    pub fn stay(&mut self) {
        self.enter(Phase::Idle);
    }

    /// Takes in when the sample of this tick was taken, ns by the plant's clock: [`Rollout::advance`] has
    /// counted on one period, this makes up for what was otherwise.
    pub fn clock(&mut self, t_ns: u64) {
        let Some(last) = self.stamp.replace(t_ns).filter(|_| !self.is_new) else { return };
        let passed = t_ns.saturating_sub(last) as f64 / self.period_ns as f64;
        let most = (MAX_STEP_S / self.period_s).max(1.0);
        self.pass(passed.min(most) - 1.0);
    }

    fn pass(&mut self, periods: f64) {
        self.elapsed = (self.elapsed + periods).max(0.0);
        self.executed = (self.executed + periods).max(0.0);
    }

    /// Ends the tick, which takes a period unless the next sample says otherwise.
    pub fn advance(&mut self, faulted: bool) {
        self.pass(1.0);
        self.is_new = false;
        if let Some(blend) = &mut self.blend
            && !blend.advance()
        {
            self.blend = None;
        }
        let t = self.elapsed * self.period_s;
        match self.phase {
            Phase::Idle => {}
            _ if faulted => self.enter(Phase::Idle),
            Phase::Approach => {
                if self.elapsed >= self.approach && self.arrived {
                    self.enter(Phase::Execute);
                } else if t > APPROACH_TIMEOUT_S {
                    self.timed_out = true;
                    self.enter(Phase::Idle);
                }
            }
            Phase::Execute if self.referee.state() == State::Lost => self.enter(Phase::Idle),
            // Settle goes on counting from the start of Execute: it is the same clock t_s.
            Phase::Execute if t >= self.policy.duration_s => self.phase = Phase::Settle,
            Phase::Execute => {}
            Phase::Settle => {
                let waited = t - self.policy.duration_s;
                let is_over = match self.referee.state() {
                    State::Running => waited >= NO_TOSS_S,
                    State::Airborne => false,
                    State::Settled | State::Lost => true,
                };
                if is_over || waited >= self.settle_s {
                    self.enter(Phase::Idle);
                }
            }
        }
    }

    fn enter(&mut self, phase: Phase) {
        (self.q_start, self.trim, self.arrived) = (None, JointVector::zeros(), false);
        self.posture.restart();
        self.phase = phase;
        (self.elapsed, self.executed, self.is_new) = (0.0, 0.0, true);
    }
}
