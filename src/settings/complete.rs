//! A configuration in which every setting is set, those without a default too: their examples.

use std::collections::BTreeMap;

use learner::compliance::ComplianceConfig;
use learner::demonstration::DemonstrationsAre;
use learner::encoding::EncodingKind;
use learner::initial_policy::InitialStiffness;
use learner::orientation::Orientation;
use search::aim::Target;

use crate::config::plant::{PanConfig, PlantKind};
use crate::config::{Config, JudgeConfig};

/// It is an example of each setting, not of all together.
pub fn complete() -> Config {
    let mut config = Config::default();
    config.cell.state_dir = Some("state".into());
    config.metrics.listen = Some(([127, 0, 0, 1], 9464).into());
    config.task.demonstration = Some("my_demo.csv".into());
    config.task.options = names("stiffness", "full");
    config.task.judge = Some(JudgeConfig {
        reward: Some("1.5*apex_m - gap_m".into()),
        success: Some("caught".into()),
        program: vec!["python3".into(), "my_judge.py".into()],
        directory: Some(".".into()),
        timeout_s: 20.0,
        measures: names("gap_m", "m"),
    });
    let plant = &mut config.plant;
    plant.kind = PlantKind::External;
    plant.program = vec!["python3".into(), "my_plant.py".into()];
    plant.socket = Some("plant.sock".into());
    plant.measures = names("contact_force_n", "N");
    (plant.arm, plant.base) = (Some("my_arm.urdf".into()), Some("base".into()));
    plant.solver_iterations = Some(4);
    (plant.torque_limits_nm, plant.speed_limits_rad_s) = (vec![80.0; 7], vec![2.0; 7]);
    plant.pan = Some(PanConfig { mass_kg: 0.5, xyz_m: [0.0, 0.0, 0.2], rpy_rad: [0.0; 3] });
    plant.held = BTreeMap::from([("finger_joint".into(), 0.04)]);
    config.controller.cpu = Some(3);
    let learner = &mut config.learner;
    learner.demonstrations_are = DemonstrationsAre::Repetitions;
    learner.initial_stiffness = InitialStiffness::Variability;
    learner.orientation = Orientation::Sphere;
    learner.encoding = EncodingKind::Dmp;
    learner.stiffness_range = 8.0;
    learner.compliance = ComplianceConfig::default();
    learner.wish = "apex_m < 0.45".into();
    let action = &mut learner.action;
    (action.start, action.unit) = (vec![0.5, 0.5], vec![0.1, 0.2]);
    (action.min, action.max) = (vec![0.0, 0.0], vec![1.0, 1.0]);
    let target = Target { parts: 20, ..Target::new("apex_m", [0.3, 0.6], 0.1).when("tossed") };
    learner.search.aim.targets = vec![target];
    config
}

fn names(name: &str, value: &str) -> BTreeMap<String, String> {
    BTreeMap::from([(name.into(), value.into())])
}
