//! A task without Rust: an arm, a demonstration, and your own world in another process, with its own measures;
//! success and reward come from the configuration. See docs/peg.md.
//!
//! Without such a process the arm moves in empty space.

#![allow(non_snake_case)] // p_WP is the position of P in W

use anyhow::Result;
use learner::compliance::ComplianceConfig;
use learner::exploration::StiffnessKind;
use nalgebra::{Isometry3, Vector3};
use physics::bare::BareArm;
use physics::plant::ObjectState;
use physics::referee::Referee;
use shm_types::measures::Measure;

use super::camera::{Camera, Followed};
use super::{ArmTask, ArmWorld, Task, World};
use crate::config::{Config, JudgeConfig};
use crate::record::solids::Solids;
use crate::report::Pictures;
use crate::setup;

pub const TASK: Task = Task {
    name: "custom",
    about: "Your own task: arm, demonstration, plant, measures and judge come from the configuration",
    world: World::Arm(ArmTask {
        urdf: include_str!("../../robots/wam7/wam7_pan.urdf"),
        demonstration: include_str!("../../demos/pancake.csv"),
        world,
        predictor: None,
        solids: |_| Solids { tip: ("tip", vec![]), object: ("object", vec![]), has_string: false },
    }),
    configure,
    check: |_| Ok(()),
    has_target: false,
    options: &[],
    action_units: &[],
    success: None,
    pictures: |_| Pictures::Plain,
};

/// Nothing is known of the movement: neither that it comes back nor that it should grow.
fn configure(config: &mut Config) {
    let reward = Some("-clipped_share".into());
    config.task.judge = Some(JudgeConfig { reward, ..JudgeConfig::default() });
    let learner = &mut config.learner;
    learner.task_dim = 3;
    learner.compliance = ComplianceConfig::off();
    let exploration = &mut learner.exploration;
    (exploration.position_amplitude, exploration.rotation_amplitude) = (0.1, 0.1);
    exploration.peak_offset_m = [0.01; 3];
    exploration.tempo_s = 0.05;
    exploration.rotation_lag_s = 0.0;
    (exploration.grows, exploration.stiffness) = (false, StiffnessKind::Uniform);
}

fn world(config: &Config) -> Result<ArmWorld> {
    let (model, q0) = (setup::arm(config)?, config.plant.start_posture());
    Ok(ArmWorld {
        plant: Box::new(BareArm::new(&model, &q0, config.controller.period_s())),
        referee: Referee::Clock,
        measurer: Box::new(Followed {
            camera: Camera::new(&model, config.controller.record_s()),
            tracker: Way::default(),
            observe: Way::observe,
            measures,
        }),
        model,
        q0,
    })
}

/// The way of the tip.
#[derive(Clone, Copy, Default)]
struct Way {
    /// Where it is, m, and when, s.
    last: Option<(f64, Vector3<f64>)>,
    length_m: f64,
    top_speed: f64,
}

impl Way {
    fn observe(&mut self, t_s: f64, X_WP: &Isometry3<f64>, _: &ObjectState) {
        let p_WP = X_WP.translation.vector;
        if let Some((last_s, last)) = self.last.replace((t_s, p_WP)) {
            let step = (p_WP - last).norm();
            self.length_m += step;
            self.top_speed = self.top_speed.max(step / (t_s - last_s));
        }
    }
}

fn measures(way: &Way, clipped_share: f64) -> Vec<Measure<'static>> {
    let number = |name, unit, value| Measure { name, unit, value };
    let end = way.last.map_or(Vector3::zeros(), |(_, p_WP)| p_WP);
    vec![
        number("end_x_m", "m", end.x),
        number("end_y_m", "m", end.y),
        number("end_z_m", "m", end.z),
        number("way_m", "m", way.length_m),
        number("top_speed_m_s", "m/s", way.top_speed),
        number("clipped_share", "1", clipped_share),
    ]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_way_of_the_tip_is_measured_to_its_end() {
        let nothing = ObjectState {
            p_WO: Vector3::zeros(),
            R_WO: nalgebra::UnitQuaternion::identity(),
            in_contact: false,
        };
        let mut way = Way::default();
        for (t_s, x, z) in [(0.0, 0.5, 0.0), (0.1, 0.5, 0.3), (0.3, 0.9, 0.3)] {
            way.observe(t_s, &Isometry3::translation(x, 0.0, z), &nothing);
        }
        let found: Vec<f64> = measures(&way, 0.25).iter().map(|measure| measure.value).collect();
        let expected = [0.9, 0.0, 0.3, 0.7, 3.0, 0.25];
        assert!(found.iter().zip(expected).all(|(a, b)| (a - b).abs() < 1e-12), "{found:?}");
    }
}
