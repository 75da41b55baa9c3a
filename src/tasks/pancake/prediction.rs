//! What a toss will come to, from the policy alone: Eq. (5) as if the arm followed it exactly, and
//! ballistics. It knows no arm, no pancake and no contact.

use learner::activation::policy_activations;
use learner::damping::dampers;
use learner::prediction::Predicted;
use learner::trajectory::Pose;
use nalgebra::DMatrix;
use shm_types::TASK_DIM;
use shm_types::policy::PolicyMsg;

const GRAVITY: f64 = 9.81;
const STEP_S: f64 = 1e-3;
/// For so many steps the activations are taken as constant.
const STEPS: usize = 10;
const INTERVAL_S: f64 = STEPS as f64 * STEP_S;
/// The last attractor is followed for so long beyond the end of the movement, s.
const BEYOND_S: f64 = 0.6;
/// Δ_h of Sec. 3.1, m.
const DROP_HEIGHT: f64 = 0.1;
/// A pancake so far below the pan will not come to Δ_h any more, m.
const BELOW: f64 = 0.02;

const X: usize = 0;
const Z: usize = 2;
const PITCH: usize = 3;

/// Pose of the pan and its rate, m, rad and s.
#[derive(Clone, Copy)]
struct State {
    x: Pose,
    xd: Pose,
}

/// Apex, turn and forward miss of a toss with `policy` from a pan at rest at `start`, as the measures of the
/// task name them.
pub fn predict(policy: &PolicyMsg, start: Pose) -> Predicted {
    toss(&motion(policy, start))
}

/// Eq. (5): ẍ = Σᵢ hᵢ [Kᵢ(μᵢ − x) − Dᵢẋ], integrated from rest (semi-implicit Euler); coordinates from
/// `task_dim` on with the orientation gains. One state per ms.
///
/// The activations are those of the middle of every 10 ms: they change over a tenth of a second.
fn motion(policy: &PolicyMsg, start: Pose) -> Vec<State> {
    let dampers = dampers(policy);
    let intervals = ((policy.duration_s + BEYOND_S) / INTERVAL_S).ceil() as usize;
    let mut states = Vec::with_capacity(intervals * STEPS + 1);
    let mut now = State { x: start, xd: [0.0; TASK_DIM] };
    states.push(now);
    for interval in 0..intervals {
        let t_s = (interval as f64 + 0.5) * INTERVAL_S;
        let springs = Springs::at(policy, &dampers, t_s.min(policy.duration_s));
        for _ in 0..STEPS {
            for (c, xdd) in springs.acceleration(&now).into_iter().enumerate() {
                now.xd[c] += STEP_S * xdd;
                now.x[c] += STEP_S * now.xd[c];
            }
            states.push(now);
        }
    }
    states
}

/// All components together: K = Σᵢ hᵢ Kᵢ, Σᵢ hᵢ Kᵢ μᵢ and D = Σᵢ hᵢ Dᵢ.
struct Springs {
    stiffness: [Pose; TASK_DIM],
    pull: Pose,
    damping: [Pose; TASK_DIM],
}

impl Springs {
    fn at(policy: &PolicyMsg, dampers: &[DMatrix<f64>], t_s: f64) -> Springs {
        let is_learnt = |c: usize| c < policy.task_dim as usize;
        let (stiffness, damping) = ([[0.0; TASK_DIM]; TASK_DIM], [[0.0; TASK_DIM]; TASK_DIM]);
        let mut springs = Springs { stiffness, pull: [0.0; TASK_DIM], damping };
        let h = policy_activations(policy, t_s);
        for ((h, component), damper) in h.iter().zip(policy.components()).zip(dampers) {
            for row in 0..TASK_DIM {
                for col in 0..TASK_DIM {
                    let (k, damping) = match (is_learnt(row), is_learnt(col)) {
                        (true, true) => (component.stiffness_at(row, col), damper[(row, col)]),
                        (false, false) if row == col => {
                            (policy.orientation_stiffness, policy.orientation_damping)
                        }
                        _ => continue,
                    };
                    springs.stiffness[row][col] += h * k;
                    springs.pull[row] += h * k * component.attractor[col];
                    springs.damping[row][col] += h * damping;
                }
            }
        }
        springs
    }

    fn acceleration(&self, now: &State) -> Pose {
        std::array::from_fn(|row| {
            let times = |matrix: &[Pose; TASK_DIM], vector: &Pose| -> f64 {
                matrix[row].iter().zip(vector).map(|(m, v)| m * v).sum()
            };
            self.pull[row] - times(&self.stiffness, &now.x) - times(&self.damping, &now.xd)
        })
    }
}

/// The pancake leaves where the pan falls faster than it: of all moments on the way up the one from which
/// it flies highest. From there it flies freely and turns at the rate it left with.
fn toss(states: &[State]) -> Predicted {
    let height = |state: &State| state.x[Z] + state.xd[Z].max(0.0).powi(2) / (2.0 * GRAVITY);
    let release = (0..states.len())
        .filter(|k| states[*k].xd[Z] > 0.0)
        .reduce(|a, b| if height(&states[b]) > height(&states[a]) { b } else { a });
    let start = &states[0];
    let Some(release) = release else { return vec![("apex_m", 0.0)] };
    let left = &states[release];
    let mut predicted = vec![("apex_m", height(left) - start.x[Z])];

    let mut was_above = false;
    for (k, pan) in states[release..].iter().enumerate() {
        let t = k as f64 * STEP_S;
        let over = left.x[Z] + left.xd[Z] * t - 0.5 * GRAVITY * t * t - pan.x[Z];
        if (was_above && over <= DROP_HEIGHT) || over < -BELOW {
            let turn = left.x[PITCH] + left.xd[PITCH] * t - pan.x[PITCH];
            predicted.push(("turn_rad", turn));
            predicted.push(("forward_m", left.x[X] + left.xd[X] * t - pan.x[X]));
            break;
        }
        was_above |= over > DROP_HEIGHT;
    }
    predicted
}

#[cfg(test)]
mod tests {
    use learner::initial_policy::initial_policy;

    use crate::config::Config;
    use crate::tasks::executor::executor;
    use crate::{judging, setup};

    /// The demonstration and a higher one, as the arm executes them and as they are foretold: the apex within
    /// several centimetres.
    #[test]
    fn foretells_what_the_arm_comes_to() {
        let config = Config::of_task("pancake");
        let judge = judging::judge(&config).unwrap();
        let mut execute = executor(&config).unwrap();
        let demonstration = setup::built_in_demonstration(&config).unwrap();
        let mut policy = initial_policy(&demonstration, &config.learner.initial_policy());
        for raised_m in [0.0, 0.05] {
            for component in &mut policy.components[3..5] {
                component.attractor[2] += raised_m;
            }
            policy = policy.sealed();
            let (header, records) = execute(&policy).unwrap();
            let (measures, ..) = judge.judge(&policy, &header, &records).unwrap();
            let predicted = judge.predictor().unwrap().of(&policy);
            let (name, apex_m) = predicted[0];
            assert!((apex_m - measures.get(name).unwrap()).abs() < 0.08, "{apex_m}");
        }
    }

    #[test]
    fn every_predicted_measure_is_one_of_the_task() {
        let config = Config::of_task("pancake");
        let judge = judging::judge(&config).unwrap();
        let demonstration = setup::built_in_demonstration(&config).unwrap();
        let policy = initial_policy(&demonstration, &config.learner.initial_policy());
        for (name, value) in judge.predictor().unwrap().of(&policy) {
            assert!(judge.declared().iter().any(|(other, _)| other == name), "{name}");
            assert!(value.is_finite(), "{name} is {value}");
        }
    }
}
