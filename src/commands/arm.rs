//! `skillet arm check`: what a URDF holds, whether it is usable, and the configuration for it.

use anyhow::{Context, Result};
use physics::arm::UrdfFault;
use physics::arm::urdf::{self, UrdfError};

use crate::Verdict;
use crate::arm_check::{self, Refusal, report};
use crate::cli::arm::{ArmArgs, ArmVerb, CheckArgs};
use crate::fields;
use crate::output::{print, print_json, write_new};

pub fn run(args: &ArmArgs) -> Result<Verdict> {
    match &args.verb {
        ArmVerb::Check(args) => check(args),
    }
}

fn check(args: &CheckArgs) -> Result<Verdict> {
    let file = args.urdf.display().to_string();
    let text = urdf::read_file(&args.urdf)?;
    let report = match arm_check::run(&text, args) {
        Ok(checked) => {
            if let Some(path) = &args.out {
                write_new(path, &checked.configuration(path.parent())?)?;
            }
            match args.json {
                true => print_json(&fields::short(report::json(&checked, args)?))?,
                false => print(&report::text(&checked, args)?)?,
            }
            return Ok(Verdict::Done);
        }
        Err(Refusal::Urdf(error)) if is_unreadable(&error) => return Err(error).context(file),
        Err(refusal) => refusal,
    };
    match args.json {
        true => print_json(&report::refusal_json(&report, args))?,
        false => print(&report::refusal_text(&report, args))?,
    }
    Ok(Verdict::Negative)
}

/// It is not even URDF.
fn is_unreadable(error: &UrdfError) -> bool {
    error.findings.iter().any(|finding| {
        matches!(finding.fault, UrdfFault::Xml(_) | UrdfFault::NotUrdf { .. } | UrdfFault::Xacro)
    })
}
