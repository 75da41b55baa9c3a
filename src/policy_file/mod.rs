//! Policies as files: JSON for programs, TOML for people, who then see every unit.

mod systems;

use std::path::Path;

use anyhow::{Context, Result, bail};
use shm_types::policy::{ACTIVATION_DECAY, Component, ORIENTATION_SPHERE, PolicyMsg};
use shm_types::policy_json;

/// A policy from a file in either format: a JSON object begins with a brace, which no TOML does.
pub fn read(path: &Path) -> Result<PolicyMsg> {
    let name = path.display();
    let text = std::fs::read_to_string(path)
        .with_context(|| format!("{name}: cannot read the policy; check the path"))?;
    let policy = match text.trim_start().starts_with('{') {
        true => policy_json::from_json(&text).map_err(Into::into),
        false => from_toml(&text),
    };
    policy.with_context(|| {
        format!("{name}: not a whole, valid policy, as `skillet policy export` prints one")
    })
}

/// By way of JSON, whose reader checks everything but what JSON cannot say.
fn from_toml(text: &str) -> Result<PolicyMsg> {
    let table: toml::Table = toml::from_str(text)?;
    for (key, value) in &table {
        if !is_finite(value) {
            bail!("{key} holds nan or inf: use finite numbers");
        }
    }
    Ok(policy_json::from_json(&serde_json::to_string(&table)?)?)
}

fn is_finite(value: &toml::Value) -> bool {
    match value {
        toml::Value::Float(number) => number.is_finite(),
        toml::Value::Array(values) => values.iter().all(is_finite),
        toml::Value::Table(table) => table.values().all(is_finite),
        _ => true,
    }
}

/// The fields of the JSON under the same names; numbers come back bit for bit.
pub fn to_toml(policy: &PolicyMsg) -> Result<String> {
    policy.validate()?;
    if policy.n_actions > 0 {
        return Ok(format!(
            "# in the units of its world: rad and rad/s (skittles), none (landscape)\naction = {:?}\n",
            policy.actions()
        ));
    }
    if policy.n_systems > 0 {
        return Ok(systems::to_toml(policy));
    }
    let decays = policy.activation == ACTIVATION_DECAY;
    let mut text = format!(
        "# Eq. (5): acceleration = Σ hᵢ Kᵢ (μᵢ − x) − damping · ẋ, world frame\n\
         task_dim = {}  # learnt coordinates: the first of x, y, z, pitch, roll, yaw\n\
         activation = \"{}\"\n\
         {}\
         duration_s = {:?}\n\
         decay_rate = {:?}  # s⁻¹\n\
         damping = {:?}  # s⁻¹\n\
         {}\
         # of the coordinates that are not learnt\n\
         orientation_stiffness = {:?}  # s⁻²\n\
         orientation_damping = {:?}  # s⁻¹\n",
        policy.task_dim,
        if decays { "decay" } else { "time" },
        orientation_toml(policy),
        policy.duration_s,
        policy.decay_rate,
        policy.damping,
        ratio_toml(policy.damping_ratio),
        policy.orientation_stiffness,
        policy.orientation_damping,
    );
    let drive = if decays { "1 (exp(−decay_rate·t))" } else { "s" };
    for component in policy.components() {
        text += &component_toml(component, policy.task_dim as usize, drive);
    }
    Ok(text)
}

/// Nothing where errors of orientation are differences of rotation vectors.
fn orientation_toml(policy: &PolicyMsg) -> &'static str {
    match policy.orientation {
        ORIENTATION_SPHERE => {
            "orientation = \"sphere\"  # errors are rotations, the shortest way\n"
        }
        _ => "",
    }
}

/// Nothing where all springs damp alike.
fn ratio_toml(ratio: f64) -> String {
    match ratio {
        0.0 => String::new(),
        ratio => format!("damping_ratio = {ratio:?}  # ζ: spring i damps with 2ζ Kᵢ^½ instead\n"),
    }
}

fn component_toml(component: &Component, task_dim: usize, drive: &str) -> String {
    let Component { center, width, attractor, .. } = component;
    let stiffness = matrix_toml(task_dim, |row, column| component.stiffness_at(row, column));
    format!(
        "\n[[components]]\n\
         center = {center:?}  # {drive}\n\
         width = {width:?}  # {drive}\n\
         # x, y, z in m; pitch, roll, yaw in rad\n\
         attractor = {attractor:?}\n\
         # s⁻²\n\
         stiffness = {stiffness}"
    )
}

/// The leading n×n block, a row a line.
fn matrix_toml(n: usize, entry: impl Fn(usize, usize) -> f64) -> String {
    let row = |row: usize| -> String {
        let entries: Vec<f64> = (0..n).map(|column| entry(row, column)).collect();
        format!("  {entries:?},\n")
    };
    format!("[\n{}]\n", (0..n).map(row).collect::<String>())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn policy() -> PolicyMsg {
        let mut policy = PolicyMsg { task_dim: 4, n_components: 2, ..PolicyMsg::EMPTY };
        policy.damping = 2.0 * 200_f64.sqrt();
        for (i, component) in policy.components[..2].iter_mut().enumerate() {
            component.center = 0.1 + 0.2 * i as f64;
            component.attractor = [0.78, -0.0, 1.0 / 3.0, 2.0, 5e-324, 1e-17];
            (0..10).for_each(|k| component.stiffness[k] = (k as f64 + 0.1).sqrt() * 37.0);
        }
        policy.sealed()
    }

    fn refusal(text: &str) -> String {
        format!("{:#}", from_toml(text).expect_err(text))
    }

    #[test]
    fn toml_comes_back_bit_for_bit() {
        let decaying = PolicyMsg { activation: ACTIVATION_DECAY, decay_rate: 2.5, ..policy() };
        let action = PolicyMsg::of_action(&[8.0, 0.1 + 0.2]);
        let damped = PolicyMsg { damping_ratio: 0.7, ..policy() };
        let sphere = PolicyMsg { orientation: ORIENTATION_SPHERE, ..policy() };
        let springs = [policy(), damped.sealed(), decaying.sealed(), sphere.sealed()];
        for policy in springs.into_iter().chain([action.sealed(), systems::sample()]) {
            let back = from_toml(&to_toml(&policy).unwrap()).unwrap();
            assert_eq!(back, policy);
            assert_eq!(back.digest, policy.digest);
        }
    }

    #[test]
    fn damaged_toml_is_refused_with_the_place() {
        let text = to_toml(&policy()).unwrap();
        for (from, to, word) in [
            ("damping = 28", "damping = nan #", "damping"),
            ("width = 1.0", "width = inf", "components holds nan or inf"),
            ("task_dim = 4", "task_dim = 3", "3 rows of 3"),
            ("task_dim", "dim", "dim"),
            ("width = 1.0", "width = 0.0", "width"),
            ("width = 1.0", "width = ", "line 13"),
        ] {
            let message = refusal(&text.replacen(from, to, 1));
            assert!(message.contains(word), "no '{word}' in: {message}");
        }
        assert!(refusal("action = [1.0]\ndamping = 2.0\n").contains("damping"));
        assert!(refusal("").contains("task_dim"));
    }
}
