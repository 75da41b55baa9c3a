//! The limits of the joints on the chain: the file's, the configuration's, or a stated assumption.

use std::f64::consts::{PI, TAU};

use super::ArmSettings;
use super::document::{Joint, Kind};
use super::finding::{Findings, UrdfFault};
use crate::arm::{Body, JointLimits, JointVector, MAX_JOINTS};

/// A joint without end stops is worked with within this far of zero, rad: the controller and the
/// inverse kinematics count turns.
const WITHOUT_STOPS: f64 = TAU;
/// Position limits beyond this, rad, are a way to write that there are none.
const NO_LIMIT: f64 = 1e3;
/// Largest speed where none is given, rad/s: half a turn a second, as of many industrial arms.
const ASSUMED_SPEED: f64 = PI;
/// Largest torque where none is given: this many times what holds the outstretched arm, N·m at
/// least.
const ASSUMED_TORQUE: f64 = 2.0;
const ASSUMED_TORQUE_MIN: f64 = 1.0;

/// Reads the limits of all joints. `bodies` are those they move.
pub(super) fn read(
    chain: &[&Joint],
    bodies: &[Body],
    settings: &ArmSettings,
    findings: &mut Findings,
) -> JointLimits {
    let mut limits = JointLimits {
        q_min: JointVector::zeros(),
        q_max: JointVector::zeros(),
        qd_max: JointVector::zeros(),
        tau_max: JointVector::zeros(),
    };
    let mut without_stops = Vec::new();
    for (i, joint) in chain.iter().enumerate() {
        let (lower, upper) = positions(joint, findings).unwrap_or_else(|| {
            without_stops.push(*joint);
            (-WITHOUT_STOPS, WITHOUT_STOPS)
        });
        (limits.q_min[i], limits.q_max[i]) = (lower, upper);
    }
    if !without_stops.is_empty() {
        let text = format!(
            "{} without end stops: used within ±{WITHOUT_STOPS:.3} rad",
            named(&without_stops)
        );
        findings.note_all(&lines(&without_stops), text);
    }
    let torque = Quantity {
        field: "torque_limits_nm",
        attribute: "effort",
        unit: "N·m",
        given: &settings.torque_limits,
        assumed: holding_bounds(bodies).map(|torque| assumed_torque(ASSUMED_TORQUE * torque)),
        of: |joint| joint.limit.effort,
    };
    let speed = Quantity {
        field: "speed_limits_rad_s",
        attribute: "velocity",
        unit: "rad/s",
        given: &settings.speed_limits,
        assumed: JointVector::repeat(ASSUMED_SPEED),
        of: |joint| joint.limit.velocity,
    };
    limits.tau_max = torque.read(chain, findings);
    limits.qd_max = speed.read(chain, findings);
    limits
}

/// The position limits of a joint; none if it has no end stops.
fn positions(joint: &Joint, findings: &mut Findings) -> Option<(f64, f64)> {
    let limit = &joint.limit;
    if joint.kind == Kind::Continuous {
        return None;
    }
    let mut invalid = |reason: String| {
        let remedy =
            "set lower and upper in its <limit>, or type=\"continuous\" if it has no stops";
        let fault = UrdfFault::InvalidLimit { joint: joint.name.clone(), reason, remedy };
        findings.fault(joint.limit_line(), fault);
        Some((0.0, 0.0))
    };
    if limit.lower.is_none() && limit.upper.is_none() {
        return invalid("it is revolute, but the position limits are missing".into());
    }
    // What is not written is zero.
    let (lower, upper) = (limit.lower.unwrap_or(0.0), limit.upper.unwrap_or(0.0));
    if !lower.is_finite() || !upper.is_finite() {
        return invalid("a position limit is not finite".into());
    }
    if lower >= upper {
        return invalid(format!("its lower limit {lower} is not below the upper one {upper}"));
    }
    if lower < -NO_LIMIT && upper > NO_LIMIT { None } else { Some((lower, upper)) }
}

/// A limit that a file may leave open.
struct Quantity<'a> {
    field: &'static str,
    attribute: &'static str,
    unit: &'static str,
    /// By the configuration, one a joint, or none at all.
    given: &'a [f64],
    assumed: JointVector,
    of: fn(&Joint) -> Option<f64>,
}

impl Quantity<'_> {
    fn read(&self, chain: &[&Joint], findings: &mut Findings) -> JointVector {
        let mut limits = JointVector::zeros();
        let (field, given) = (self.field, self.given);
        if !given.is_empty() && given.len() != chain.len() {
            let names: Vec<_> = chain.iter().map(|joint| joint.name.as_str()).collect();
            let (found, expected, joints) = (given.len(), chain.len(), names.join(", "));
            findings.fault(None, UrdfFault::WrongCount { field, found, expected, joints });
            return limits;
        }
        let mut open = Vec::new();
        for (i, &joint) in chain.iter().enumerate() {
            let written = (self.of)(joint);
            limits[i] = match (given.get(i), written) {
                (Some(&value), _) if value > 0.0 && value.is_finite() => value,
                (Some(&value), _) => {
                    let joint = joint.name.clone();
                    findings.fault(None, UrdfFault::NotPositive { field, joint, value });
                    0.0
                }
                (None, Some(value)) if value > 0.0 && value.is_finite() => value,
                (None, Some(value)) if value.is_nan() => {
                    findings.fault(
                        joint.limit_line(),
                        UrdfFault::InvalidLimit {
                            joint: joint.name.clone(),
                            reason: format!("its {} limit is not a number", self.attribute),
                            remedy: "set effort and velocity in its <limit>",
                        },
                    );
                    0.0
                }
                (None, _) => {
                    open.push((joint, self.assumed[i]));
                    self.assumed[i]
                }
            };
        }
        if !open.is_empty() {
            let joints: Vec<&Joint> = open.iter().map(|(joint, _)| *joint).collect();
            let values: Vec<String> = open.iter().map(|(_, value)| format!("{value:.4}")).collect();
            let text = format!(
                "{} no {} limit: {} {} assumed; write {field} in [plant] if you know better",
                with_verb(&joints, "has", "have"),
                self.attribute,
                values.join(", "),
                self.unit
            );
            findings.note_all(&lines(&joints), text);
        }
        limits
    }
}

fn assumed_torque(torque: f64) -> f64 {
    torque.max(ASSUMED_TORQUE_MIN)
}

/// At least what any posture takes to be held, N·m: everything outboard, stretched out.
fn holding_bounds(bodies: &[Body]) -> JointVector {
    let mut bounds = JointVector::zeros();
    for i in 0..bodies.len().min(MAX_JOINTS) {
        let mut distance = 0.0;
        for (k, body) in bodies.iter().enumerate().skip(i) {
            if k > i {
                distance += body.p_AB.norm();
            }
            bounds[i] += 9.81 * body.mass * (distance + body.p_BBcm.norm());
        }
    }
    bounds
}

fn named(joints: &[&Joint]) -> String {
    with_verb(joints, "is", "are")
}

fn with_verb(joints: &[&Joint], one: &str, several: &str) -> String {
    let names: Vec<String> = joints.iter().map(|joint| format!("\"{}\"", joint.name)).collect();
    match joints.len() {
        1 => format!("joint {} {one}", names[0]),
        _ => format!("joints {} {several}", names.join(", ")),
    }
}

fn lines(joints: &[&Joint]) -> Vec<u32> {
    joints.iter().map(|joint| joint.limit_line()).collect()
}
