//! Ball in a cup (Kober and Peters 2009, whose PoWER the paper takes up): the arm holds a cup, a ball
//! hangs from it on a string, and the ball is to be swung up and caught.

use anyhow::Result;
use learner::compliance::ComplianceConfig;
use learner::exploration::StiffnessKind;
use physics::cup::outcome::OutcomeTracker;
use physics::cup::{CupConfig, CupPlant, WAM7_CUP_POSTURE};
use physics::referee::Referee;
use search::aim::Target;
use shm_types::measures::Measure;

use super::camera::{Camera, Followed};
use super::{ArmTask, ArmWorld, Task, World};
use crate::config::{Config, JudgeConfig};
use crate::record::solids::{Solid, Solids};
use crate::report::Pictures;
use crate::setup;

pub const TASK: Task = Task {
    name: "ball-in-a-cup",
    about: "Swing a ball on a string up into the cup it hangs from (Kober and Peters 2009)",
    world: World::Arm(ArmTask {
        urdf: include_str!("../../robots/wam7/wam7_cup.urdf"),
        demonstration: include_str!("../../demos/ball_in_a_cup.csv"),
        world,
        predictor: None,
        solids,
    }),
    configure,
    check: |_| Ok(()),
    has_target: false,
    options: &[],
    action_units: &[],
    success: Some("catch"),
    pictures: |_| Pictures::Plain,
};

const WOOD: [f64; 4] = [0.62, 0.42, 0.22, 0.5];
const RED: [f64; 4] = [0.84, 0.16, 0.16, 1.0];

fn cup(config: &Config) -> CupConfig {
    let (dynamics, period_s) = (config.plant.dynamics(), config.controller.period_s());
    CupConfig { dynamics, period_s, ..CupConfig::default() }
}

fn configure(config: &mut Config) {
    config.plant.tip = "cup".into();
    config.plant.start_posture_rad = WAM7_CUP_POSTURE.iter().copied().collect();
    // The arm's model does not know of the ball, whose weight a soft wrist would follow.
    (config.controller.posture_stiffness, config.controller.posture_damping) = (400.0, 40.0);
    // The reward of Kober and Peters is the first term; the second tells which way leads to it.
    let reward = "exp(-100*miss_m^2) + exp(-miss_m/0.2) + if(caught, 1, 0)";
    config.task.judge = Some(JudgeConfig::written(reward, "caught"));
    // Found on seeds 1 to 40. A swing bears smaller changes than a toss; wide ones find catches that are
    // far apart, and between them there is none.
    let learner = &mut config.learner;
    learner.n_components = 12.into();
    let exploration = &mut learner.exploration;
    exploration.position_amplitude = 0.06;
    exploration.peak_offset_m = [0.02, 0.0, 0.02];
    exploration.tempo_s = 0.02;
    // A swing grows no further, and comes back more than once.
    (exploration.grows, exploration.stiffness) = (false, StiffnessKind::Uniform);
    exploration.position_log_stiffness = 0.2;
    learner.compliance = ComplianceConfig::off();
    let power = &mut learner.search.power;
    (power.floor_min, power.floor_decay, power.min_successes) = (0.02, 0.8, 2);
    (power.mean_every, power.candidates) = (0, 1);
    (power.success_rate, power.fewer_elites) = (0.0, false);
    // What was measured of the ball, for a search that learns from it: over the rim, and down into it.
    learner.search.aim.targets = vec![
        Target::new("apex_m", [0.02, 0.2], 0.1),
        Target::new("miss_forward_m", [-0.03, 0.03], 0.1).when("crossed"),
        Target::new("miss_left_m", [-0.03, 0.03], 0.05).when("crossed"),
    ];
}

fn world(config: &Config) -> Result<ArmWorld> {
    let (model, q0) = (setup::arm(config)?, config.plant.start_posture());
    let cup = cup(config);
    Ok(ArmWorld {
        plant: Box::new(CupPlant::new(&model, &q0, &cup)),
        // The movement ends with the cup at rest: what becomes of the ball is seen by then.
        referee: Referee::Clock,
        measurer: Box::new(Followed {
            camera: Camera::new(&model, config.controller.record_s()),
            tracker: OutcomeTracker::new(&cup),
            observe: OutcomeTracker::observe,
            measures,
        }),
        model,
        q0,
    })
}

fn solids(config: &Config) -> Solids {
    let CupConfig { bottom_radius, rim_radius, depth, ball_radius, .. } = cup(config);
    let (top_radius, z) = (rim_radius, depth / 2.0);
    let cup = Solid::Cone { bottom_radius, top_radius, height: depth, z, color: WOOD };
    let ball = Solid::Ball { radius: ball_radius, color: RED };
    Solids { tip: ("cup", vec![cup]), object: ("ball", vec![ball]), has_string: true }
}

fn measures(tracker: &OutcomeTracker, clipped_share: f64) -> Vec<Measure<'static>> {
    let (outcome, truth) = (tracker.outcome(), Measure::truth);
    let number = |name, unit, value| Measure { name, unit, value };
    vec![
        truth("caught", outcome.caught),
        truth("crossed", outcome.crossed),
        number("crossing_time_s", "s", outcome.crossing_time_s),
        number("miss_m", "m", outcome.miss_m),
        number("miss_forward_m", "m", outcome.miss_forward_m),
        number("miss_left_m", "m", outcome.miss_left_m),
        number("apex_m", "m", outcome.apex_m),
        number("clipped_share", "1", clipped_share),
    ]
}
