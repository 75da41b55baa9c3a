//! What the benches of the loop work on: the built-in arm, policies of any size, varied states.

use anyhow::Result;
use nalgebra::Vector6;
use physics::arm::{ArmModel, JointVector, TipKinematics};
use physics::pancake::{PancakeConfig, PancakePlant};
use physics::plant::Plant;
use physics::referee::{Referee, Toss, TossConfig};
use rand::RngExt;
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::SeedableRng;
use rt_controller::admit::admission::admit;
use rt_controller::hot::policy::Policy;
use rt_controller::hot::rollout::Phase;
use rt_controller::hot::task_space::TaskState;
use rt_controller::hot::tick::Controller;
use rt_controller::hot::wrench::ArmState;
use shm_types::TASK_DIM;
use shm_types::episode::TickRecord;
use shm_types::policy::{ACTIVATION_STATE, OUTPUT_VELOCITY, PolicyMsg, packed_index};

use crate::config::Config;
use crate::setup;

/// Length of the policies, s.
pub const DURATION_S: f64 = 1.4;
/// States are within this part of the joints' ranges and speeds.
const REACH: f64 = 0.9;
const SPEED: f64 = 0.5;

/// Arm and configuration, by default.
pub struct Arm {
    pub config: Config,
    pub model: ArmModel,
    pub q0: JointVector,
}

/// A configuration the arm may be in, and what a policy and a posture ask of it there.
pub struct State {
    pub q: JointVector,
    pub qd: JointVector,
    pub t_s: f64,
    pub task: TaskState,
    pub arm: ArmState,
    pub xdd: Vector6<f64>,
    pub qdd: JointVector,
}

impl Arm {
    pub fn new() -> Result<Arm> {
        let config = Config::default();
        let (model, q0) = (setup::arm(&config)?, config.plant.start_posture());
        Ok(Arm { config, model, q0 })
    }

    pub fn world(&self) -> PancakeConfig {
        self.config.plant.world(self.config.controller.period_s())
    }

    /// `n` states from one seed: the same in every run.
    pub fn states(&self, n: usize) -> Vec<State> {
        let mut rng = ChaCha8Rng::seed_from_u64(1);
        let limits = self.model.limits();
        let mut draw = |low: f64, high: f64| low + (high - low) * rng.random::<f64>();
        let state = |_| {
            let q =
                JointVector::from_fn(|i, _| draw(REACH * limits.q_min[i], REACH * limits.q_max[i]));
            let qd = JointVector::from_fn(|i, _| {
                draw(-SPEED * limits.qd_max[i], SPEED * limits.qd_max[i])
            });
            State {
                q,
                qd,
                t_s: draw(0.0, DURATION_S),
                task: TaskState::new(&TipKinematics::new(&self.model, &q, &qd)),
                arm: ArmState::new(&self.model, &q, &qd),
                xdd: Vector6::from_fn(|_, _| draw(-5.0, 5.0)),
                qdd: JointVector::from_fn(|_, _| draw(-5.0, 5.0)),
            }
        };
        (0..n).map(state).collect()
    }

    pub fn policy(&self, components: usize, dims: usize) -> Result<Policy> {
        Ok(admit(&message(components, dims, 0.02), &self.model, &self.config.controller)?)
    }

    /// Eight systems driven by the state, in six coordinates.
    pub fn field(&self) -> Result<Policy> {
        Ok(admit(&field(), &self.model, &self.config.controller)?)
    }
}

/// Springs that move the pan up and down by `amplitude` m, evenly over the duration.
pub fn message(components: usize, dims: usize, amplitude: f64) -> PolicyMsg {
    let (n_components, task_dim) = (components as u32, dims as u32);
    let mut message = PolicyMsg { task_dim, n_components, ..PolicyMsg::EMPTY };
    let stiffness = 200.0_f64;
    message.duration_s = DURATION_S;
    message.damping = 2.0 * stiffness.sqrt();
    message.orientation_stiffness = 400.0;
    message.orientation_damping = 40.0;
    let spacing = DURATION_S / components as f64;
    for (i, component) in message.components.iter_mut().take(components).enumerate() {
        component.center = (i as f64 + 0.5) * spacing;
        component.width = 0.5 * spacing;
        let z = if i % 2 == 0 { 0.72 + amplitude } else { 0.72 - amplitude };
        component.attractor = [0.78, 0.0, z, 0.0, 0.0, 0.0];
        for row in 0..dims {
            component.stiffness[packed_index(row, row)] = stiffness;
        }
    }
    message.sealed()
}

/// Eight systems on the way from the start posture's pan to a target above it; each turns otherwise.
fn field() -> PolicyMsg {
    let mut field = PolicyMsg { task_dim: 6, n_systems: 8, ..PolicyMsg::EMPTY };
    (field.activation, field.output, field.following) = (ACTIVATION_STATE, OUTPUT_VELOCITY, 60.0);
    field.duration_s = DURATION_S;
    field.target = [0.78, 0.0, 0.76, 0.0, 0.0, 0.0];
    (0..TASK_DIM).for_each(|i| field.certificate[packed_index(i, i)] = 1.0);
    for (k, system) in field.systems.iter_mut().take(8).enumerate() {
        system.center = [0.78, 0.0, 0.72 + 0.005 * k as f64, 0.0, 0.0, 0.0];
        let turn = 0.25 * k as f64 - 1.0;
        for i in 0..TASK_DIM {
            system.covariance[packed_index(i, i)] = 1e-4;
            system.of_position[TASK_DIM * i + i] = -3.0;
            // A rotation in each pair of neighbours: it changes no distance from the target.
            let (pair, sign) = if i % 2 == 0 { (i + 1, 1.0) } else { (i - 1, -1.0) };
            system.of_position[TASK_DIM * i + pair] = sign * turn;
        }
        for i in 0..TASK_DIM {
            let row = &system.of_position[TASK_DIM * i..][..TASK_DIM];
            system.offset[i] = -row.iter().zip(field.target).map(|(a, x)| a * x).sum::<f64>();
        }
    }
    field.sealed()
}

/// A loop without pace or transport that goes from rollout to rollout.
pub struct Loop<'a> {
    pub controller: Controller<'a>,
    pub plant: PancakePlant,
    policy: Policy,
    pub record: TickRecord,
}

impl<'a> Loop<'a> {
    pub fn new(arm: &'a Arm, policy: Policy, world: &PancakeConfig) -> Loop<'a> {
        let (model, config) = (&arm.model, &arm.config.controller);
        let plant = PancakePlant::new(model, &arm.q0, world);
        let controller = Controller::new(
            model,
            &arm.q0,
            config,
            &Referee::Toss(Toss::new(&TossConfig::default())),
        );
        Loop { controller, plant, policy, record: TickRecord::ZERO }
    }

    /// Starts the next rollout when the last one has ended.
    pub fn begin_if_idle(&mut self) {
        if self.controller.phase() == Phase::Idle {
            self.plant.begin_reset();
            self.controller.enter_fresh_world();
            self.controller.start(&self.policy);
        }
    }

    /// The policy drives the arm: not the way to the start posture.
    pub fn is_executing(&self) -> bool {
        matches!(self.controller.phase(), Phase::Execute | Phase::Settle)
    }
}
