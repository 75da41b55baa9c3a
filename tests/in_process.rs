//! A rollout simulated in one process is, bit for bit, the rollout of a session with two.

#[path = "../src/tasks/camera.rs"]
mod camera;
#[path = "../src/tasks/pancake/measurer.rs"] // what the tool measures by
mod measurer;
mod util;
/// Where the measurer finds the camera.
mod tasks {
    pub(crate) use crate::camera;
}

use camera::Camera;
use learner::judge::{Judge, Paid};
use learner::parameters::PolicyIds;
use learner::problem::Problem;
use learner::{Demonstration, LearnerConfig};
use measurer::measurer;
use physics::arm::ArmModel;
use physics::pancake::outcome::OutcomeConfig;
use physics::pancake::{PancakeConfig, PancakePlant, WAM7_START_POSTURE};
use physics::referee::{Referee, Toss};
use rt_controller::ControllerConfig;
use rt_controller::run::Controlled;
use rt_controller::simulate::simulate;
use search::trial::{Proposal, Trial};
use shm_types::episode::{EpisodeHeader, FLAG_TORQUE_CLIPPED, MAX_RECORDS, TickRecord};
use util::{Bench, text};

#[test]
fn thetas_rewards_and_outcomes_are_those_of_a_session() {
    let bench = Bench::new();
    // Some of the rollouts are adapted ones, and some execute the mean.
    let rollouts = 40;
    bench.ok(&["learn", "pancake", "--seed", "2", "--rollouts", "40", "--out", "s", "--json"]);
    let session = bench.trials("s");
    assert_eq!(session.len(), rollouts);
    assert!(session.iter().any(|trial| trial.is_mean));

    let arm = ArmModel::from_urdf(&text(&bench.path("s/arm.urdf")), "pan").unwrap();
    let csv = text(&bench.path("s/demonstration.csv"));
    let demonstration = Demonstration::parse("demonstration.csv", &csv).unwrap();
    let config = LearnerConfig { seed: 2, ..LearnerConfig::default() };
    let problem = Problem::new(&config, std::slice::from_ref(&demonstration)).unwrap();
    let mut search = problem.search(&config);
    let mut plant = PancakePlant::new(&arm, &WAM7_START_POSTURE, &PancakeConfig::default());
    let outcome = OutcomeConfig::default();
    let referee = Referee::Toss(Toss::new(&outcome.toss));
    let mut controlled =
        Controlled { model: &arm, plant: &mut plant, q0: WAM7_START_POSTURE, referee };
    let controller = ControllerConfig::default();
    let measurer = measurer(Camera::new(&arm, controller.record_s()), &outcome);
    let judge = Judge::new(
        Box::new(measurer),
        Box::new(Paid { verdict: config.reward, weight: config.compliance.weight }),
    )
    .with_compliance(&config.compliance);
    let mut records = vec![TickRecord::ZERO; MAX_RECORDS];
    for trial in session {
        let Proposal { rollout, theta } = search.ask(trial.rollout, &[]);
        assert_eq!(theta, trial.theta, "rollout {rollout}");
        assert_eq!(trial.is_mean, rollout > 1 && theta == *search.mean(), "rollout {rollout}");
        let policy = problem.decode(&theta, PolicyIds::default());
        let simulated = simulate(&mut controlled, &controller, &policy, &mut records).unwrap();
        let episode = &records[..simulated.n_records];
        let (measures, success, reward) =
            judge.judge(&policy, &EpisodeHeader::default(), episode).unwrap();
        assert_eq!(measures, trial.measures, "rollout {rollout}");
        assert_eq!(simulated.n_records as u64, trial.n_records);
        assert_eq!(simulated.fault, trial.fault);
        let last = &records[simulated.n_records - 1];
        let end_s = (simulated.n_records - 1) as f64 * controller.period_s();
        assert!((last.t_s - end_s).abs() < 1e-9 && last.phase >= 2, "records of Execute on");

        let clipped = records[..simulated.n_records]
            .iter()
            .filter(|record| record.flags & FLAG_TORQUE_CLIPPED != 0);
        let share = clipped.count() as f64 / simulated.n_records as f64;
        assert_eq!(measures.get("clipped_share"), Some(share), "rollout {rollout}");

        assert_eq!((success, reward.to_bits()), (trial.success, trial.reward.to_bits()));
        search.tell(&Trial { rollout, theta, reward, success, measured: Vec::new() });
    }
}
