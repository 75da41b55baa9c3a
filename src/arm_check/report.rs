//! The result of `skillet arm check`, for people and for machines.

use std::fmt::Write;

use anyhow::Result;
use physics::arm::start_posture::{largest_share, reach};
use physics::arm::urdf::LoadedArm;
use serde_json::{Value, json};

use super::{Checked, Fitting, Refusal};
use crate::cli::arm::CheckArgs;

/// Below this height of the demonstration's tip above the base, m, a throw may go below the base: it dips by about
/// 0.25 m more.
const LOW_M: f64 = 0.25;

/// The demonstration that the configuration names, and the next command makes.
pub const DEMONSTRATION: &str = "my_demo.csv";

/// Limits the URDF does not give, by the names they have in the configuration.
pub fn assumed_limits(arm: &LoadedArm) -> Vec<(&'static str, Vec<f64>)> {
    let (limits, n) = (arm.model.limits(), arm.model.n_joints());
    let rounded = |values: &[f64]| values[..n].iter().map(|x| (x * 1e4).round() / 1e4).collect();
    [("torque_limits_nm", &limits.tau_max), ("speed_limits_rad_s", &limits.qd_max)]
        .into_iter()
        .filter(|(field, _)| arm.notes.iter().any(|note| note.text.contains(field)))
        .map(|(field, values)| (field, rounded(values.as_slice())))
        .collect()
}

pub fn text(checked: &Checked, args: &CheckArgs) -> Result<String> {
    let (model, posture) = (&checked.arm.model, &checked.posture);
    let limits = model.limits();
    let mass: f64 = model.bodies().iter().map(|body| body.mass).sum();
    let mut out = String::new();
    writeln!(
        out,
        "{}: {} joints to \"{}\", moving mass {mass:.2} kg, reach {:.2} m",
        args.urdf.display(),
        model.n_joints(),
        checked.config.plant.tip,
        reach(model)
    )?;
    let names = model.joint_names();
    let width = names.iter().map(String::len).max().unwrap_or(0).max(5);
    let header = "range rad         speed rad/s  torque N·m    start  holding N·m";
    writeln!(out, "\n  {:width$}  {header}", "joint")?;
    for (i, name) in names.iter().enumerate() {
        writeln!(
            out,
            "  {name:width$}  {:7.3} to {:6.3} {:12.3} {:11.3} {:8.3} {:8.3} ({:.0} %)",
            limits.q_min[i],
            limits.q_max[i],
            limits.qd_max[i],
            limits.tau_max[i],
            posture.q[i],
            posture.holding[i],
            100.0 * posture.holding[i].abs() / limits.tau_max[i]
        )?;
    }
    let p = posture.X_WP.translation.vector;
    writeln!(out, "\nstart    pan level at ({:.3}, {:.3}, {:.3}) m", p.x, p.y, p.z)?;
    match (&checked.misfit, &checked.demonstration) {
        (None, _) => writeln!(out, "demo     the built-in one is feasible from there")?,
        (Some(_), Some(other)) => writeln!(out, "demo     {} is feasible from there", other.name)?,
        (Some(misfit), None) => {
            writeln!(out, "demo     none that comes with the tool is feasible: {misfit}")?;
        }
    }
    if let Some(pan) = &checked.config.plant.pan {
        writeln!(out, "pan      added, {} kg; mass and reach include it", pan.mass_kg)?;
    }
    checked.arm.notes.iter().try_for_each(|note| writeln!(out, "warning: {note}"))?;
    if let Some(Fitting { lowest_m, .. }) = checked.demonstration.as_ref().filter(is_low) {
        writeln!(
            out,
            "warning: the demonstration dips to z = {lowest_m:.2} m, and a learnt throw dips lower: if the arm stands \
             on a table, set controller.workspace_floor_m, try --seed 2, or raise the base in the URDF"
        )?;
    }
    for candidate in other_chains(checked, args) {
        writeln!(out, "another chain: --tip {}{}", candidate.0, candidate.1)?;
    }
    match &args.out {
        Some(path) => writeln!(out, "\nwritten  {}", path.display())?,
        None => {
            writeln!(out, "\nConfiguration:\n")?;
            out += &checked.configuration(None)?;
        }
    }
    out += &next(checked, args);
    Ok(out)
}

/// It comes so near to the height of the base that a throw may go below it.
fn is_low(fitting: &&Fitting) -> bool {
    fitting.lowest_m < LOW_M
}

/// The commands that lead from here to a learnt skill.
fn next(checked: &Checked, args: &CheckArgs) -> String {
    let config = args.out.clone().unwrap_or_else(|| "my.toml".into());
    // The configuration names it, relative to itself.
    let demonstration = config.with_file_name(DEMONSTRATION);
    let (config, demonstration) = (config.display(), demonstration.display());
    let (recording, whose) = match &checked.demonstration {
        Some(Fitting { name, .. }) => {
            (name.as_str(), ", with this demonstration or your own recording")
        }
        None => ("recording.csv", ", with your own recording (docs/own-demonstration.md)"),
    };
    let write = match args.out {
        Some(_) => String::new(),
        None => "  (this command again, with --out my.toml)\n".into(),
    };
    format!(
        "\nNext{whose}:\n\n{write}  skillet demo convert {recording} --at-start --config {config} --out \
         {demonstration}\n  skillet learn pancake --config {config}\n"
    )
}

/// Tip and flags of the chains that were not chosen.
fn other_chains<'a>(checked: &'a Checked, args: &CheckArgs) -> Vec<(&'a str, String)> {
    if args.tip.is_some() {
        return Vec::new();
    }
    let chosen = &checked.arm.model.joint_names();
    let others = checked.candidates.iter().filter(|other| other.joints != **chosen);
    others
        .map(|other| {
            let base = other.base.as_ref().map(|base| format!(" --base {base}"));
            let joints = other.joints.len();
            (other.tip.as_str(), format!("{} ({joints} joints)", base.unwrap_or_default()))
        })
        .collect()
}

pub fn json(checked: &Checked, args: &CheckArgs) -> Result<Value> {
    let (model, posture) = (&checked.arm.model, &checked.posture);
    let limits = model.limits();
    let joints: Vec<Value> = (0..model.n_joints())
        .map(|i| {
            json!({
                "name": model.joint_names()[i],
                "lower_rad": limits.q_min[i],
                "upper_rad": limits.q_max[i],
                "speed_rad_s": limits.qd_max[i],
                "torque_nm": limits.tau_max[i],
                "start_rad": checked.config.plant.start_posture_rad[i],
                "holding_nm": posture.holding[i],
                "mass_kg": model.bodies()[i].mass,
            })
        })
        .collect();
    let held: Vec<Value> = (checked.arm.held.iter())
        .map(|held| json!({ "joint": held.joint, "line": held.line, "position": held.position }))
        .collect();
    let warnings: Vec<Value> = (checked.arm.notes.iter())
        .map(|note| json!({ "line": note.line, "text": note.text }))
        .collect();
    let chains: Vec<Value> = (checked.candidates.iter())
        .map(|chain| json!({ "base": chain.base, "tip": chain.tip, "joints": chain.joints }))
        .collect();
    let p = posture.X_WP.translation.vector;
    Ok(json!({
        "urdf": args.urdf,
        "usable": true,
        "base": checked.config.plant.base,
        "tip": checked.config.plant.tip,
        "joints": joints,
        "held": held,
        "mass_kg": model.bodies().iter().map(|body| body.mass).sum::<f64>(),
        "reach_m": reach(model),
        "start_m": [p.x, p.y, p.z],
        "holding_share_max": largest_share(model, &posture.holding),
        "dexterity": posture.dexterity,
        "demonstration_misfit": checked.misfit,
        "demonstration": checked.demonstration.as_ref().map(|fitting| &fitting.name),
        "demonstration_lowest_m": checked.demonstration.as_ref().map(|fitting| fitting.lowest_m),
        "warnings": warnings,
        "chains": chains,
        "configuration": checked.configuration(None)?,
    }))
}

/// Every reason on its own.
fn reasons(refusal: &Refusal) -> Vec<(Option<u32>, String)> {
    match refusal {
        Refusal::Urdf(error) => (error.findings.iter())
            .map(|finding| (finding.line, finding.fault.to_string()))
            .collect(),
        Refusal::NoChain => vec![(
            None,
            "no joint is revolute or continuous: this is not an arm; use an arm's URDF".into(),
        )],
        Refusal::NoPosture(reason) => vec![(None, format!("no start posture: {reason}"))],
        Refusal::Other(error) => vec![(None, format!("{error:#}"))],
    }
}

pub fn refusal_text(refusal: &Refusal, args: &CheckArgs) -> String {
    let mut out = format!("{}: not usable\n", args.urdf.display());
    for (line, reason) in reasons(refusal) {
        match line {
            Some(line) => out += &format!("  line {line}: {reason}\n"),
            None => out += &format!("  {reason}\n"),
        }
    }
    out
}

pub fn refusal_json(refusal: &Refusal, args: &CheckArgs) -> Value {
    let findings: Vec<Value> = reasons(refusal)
        .into_iter()
        .map(|(line, text)| json!({ "line": line, "text": text }))
        .collect();
    json!({ "urdf": args.urdf, "usable": false, "findings": findings })
}
