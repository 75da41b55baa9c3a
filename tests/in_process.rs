//! A rollout simulated in one process is, bit for bit, the rollout of a session with two.

mod util;

use learner::parameters::PolicyIds;
use learner::problem::Problem;
use search::trial::{Proposal, Trial};
use learner::{Demonstration, LearnerConfig};
use physics::arm::ArmModel;
use physics::outcome::OutcomeConfig;
use physics::pancake::{PancakeConfig, PancakePlant, WAM7_START_POSTURE};
use rt_controller::ControllerConfig;
use rt_controller::run::Controlled;
use rt_controller::simulate::simulate;
use shm_types::episode::{FLAG_TORQUE_CLIPPED, MAX_RECORDS, OUTCOME_SUCCESS, TickRecord};
use util::{Bench, text};

#[test]
fn thetas_rewards_and_outcomes_are_those_of_a_session() {
    let bench = Bench::new();
    // Some of the rollouts are adapted ones.
    let rollouts = 20;
    bench.ok(&["learn", "pancake", "--seed", "2", "--rollouts", "20", "--out", "s", "--json"]);
    let session = bench.trials("s");
    assert_eq!(session.len(), rollouts);

    let arm = ArmModel::from_urdf(&text(&bench.path("s/arm.urdf")), "pan").unwrap();
    let csv = text(&bench.path("s/demonstration.csv"));
    let demonstration = Demonstration::parse("demonstration.csv", &csv).unwrap();
    let config = LearnerConfig { seed: 2, ..LearnerConfig::default() };
    let problem = Problem::new(&config, std::slice::from_ref(&demonstration)).unwrap();
    let mut search = problem.search(&config);
    let mut plant = PancakePlant::new(&arm, &WAM7_START_POSTURE, &PancakeConfig::default());
    let outcome = OutcomeConfig::default();
    let mut controlled =
        Controlled { model: &arm, plant: &mut plant, q0: WAM7_START_POSTURE, outcome };
    let controller = ControllerConfig::default();
    let mut records = vec![TickRecord::ZERO; MAX_RECORDS];
    for trial in session {
        let Proposal { rollout, theta } = search.ask(trial.rollout);
        assert_eq!(theta, trial.theta, "rollout {rollout}");
        let policy = problem.decode(&theta, PolicyIds::default());
        let simulated = simulate(&mut controlled, &controller, &policy, &mut records).unwrap();
        assert_eq!(simulated.outcome, trial.outcome, "rollout {rollout}");
        assert_eq!(simulated.n_records as u64, trial.n_records);
        assert_eq!(simulated.fault, trial.fault);
        let last = &records[simulated.n_records - 1];
        let end_s = (simulated.n_records - 1) as f64 * controller.period_s();
        assert!((last.t_s - end_s).abs() < 1e-9 && last.phase >= 2, "records of Execute on");

        let clipped = records[..simulated.n_records]
            .iter()
            .filter(|record| record.flags & FLAG_TORQUE_CLIPPED != 0);
        let share = clipped.count() as f64 / simulated.n_records as f64;
        assert_eq!(simulated.outcome.clipped_share, share, "rollout {rollout}");

        let reward = config.reward.reward(&simulated.outcome);
        assert_eq!(reward.to_bits(), trial.reward.to_bits());
        let success = simulated.outcome.has(OUTCOME_SUCCESS);
        search.tell(&Trial { rollout, theta, reward, success });
    }
}
