//! Times the arm's functions and one step of the pancake world.
//!
//! ```text
//! cargo run --release -p physics --example measure_speed
//! ```

use std::hint::black_box;
use std::path::Path;
use std::time::Instant;

use physics::arm::{ArmModel, BodyFrames, JointVector, TipKinematics, dynamics};
use physics::pancake::{PancakeConfig, PancakePlant, WAM7_START_POSTURE};
use physics::plant::Plant;

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let directory = Path::new(env!("CARGO_MANIFEST_DIR")).join("../robots/wam7");
    let model = ArmModel::from_urdf_file(directory.join("wam7_pan.urdf"), "pan")?;
    let q = WAM7_START_POSTURE;
    let qd = JointVector::from_element(0.3);

    report("kinematics", 200_000, || TipKinematics::new(&model, black_box(&q), &qd));
    report("rnea", 200_000, || dynamics::rnea(&model, black_box(&q), &qd, &qd));
    report("mass_matrix", 200_000, || dynamics::mass_matrix(&model, black_box(&q)));
    report("gravity_torque", 200_000, || dynamics::gravity_torque(&model, black_box(&q)));

    report("tip, mass, bias: own frames", 100_000, || {
        let tip = TipKinematics::new(&model, black_box(&q), &qd);
        (
            tip,
            dynamics::mass_matrix(&model, black_box(&q)),
            dynamics::bias(&model, black_box(&q), &qd),
        )
    });
    report("tip, mass, bias: shared frames", 100_000, || {
        let frames = BodyFrames::new(&model, black_box(&q));
        let tip = TipKinematics::at(&model, &frames, &qd);
        let mass_matrix = dynamics::mass_matrix_at(&model, &frames);
        (tip, mass_matrix, dynamics::bias_at(&model, &frames, &qd))
    });

    let mut plant = PancakePlant::new(&model, &q, &PancakeConfig::default());
    report("plant: step, measure, hold", 5_000, || {
        let state = plant.measure();
        let qdd = (q - state.q) * 400.0 - state.qd * 40.0;
        plant.apply(&dynamics::rnea(&model, &state.q, &state.qd, &qdd));
        plant.advance();
    });
    report("plant: reset", 200, || plant.begin_reset());
    Ok(())
}

/// Prints the median over ten batches.
fn report<T>(name: &str, calls: u32, mut call: impl FnMut() -> T) {
    let mut batches_us = [0.0; 10];
    for batch_us in &mut batches_us {
        let start = Instant::now();
        for _ in 0..calls {
            black_box(call());
        }
        *batch_us = start.elapsed().as_secs_f64() * 1e6 / f64::from(calls);
    }
    batches_us.sort_by(f64::total_cmp);
    println!("{name:28} {:8.3} µs (best {:.3})", batches_us[5], batches_us[0]);
}
