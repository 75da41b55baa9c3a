//! A policy of linear systems as TOML.

use shm_types::policy::{
    ACTIVATION_DECAY, ACTIVATION_STATE, LinearSystem, OUTPUT_VELOCITY, PolicyMsg,
};

use super::{matrix_toml, orientation_toml};

/// Precondition: a valid policy of systems.
pub(super) fn to_toml(policy: &PolicyMsg) -> String {
    let is_velocity = policy.output == OUTPUT_VELOCITY;
    let (output, law) = match is_velocity {
        true => ("velocity", "acceleration = following · (velocity − ẋ)"),
        false => ("acceleration", "m/s² and rad/s²"),
    };
    let (activation, unit) = match policy.activation {
        ACTIVATION_STATE => ("state", "m, rad"),
        ACTIVATION_DECAY => ("decay", "1 (exp(−decay_rate·t))"),
        _ => ("time", "s"),
    };
    let certificate = |row, column| policy.certificate_at(row, column);
    let d = policy.task_dim as usize;
    let mut text = format!(
        "# Eq. (2): {output} = Σ hᵢ [of_position · x + of_velocity · ẋ + of_drive · drive + offset], world \
         frame\n\
         task_dim = {d}  # learnt coordinates: the first of x, y, z, pitch, roll, yaw\n\
         activation = \"{activation}\"  # the drive\n\
         output = \"{output}\"  # {law}\n\
         {}\
         duration_s = {:?}\n\
         decay_rate = {:?}  # s⁻¹\n\
         following = {:?}  # s⁻¹\n\
         # of the coordinates that are not learnt\n\
         orientation_stiffness = {:?}  # s⁻²\n\
         orientation_damping = {:?}  # s⁻¹\n\
         # x, y, z in m; pitch, roll, yaw in rad\n\
         target = {:?}\n\
         # P: (x − target)ᵀ P (x − target) falls along a field of the state\n\
         certificate = {}",
        orientation_toml(policy),
        policy.duration_s,
        policy.decay_rate,
        policy.following,
        policy.orientation_stiffness,
        policy.orientation_damping,
        policy.target,
        matrix_toml(d, certificate),
    );
    for system in policy.systems() {
        text += &system_toml(system, d, policy.drive_dim(), unit);
    }
    text
}

fn system_toml(system: &LinearSystem, d: usize, drive_dim: usize, unit: &str) -> String {
    format!(
        "\n[[systems]]\n\
         log_prior = {:?}\n\
         center = {:?}  # {unit}\n\
         covariance = {}\
         of_position = {}\
         of_velocity = {}\
         of_drive = {:?}\n\
         offset = {:?}\n",
        system.log_prior,
        &system.center[..drive_dim],
        matrix_toml(drive_dim, |row, column| system.covariance_at(row, column)),
        matrix_toml(d, |row, column| system.of_position_at(row, column)),
        matrix_toml(d, |row, column| system.of_velocity_at(row, column)),
        &system.of_drive[..d],
        &system.offset[..d],
    )
}

/// A policy of systems with a number for everything.
#[cfg(test)]
pub(super) fn sample() -> PolicyMsg {
    let mut policy = PolicyMsg { task_dim: 3, n_systems: 2, ..PolicyMsg::EMPTY };
    (policy.activation, policy.output) = (ACTIVATION_STATE, OUTPUT_VELOCITY);
    (policy.following, policy.target) = (60.0, [0.7, -0.0, 1.0 / 3.0, 5e-324, 0.1, -1e-17]);
    (0..6).for_each(|k| policy.certificate[k] = (k as f64 + 0.1).sqrt());
    for (i, system) in policy.systems[..2].iter_mut().enumerate() {
        system.log_prior = -(1.0 / (i as f64 + 3.0));
        (0..3).for_each(|k| system.center[k] = (k + i) as f64 * 0.1);
        (0..6).for_each(|k| system.covariance[k] = (k as f64 + 1.1).ln());
        for k in [0, 1, 2, 6, 7, 8, 12, 13, 14] {
            system.of_position[k] = -(k as f64 + 0.3).sqrt();
        }
        (0..3).for_each(|k| system.offset[k] = (k as f64 + 0.2).cbrt());
    }
    policy.sealed()
}
